"""A static site from signed certificates alone: which robot may be trusted with what, by whose word, since when."""
