"""Checkers of the paper's contract for every exchange of a run, live and in roaas judge."""
