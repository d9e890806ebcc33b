"""SOAP as the suite makes and judges it: raw XML, by lxml and xmlschema; zeep is the interoperability client."""
