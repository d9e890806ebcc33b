"""A web API by its description: REST by OpenAPI, SOAP by WSDL."""
