"""Turns result files into what people read."""
