"""Explain requirements, for `roaas explain` and the docs: why they matter, their sources, and how to meet them."""
