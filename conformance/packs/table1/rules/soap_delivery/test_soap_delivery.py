"""The publishers service over SOAP: the robot must accept all valid deliveries and reject all others."""

import pytest
from hypothesis import strategies as st

from conformance.api.soap.callable_services import repetitions
from conformance.api.soap.calls import judge_answer, read_exchange, send
from conformance.api.soap.envelope import envelope
from conformance.api.soap.forms import written_integer
from conformance.api.soap.messages import padded, variants, with_text
from conformance.api.soap.service import SoapService
from conformance.api.soap.valid_messages import call_valid, require_valid_document, with_xsi_types
from conformance.api.soap.xml_style import XmlStyle, serialize, single_changes, xml_styles
from conformance.contract.classes import TAKEN_OCTETS
from conformance.documents.xml import ADDRESSING, Node, clark
from conformance.packs.table1.robot import soap_services
from conformance.transport.exchange import Exchange
from conformance.transport.parallel import MOST_CLIENTS, is_busy, send_together
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge
from conformance.verdict.explorer import Explorer

pytestmark = [pytest.mark.phase("acting"), pytest.mark.needs("publishers"), pytest.mark.motion]
_BOTH = ("ExecuteDeliveryRequest", "ExecuteCoffeeRequest")


@pytest.mark.requirement("soap-delivery/delivery", "soap-delivery/coffee", "soap-delivery/response-valid")
def test_operations(publishers: SoapService, judge: Judge, effort: Effort) -> None:
    """Send the paper's example to both operations repeatedly: each must respond with its own empty wrapper."""
    for number in range(effort.cases(55)):
        for operation, id_ in zip(_BOTH, ("soap-delivery/delivery", "soap-delivery/coffee"), strict=True):
            code = "3" if operation == "ExecuteDeliveryRequest" and number % 2 else "4"
            answer = call_valid(publishers, soap_services.delivery(operation, code))
            right = answer.payload == clark(soap_services.NAMESPACE, f"{operation}Response")
            judge_answer(judge, id_, answer.is_taken and right, answer, f"2xx with {operation}Response for code {code}")


@pytest.mark.requirement("soap-delivery/range")
def test_range(publishers: SoapService, judge: Judge, explore: Explorer) -> None:
    """Send doubles over their whole range and both codes, in every notation that XML Schema allows."""
    declared = publishers.contract.shape(clark(soap_services.NAMESPACE, "ExecuteDeliveryRequest"))
    if declared is None:
        pytest.skip("the contract has no ExecuteDeliveryRequest")
    base = soap_services.delivery()
    code_path = base.path_to("message_code")

    def judge_range(case: tuple[Node, str, int, str]) -> None:
        message, operation, form, space = case
        code = 3 if operation == "ExecuteDeliveryRequest" and form % 2 else 4
        message = with_text(message, code_path, f"{space}{written_integer(code, form // 2)}{space}")
        message = Node(clark(soap_services.NAMESPACE, operation), "", message.children)
        answer = call_valid(publishers, message)
        values = ", ".join(f"{leaf.name} {leaf.text!r}" for leaf in message.children[0].children)
        judge.require(
            "soap-delivery/range",
            answer.is_taken,
            answer.exchange,
            "2xx for finite doubles and code 3 or 4",
            found=f"{answer.describe()}, for {values}",
            cause=f"{answer.status} {answer.code}",
        )

    strategy = st.tuples(
        variants(declared, base, frozenset({code_path})),
        st.sampled_from(_BOTH),
        st.integers(0, 7),
        st.sampled_from(["", " ", "\n"]),
    )
    explore(strategy, judge_range, cases=150)


@pytest.mark.requirement("soap-delivery/syntax")
def test_syntax(publishers: SoapService, judge: Judge, explore: Explorer, effort: Effort) -> None:
    """Send requests that differ only in XML syntax (prefixes, quotes, white space): the robot must accept all."""

    def judge_style(operation: str, style: XmlStyle, what: str) -> None:
        document = serialize(envelope([soap_services.delivery(operation)]), style)
        answer = send(publishers, require_valid_document(publishers, document))
        judge.require(
            "soap-delivery/syntax",
            answer.is_taken,
            answer.exchange,
            f"2xx for the same message with {what}",
            found=answer.describe(),
        )

    for operation in _BOTH:
        for what, style in single_changes()[: effort.cases(len(single_changes()))]:
            document = serialize(envelope([soap_services.delivery(operation)]), style)
            answer = send(publishers, require_valid_document(publishers, document))
            judge_answer(judge, "soap-delivery/syntax", answer.is_taken, answer, f"2xx for the same with {what}")
    explore(
        st.tuples(st.sampled_from(_BOTH), xml_styles()),
        lambda case: judge_style(case[0], case[1], "several changes of syntax"),
        cases=60,
    )


@pytest.mark.requirement("soap-delivery/typed-values")
def test_typed_values(publishers: SoapService, judge: Judge) -> None:
    """Send values with xsi:type, as PHP and ksoap2 clients do: they must mean the same."""
    for operation in _BOTH:
        declared = publishers.contract.shape(clark(soap_services.NAMESPACE, operation))
        if declared is None:
            pytest.skip(f"the contract has no {operation}")
        payload = soap_services.delivery(operation)
        document = require_valid_document(publishers, with_xsi_types(envelope([payload]), declared, payload))
        answer = send(publishers, document)
        expected = "2xx for the same with xsi:type on each value"
        judge_answer(judge, "soap-delivery/typed-values", answer.is_taken, answer, expected)


@pytest.mark.requirement("soap-delivery/addressing")
def test_addressing(publishers: SoapService, judge: Judge, effort: Effort) -> None:
    """Send WS-Addressing headers, with the paper's action and with that of JAX-WS RI: they must change nothing."""
    address = publishers.endpoint
    for number in range(repetitions(effort, 5)):
        for operation in _BOTH:
            for form in (operation, f"{operation}Request"):
                action = f"{soap_services.NAMESPACE}TurtlebotPublishersInterface/{form}"
                headers = (
                    Node(clark(ADDRESSING, "Action"), action),
                    Node(clark(ADDRESSING, "MessageID"), f"urn:uuid:7f0e6c3a-52c5-4f0d-9c63-{number:012d}"),
                    Node(clark(ADDRESSING, "To"), address),
                    Node(
                        clark(ADDRESSING, "ReplyTo"),
                        "",
                        (Node(clark(ADDRESSING, "Address"), f"{ADDRESSING}/anonymous"),),
                    ),
                )
                answer = call_valid(publishers, soap_services.delivery(operation), headers=headers)
                judge_answer(judge, "soap-delivery/addressing", answer.is_taken, answer, f"2xx for wsa:Action {form}")


@pytest.mark.requirement("soap-delivery/refuses-code", "strict-input/soap-code", "strict-input/soap-fault")
def test_codes(publishers: SoapService, judge: Judge, effort: Effort) -> None:
    """Send codes other than 3 and 4: the robot must reject them."""
    if publishers.contract.target_namespace != soap_services.NAMESPACE:
        # The requirement on faults belongs to every contract; these fault codes do not.
        return
    codes = ("5", "0", "2", "-4", "1", "7", "44", "2147483647", "-2147483648", "34", "-3", "100")
    for code in codes[: effort.cases(len(codes))]:
        answer = call_valid(publishers, soap_services.delivery(code=code))
        for id_ in ("soap-delivery/refuses-code", "strict-input/soap-code"):
            judge_answer(judge, id_, answer.is_refused, answer, f"a refusal of code {code}")
        if not answer.is_taken:
            judge_answer(
                judge,
                "strict-input/soap-fault",
                answer.fault is not None and answer.status == 500,
                answer,
                "a fault with status 500",
            )


@pytest.mark.requirement("soap-delivery/size")
def test_64_kib(publishers: SoapService, judge: Judge) -> None:
    """Send a valid message of 64 KiB: the robot must accept it."""
    document = padded(envelope((soap_services.delivery(),)).serialize(), TAKEN_OCTETS)
    answer = send(publishers, require_valid_document(publishers, document))
    judge_answer(judge, "soap-delivery/size", answer.is_taken, answer, f"2xx for a message of {TAKEN_OCTETS:,} bytes")


@pytest.mark.requirement("soap-delivery/concurrent-answers")
def test_answers_do_not_cross(publishers: SoapService, judge: Judge, effort: Effort) -> None:
    """Call both operations at the same moment from several clients: each must get its own operation's response."""
    operations = [_BOTH[client % 2] for client in range(MOST_CLIENTS)]
    outgoing = [soap_services.outgoing(publishers, soap_services.delivery(name)) for name in operations]
    for came in send_together([outgoing] * effort.cases(20)):
        for operation, attempt in zip(operations, came, strict=True):
            if isinstance(attempt, Exchange) and not is_busy(attempt):
                answer = read_exchange(attempt)
                own = answer.payload == clark(soap_services.NAMESPACE, f"{operation}Response")
                if answer.is_taken:  # it does not show which interface is at fault
                    judge_answer(judge, "soap-delivery/concurrent-answers", own, answer, f"the answer to {operation}")
