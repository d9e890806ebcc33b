"""The certificate of a result.json as HTML and Markdown, and the difference of two results."""
