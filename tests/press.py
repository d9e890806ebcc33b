"""A press with jobs over SOAP, which have states and a list in pages: right, or with faults."""

import threading
from dataclasses import dataclass, field
from typing import Any
from xml.sax.saxutils import escape

from lxml import etree
from soap_devices import Device, messages, operation, wsdl

_XS = 'xmlns:xs="http://www.w3.org/2001/XMLSchema"'


def _element(name: str, type_: str, more: str = "", says: str = "") -> str:
    said = f"<xs:annotation><xs:documentation>{says}</xs:documentation></xs:annotation>" if says else ""
    return f'<xs:element name="{name}" type="{type_}" {more}>{said}</xs:element>'


_OWN = _element("title", "c:Title") + _element("copies", "c:Copies") + _element("material", "c:Material")
_ID, _STATE, _OPTIONAL = _element("jobId", "c:Id"), _element("state", "c:State"), 'minOccurs="0"'
_MEMBERS = ("jobId", "title", "copies", "material", "state")
_ELEMENTS = {
    "CreateJob": _OWN,
    "CreateJobResponse": _ID,
    "GetJob": _ID,
    "GetJobResponse": _element("job", "c:Job"),
    "UpdateJob": _ID + _OWN,
    "UpdateJobResponse": "",
    "DeleteJob": _ID,
    "DeleteJobResponse": "",
    "StartJob": _ID,
    "StartJobResponse": _STATE,
    "CancelJob": _ID,
    "CancelJobResponse": _STATE,
    "ListJobs": _element("material", "c:Material", _OPTIONAL)
    + _element("sortBy", "c:SortKey", _OPTIONAL)
    + _element("limit", "c:Limit", _OPTIONAL)
    + _element("offset", "xs:nonNegativeInteger", _OPTIONAL),
    "ListJobsResponse": _element("job", "c:Job", 'minOccurs="0" maxOccurs="unbounded"')
    + _element("total", "xs:int", "", "How many jobs match, on all pages."),
}
_NAMES = [name for name in _ELEMENTS if not name.endswith("Response")]
_SAYS = {
    "StartJob": "Queued becomes running. In every other state InvalidStateFault.",
    "CancelJob": "Cancels a job. done and cancelled are final.",
    "DeleteJob": "Deletes a job for good.",
}


def _simple(name: str, base: str, **facets: Any) -> str:
    given = [(key, one) for key, some in facets.items() for one in (some if isinstance(some, tuple) else (some,))]
    inside = "".join(f'<xs:{key} value="{one}"/>' for key, one in given)
    return f'<xs:simpleType name="{name}"><xs:restriction base="xs:{base}">{inside}</xs:restriction></xs:simpleType>'


XSD = (
    f'<xs:schema {_XS} targetNamespace="urn:press" xmlns:c="urn:press" elementFormDefault="qualified">'
    + _simple("Id", "string", pattern="J-[0-9]{4}")
    + _simple("Title", "string", minLength=1, maxLength=40)
    + _simple("Copies", "int", minInclusive=1, maxInclusive=500)
    + _simple("Material", "string", enumeration=("paper", "card", "film"))
    + _simple("State", "string", enumeration=("queued", "running", "done", "cancelled"))
    + _simple("SortKey", "string", enumeration=("title", "copies"))
    + _simple("Limit", "int", minInclusive=1, maxInclusive=100)
    + f'<xs:complexType name="Job"><xs:sequence>{_ID}{_OWN}{_STATE}</xs:sequence></xs:complexType>'
    + _element("InvalidStateFault", "xs:string")
    + "".join(
        f'<xs:element name="{name}"><xs:complexType><xs:sequence>{inside}</xs:sequence></xs:complexType></xs:element>'
        for name, inside in _ELEMENTS.items()
    )
    + "</xs:schema>"
)
WSDL = wsdl(
    "press",
    f'<xs:schema {_XS}><xs:import namespace="urn:press" schemaLocation="press.xsd"/></xs:schema>',
    messages(*_NAMES) + '<message name="StateFaultIn"><part name="p" element="c:InvalidStateFault"/></message>',
    "".join(
        f'<operation name="{name}"><documentation>{_SAYS.get(name, "")}</documentation>'
        f'<input message="c:{name}In"/><output message="c:{name}Out"/>'
        f'<fault name="state" message="c:StateFaultIn"/></operation>'
        for name in _NAMES
    ),
    "soap",
    "document",
    "".join(operation(name, "soap", f"urn:press/{name}") for name in _NAMES),
)


@dataclass
class Press(Device):
    """The device, with ``faults`` by name."""

    faults: frozenset[str] = frozenset()
    jobs: dict[str, dict[str, str]] = field(default_factory=dict)
    last: int = 0
    lock: Any = field(default_factory=threading.RLock)

    def respond(self, octets: bytes) -> tuple[int, bytes]:
        """Return status and content of the response to a message."""
        with self.lock:
            return super().respond(octets)

    def answer(self, name: str, payload: Any) -> str | None:
        """Return the Body of a success."""
        sent = {etree.QName(one).localname: one.text or "" for one in payload}
        job = self.jobs.get(sent.get("jobId", ""))
        if name in {"CreateJob", "ListJobs"} or job is not None:
            made = getattr(self, f"_{name}")(sent, job)
            return None if made is None else f'<c:{name}Response xmlns:c="urn:press">{made}</c:{name}Response>'
        return None

    def _shown(self, job: dict[str, str]) -> str:
        inside = "".join(f"<c:{name}>{escape(job[name])}</c:{name}>" for name in _MEMBERS)
        return f"<c:job>{inside}</c:job>"

    def _CreateJob(self, sent: dict[str, str], _: Any) -> str:  # noqa: N802 - as the operation is called
        self.last += 1
        id_ = f"J-{self.last:04}"
        self.jobs[id_] = {"jobId": id_, **sent, "state": "queued"}
        return f"<c:jobId>{id_}</c:jobId>"

    def _GetJob(self, _: Any, job: dict[str, str]) -> str:  # noqa: N802 - as the operation is called
        return self._shown(job)

    def _UpdateJob(self, sent: dict[str, str], job: dict[str, str]) -> str:  # noqa: N802 - as the operation is called
        job.update({name: text for name, text in sent.items() if "copies lost" not in self.faults or name != "copies"})
        return ""

    def _DeleteJob(self, sent: dict[str, str], _: Any) -> str:  # noqa: N802 - as the operation is called
        del self.jobs[sent["jobId"]]
        return ""

    def _StartJob(self, _: Any, job: dict[str, str]) -> str | None:  # noqa: N802 - as the operation is called
        if job["state"] != "queued" and "starts again" not in self.faults:
            return None
        job["state"] = "running"
        return "<c:state>running</c:state>"

    def _CancelJob(self, _: Any, job: dict[str, str]) -> str:  # noqa: N802 - as the operation is called
        job["state"] = "cancelled"
        return "<c:state>cancelled</c:state>"

    def _ListJobs(self, sent: dict[str, str], _: Any) -> str:  # noqa: N802 - as the operation is called
        chosen = "" if "filter ignored" in self.faults else sent.get("material", "")
        jobs = [job for job in self.jobs.values() if chosen in {"", job["material"]}]
        if "sortBy" in sent and "sort ignored" not in self.faults:
            jobs.sort(key=lambda job: int(job["copies"]) if sent["sortBy"] == "copies" else job["title"])
        begin, most, total = int(sent.get("offset", 0)), int(sent.get("limit", 100)), len(jobs)
        jobs = jobs[begin + (begin > 0 and "offset skips" in self.faults) :][:most]
        total = len(jobs) if "total of the page" in self.faults else total
        return "".join(map(self._shown, jobs)) + f"<c:total>{total}</c:total>"


def press(*faults: str) -> Press:
    """Return the device."""
    return Press("press", WSDL, XSD, {}, faults=frozenset(faults))
