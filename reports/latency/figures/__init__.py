"""The figures of the latency reports: one module for each kind, drawn with matplotlib, handed out as inline SVG."""
