"""Write the pages for a fleet run: which robot passed which classes."""
