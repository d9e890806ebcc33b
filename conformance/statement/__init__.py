"""The implementation conformance statement, in which a vendor describes a device, and its reader."""
