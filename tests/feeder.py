"""A feeder with settings, bins and recipes over SOAP: right in several styles, or with one fault."""

import itertools
import re
import threading
import time
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any
from xml.sax.saxutils import escape

from lxml import etree
from soap_devices import Device, abstract, messages, operation, wsdl

_XS = 'xmlns:xs="http://www.w3.org/2001/XMLSchema"'
_SETTINGS = (
    '<xs:element name="Rate" type="c:Rate"/><xs:element name="Label" type="c:Label"/>'
    '<xs:element name="Mode" type="c:Mode"/><xs:element name="Quiet" type="xs:boolean"/>'
    '<xs:element name="Offset" type="xs:double"/><xs:element name="Note" type="c:Label" nillable="true"/>'
)
_NOTHING = "<xs:complexType><xs:sequence/></xs:complexType>"
_ELEMENTS = {
    "GetSettings": "",
    "GetSettingsResponse": _SETTINGS,
    "SetSettings": _SETTINGS,
    "SetSettingsResponse": "",
    "GetBin": '<xs:element name="Bin" type="c:Number"/>',
    "GetBinResponse": '<xs:element name="Bin" type="c:Number"/><xs:element name="Weight" type="c:Rate"/>',
    "SetBin": '<xs:element name="Bin" type="c:Number"/><xs:element name="Weight" type="c:Rate"/>',
    "SetBinResponse": "",
    "AddRecipe": '<xs:element name="Title" type="c:Label"/><xs:element name="Grams" type="c:Number"/>',
    "AddRecipeResponse": '<xs:element name="RecipeId" type="c:RecipeId"/>',
    "GetRecipes": "",
    "GetRecipesResponse": '<xs:element name="Recipe" minOccurs="0" maxOccurs="unbounded"><xs:complexType><xs:sequence>'
    '<xs:element name="RecipeId" type="c:RecipeId"/><xs:element name="Title" type="xs:string"/></xs:sequence>'
    "</xs:complexType></xs:element>",
    "DeleteRecipe": '<xs:element name="RecipeId" type="c:RecipeId"/>',
    "DeleteRecipeResponse": "",
    "GetSlot": '<xs:element name="Tray" type="c:Number"/><xs:element name="Slot" type="c:Number"/>',
    "GetSlotResponse": '<xs:element name="Tray" type="c:Number"/><xs:element name="Slot" type="c:Number"/>'
    '<xs:element name="Metres" type="c:Rate"/>',
}
_NAMES = [name for name in _ELEMENTS if not name.endswith("Response")]


def _simple(name: str, base: str, *facets: str) -> str:
    inside = "".join(f"<xs:{facet}/>" for facet in facets)
    return f'<xs:simpleType name="{name}"><xs:restriction base="xs:{base}">{inside}</xs:restriction></xs:simpleType>'


XSD = (
    f'<xs:schema {_XS} targetNamespace="urn:feeder" xmlns:c="urn:feeder" elementFormDefault="qualified">'
    + _simple("Rate", "double", 'minInclusive value="0"', 'maxInclusive value="8"')
    + _simple("Number", "int", 'minInclusive value="1"', 'maxInclusive value="9"')
    + _simple("Label", "string", 'maxLength value="40"')
    + _simple("RecipeId", "string", 'pattern value="r[0-9]{1,6}"')
    + _simple("Mode", "string", 'enumeration value="slow"', 'enumeration value="even"', 'enumeration value="burst"')
    + "".join(
        f'<xs:element name="{name}"><xs:complexType><xs:sequence>{inside}</xs:sequence></xs:complexType></xs:element>'
        for name, inside in _ELEMENTS.items()
    )
    + "</xs:schema>"
)
WSDL = wsdl(
    "feeder",
    f'<xs:schema {_XS}><xs:import namespace="urn:feeder" schemaLocation="feeder.xsd"/></xs:schema>',
    messages(*_NAMES),
    abstract(*_NAMES),
    "soap",
    "document",
    "".join(operation(name, "soap", f"urn:feeder/{name}") for name in _NAMES),
)
# Which values of a refused message are applied.
_APPLIED = {
    "refused applied": ("Rate", "Label"),
    "refused label applied": ("Label",),
    "mandatory label applied": ("Label",),
}


@dataclass
class Feeder(Device):
    """The device, with ``style`` or ``faults`` by name."""

    style: str = ""
    faults: frozenset[str] = frozenset()
    settings: dict[str, str] = field(
        default_factory=lambda: {
            "Rate": "2",
            "Label": "feeder",
            "Mode": "even",
            "Quiet": "false",
            "Offset": "0.5",
            "Note": "new",
        }
    )
    bins: dict[str, str] = field(default_factory=lambda: {"1": "3", "2": "4"})
    recipes: dict[str, str] = field(default_factory=dict)
    lock: Any = field(default_factory=threading.RLock)
    numbers: Any = field(default_factory=lambda: itertools.count(1))
    slot: dict[str, str] | None = None
    refusals: int = 0
    writes: int = 0
    reads: int = 0
    due: list[tuple[float, dict[str, str]]] = field(default_factory=list)

    @cached_property
    def schema(self) -> etree.XMLSchema:
        """The schema that validates requests, without some of the facets if that is the fault."""
        names = [name for name in ("maxInclusive", "maxLength") if f"no {name}" in self.faults]
        return etree.XMLSchema(
            etree.fromstring(re.sub(f'<xs:({"|".join(names) or "-"}) value="[^"]*"/>', "", self.xsd))
        )

    def respond(self, octets: bytes) -> tuple[int, bytes]:
        """Answer, and note what was refused."""
        if "utf-16 lost" in self.faults and octets[:2] in {b"\xff\xfe", b"\xfe\xff"}:
            octets = octets.decode("utf-16").replace("utf-16", "ascii", 1).encode("ascii", "replace")
        with self.lock:
            status, body = super().respond(octets)
            if status != 200:
                self.refusals += 1
                self._refused(octets)
            return status, body

    def _refused(self, octets: bytes) -> None:
        """Let a message that the schema forbids have an effect, if that is the fault."""
        if "refused creates" in self.faults and b"AddRecipe" in octets:
            self.recipes[f"r{next(self.numbers)}"] = "broken"
        if b"SetSettings" not in octets:
            return
        try:
            sent = {etree.QName(one).localname: one.text or "" for one in etree.fromstring(octets).iter(etree.Element)}
        except etree.XMLSyntaxError:
            return
        for fault, names in _APPLIED.items():
            is_one = fault in self.faults and (b"Strange" in octets or "mandatory" not in fault)
            for name in names if is_one else ():
                self.settings[name] = sent.get(name, self.settings[name])

    def answer(self, name: str, payload: Any) -> str | None:
        """Return the Body of a success."""
        sent = {etree.QName(one).localname: one.text or "" for one in payload}
        made = getattr(self, f"_{name}")(sent)
        if made is None:
            return None
        return f'<c:{name}Response xmlns:c="urn:feeder">{made}</c:{name}Response>'

    def _GetSettings(self, _: dict[str, str]) -> str | None:  # noqa: N802 - as the operation is called
        self.reads += 1
        now = time.monotonic()
        for at, values in [one for one in self.due if one[0] <= now]:
            self.settings.update(values)
            self.due.remove((at, values))
        told = dict(self.settings)
        if "fails at times" in self.faults and self.reads % 8 == 0:
            return None
        if "latin" in self.faults and not told["Label"].isascii():
            told["Label"] = told["Label"].encode().decode("latin-1")
        if "escaped twice" in self.faults:
            told["Label"] = escape(told["Label"])
        if self.style == "drifts":
            told["Rate"] = str(min(8.0, float(told["Rate"]) + 0.003 * (self.reads % 5)))
        return "".join(f"<c:{key}>{escape(text)}</c:{key}>" for key, text in told.items())

    def _SetSettings(self, sent: dict[str, str]) -> str | None:  # noqa: N802 - as the operation is called
        self.writes += 1
        values = {**sent, "Quiet": {"1": "true", "0": "false"}.get(sent["Quiet"], sent["Quiet"])}
        if "mode burst refused" in self.faults and values["Mode"] == "burst":
            return None
        if self.style == "narrow" and abs(float(values["Rate"])) > 99:
            return None
        values["Label"] = self._label(values["Label"])
        values |= {"Note": values["Note"] or self.settings["Note"]} if "nil stays" in self.faults else {}
        values |= {"Offset": "0"} if "NaN is zero" in self.faults and values["Offset"] == "NaN" else {}
        if "quiet stays" in self.faults and values["Quiet"] == "false":
            values["Quiet"] = "true"
        if "rate whole" in self.faults and self.writes > 3:
            values["Rate"] = str(int(float(values["Rate"])))
        if "lost after refusal" in self.faults and self.refusals > 4 and self.writes % 2:
            return ""
        if self.style == "limits":
            values["Rate"] = str(min(5.0, float(values["Rate"])))
        if self.style == "slow":
            self.due.append((time.monotonic() + 0.3, values))
            return ""
        self.settings.update(values)
        if self.style == "expires":
            self.due.append((time.monotonic() + 0.5, {"Rate": "0"}))
        return ""

    def _label(self, text: str) -> str:
        if "label ignored" in self.faults:
            return "feeder"
        if "empty label stays" in self.faults:
            text = text or self.settings["Label"]
        return text[:30] if "label cut" in self.faults else text

    def _GetBin(self, sent: dict[str, str]) -> str | None:  # noqa: N802 - as the operation is called
        number = sent["Bin"]
        if number not in self.bins:
            return None
        return f"<c:Bin>{number}</c:Bin><c:Weight>{self.bins[number]}</c:Weight>"

    def _SetBin(self, sent: dict[str, str]) -> str | None:  # noqa: N802 - as the operation is called
        if sent["Bin"] not in self.bins:
            return None
        if "bins share" in self.faults:
            self.bins = dict.fromkeys(self.bins, sent["Weight"])
        self.bins[sent["Bin"]] = sent["Weight"]
        return ""

    def _GetSlot(self, sent: dict[str, str]) -> str | None:  # noqa: N802 - as the operation is called
        last, self.slot = self.slot or sent, sent
        told = last if "slots crossed" in self.faults and next(self.numbers) % 3 == 0 else sent
        is_far = "last slot is far" in self.faults and sent == {"Tray": "9", "Slot": "9"}
        told = {**told, "Metres": "90" if is_far else "0.5"}
        return "".join(f"<c:{name}>{text}</c:{name}>" for name, text in told.items())

    def _AddRecipe(self, sent: dict[str, str]) -> str | None:  # noqa: N802 - as the operation is called
        is_old = "id twice" in self.faults and len(self.recipes) % 3 > 1
        id_ = list(self.recipes)[-1] if is_old else f"r{next(self.numbers)}"
        if not ("third recipe lost" in self.faults and len(self.recipes) == 2):
            self.recipes[id_] = sent["Title"]
        return f"<c:RecipeId>{id_}</c:RecipeId>"

    def _GetRecipes(self, _: dict[str, str]) -> str | None:  # noqa: N802 - as the operation is called
        return "".join(
            f"<c:Recipe><c:RecipeId>{id_}</c:RecipeId><c:Title>{escape(title)}</c:Title></c:Recipe>"
            for id_, title in self.recipes.items()
        )

    def _DeleteRecipe(self, sent: dict[str, str]) -> str | None:  # noqa: N802 - as the operation is called
        if sent["RecipeId"] not in self.recipes:
            return None
        if "delete takes another" in self.faults and len(self.recipes) > 1:
            del self.recipes[next(one for one in self.recipes if one != sent["RecipeId"])]
        if "delete takes all" in self.faults:
            self.recipes.clear()
        elif "delete does nothing" not in self.faults and not (
            "second delete does nothing" in self.faults and len(self.recipes) == 2
        ):
            del self.recipes[sent["RecipeId"]]
        return ""


def feeder(style: str = "", *faults: str) -> Feeder:
    """Return the device."""
    return Feeder("feeder", WSDL, XSD, {}, style=style, faults=frozenset(faults))
