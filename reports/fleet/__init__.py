"""The page of a fleet: which robot passed which classes."""
