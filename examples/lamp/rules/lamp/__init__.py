"""The lamp's own checks."""
