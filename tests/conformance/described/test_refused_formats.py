"""An operation that declares 406 refuses an Accept without a format that it has."""

import pytest
from aiohttp import web
from small_device import REFUSED, answers, certified, described, small_device

_BODY = {"type": "array", "items": {"type": "integer"}}


def _device(*, declares, refuses):
    """Return the description and the routes of a list that is there as JSON alone."""
    responses = {"200": answers(_BODY), **({"406": REFUSED} if declares else {})}

    async def read(request):
        accept = request.headers.get("Accept", "*/*").replace(" ", "")
        is_right = "*/*" in accept or ("application/json" in accept and "application/json;q=0" not in accept)
        if refuses(accept) and not is_right:
            return web.json_response({"title": "JSON is all there is"}, status=406)
        return web.json_response([1, 2])

    return described({"/levels": {"get": {"responses": responses}}}, "3.1.0"), {"/levels": {"GET": read}}


@pytest.mark.parametrize(
    ("declares", "refuses", "is_found"),
    [
        (True, lambda _: True, False),
        (False, lambda _: False, False),
        (True, lambda _: False, True),
        (True, lambda accept: "q=0" not in accept, True),
    ],
    ids=["refused", "not declared", "ignored", "q=0 ignored"],
)
def test_a_declared_406(tmp_path, declares, refuses, is_found):
    with small_device(*_device(declares=declares, refuses=refuses)) as url:
        done = certified(f"{url}/openapi.json", tmp_path / "out", "--class", "description")
    assert ("description/required" in done.blamed) is is_found, done.text
