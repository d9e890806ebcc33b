"""Where a reader is sent for a case: a line of the vendor's statement, or of the contract's ledger; and web pages.

result.json says where things stand (`places`). Robots have no source code that a code host could show: what a vendor
can look at, and change, is the claim in its statement.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from reports.formats.cases import Case

_UNKNOWN = "requirements.toml"
# The first octets of a source, as the ledger writes them, and the page that has the clause.
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


@dataclass(frozen=True, slots=True)
class Place:
    """A line of a file.

    Attributes:
        file: its path relative to where the run was started, with `/`.
        line: counted from 1.
    """

    file: str
    line: int


def places_of(result: Mapping[str, Any], case: Case) -> list[Place]:
    """Where the robot promises to keep it, and where the contract asks for it; at least one of the two."""
    return list(_places(result, case))


def page_of(source: str) -> str | None:
    """The web page, on https, of the first of a requirement's sources that has one."""
    for part in source.split("; "):
        for pattern, page in _PAGES:
            if found := re.match(pattern, part):
                return page.format(*found.groups())
    return None


def _places(result: Mapping[str, Any], case: Case) -> Iterator[Place]:
    known = result.get("places", {})
    statement, ledger = known.get("statement"), known.get("ledger")
    if statement:
        yield Place(statement["file"], statement["classes"].get(case.class_name, statement["line"]))
    if ledger and case.name in ledger["lines"]:
        yield Place(ledger["file"], ledger["lines"][case.name])
    elif not statement:
        yield Place(ledger["file"] if ledger else _UNKNOWN, 1)
