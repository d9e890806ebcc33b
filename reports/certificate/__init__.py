"""What becomes of result.json: the certificate as HTML and Markdown, and what changed between two."""
