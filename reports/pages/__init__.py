"""What all pages share: templates, and the escaping of text from a robot."""
