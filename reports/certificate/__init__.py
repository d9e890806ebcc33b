"""What becomes of result.json: the certificate as HTML and Markdown, and junit.xml."""
