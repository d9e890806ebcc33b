"""Share code among all pages: templates, the table of robots and classes, and escaping of text from a robot."""
