"""One message in many styles: XML and its namespaces let a writer choose, and a reader must accept each choice."""

from dataclasses import dataclass, field, replace
from typing import Final
from xml.sax.saxutils import escape

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from conformance.documents.xml import ENVELOPE, XSI, Node, clark, local, namespace

DECLARATIONS: Final = (
    "",
    '<?xml version="1.0"?>',
    '<?xml version="1.0" encoding="UTF-8"?>\n',
    "<?xml version='1.0' encoding='utf-8' standalone='yes'?>",
)
TEXTS: Final = ("plain", "cdata", "reference", "hexadecimal", "comment", "split", "comment inside")
# Namespace of the `Id` attribute of signed messages (WS-Security 4.2); SOAP 1.1 4.1.1 lets the Envelope have any
# qualified attribute.
_SECURITY: Final = "http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-wssecurity-utility-1.0.xsd"
_PREFIXES: Final = ("soapenv", "S", "SOAP-ENV", "_", "x.1-y")


@dataclass(frozen=True)
class XmlStyle:
    """The choices of a writer.

    Attributes:
        envelope_prefix: for SOAP's namespace; empty if it is the default namespace there.
        payload_prefix: for the namespaces of the payload; empty means default namespaces.
        early: whether prefixes are bound at the root rather than where they are used first.
        declaration: XML declaration.
        quote: around attribute values.
        indent: whether elements stand on lines of their own.
        comments: whether comments stand between elements.
        text: how texts are written (TEXTS).
        empty_tags: whether an empty element is written as one tag.
        location: whether the payload carries xsi:schemaLocation, with a query, whose "&" is a predefined entity.
        header: whether there is an empty Header where the message has none.
        identified: whether the Envelope has an attribute of another namespace, wsu:Id.
    """

    envelope_prefix: str = "soapenv"
    payload_prefix: str = "ns"
    early: bool = True
    declaration: str = ""
    quote: str = '"'
    indent: bool = False
    comments: bool = False
    text: str = "plain"
    empty_tags: bool = True
    location: bool = False
    header: bool = False
    identified: bool = False


def single_changes() -> tuple[tuple[str, XmlStyle], ...]:
    """Return styles that differ from the plain one in one choice, each with the choice's name."""
    return (
        ("plain", XmlStyle()),
        ("other prefixes", XmlStyle(envelope_prefix="S", payload_prefix="a")),
        ("prefixes of other characters", XmlStyle(envelope_prefix="SOAP-ENV", payload_prefix="x.1-y")),
        ("SOAP as default namespace", XmlStyle(envelope_prefix="")),
        ("a default namespace on the wrapper, undone on its children", XmlStyle(payload_prefix="", early=False)),
        ("namespaces bound where they are used", XmlStyle(early=False)),
        *((f"declaration {text.strip()}", XmlStyle(declaration=text)) for text in DECLARATIONS[1:]),
        ("single quotes", XmlStyle(quote="'")),
        ("white space between elements", XmlStyle(indent=True)),
        ("comments between elements", XmlStyle(comments=True)),
        *((f"texts: {text}", XmlStyle(text=text)) for text in TEXTS[1:]),
        ("start and end tags for empty elements", XmlStyle(empty_tags=False)),
        ("xsi:schemaLocation with a predefined entity", XmlStyle(location=True)),
        ("an empty Header", XmlStyle(header=True)),
        ("an attribute of another namespace on the Envelope", XmlStyle(identified=True)),
    )


def value_styles() -> tuple[XmlStyle, ...]:
    """Return the styles, first those in which a reader may misread a value."""
    styles = [style for _, style in single_changes()]
    return tuple(sorted(styles, key=lambda style: style.text == "plain"))


def xml_styles() -> SearchStrategy[XmlStyle]:
    """Return a strategy for any combination of choices."""
    return st.builds(
        XmlStyle,
        envelope_prefix=st.sampled_from(("", *_PREFIXES)),
        payload_prefix=st.sampled_from(("", "ns", "ns2", "_a", "tns")),
        early=st.booleans(),
        declaration=st.sampled_from(DECLARATIONS),
        quote=st.sampled_from("\"'"),
        indent=st.booleans(),
        comments=st.booleans(),
        text=st.sampled_from(TEXTS),
        empty_tags=st.booleans(),
        location=st.booleans(),
        header=st.booleans(),
        identified=st.booleans(),
    )


@dataclass
class _Writer:
    style: XmlStyle
    prefixes: dict[str, str] = field(default_factory=dict)

    def prefix(self, space: str) -> str:
        """Return the prefix of a namespace, always the same one."""
        if space not in self.prefixes:
            given = self.style.envelope_prefix if space == ENVELOPE else self.style.payload_prefix
            number = sum(1 for other in self.prefixes if other != ENVELOPE)
            self.prefixes[space] = given if space == ENVELOPE or not given or not number else f"{given}{number}"
        return self.prefixes[space]

    def element(self, node: Node, bound: dict[str, str], depth: int, *, root: bool = False) -> str:
        """Write an element; ``bound`` maps each prefix in scope to its namespace, the empty prefix to the default."""
        scope = dict(bound)
        space = namespace(node.tag)
        attributes = self._bindings(node, scope, root=root)
        name = local(node.tag)
        if space and self.prefix(space):
            name = f"{self.prefix(space)}:{name}"
        attributes += [
            f"{self._attribute(key, scope, attributes)}={self._quoted(value)}" for key, value in node.attributes
        ]
        start = " ".join([name, *attributes])
        line = "\n" + "  " * depth if self.style.indent else ""
        note = "<!-- <a> & - -->" if self.style.comments else ""
        inside = "".join(f"{line}  {note}" + self.element(child, scope, depth + 1) for child in node.children)
        inside += f"{note}{line}" if node.children else self._text(node.text)
        if not inside and self.style.empty_tags:
            return f"<{start}/>"
        return f"<{start}>{inside}</{name}>"

    def _bindings(self, node: Node, scope: dict[str, str], *, root: bool) -> list[str]:
        wanted = {namespace(node.tag)}
        if root and self.style.early:
            wanted |= _all_namespaces(node)
        made: list[str] = []
        for space in sorted(wanted):
            if not space:
                # An unqualified element under a default namespace needs `xmlns=""`.
                if scope.get("") and not namespace(node.tag):
                    scope[""] = ""
                    made.append(f"xmlns={self._quoted('')}")
                continue
            prefix = self.prefix(space)
            if scope.get(prefix) == space or (not prefix and space != namespace(node.tag)):
                continue
            scope[prefix] = space
            made.append(f"xmlns{':' if prefix else ''}{prefix}={self._quoted(space)}")
        if self.style.location and scope and namespace(node.tag) not in {"", ENVELOPE} and "xsi" not in scope:
            scope["xsi"] = XSI
            made.append(f"xmlns:xsi={self._quoted(XSI)}")
            made.append(f"xsi:schemaLocation={self._quoted(namespace(node.tag) + ' nowhere.xsd?of=robot&as=xsd')}")
        return made

    def _attribute(self, key: str, scope: dict[str, str], made: list[str]) -> str:
        """Return the name of an attribute; a qualified attribute needs a prefix, even in the default namespace."""
        space = namespace(key)
        if not space:
            return key
        for prefix, bound in scope.items():
            if prefix and bound == space:
                return f"{prefix}:{local(key)}"
        prefix = f"at{len(scope)}"
        scope[prefix] = space
        made.append(f"xmlns:{prefix}={self._quoted(space)}")
        return f"{prefix}:{local(key)}"

    def _quoted(self, value: str) -> str:
        quote = self.style.quote
        return quote + escape(value, {quote: "&#34;" if quote == '"' else "&#39;", "\n": "&#10;", "\t": "&#9;"}) + quote

    def _text(self, text: str) -> str:
        if not text:
            return ""
        half = len(text) // 2
        forms = {
            "cdata": f"<![CDATA[{text}]]>",
            "reference": "".join(f"&#{ord(char)};" for char in text),
            "hexadecimal": "".join(f"&#x{ord(char):X};" for char in text),
            "comment": f"{escape(text)}<!-- 1 -->",
            "split": f"{escape(text[:half])}<![CDATA[{text[half:]}]]>",
            # A parser that uses only the first text node sees only part of the value.
            "comment inside": f"{escape(text[:half])}<!-- 2 -->{escape(text[half:])}",
        }
        return forms.get(self.style.text, escape(text))


def _all_namespaces(node: Node) -> set[str]:
    found = {namespace(node.tag)}
    for child in node.children:
        found |= _all_namespaces(child)
    return found


def serialize(message: Node, style: XmlStyle) -> str:
    """Write a message (an Envelope) in a style."""
    if style.header and not any(child.name == "Header" for child in message.children):
        header = Node(clark(namespace(message.tag), "Header"))
        message = replace(message, children=(header, *message.children))
    if style.identified:
        message = replace(message, attributes=(*message.attributes, (clark(_SECURITY, "Id"), "request-1")))
    before = "<!-- before -->" if style.comments else ""
    after = "<!-- after -->" if style.comments else ""
    return style.declaration + before + _Writer(style).element(message, {}, 0, root=True) + after
