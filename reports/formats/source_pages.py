"""Link a requirement's source to its web page: RFCs, the Basic Profile, W3C documents, CWE."""

import re

# Beginning of a source as the ledger writes it, and the page of the clause.
_PAGES = (
    (r"RFC (\d+) (\d+(?:\.\d+)*)", "https://www.rfc-editor.org/rfc/rfc{0}#section-{1}"),
    (r"RFC (\d+) Appendix ([A-Z])", "https://www.rfc-editor.org/rfc/rfc{0}#appendix-{1}"),
    (r"RFC (\d+)", "https://www.rfc-editor.org/rfc/rfc{0}"),
    (r"CWE-(\d+)", "https://cwe.mitre.org/data/definitions/{0}.html"),
    (r"BP (R\d+)", "https://www.ws-i.org/Profiles/BasicProfile-1.1.html#{0}"),
    (r"SOAP 1\.1", "https://www.w3.org/TR/2000/NOTE-SOAP-20000508/"),
    (r"WSDL 1\.1", "https://www.w3.org/TR/2001/NOTE-wsdl-20010315"),
    (r"XML Schema 1\.0 Part 2", "https://www.w3.org/TR/xmlschema-2/"),
    (r"Namespaces in XML", "https://www.w3.org/TR/xml-names/"),
    (r"XML 1\.0", "https://www.w3.org/TR/xml/"),
)


def page_of(source: str) -> str | None:
    """Return the https URL of the first source in a "; "-separated list that has a known web page, or None."""
    for part in source.split("; "):
        for pattern, page in _PAGES:
            if found := re.match(pattern, part):
                return page.format(*found.groups())
    return None
