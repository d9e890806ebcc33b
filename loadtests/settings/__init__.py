"""The settings of a run: from options, then the statement, then defaults, checked before any request is sent."""
