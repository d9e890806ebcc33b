"""Build a static site from signed certificates: which robot passed which classes, signed by whom, and when."""
