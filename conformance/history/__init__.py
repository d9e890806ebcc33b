"""Record a run event by event: requests, responses, observations, and what the suite was doing."""
