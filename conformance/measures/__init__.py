"""Estimators: what several readings show together. Pure functions, which talk to no device and judge nothing."""
