"""What becomes of latency.json: the report of one measurement, and the comparison of two."""
