"""Move a device by its motion map, and record where it is."""
