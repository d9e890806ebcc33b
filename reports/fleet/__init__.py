"""The page of a fleet: which robot may be trusted with what."""
