"""Record a run event by event: requests, responses, observations, and the check that was running."""
