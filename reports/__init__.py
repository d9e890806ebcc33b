"""Writes reports from result files, and signs them.

`reports.rendering.render(directory)` writes all pages for the result files in a directory, `reports.attestation` signs
and verifies, and `reports.errors` has the exceptions.
"""
