"""Rules on any SOAP service, by its WSDL."""
