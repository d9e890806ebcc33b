"""Messages and faults, by SOAP 1.1 and the WS-I Basic Profile 1.1; the services' descriptions."""

import pytest
import zeep
from lxml import etree
from web_messages import ENVELOPE, NAMESPACE, SOAP, delivery_envelope, fault_of, goal, query_envelope

from conformance.papers_robot.delivery import EXAMPLE

GOOD = delivery_envelope()
UNKNOWN = '<s:Header><x:token xmlns:x="urn:x" {}/></s:Header>'
ADDRESSING = (
    '<s:Header xmlns:a="http://www.w3.org/2005/08/addressing">'
    '<a:Action s:mustUnderstand="1">urn:anything</a:Action><a:MessageID>urn:uuid:1</a:MessageID>'
    '<a:ReplyTo s:mustUnderstand="1"><a:Address>http://127.0.0.1:1/</a:Address></a:ReplyTo></s:Header>'
)


CLIENTS_FAULTS = {
    "no arg0": query_envelope("ExecuteDeliveryRequest"),
    "nil arg0": query_envelope(
        "ExecuteDeliveryRequest", '<arg0 xmlns:i="http://www.w3.org/2001/XMLSchema-instance" i:nil="true"/>'
    ),
    "missing": GOOD.replace("<source_y>41.35</source_y>", ""),
    "order": GOOD.replace("<depot_x>68.269</depot_x>", "").replace("</arg0>", "<depot_x>1</depot_x></arg0>"),
    "unknown": delivery_envelope(hurry=1),
    "twice": GOOD.replace("<source_y>", "<source_y>1</source_y><source_y>"),
    "qualified arg0": GOOD.replace("arg0>", "t:arg0>"),
    "text": delivery_envelope(depot_x="near"),
    "empty": delivery_envelope(depot_x=""),
    "code 2**40": delivery_envelope(message_code=2**40),
    "code 4.0": delivery_envelope(message_code="4.0"),
    "INF coffee": delivery_envelope("ExecuteCoffeeRequest", depot_x="INF"),
    "encodingStyle": GOOD.replace("<arg0>", '<arg0 s:encodingStyle="urn:x">'),
    "unknown operation": query_envelope("ExecuteTeaRequest"),
    "other namespace": GOOD.replace(NAMESPACE, "http://ros-ws.org"),
    "unqualified": ENVELOPE.format("", "<ExecuteDeliveryRequest/>"),
    "empty Body": ENVELOPE.format("", ""),
    "two requests": ENVELOPE.format("", f'<t:GetPose xmlns:t="{NAMESPACE}"/>' * 2),
    "no Body": '<s:Envelope xmlns:s="http://schemas.xmlsoap.org/soap/envelope/"/>',
    "after the Body": GOOD.replace("</s:Envelope>", "<more/></s:Envelope>"),
    "no envelope": f'<ExecuteDeliveryRequest xmlns="{NAMESPACE}"/>',
    "mustUnderstand true": delivery_envelope(header=UNKNOWN.format('s:mustUnderstand="true"')),
}


@pytest.mark.parametrize("message", CLIENTS_FAULTS.values(), ids=CLIENTS_FAULTS)
def test_what_the_description_does_not_allow_is_a_client_fault(served, foreign, message):
    assert fault_of(served.soap(message)) == "Client"
    assert served.soap(delivery_envelope(source_x=0.5)).status_code == 200
    assert foreign.next("delivery")["source_x"] == "3fe0000000000000"


@pytest.mark.parametrize(
    ("name", "sent"),
    [
        ("depot_x", "INF"),
        ("depot_y", "-INF"),
        ("source_x", "NaN"),
        ("source_y", "1e400"),
        ("destination_x", "1e400"),
        ("destination_y", "-INF"),
        ("depot_x", "9" * 400),
        ("message_code", "5"),
        ("message_code", "+05"),
        ("message_code", "0" * 5000 + "4"),
    ],
)
def test_a_value_that_no_delivery_may_have_is_named_and_repeated(served, foreign, name, sent):
    answer = served.soap(delivery_envelope(**{name: sent}))
    assert fault_of(answer) == "Client"
    told = etree.fromstring(answer.content).findtext(".//faultstring")
    assert told.startswith(f"{name} must be ")
    assert f"not '{sent[:7]}" in told
    assert len(told) < 300
    assert foreign.heard_nothing()


def test_another_envelope_is_a_version_mismatch(served):
    other = GOOD.replace("http://schemas.xmlsoap.org/soap/envelope/", "http://www.w3.org/2003/05/soap-envelope")
    assert fault_of(served.soap(other)) == "VersionMismatch"


def test_a_mandatory_header_block_that_is_unknown_stops_the_message(served, foreign):
    mandatory = UNKNOWN.format('s:mustUnderstand="1"')
    assert fault_of(served.soap(delivery_envelope(header=mandatory))) == "MustUnderstand"
    assert foreign.heard_nothing()
    # It is looked at before what is wrong with the Body (R2725).
    assert fault_of(served.soap(ENVELOPE.format(mandatory, ""))) == "MustUnderstand"


@pytest.mark.parametrize(
    "header",
    [
        "<s:Header/>",
        UNKNOWN.format(""),
        UNKNOWN.format('s:mustUnderstand="0"'),
        UNKNOWN.format('s:mustUnderstand="1" s:actor="urn:another"'),
        ADDRESSING,
    ],
)
def test_other_header_blocks_are_taken(served, foreign, header):
    answer = served.soap(delivery_envelope(header=header))
    assert answer.status_code == 200
    assert "ExecuteDeliveryRequestResponse" in answer.text
    foreign.next("delivery")


@pytest.mark.parametrize(
    "message",
    [
        GOOD.replace("<t:", "<")
        .replace("</t:", "</")
        .replace("xmlns:t=", "xmlns=")
        .replace("<arg0>", '<arg0 xmlns="">'),
        GOOD.replace("<s:", "<env-1:").replace("</s:", "</env-1:").replace(":s=", ":env-1="),
        f'<?xml version="1.0"?>\n<!-- coffee -->{GOOD}<!-- soon -->\n',
        GOOD.replace("68.269", "<![CDATA[68.]]>269").replace("76.02", "76<!-- . -->.02").replace("41", "&#52;&#x31;"),
        GOOD.replace("><", ">\n\t <").replace("68.269", "\n68.269 ").replace(">4<", "> +4 <"),
        GOOD.replace("68.269", "6.8269E+1"),
        GOOD.replace(
            "<depot_x>",
            '<depot_x xmlns:i="http://www.w3.org/2001/XMLSchema-instance" '
            'xmlns:x="http://www.w3.org/2001/XMLSchema" i:type="x:double">',
        ),
    ],
)
def test_another_way_to_write_the_same_is_the_same(served, foreign, message):
    assert served.soap(GOOD).status_code == 200
    expected = foreign.next("delivery")
    assert served.soap(message).status_code == 200
    assert foreign.next("delivery") == expected


@pytest.mark.parametrize(
    ("encoding", "declared", "charset"),
    [
        ("utf-8", "", "text/xml"),
        ("utf-8-sig", "", "text/xml; charset=utf-8"),
        ("utf-8", '<?xml version="1.0" encoding="utf-8"?>', 'text/xml;charset="UTF-8"'),
        ("utf-16", "", "text/xml; charset=utf-16"),
        ("utf-16", '<?xml version="1.0" encoding="UTF-16"?>', "text/xml"),
        ("utf-16-be", "", "text/xml; charset=UTF-16BE"),
        ("utf-8", '<?xml version="1.0" encoding="iso-8859-1"?>', "text/xml; charset=utf-8"),
        ("utf-8", "", "TEXT/XML ; charset=utf-8; action=x"),
    ],
)
def test_both_encodings_are_read(served, foreign, encoding, declared, charset):
    answer = served.soap((declared + GOOD).encode(encoding), Content_Type=charset)
    assert answer.status_code == 200, answer.text
    foreign.next("delivery")


@pytest.mark.parametrize("action", ["", '""', '"urn:ExecuteCoffeeRequest"', "nonsense"])
def test_the_soap_action_chooses_nothing(served, foreign, action):
    answer = served.soap(delivery_envelope(message_code=3), SOAPAction=action)
    assert "ExecuteDeliveryRequestResponse" in answer.text
    assert foreign.next("delivery")["message_code"] == 3


@pytest.mark.parametrize(
    ("body", "content_type", "status"),
    [
        (b"", "text/xml", 400),
        (b"<s:Envelope", "text/xml", 400),
        (GOOD.encode()[:-5], "text/xml", 400),
        (b"\xff\xfe<\0", "text/xml", 400),
        (GOOD.replace("68.269", "\xe9").encode("latin-1"), "text/xml; charset=utf-8", 400),
        (b"<!DOCTYPE x>" + GOOD.encode(), "text/xml", 400),
        (
            f'<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/hostname">]>{delivery_envelope(depot_x="&e;")}',
            "text/xml",
            400,
        ),
        (b"<?go?>" + GOOD.encode(), "text/xml", 400),
        (GOOD.replace("<arg0>", "<arg0><?go?>").encode(), "text/xml", 400),
        (GOOD.replace("<arg0>", "<a>" * 5000 + "<arg0>"), "text/xml", 400),
        (GOOD.encode("utf-16-le"), "text/xml; charset=utf-16be", 400),
        (GOOD, "text/plain", 415),
        (GOOD, "application/soap+xml", 415),
        (GOOD, "application/xml", 415),
        (GOOD, "text/xml; charset=iso-8859-1", 415),
        ('<?xml version="1.0" encoding="iso-8859-1"?>' + GOOD, "text/xml", 415),
    ],
)
def test_what_is_no_message_is_4xx_without_a_fault(served, foreign, body, content_type, status):
    answer = served.soap(body, Content_Type=content_type)
    assert answer.status_code == status
    assert "Fault" not in answer.text
    assert "Traceback" not in answer.text
    assert served.soap(delivery_envelope(source_x=0.5)).status_code == 200
    assert foreign.next("delivery")["source_x"] == "3fe0000000000000"


def test_methods_other_than_post_are_405(served):
    for method in ("GET", "PUT", "DELETE", "PATCH", "HEAD"):
        answer = served.client.request(method, served.publishers)
        assert (answer.status_code, answer.headers["Allow"]) == (405, "POST, OPTIONS")
    assert served.client.post(served.publishers + "/other", content=GOOD).status_code == 404


@pytest.mark.parametrize("service", ["publishers", "subscribers"])
def test_the_description_carries_the_real_address(served, service):
    url = getattr(served, service)
    wsdl = etree.fromstring(served.client.get(url + "?wsdl").content)
    assert wsdl.find(".//{http://schemas.xmlsoap.org/wsdl/soap/}address").get("location") == url
    schema = wsdl.find(".//{http://www.w3.org/2001/XMLSchema}import").get("schemaLocation")
    assert etree.XMLSchema(etree.fromstring(served.client.get(schema).content))


def test_zeep_calls_every_operation(served, foreign):
    publishers = zeep.Client(served.publishers + "?wsdl").service
    request = EXAMPLE | {"message_code": 3}
    publishers.ExecuteDeliveryRequest(request)
    publishers.ExecuteCoffeeRequest(request)
    assert [foreign.next("delivery")["message_code"] for _ in range(2)] == [3, 4]
    subscribers = zeep.Client(served.subscribers + "?wsdl").service
    assert len(subscribers.GetPose().pose.covariance) == 36
    assert subscribers.GetVelocity().linear.y == 0
    assert subscribers.GetSensors() in ([], None)
    assert subscribers.GetNavigationServices() in ([], None)
    with pytest.raises(zeep.exceptions.Fault, match="no goal"):
        subscribers.GetGoal()
    with pytest.raises(zeep.exceptions.Fault, match="no planner"):
        subscribers.GetPlan(x=1, y=2)


@pytest.mark.parametrize("operation", ["GetPose", "GetVelocity", "GetSensors", "GetNavigationServices", "GetGoal"])
def test_answers_are_valid_by_the_schema(served, foreign, operation):
    served.call("PUT", "/robot/navigation/action/goal/", json=goal())
    foreign.next("goal")
    schema = etree.XMLSchema(etree.fromstring(served.client.get(served.subscribers + "?xsd=1").content))
    answer = served.soap(query_envelope(operation), url=served.subscribers)
    wrapper = etree.fromstring(answer.content).find(f"{SOAP}Body")[0]
    assert wrapper.tag == f"{{{NAMESPACE}}}{operation}Response"
    schema.assertValid(wrapper)


@pytest.mark.parametrize("sent", ["1e400", "9" * 400])
def test_a_plan_query_s_number_is_repeated(served, sent):
    answer = served.soap(query_envelope("GetPlan", f"<x>{sent}</x><y>1</y>"), url=served.subscribers)
    assert fault_of(answer) == "Client"
    told = etree.fromstring(answer.content).findtext(".//faultstring")
    assert told.startswith(f"x must be finite, not '{sent[:5]}")
    assert len(told) < 300


@pytest.mark.parametrize(
    "content", ["<x>1</x>", "<x>INF</x><y>1</y>", "<x>1</x><y>1</y><frame_id>mars</frame_id>", "<y>1</y><x>1</x>"]
)
def test_a_bad_plan_query_is_a_client_fault(served, content):
    assert fault_of(served.soap(query_envelope("GetPlan", content), url=served.subscribers)) == "Client"


def test_a_host_that_is_none_gets_no_description(served):
    answer = served.client.get(served.publishers + "?wsdl", headers={"Host": 'x"><y'})
    assert (answer.status_code, answer.headers["Content-Type"]) == (421, "application/problem+json")
