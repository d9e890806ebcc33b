"""One reader for each kind of document: JSON, XML, YAML, JSON Schema, XSD, OpenAPI, WADL, WSDL."""
