"""Write reports from latency.json: of one measurement, of two compared, and of a robot's history."""
