"""The checks of the lamp contract."""
