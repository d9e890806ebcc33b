"""The REST interface of any web API. Operations and their targets come from the contract's OpenAPI description."""
