"""What a replay says of a device that has changed since, that is away, and of a result that someone else wrote."""

import socket
import sys
from contextlib import contextmanager
from threading import Thread

import pytest
from aiohttp import web
from processes import ended
from small_device import certified, constant, described, error, reading, small_device

_PORT_OF = "http://127.0.0.1:"
_STATE = {"type": "object", "required": ["on"], "properties": {"on": {"type": "boolean"}}}


@pytest.fixture(name="found", scope="module")
def _found(tmp_path_factory):
    """Certify a device with three faults; return the folder of the result, and the address that it was at."""
    out = tmp_path_factory.mktemp("run") / "out"

    async def teapot(_):
        return error(418, "I am a teapot")

    description = described({"/state": reading(_STATE), "/pot": reading(_STATE)})
    for path in description["paths"].values():
        path["get"]["responses"] = {"200": path["get"]["responses"]["200"]}
    with small_device(description, {"/state": constant({"on": 1}), "/pot": {"GET": teapot}}) as url:
        done = certified(url, out)
    assert {"description/body-schema", "description/status-declared"} <= set(done.blamed), done.text
    return out, url


def _replayed(out, *arguments):
    done = ended(sys.executable, "-m", "roaas", "replay", out, *arguments)
    assert "Traceback" not in done.stderr, done.stderr
    return done.returncode, done.stdout + done.stderr


def _moved(found, url, tmp_path):
    """Return a copy of a result whose device is at another address now."""
    out, before = found
    copy = tmp_path / "out"
    copy.mkdir()
    (copy / "result.json").write_text((out / "result.json").read_text().replace(before, url))
    (copy / "description").symlink_to(out / "description")
    return copy


@pytest.mark.parametrize(
    ("state", "outcome", "code"),
    [({"on": True}, "gone", 0), ({"on": 2}, "still there", 1), (502, "cannot tell", 4), (503, "cannot tell", 4)],
)
def test_a_body_is_judged_again_by_the_description(found, state, outcome, code, tmp_path):
    async def away(_):
        return error(state, "away")

    handlers = {"GET": away} if isinstance(state, int) else constant(state)
    with small_device(described({}), {"/state": handlers}) as url:
        said = _replayed(_moved(found, url, tmp_path), "description/body-schema")
    assert said[0] == code, said
    assert said[1].startswith(f"{outcome}: description/body-schema"), said


@contextmanager
def _closing():
    with socket.create_server(("127.0.0.1", 0)) as server:

        def close():
            while server.fileno() >= 0:
                try:
                    server.accept()[0].close()
                except OSError:
                    return

        Thread(target=close, daemon=True).start()
        yield f"{_PORT_OF}{server.getsockname()[1]}"
        server.shutdown(socket.SHUT_RDWR)


def test_a_device_that_is_away_or_closes_the_connection_cannot_be_judged(found, tmp_path):
    out, _ = found
    assert _replayed(out, "description/body-schema")[0] == 4
    with _closing() as url:
        code, text = _replayed(_moved(found, url, tmp_path))
    assert (code, "gone" in text, "still there" in text) == (4, False, False), text


def test_what_is_declared_since_is_gone_by_the_statement_that_names_the_description(found, tmp_path):
    async def teapot(_):
        return web.json_response({"on": True}, status=418)

    paths = {"/pot": reading(_STATE), "/state": reading(_STATE)}
    paths["/pot"]["get"]["responses"]["418"] = {"description": "a teapot"}
    description = described(paths)
    with small_device(description, {"/pot": {"GET": teapot}, "/state": constant({"on": True})}) as url:
        statement = tmp_path / "robot.toml"
        statement.write_text(f'[api]\nopenapi = "{url}/openapi.json"\n')
        code, text = _replayed(found[0], "description/status-declared", "--statement", statement)
    assert (code, text.split(":")[0]) == (0, "gone"), text
