"""The contract as files, and what reads them: the ground floor, which imports nothing of ours."""
