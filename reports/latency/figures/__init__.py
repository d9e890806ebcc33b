"""Draw the figures of the latency reports with matplotlib as inline SVG: one module for each kind."""
