"""Order the paper's coffee over REST and print the robot's progress: ``python examples/deliver_rest.py [URL]``."""

import sys
import time

import httpx

ROBOT = "http://127.0.0.1:7003"
COFFEE = 4
UNDER_WAY = ("queued", "active")

with httpx.Client(base_url=sys.argv[1] if len(sys.argv) > 1 else ROBOT) as robot:
    depot, destination, source = (68.269, 38.718), (60.633, 37.51), (76.02, 41.35)
    robot.put(
        f"/robot/app/delivery/{COFFEE}/depot_x/{depot[0]}/depot_y/{depot[1]}"
        f"/dest_x/{destination[0]}/dest_y/{destination[1]}/source_x/{source[0]}/source_y/{source[1]}"
    ).raise_for_status()
    while (state := robot.get("/robot/app/delivery/").raise_for_status().json()[0]["state"]) in UNDER_WAY:
        where = robot.get("/robot/pose/").raise_for_status().json()["pose"]["pose"]["position"]
        print(f"{state} at x = {where['x']:.1f} m, y = {where['y']:.1f} m")
        time.sleep(1)
    print(f"The delivery is {state}.")
