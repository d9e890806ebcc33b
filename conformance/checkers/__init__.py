"""Checkers judge what was exchanged. They send nothing, and know neither the checks nor where it was written down."""
