"""From recordings to figures: histograms, intervals, comparisons, service levels, verdicts."""
