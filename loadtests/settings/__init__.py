"""What a run is asked to do: options over statement over defaults, checked before anything is sent."""
