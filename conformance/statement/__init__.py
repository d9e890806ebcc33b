"""What a vendor says of a device: the implementation conformance statement and its reader."""
