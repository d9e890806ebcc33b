"""Web servers that robots stand behind: each in front of a good robot, with its defaults."""
