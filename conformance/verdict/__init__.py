"""From evidence to verdicts: what was judged, requirement by requirement, and what follows for class and robot."""
