"""Write the certificate of a result.json as HTML and Markdown, and compare two results."""
