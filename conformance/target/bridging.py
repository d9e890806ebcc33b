"""A rosbridge as a device: it has no description, so its map is one; without a statement, it gets a usual map."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

from conformance.commandline.out_folder import own_folder, write_atomically, write_json
from conformance.contract.toml_file import basic_string
from conformance.statement.ros_map import RosMap

_MAP: Final = """# {url} as it was judged: change the topics and services, and give this file in place of the URL.
[ros]
domain_id = {domain_id}

[ros.rosbridge]
url = {url}
subscribe = {{ "/odom" = "nav_msgs/msg/Odometry", "/note" = "std_msgs/msg/String" }}
publish = {{ "/cmd_vel" = "geometry_msgs/msg/Twist", "/say" = "std_msgs/msg/String" }}
call = {{ "/enable" = "std_srvs/srv/SetBool" }}
"""


def usual_map(url: str, domain_id: int, out: Path) -> Path:
    """Write a statement with a usual map of a rosbridge; return its file.

    Raises:
        OSError: it cannot be written.
    """
    file = own_folder(out) / "rosbridge.toml"
    write_atomically(file, _MAP.format(url=basic_string(url), domain_id=domain_id))
    return file


def description_of(ros: RosMap, out: Path) -> str:
    """Write an OpenAPI description of a rosbridge's operations; return its file.

    Raises:
        OSError: it cannot be written.
    """
    paths: dict[str, dict[str, Any]] = {}
    for call in ros.calls:
        method, _, path = call.partition(" ")
        names = [
            {"name": name, "in": "path", "required": True, "schema": {"type": "string"}}
            for name in re.findall(r"\{(\w+)\}", path)
        ]
        responses = {"200": {"description": "what came"}}
        paths.setdefault(path, {})[method.lower()] = {"responses": responses, "parameters": names}
    server = {"url": ros.rosbridge.replace("ws", "http", 1)}
    info = {"title": "rosbridge", "version": "2"}
    file = own_folder(out) / "rosbridge.json"
    write_json(file, {"openapi": "3.1.0", "info": info, "servers": [server], "paths": paths})
    return str(file)
