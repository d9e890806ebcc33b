"""HTTP for the REST and SOAP interfaces: requests and responses, negotiation, tokens, and limits on connections."""
