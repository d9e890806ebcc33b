"""Schemas of several documents: each way in which one may lead to another, what is missing, and what is too much."""

import time

import pytest
from lxml import etree

from conformance.api.soap.messages import ordinary, unknown_in
from conformance.documents.wsdl import WsdlError, read_services
from conformance.documents.wsdl_imports import SchemaFolder
from conformance.documents.xml import XSD

_WSDL = f"""<w:definitions xmlns:w="http://schemas.xmlsoap.org/wsdl/" xmlns:s="http://schemas.xmlsoap.org/wsdl/soap/"
 xmlns:t="urn:t" xmlns:x="urn:x" xmlns:y="urn:y" xmlns:xs="{XSD}" targetNamespace="urn:t"><w:types>TYPES</w:types>
<w:message name="i"><w:part name="p" element="t:Get"/></w:message>
<w:message name="o"><w:part name="p" element="t:Got"/></w:message>
<w:portType name="P"><w:operation name="Get">
<w:input message="t:i"/><w:output message="t:o"/></w:operation></w:portType>
<w:binding name="B" type="t:P"><s:binding transport="http://schemas.xmlsoap.org/soap/http"/><w:operation name="Get">
<s:operation soapAction=""/><w:input><s:body use="literal"/></w:input><w:output><s:body use="literal"/></w:output>
</w:operation></w:binding><w:service name="S"><w:port name="P" binding="t:B"><s:address location="http://device/soap"/>
</w:port></w:service></w:definitions>"""
_GET = '<xs:element name="Get"><xs:complexType/></xs:element>'


def _schema(space, body, more=""):
    of = f'targetNamespace="{space}"' if space else ""
    spaces = f'xmlns:xs="{XSD}" xmlns:t="urn:t" xmlns:x="urn:x" xmlns:y="urn:y"'
    return f'<xs:schema {spaces} {of} elementFormDefault="qualified" {more}>{body}</xs:schema>'


def _got(content):
    return f'{_GET}<xs:element name="Got"><xs:complexType>{content}</xs:complexType></xs:element>'


def _value(type_):
    return _got(f'<xs:sequence><xs:element name="v" type="{type_}"/></xs:sequence>')


def _import(space, place=""):
    where = f'schemaLocation="{place}"' if place else ""
    return f'<xs:import namespace="{space}" {where}/>'


def _read(types, files=(), source="http://device/a/b.wsdl", **how):
    documents = dict(files)

    def fetch(place):
        if place not in documents:
            raise ValueError("404")
        return documents[place].encode()

    return read_services(_WSDL.replace("TYPES", types).encode(), source, fetch, **how)


def _answer(inside):
    spaces = 'xmlns="urn:t" xmlns:x="urn:x" xmlns:y="urn:y" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"'
    return etree.fromstring(f"<Got {spaces}>{inside}</Got>")


_MODE = '<xs:simpleType name="Mode"><xs:restriction base="xs:string">{}</xs:restriction></xs:simpleType>'
_ON, _AUTO = '<xs:enumeration value="on"/>', '<xs:enumeration value="auto"/>'


def _simple(name, base, facets=""):
    return f'<xs:simpleType name="{name}"><xs:restriction base="{base}">{facets}</xs:restriction></xs:simpleType>'


_DEGREES = _simple("D", "xs:double", '<xs:maxInclusive value="9"/>')
_REDEFINED = '<xs:redefine schemaLocation="base.xsd">{}</xs:redefine>'.format(
    _MODE.format(_ON).replace("xs:string", "t:Mode")
)
_BASE = {"http://device/a/base.xsd": _schema("urn:t", _MODE.format(_ON + _AUTO))}
_WHOLE = {
    "diamond": (
        _schema("urn:t", _import("urn:x", "../x/x.xsd") + _import("urn:y", "../y/./y.xsd") + _value("x:T")),
        {
            "http://device/x/x.xsd": _schema("urn:x", _import("urn:y", "../y/y.xsd") + "" + _simple("T", "y:D")),
            "http://device/y/y.xsd": _schema("urn:y", _DEGREES),
        },
    ),
    "chameleon": (
        _schema("urn:t", '<xs:include schemaLocation="one.xsd"/>' + _value("t:T")),
        {
            "http://device/a/one.xsd": _schema("", '<xs:include schemaLocation="two.xsd"/>' + _simple("T", "D")),
            "http://device/a/two.xsd": _schema("", _DEGREES),
        },
    ),
    "circle": (
        _schema("urn:t", '<xs:include schemaLocation="one.xsd"/>' + _value("t:D")),
        {
            "http://device/a/one.xsd": _schema("urn:t", '<xs:include schemaLocation="two.xsd"/>'),
            "http://device/a/two.xsd": _schema("urn:t", '<xs:include schemaLocation="one.xsd"/>' + _DEGREES),
        },
    ),
    "no location": (_schema("urn:x", _DEGREES) + _schema("urn:t", _import("urn:x") + _value("x:D")), {}),
    "two of one namespace": (_schema("urn:t", _DEGREES) + _schema("urn:t", _value("t:D")), {}),
    "the same twice": (_schema("urn:t", _DEGREES) + _schema("urn:t", _DEGREES + _value("t:D")), {}),
    "xml:lang": (
        _schema(
            "urn:t",
            _import("http://www.w3.org/XML/1998/namespace")
            + _DEGREES
            + _got('<xs:sequence><xs:element name="v" type="t:D"/></xs:sequence><xs:attribute ref="xml:lang"/>'),
        ),
        {},
    ),
    "override": (
        _schema("urn:t", f'<xs:override schemaLocation="base.xsd">{_DEGREES}</xs:override>' + _value("t:D")),
        {"http://device/a/base.xsd": _schema("urn:t", _simple("D", "xs:string"))},
    ),
    "xsd 1.1": (_schema("urn:t", _simple("D", "xs:double", '<xs:assertion test="$value le 9"/>') + _value("t:D")), {}),
}


_XSD_11 = {"xsd 1.1", "override"}


@pytest.mark.parametrize("name", _WHOLE)
def test_documents_are_found_by_each_kind_of_reference(name):
    found = _read(*_WHOLE[name])
    assert (len(found.notes), found.faults) == (int(name in _XSD_11), ())
    assert not found.types.invalid(_answer("<v>9</v>"))
    assert found.types.invalid(_answer("<v>10</v>"))


def test_what_is_redefined_counts():
    found = _read(_schema("urn:t", _REDEFINED + _value("t:Mode")), _BASE)
    assert (found.faults, found.notes) == ((), ())
    assert not found.types.invalid(_answer("<v>on</v>"))
    assert found.types.invalid(_answer("<v>auto</v>"))


_UNKNOWN = {
    "type": '<xs:sequence><xs:element name="v" type="x:T"/><xs:element name="n" type="xs:int"/></xs:sequence>',
    "element": '<xs:sequence><xs:element ref="x:e"/><xs:element name="n" type="xs:int"/></xs:sequence>',
    "base": '<xs:complexContent><xs:extension base="x:T"><xs:sequence><xs:element name="n" type="xs:int"/>'
    "</xs:sequence></xs:extension></xs:complexContent>",
    "attribute": '<xs:sequence><xs:element name="n" type="xs:int"/></xs:sequence><xs:attribute name="a" type="x:A"/>',
    "attribute group": '<xs:sequence><xs:element name="n" type="xs:int"/></xs:sequence><xs:attributeGroup ref="x:g"/>',
    "group": '<xs:sequence><xs:element name="n" type="xs:int"/><xs:group ref="x:g"/></xs:sequence>',
    "head": '<xs:sequence><xs:element name="n" type="xs:int"/></xs:sequence>',
}
_RIGHT = {
    "type": '<v xsi:type="x:Other"><a>1</a></v><n>1</n>',
    "element": "<x:e><b/></x:e><n>1</n>",
    "base": "<x:any>1</x:any><n>1</n>",
    "group": "<n>1</n><x:a/>",
}


@pytest.mark.parametrize("name", _UNKNOWN)
@pytest.mark.parametrize("place", ["", "http://www.w3.org/x.xsd"])
def test_what_no_document_declares_counts_as_any_and_is_a_note(name, place):
    head = '<xs:element name="h" substitutionGroup="x:e"/>' if name == "head" else ""
    found = _read(_schema("urn:t", _import("urn:x", place) + head + _got(_UNKNOWN[name])))
    assert found.faults == ()
    assert len(found.notes) == 1
    assert "--schemas" in found.notes[0]
    right = _RIGHT.get(name, "<n>1</n>")
    assert not found.types.invalid(_answer(right))
    if name != "base":
        assert found.types.invalid(_answer(right.replace("<n>1</n>", "<n>one</n>")))
    declared = found.types.shape("{urn:t}Got")
    assert bool(unknown_in(declared, ordinary(declared))) is (name in {"type", "element", "base"})


def test_what_the_devices_own_server_does_not_have_is_its_fault():
    found = _read(_schema("urn:t", _import("urn:x", "x.xsd") + _value("x:T")))
    assert found.faults == ("http://device/a/x.xsd could not be read: 404",)
    misspelt = _read(_schema("urn:t", _value("t:Missing")))
    assert misspelt.faults == ("its schemas name the type {urn:t}Missing, which no document declares",)
    differing = _read(_schema("urn:t", _DEGREES) + _schema("urn:t", _DEGREES.replace("9", "8") + _value("t:D")))
    assert "each in its own way" in differing.faults[0]


def test_a_folder_gives_what_references_do_not_lead_to(tmp_path):
    types = _schema("urn:t", _import("urn:x", "http://www.example.org/x/1.0/types") + _import("urn:y") + _value("x:D"))
    (tmp_path / "1.0").mkdir()
    (tmp_path / "1.0" / "types.xsd").write_text(
        _schema("urn:x", _import("urn:y") + _DEGREES.replace("xs:double", "y:E"))
    )
    (tmp_path / "types.xsd").write_text(_schema("urn:other", ""))
    (tmp_path / "y.xsd").write_text(
        _schema("urn:y", '<xs:simpleType name="E"><xs:restriction base="xs:double"/></xs:simpleType>')
    )
    folder = SchemaFolder(tmp_path)

    def fetch(place):
        return folder.at(place) or b""

    found = read_services(_WSDL.replace("TYPES", types).encode(), "http://device/a/b.wsdl", fetch, locate=folder.locate)
    assert (found.faults, found.notes) == ((), ())
    assert not found.types.invalid(_answer("<v>9</v>"))
    assert found.types.invalid(_answer("<v>10</v>"))
    assert folder.at("http://www.example.org/nothing") is None


@pytest.mark.parametrize("space", ["##targetNamespace", "##any"])
def test_an_ambiguous_content_model_is_judged(space):
    wild = f'<xs:any namespace="{space}" processContents="lax" minOccurs="0" maxOccurs="unbounded"/>'
    many = '<xs:element name="v" type="xs:double" minOccurs="0" maxOccurs="unbounded"/>'
    found = _read(_schema("urn:t", _got(f"<xs:sequence>{many}{wild}</xs:sequence>")))
    assert found.faults == ()
    assert "ambiguous" in found.notes[0]
    for right in ("", "<v>1</v><v>2</v>", "<v>1</v><w/>", "<w/>"):
        assert not found.types.invalid(_answer(right)), right
    assert found.types.invalid(_answer("<v>far</v>"))


def test_the_faults_of_a_standards_file_are_no_devices():
    types = _schema("urn:t", _value("t:Missing"))
    found = _read(types, source="standard.wsdl", foreign=True)
    assert (found.faults, len(found.notes)) == ((), 1)


_MANY = 12
_MUTUAL = "".join(
    f'<xs:complexType name="T{one}"><xs:sequence>'
    + "".join(f'<xs:element name="e{other}" type="t:T{other}" minOccurs="0"/>' for other in range(_MANY))
    + "</xs:sequence></xs:complexType>"
    for one in range(_MANY)
)
_OFTEN = (
    '<xs:sequence minOccurs="9" maxOccurs="999999999"><xs:element name="v" minOccurs="2" maxOccurs="{}"/></xs:sequence>'
)


@pytest.mark.parametrize(
    "types",
    [
        _MUTUAL + _value("t:T0"),
        _got(_OFTEN.format("999999999")),
        _got('<xs:sequence><xs:element name="v" minOccurs="999999999" maxOccurs="unbounded"/></xs:sequence>'),
        *(
            _simple("D", "xs:string", f'<xs:pattern value="{one}"/>') + _value("t:D")
            for one in ("(a+)+b", "(a|aa)+b", "((a{1,99}){1,99}){1,99}b", "(.*a){20}b")
        ),
    ],
)
def test_schemas_cost_a_bounded_time(types):
    started = time.process_time()
    found = _read(_schema("urn:t", types))
    found.types.invalid(_answer("<v>" + "a" * 60 + "</v>"))
    declared = found.types.shape("{urn:t}Got")
    assert len(ordinary(declared, optional=True).serialize()) < 10_000_000
    assert time.process_time() - started < 10


def test_entities_and_depth_are_no_way_in():
    entity = '<!DOCTYPE w:definitions [<!ENTITY e SYSTEM "file:///etc/passwd"><!ENTITY f "x">]>'
    wsdl = entity + _WSDL.replace(
        "TYPES",
        _schema(
            "urn:t", f"<xs:annotation><xs:documentation>&e;&f;</xs:documentation></xs:annotation>{_value('xs:int')}"
        ),
    )
    found = read_services(wsdl.encode(), "http://device/a.wsdl", lambda _: b"")
    assert not found.types.invalid(_answer("<v>9</v>"))


_LIST = '<xs:simpleType name="L"><xs:list itemType="xs:int"/></xs:simpleType>'
_UNION = '<xs:simpleType name="U"><xs:union memberTypes="xs:gMonthDay t:L"/></xs:simpleType>'


def test_a_message_can_be_made_of_each_kind_of_value():
    names = (
        "t:L", "t:U", "xs:gYear", "xs:gYearMonth", "xs:gMonth", "xs:gMonthDay", "xs:gDay", "xs:NMTOKENS", "xs:QName",
    )  # fmt: skip
    values = "".join(f'<xs:element name="v{number}" type="{name}"/>' for number, name in enumerate(names))
    fixed = '<xs:element name="f" type="xs:int" fixed="7"/>'
    attribute = '<xs:attribute name="a" type="xs:token" use="required" fixed="always"/>'
    some = f"<xs:sequence>{values}{fixed}</xs:sequence>{attribute}"
    found = _read(_schema("urn:t", _LIST + _UNION + _got(some)))
    made = ordinary(found.types.shape("{urn:t}Got"))
    assert not found.types.invalid(etree.fromstring(made.serialize())), made.serialize()


def test_header_parts_and_attachments_of_a_binding():
    """A header part is no part of the Body; a body within mime:part is found; attachments in a request are named."""
    types = _schema("urn:t", _value("xs:int") + '<xs:element name="Head" type="xs:int"/>')
    both = '<w:part name="h" element="t:Head"/><w:part name="p" element="t:Get"/>'
    wsdl = _WSDL.replace("TYPES", types).replace('<w:part name="p" element="t:Get"/>', both)
    header = '<s:header message="t:i" part="h" use="literal"/></w:input>'
    spaces = 'xmlns:m="http://schemas.xmlsoap.org/wsdl/mime/"'
    packaged = f'<m:multipartRelated {spaces}><m:part><s:body use="literal"/></m:part>MORE</m:multipartRelated>'
    plain = wsdl.replace('<w:input><s:body use="literal"/></w:input>', f'<w:input><s:body use="literal"/>{header}')
    for more, remark in (("", ""), ('<m:part><m:content part="a" type="image/png"/></m:part>', "attachments")):
        text = plain.replace('<s:body use="literal"/>', packaged.replace("MORE", more), 1)
        found = read_services(text.encode(), "http://device/a.wsdl", lambda _: b"")
        (operation,) = found.ports[0].operations
        assert (operation.request, operation.headers) == ("{urn:t}Get", ("{urn:t}Head",))
        assert remark in found.remark(operation)
        assert bool(found.remark(operation)) is bool(remark)


def _nested(kind: str, inner: str) -> str:
    """Return twelve groups, each of which names the next one ten times, and a type of them."""
    more = {"group": "<xs:sequence>{}</xs:sequence>", "attributeGroup": "{}"}[kind]
    parts = [more.format(f'<xs:{kind} ref="t:g{number + 1}"/>' * 10) for number in range(12)] + [more.format(inner)]
    groups = "".join(f'<xs:{kind} name="g{number}">{part}</xs:{kind}>' for number, part in enumerate(parts))
    return groups + _got(f'<xs:{kind} ref="t:g0"/>')


_OPTIONAL = '<xs:element name="v" type="xs:int" minOccurs="0"/>'


@pytest.mark.parametrize(
    "content",
    [
        _nested("group", _OPTIONAL),
        _nested("attributeGroup", '<xs:attribute name="a"/>'),
        _got(f"<xs:sequence>{_OPTIONAL * 3000}</xs:sequence>"),
    ],
    ids=["groups", "groups of attributes", "one type"],
)
def test_a_type_that_no_compiler_ends_with_is_refused(content: str) -> None:
    started = time.process_time()

    with pytest.raises(WsdlError, match="more than 1,000 elements or attributes, groups included"):
        _read(_schema("urn:t", content))

    assert time.process_time() - started < 5


def _derived(count: int) -> str:
    one = '<xs:complexType name="C{}"><xs:complexContent><xs:extension base="{}"/></xs:complexContent></xs:complexType>'
    first = '<xs:complexType name="C0"><xs:sequence/></xs:complexType>'
    types = "".join(one.format(number, f"t:C{number - 1}") for number in range(1, count))
    return first + types + _got(f'<xs:sequence><xs:element name="a" type="t:C{count - 1}"/></xs:sequence>')


def _inside(count: int) -> str:
    one = '<xs:complexType name="C{}"><xs:sequence><xs:element name="a" type="{}"/></xs:sequence></xs:complexType>'
    types = "".join(one.format(number, f"t:C{number + 1}") for number in range(count))
    last = f'<xs:simpleType name="C{count}"><xs:restriction base="xs:int"/></xs:simpleType>'
    return types + last + _got('<xs:sequence><xs:element name="a" type="t:C0"/></xs:sequence>')


def _repeated(times: int, depth: int, how: str = "minOccurs") -> str:
    group = f'<xs:sequence minOccurs="{{}}" maxOccurs="{times}">'.format(times if how == "minOccurs" else 0)
    return _got(group * depth + '<xs:element name="v" type="xs:int"/>' + "</xs:sequence>" * depth)


def _text(pattern: str) -> str:
    facet = f'<xs:restriction base="xs:string"><xs:pattern value="{pattern}"/></xs:restriction>'
    return _got(f'<xs:sequence><xs:element name="a"><xs:simpleType>{facet}</xs:simpleType></xs:element></xs:sequence>')


def _grown(count: int, own: int) -> str:
    """Return a chain of types, each of which adds so many elements to those of its base."""
    one = '<xs:complexType name="C{}"><xs:complexContent><xs:extension base="t:C{}"><xs:sequence>{}</xs:sequence>'
    types = "".join(
        one.format(number, number - 1, "".join(f'<xs:element name="a{number}_{part}"/>' for part in range(own)))
        + "</xs:extension></xs:complexContent></xs:complexType>"
        for number in range(1, count)
    )
    return '<xs:complexType name="C0"><xs:sequence/></xs:complexType>' + types + _value(f"t:C{count - 1}")


def _linked(count: int, one: str, last: str, first: str) -> str:
    """Return components of which each refers to the next, N."""
    return "".join(one.format(I=number, N=number + 1) for number in range(count)) + last.format(I=count) + _got(first)


_ELEMENT = (
    '<xs:element name="e{I}"><xs:complexType><xs:choice><xs:element ref="t:e{N}"/></xs:choice></xs:complexType>'
    "</xs:element>"
)
_UNION = '<xs:simpleType name="u{{I}}"><xs:union memberTypes="{}"/></xs:simpleType>'
_TEXT = '<xs:simpleType name="u{I}"><xs:restriction base="xs:string"/></xs:simpleType>'
_OF_UNION = '<xs:sequence><xs:element name="a" type="t:u0"/></xs:sequence>'
_GROUP = (
    '<xs:group name="g{I}"><xs:sequence><xs:group ref="t:g{N}" minOccurs="1000" maxOccurs="1000"/></xs:sequence>'
    "</xs:group>"
)
_LAST = '<xs:group name="g{I}"><xs:sequence><xs:element name="v"/></xs:sequence></xs:group>'


def _types(count: int, members: int) -> str:
    one = '<xs:complexType name="C{}"><xs:sequence>{}</xs:sequence></xs:complexType>'
    parts = "".join(f'<xs:element name="a{part}" minOccurs="0"/>' for part in range(members))
    return "".join(one.format(number, parts) for number in range(count)) + _value("t:C0")


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (
            _linked(2000, _ELEMENT, '<xs:element name="e{I}"/>', '<xs:sequence><xs:element ref="t:e0"/></xs:sequence>'),
            "element e1850 begins a chain",
        ),
        (_linked(2000, _UNION.format("t:u{N} xs:int"), _TEXT, _OF_UNION), "type u1850 begins a chain"),
        (_linked(2000, _GROUP, _LAST, '<xs:group ref="t:g0"/>'), "group g1850 begins a chain"),
        (_linked(10, _UNION.format("t:u{N} " * 10), _TEXT, _OF_UNION), "type u[0-9] has more than 1,000"),
        (_grown(140, 100), "type C11 has more than 1,000"),
        (_types(100, 500), "types have 50,00[0-9] elements"),
        (_text("a*" * 2000), "a pattern of 4,000 characters and 2,000 groups, quantifiers"),
        (_derived(2000), "a chain of more than 150 types"),
        (_inside(2000), "a chain of more than 150 types"),
        (_repeated(1000, 4), "more than 10,000 elements, unrolled"),
        (_repeated(20_000, 1), "more than 10,000 elements, unrolled"),
        (_text("(a|b)*" * 1000 + "c"), "a pattern of 6,001 characters"),
    ],
    ids=[
        "elements",
        "unions",
        "groups",
        "union of unions",
        "inherited",
        "types",
        "quantifiers",
        "derived",
        "inside",
        "repeated in repeated",
        "repeated",
        "pattern",
    ],
)
def test_what_takes_a_compiler_all_memory_is_refused(content: str, reason: str) -> None:
    started = time.process_time()

    with pytest.raises(WsdlError, match=reason):
        _read(_schema("urn:t", content))

    assert time.process_time() - started < 5


@pytest.mark.parametrize(
    "content",
    [
        _derived(30),
        _grown(30, 5),
        _got(
            '<xs:sequence minOccurs="200" maxOccurs="200"><xs:element name="a"><xs:complexType>'
            '<xs:sequence minOccurs="200" maxOccurs="200"><xs:element name="b"/></xs:sequence>'
            "</xs:complexType></xs:element></xs:sequence>"
        ),
        _inside(30),
        _repeated(100, 1),
        _repeated(99_999, 1, "maxOccurs"),
        _text("(a|b)*[A-Z]{3}(-\\d{2}){1,5}"),
        '<xs:complexType name="C"><xs:sequence><xs:element name="c" type="t:C" minOccurs="0"/></xs:sequence>'
        "</xs:complexType>" + _got('<xs:sequence><xs:element name="a" type="t:C"/></xs:sequence>'),
    ],
    ids=[
        "derived",
        "grown",
        "repeated in a type of its own",
        "inside",
        "repeated",
        "repeated at most",
        "pattern",
        "within itself",
    ],
)
def test_what_real_services_have_is_compiled(content: str) -> None:
    assert _read(_schema("urn:t", content)).ports


@pytest.mark.parametrize(
    ("content", "remark"),
    [
        (_linked(3, _GROUP, _LAST, '<xs:group ref="t:g0"/>'), "its smallest request has 1,000,000,001 elements"),
        (
            _got('<xs:sequence><xs:element name="v" minOccurs="99"/></xs:sequence>').replace(
                '"99"', '"99" maxOccurs="99"'
            ),
            "",
        ),
    ],
    ids=["groups", "real"],
)
def test_an_operation_whose_smallest_request_is_too_large_is_not_called(content: str, remark: str) -> None:
    content = content.replace("Got", "Put").replace("Get", "Got").replace("Put", "Get")

    found = _read(_schema("urn:t", content))

    said = found.remark(found.ports[0].operations[0])
    assert said.startswith(remark)
    assert bool(said) is bool(remark)


def test_a_service_of_many_operations_is_read_in_linear_time() -> None:
    many = range(1500)
    messages = "".join(f'<w:message name="i{one}"><w:part name="p" element="t:Get"/></w:message>' for one in many)
    declared = "".join(f'<w:operation name="G{one}"><w:input message="t:i{one}"/></w:operation>' for one in many)
    body = '<w:input><s:body use="literal"/></w:input>'
    bound = "".join(f'<w:operation name="G{one}"><s:operation soapAction=""/>{body}</w:operation>' for one in many)
    wsdl = _WSDL.replace("TYPES", _schema("urn:t", _value("xs:int"))).replace("<w:portType", messages + "<w:portType")
    wsdl = wsdl.replace('<w:portType name="P">', f'<w:portType name="P">{declared}')
    wsdl = wsdl.replace("</w:binding>", f"{bound}</w:binding>")
    started = time.process_time()

    (port,) = read_services(wsdl.encode(), "http://device/a.wsdl", lambda _: b"").ports

    assert len(port.operations) == 1501
    assert time.process_time() - started < 5


def test_the_parts_of_an_rpc_message_may_have_types_of_several_namespaces():
    parts = ("xs:int", "x:D", "xs:string", "y:D")
    parts = "".join(f'<w:part name="p{place}" type="{type_}"/>' for place, type_ in enumerate(parts))
    rpc = _WSDL.replace('<w:part name="p" element="t:Get"/>', parts).replace('<w:part name="p" element="t:Got"/>', "")
    rpc = rpc.replace("<s:binding ", '<s:binding style="rpc" ').replace('"literal"/>', '"literal" namespace="urn:t"/>')
    found = read_services(
        rpc.replace("TYPES", _schema("urn:x", _DEGREES) + _schema("urn:y", _DEGREES)).encode(),
        "http://device/a/b.wsdl",
        lambda _: b"",
    )
    assert found.faults == ()
    spaces = '<Get xmlns="urn:t"><p0 xmlns="">1</p0><p1 xmlns="">9</p1><p2 xmlns="">a</p2><p3 xmlns="">{}</p3></Get>'
    assert not found.types.invalid(etree.fromstring(spaces.format(9)))
    assert found.types.invalid(etree.fromstring(spaces.format(10)))
    nil = '<{} xmlns="urn:t" xmlns:i="http://www.w3.org/2001/XMLSchema-instance" i:nil="true"/>'
    assert not found.types.invalid(etree.fromstring(nil.format("GetResponse")))
    assert found.types.invalid(etree.fromstring(nil.format("Get")))
