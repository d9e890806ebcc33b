"""Write the suite's reports (certificate, latency and fleet pages) from result files, and sign them.

`reports.rendering.render(directory)` writes all pages for the result files in a directory, `reports.attestation` signs
and verifies, and `reports.errors` has the exceptions.
"""
