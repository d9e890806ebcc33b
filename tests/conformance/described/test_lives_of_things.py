"""What a run created is read once more at its end; the lives of things are those of hostile/test_kept_things.py."""

from aiohttp import web
from small_device import REFUSED, answers, certified, described, error, reading, small_device


def test_what_was_created_is_read_once_more_at_the_end(tmp_path):
    made, sent = [], []
    job = {"type": "object", "required": ["id"], "properties": {"id": {"type": "string"}}}
    item = {"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}
    created = {"201": answers(job), "4XX": REFUSED}
    document = described({"/jobs": {"post": {"responses": created}}, "/jobs/{id}": reading(job, parameters=[item])})

    async def create(_):
        made.append(f"j{len(made)}")
        sent.clear()
        return web.json_response({"id": made[-1]}, status=201, headers={"Location": f"/jobs/{made[-1]}"})

    async def read(request):
        sent.append(request.path)
        is_there = request.match_info["id"] in made
        return web.json_response({"id": request.match_info["id"]}) if is_there else error(404, "no such job")

    with small_device(document, {"/jobs": {"POST": create}, "/jobs/{id}": {"GET": read}}) as url:
        seen = certified(f"{url}/openapi.json", tmp_path / "out", "--call", "*")

    assert seen.exit_code == 0, seen.text
    assert {f"/jobs/{one}" for one in made[:30]} <= set(sent)  # since the last one was created
