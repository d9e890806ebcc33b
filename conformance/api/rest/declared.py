"""Judge whether the contract declares a response for its operation: status, media type, schema, Vary."""

from http import HTTPStatus

from conformance.api.expectation import expect
from conformance.api.rest.accept import quality
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.request_context import RequestContext
from conformance.api.rest.validity import VALID, validity
from conformance.documents.json_schema import Schema, shape_of
from conformance.documents.openapi import Operation, is_json, is_xml
from conformance.documents.patterns import PatternError
from conformance.documents.representation import UnreadableError, read
from conformance.documents.resources import resource_at
from conformance.transport.exchange import Exchange, Response

# RFC 9110 and RFC 6585 allow these for any request: authentication and rate. Another requirement judges 5xx.
_ANY_REQUEST = frozenset({401, 429})
# ... and these for a request that has more in it than method, path and Accept.
_ODD_REQUEST = frozenset({400, 408, 411, 413, 414, 415, 417, 431})
# Methods that a server in front may refuse itself, without a word of the resource.
_OF_SERVERS = frozenset({"TRACE", "CONNECT"})
_OK, _NO_CONTENT, _NOT_FOUND, _NO_METHOD, _NOT_ACCEPTABLE, _SERVER_ERROR = 200, 204, 404, 405, 406, 500


def judge(api: RestInterface, exchange: Exchange, answer: Response, context: RequestContext) -> None:
    """Judge one response to a request for an operation of the contract."""
    operation = context.operation
    if operation is None:
        return
    if answer.status < _SERVER_ERROR:
        expect(api.run.judge, "http/declared-status", exchange).that(
            _status_fits(api, operation, answer, context),
            f"a status that the contract declares for {operation.id}: {', '.join(operation.responses)}",
            f"status {answer.status}",
            cause=f"{operation.id} {answer.status}",
        )
    if answer.ok and not context.is_head:
        _judge_body(api, exchange, answer, context)
    if answer.ok and operation.method == "GET":
        _judge_negotiation(api, exchange, answer, context)


def judge_refused_method(api: RestInterface, exchange: Exchange, context: RequestContext) -> None:
    """Judge Allow where a device refuses a method that its description does not have (RFC 9110 10.2.1, 15.5.6)."""
    contract, method = api.run.contract, exchange.request.method
    is_own = contract.described and context.usual and context.operation is None and method not in _OF_SERVERS
    resource = resource_at(contract, context.target.split("?", 1)[0]) if is_own else None
    if resource is None or exchange.response.status != _NO_METHOD:
        return
    if not expect(api.run.judge, "http/allow", exchange).header("Allow"):
        return
    allow = exchange.response.header("allow") or ""
    named = {name.strip() for name in allow.split(",")}
    wanted = set(resource.methods) - {"HEAD", "OPTIONS", "TRACE"}
    expect(api.run.judge, "http/allow-agrees", exchange).that(
        wanted <= named and method not in named,
        f"Allow: {', '.join(sorted(wanted))} (others may stand beside them, but none that got 405)",
        f"Allow: {allow}",
        cause="methods left out",
    )


def _is_valid(api: RestInterface, context: RequestContext) -> bool:
    """Return whether the contract allows a request, so that nothing in it is a reason to refuse it."""
    request = context.request
    said = validity(api.run.contract, request.method, context.target, request.media_type, request.body)
    return said.verdict == VALID


def _status_fits(api: RestInterface, operation: Operation, answer: Response, context: RequestContext) -> bool:
    status = answer.status
    if status in _ANY_REQUEST or operation.declared(status) is not None:
        return True
    if status == _OK and operation.declared(_NO_CONTENT) is not None:
        return True  # a robot may send 200 instead of 204
    if status == _NOT_ACCEPTABLE:
        return context.accept not in {None, "*/*"}
    if context.plain and not operation.parameters:
        return False
    if status in _ODD_REQUEST:
        return True
    # Invalid input may be refused with any 4xx (contract, fine print); 404 only where a value is in the path.
    has_input = bool(context.request.body or operation.parameters or operation.bodies)
    elsewhere = status == _NO_METHOD or (status == _NOT_FOUND and not operation.parameter("path"))
    refused = has_input and HTTPStatus.BAD_REQUEST <= status < _SERVER_ERROR and not elsewhere
    return refused and not (status != _NOT_FOUND and context.usual and _is_valid(api, context))


def _judge_body(api: RestInterface, exchange: Exchange, answer: Response, context: RequestContext) -> None:
    operation = context.operation
    content = operation.declared(answer.status) if operation else None
    if operation is None or not content:
        return
    if not answer.body:
        # Only GET must return a body: the response to a PUT need not repeat what it accepted.
        if operation.method == "GET" and answer.status != _NO_CONTENT:
            expected = f"a body as {' or '.join(content)}"
            expect(api.run.judge, "http/declared-body", exchange).that(holds=False, expected=expected, got="no body")
        elif answer.media_type in content and answer.status != _NO_CONTENT:
            # It says that there is a document, and a client that asked for one reads it.
            _judge_shape(api, exchange, answer, operation, content[answer.media_type])
        return
    media_type = answer.media_type
    declared = expect(api.run.judge, "http/declared-body", exchange).that(
        media_type in content,
        f"a body as {' or '.join(content)}",
        f"a body as {media_type}" if media_type else "a body without Content-Type",
        cause=f"{operation.id} {media_type}",
    )
    if declared:
        _judge_shape(api, exchange, answer, operation, content[media_type])


def _judge_shape(
    api: RestInterface, exchange: Exchange, answer: Response, operation: Operation, schema: Schema
) -> None:
    media_type = answer.media_type
    if is_json(media_type):
        id_, kind = "http/declared-body", "JSON"
    elif is_xml(media_type):
        id_, kind = "rest-formats/xml", "XML"
    elif media_type == "text/plain" and operation.shape is not None:
        id_, kind, schema = "rest-formats/text", "YAML", operation.shape
    else:
        return
    try:
        problem = shape_of(schema).problem(read(media_type, answer.body, schema))
        fault = f"a body in which {problem}" if problem else ""
    except PatternError:
        return  # other checks tell that the schema cannot be judged
    except UnreadableError as error:
        fault = str(error)
    expect(api.run.judge, id_, exchange).that(
        not fault,
        f"{kind} that is valid by the schema of {operation.id}",
        fault,
        cause=f"{operation.id} {kind} {fault.split(':', 1)[0]}",
    )


def _judge_negotiation(api: RestInterface, exchange: Exchange, answer: Response, context: RequestContext) -> None:
    operation = context.operation
    if operation is None or not operation.formats:
        return
    media_type = answer.media_type
    if media_type and context.usual:
        # A format that q=0 rules out breaks another rule than a format that Accept does not name.
        ruled_out = "q=0" in (context.accept or "").lower().replace(" ", "")
        expect(api.run.judge, "http/q-zero" if ruled_out else "http/not-acceptable", exchange).that(
            quality(media_type, context.accept) > 0,
            f"an acceptable format or status 406 when Accept is {context.accept}",
            f"status {answer.status} with {media_type}",
            cause="not acceptable",
        )
    if len(operation.formats) > 1 and not context.is_head:
        vary = (answer.header("vary") or "").lower()
        names_accept = "*" in vary or "accept" in [name.strip() for name in vary.split(",")]
        found = f"Vary: {answer.header('vary')}" if vary else "no header field Vary"
        expect(api.run.judge, "rest-formats/vary", exchange).that(names_accept, "Vary: Accept", found)
