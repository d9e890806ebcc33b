"""Readers for documents: JSON, XML, YAML, JSON Schema, XSD, OpenAPI, WADL, WSDL."""
