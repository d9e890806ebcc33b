"""The figures of the latency reports: one module for each kind, drawn with matplotlib, as inline SVG."""
