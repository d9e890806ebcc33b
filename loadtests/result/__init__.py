"""Write latency.json and the files beside it, and the summary for the terminal."""
