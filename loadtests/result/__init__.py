"""latency.json and what stands beside it, and the summary for the terminal."""
