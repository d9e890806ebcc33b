"""A robot on the standard library alone: http.server, json and expat.

Freedoms that it takes:

- HTTP/1.0; every connection is closed; 411 for a chunked request.
- 204 wherever it may be: velocity, repeated goal, delivery; 202 for a new goal; OPTIONS 204.
- A redirect (308) where the trailing slash is missing.
- JSON integers for whole floats; no spaces.
- Problems with nothing but ``status`` and ``detail`` (and ``about:blank`` understood).
- XML: array items repeat their field's element; list items are called ``item`` under ``Sensors``.
- No list of deliveries, so no class ``equivalence``.
- 409 for a velocity while a goal is active; 422 at once for a goal off the map; DELETE without a goal is 404.
- SOAP: malformed XML is 400 without a fault; no active goal is an empty response; a WSDL with its schema inline,
  WSDL's namespace the default one, and the paper's form of wsam:Action.
- It declares nothing: neither limits nor hold time.
"""

from collections.abc import Callable

from proof.table1.independent_robots.body import Body, Build
from proof.table1.independent_robots.plain.rest import Rest
from proof.table1.independent_robots.plain.server import start
from proof.table1.independent_robots.plain.soap import Soap

BUILD = Build(
    linear_m_s=0.4,
    angular_rad_s=1.3,
    cruise_m_s=0.34,
    turn_rad_s=1.2,
    acceleration=2.0,
    spin=6.0,
    hold_s=1.5,
    bounds=(-100.0, -100.0, 100.0, 100.0),
    start=(0.0, 0.0, 0.0),
)


def serve(rest_port: int, soap_port: int) -> tuple[str, str, Callable[[], None]]:
    """Start the robot. Return REST's base URL, the publishers' WSDL, and a function that stops the robot."""
    body = Body(BUILD)
    rest_at, stop_rest = start(Rest(body), rest_port)
    soap = Soap(body)
    soap_at, stop_soap = start(soap, soap_port)
    soap.base = soap_at

    def stop() -> None:
        stop_rest()
        stop_soap()

    return rest_at, f"{soap_at}/turtlesim_publisher_ws?wsdl", stop
