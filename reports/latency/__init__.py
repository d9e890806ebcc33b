"""Write reports from latency.json: of one measurement, and of two compared."""
