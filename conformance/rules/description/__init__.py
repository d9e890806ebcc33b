"""The class ``description``: an API keeps its own OpenAPI description, and the description fits the API."""
