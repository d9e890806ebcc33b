"""Keep what happened in a run, event by event: what was sent and came back, what was seen, what the suite was doing."""
