"""Sign conformance results, and verify signed results ("certificates") by the recipient's policy."""
