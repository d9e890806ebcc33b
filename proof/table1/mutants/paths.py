"""The paths of the resources, and the SOAP namespace, that this pack's mutants change."""

from proof.mutation.messages import Request

POSE, VELOCITY, LINEAR = "/robot/pose/", "/robot/velocity/", "/robot/velocity/linear/"
SENSORS, SERVICES = "/robot/sensors/", "/robot/navigation/services/"
GOAL, PLAN, DELIVERIES = "/robot/navigation/action/goal/", "/robot/navigation/service/plan", "/robot/app/delivery/"
RESOURCES = (POSE, VELOCITY, LINEAR, SENSORS, SERVICES, GOAL, PLAN)
TNS = "http://soap.turtlebot.mybot.org/"


def deliveries(request: Request) -> bool:
    """Return whether a request is PUT of a delivery."""
    return (
        request.side == "rest"
        and request.method == "PUT"
        and request.path.startswith(DELIVERIES)
        and len(request.path) > len(DELIVERIES)
    )
