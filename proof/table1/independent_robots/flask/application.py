"""The WSGI application."""

from collections.abc import Callable
from urllib.parse import quote

import flask
from werkzeug.exceptions import BadRequest, HTTPException

from proof.table1.independent_robots.plain.rest import Handler
from proof.table1.independent_robots.plain.server import Answer
from proof.table1.independent_robots.routing import MAX_BODY, call, message, problem, resources

application = flask.Flask(__name__)
application.config["MAX_CONTENT_LENGTH"] = MAX_BODY


def _view(methods: dict[str, Handler]) -> Callable[..., flask.Response]:
    def view(**_parameters: str) -> flask.Response:
        request = flask.request
        handler = methods["GET" if request.method == "HEAD" else request.method]
        target = f"{quote(request.path)}?{request.query_string.decode('latin-1')}"
        return _response(call(handler, message(request.headers), request.get_data(), target))

    return view


def _response(answer: Answer) -> flask.Response:
    response = flask.Response(answer.body, answer.status, answer.fields)
    if answer.media_type:
        response.headers["Content-Type"] = answer.media_type
    else:
        del response.headers["Content-Type"]
    return response


for _path, _methods in resources().items():
    _rule = _path.replace("{", "<").replace("}", ">")
    application.add_url_rule(_rule, endpoint=_path, view_func=_view(_methods), methods=[*_methods])


@application.before_request
def _one_host() -> None:
    """Reject a request without a Host field or with several, which WSGI joins with commas (RFC 9112 3.2)."""
    host = flask.request.environ.get("HTTP_HOST", "")
    if not host or "," in host:
        raise BadRequest("Host is not there once")


@application.before_request
def _whole() -> None:
    """Reject a request whose client vanished before its end: WSGI servers pass on incomplete content."""
    request = flask.request
    if request.content_length is not None and len(request.get_data()) < request.content_length:
        raise BadRequest("the content ends before its Content-Length")


@application.errorhandler(HTTPException)
def _refuse(error: HTTPException) -> flask.Response:
    """Turn Flask's own errors into problems, and keep their header fields."""
    response = _response(problem(error.code or 500, error.description, message(flask.request.headers)))
    for name, value in error.get_headers(flask.request.environ):
        if name.lower() not in {"content-type", "content-length"}:
            response.headers[name] = value
    return response
