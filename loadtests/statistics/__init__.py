"""From recordings to figures: histograms, intervals, comparisons, thresholds, verdicts."""
