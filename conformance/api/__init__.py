"""A web API as its description tells it: REST by OpenAPI, SOAP by WSDL."""
