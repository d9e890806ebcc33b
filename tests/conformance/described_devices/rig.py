"""A camera rig on FastAPI that keeps its description: ``python rig.py --port 8000``."""

import argparse
import uuid
from datetime import UTC, datetime
from typing import Annotated, Any, Literal

import uvicorn
from fastapi import FastAPI, HTTPException, Path, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel, ConfigDict, Field
from starlette.exceptions import HTTPException as StarletteHTTPException
from starlette.routing import Match

Kind = Literal["pan", "tilt", "zoom"]
_MOST = 50


class Error(BaseModel):
    """What an error says."""

    detail: str


class State(BaseModel):
    """The rig's state."""

    mode: Literal["idle", "tracking", "fault"]
    battery: float = Field(ge=0, le=100)
    updated: datetime
    note: str | None


class Axis(BaseModel):
    """One axis."""

    id: int = Field(ge=1)
    kind: Kind
    position: float
    moving: bool


class Speed(BaseModel):
    """How fast an axis turns."""

    model_config = ConfigDict(strict=True)

    speed: float = Field(ge=0, le=10)
    unit: Literal["deg/s", "rad/s"]
    ramp: bool = True


class NewPreset(BaseModel):
    """A preset to be stored."""

    model_config = ConfigDict(strict=True)

    name: str = Field(min_length=1, max_length=20, pattern="^[a-z][a-z0-9-]*$")
    positions: list[float] = Field(min_length=1, max_length=6)


class Preset(NewPreset):
    """A stored preset."""

    id: uuid.UUID


# Errors that every operation with input shares.
_REFUSED: dict[int | str, dict[str, Any]] = {422: {"model": Error}}
_BODY: dict[int | str, dict[str, Any]] = {400: {"model": Error}}
_MISSING: dict[int | str, dict[str, Any]] = {404: {"model": Error}, **_REFUSED}
_AxisId = Annotated[int, Path(ge=1, le=99)]
app = FastAPI(title="Camera rig", version="1.0", docs_url=None, redoc_url=None)
axes = [Axis(id=1 + number, kind=kind, position=0.0, moving=False) for number, kind in enumerate(("pan", "tilt"))]
speeds = {axis.id: Speed(speed=1.0, unit="deg/s") for axis in axes}
first = Preset(id=uuid.UUID(int=4 << 76 | 8 << 60 | 1), name="home", positions=[0.0, 0.0])
presets = {first.id: first}


@app.get("/state")
def read_state() -> State:
    """Return the rig's state."""
    return State(mode="idle", battery=87.5, updated=datetime.now(UTC), note=None)


@app.get("/axes", responses=_REFUSED)
def list_axes(
    kind: Kind | None = None,
    limit: Annotated[int, Query(ge=1, le=50)] = 10,
    moving: bool | None = None,  # noqa: FBT001 - a parameter of the query
) -> list[Axis]:
    """Return the axes of a kind that move, or do not."""
    return [one for one in axes if kind in {None, one.kind} and moving in {None, one.moving}][:limit]


def _axis(axis_id: int) -> Axis:
    found = next((one for one in axes if one.id == axis_id), None)
    if found is None:
        raise HTTPException(404, "no such axis")
    return found


@app.get("/axes/{axis_id}", responses=_MISSING)
def read_axis(axis_id: _AxisId) -> Axis:
    """Return an axis."""
    return _axis(axis_id)


@app.put("/axes/{axis_id}/speed", responses=_MISSING | _BODY)
def set_speed(axis_id: _AxisId, speed: Speed) -> Speed:
    """Set how fast an axis turns."""
    speeds[_axis(axis_id).id] = speed
    return speed


@app.get("/presets", responses=_REFUSED)
def list_presets(order: Literal["newest", "oldest"] = "oldest") -> list[Preset]:
    """Return the stored presets."""
    return list(presets.values())[:: 1 if order == "oldest" else -1]


@app.post("/presets", status_code=201, responses=_REFUSED | _BODY)
def store_preset(new: NewPreset, response: Response) -> Preset:
    """Store a preset; the oldest goes where there are too many."""
    preset = Preset(id=uuid.uuid4(), **new.model_dump())
    presets[preset.id] = preset
    if len(presets) > _MOST:
        del presets[next(iter(presets))]
    response.headers["Location"] = f"/presets/{preset.id}"
    return preset


@app.get("/presets/{preset_id}", responses=_MISSING)
def read_preset(preset_id: uuid.UUID) -> Preset:
    """Return a preset."""
    if preset_id not in presets:
        raise HTTPException(404, "no such preset")
    return presets[preset_id]


@app.delete("/presets/{preset_id}", status_code=204, responses=_MISSING)
def delete_preset(preset_id: uuid.UUID) -> None:
    """Delete a preset; there is always one."""
    read_preset(preset_id)
    del presets[preset_id]
    presets.setdefault(first.id, first)


@app.exception_handler(RequestValidationError)
def refuse(_request: Request, error: RequestValidationError) -> JSONResponse:
    """Answer an invalid request without repeating it, as it may hold what JSON cannot."""
    return JSONResponse({"detail": "; ".join(one["msg"] for one in error.errors())}, 422)


@app.exception_handler(StarletteHTTPException)
def tell(request: Request, error: StarletteHTTPException) -> JSONResponse:
    """Answer an error; 405 names the methods of all routes of the path, where Starlette names those of the first."""
    headers = dict(error.headers or {})
    if error.status_code == 405:
        there = [route for route in app.routes if route.matches(request.scope)[0] is not Match.NONE]
        headers["Allow"] = ", ".join(sorted({name for route in there for name in getattr(route, "methods", ())}))
    return JSONResponse({"detail": str(error.detail)}, error.status_code, headers)


async def whole(scope: dict[str, Any], receive: Any, send: Any) -> None:
    """Serve a request; do what uvicorn does not: absolute targets, closing after two lengths (RFC 9112 3.2.2, 6.1)."""

    async def closing(message: dict[str, Any]) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message["headers"], (b"connection", b"close")]}
        await send(message)

    if scope["type"] == "http" and "://" in scope["path"]:
        path = "/" + scope["path"].split("://", 1)[1].partition("/")[2]
        scope = {**scope, "path": path, "raw_path": path.encode()}
    both = {b"content-length", b"transfer-encoding"} <= {name for name, _ in scope.get("headers", ())}
    await app(scope, receive, closing if both else send)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, default=8000)
    # On httptools uvicorn takes a request without Host; on h11 its own refusal of longer fields has no Date.
    settings = {"http": "h11", "h11_max_incomplete_event_size": 1 << 20, "log_level": "warning"}
    uvicorn.run(whole, host="127.0.0.1", port=parser.parse_args().port, **settings)
