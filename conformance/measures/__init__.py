"""Estimators over several readings. Pure functions: they talk to no device and judge nothing."""
