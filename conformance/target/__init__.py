"""How the suite reaches a robot: requests and answers over HTTP, each with a deadline, each recorded."""
