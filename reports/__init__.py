"""Turns result files into what people read, and signs them.

`reports.rendering.render(directory)` writes everything that belongs to the result files of a directory;
`reports.attestation` signs and verifies; `reports.errors` names what can be wrong.
"""
