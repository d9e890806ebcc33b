"""What is generic over HTTP: operations and their targets come from the contract's OpenAPI, never from code."""
