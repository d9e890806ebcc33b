"""The robot `plain` on asyncio and h11, writing with lxml and PyYAML, as elaborate as the contract lets it be.

Freedoms that it takes:

- Chunked bodies in several pieces; field names in unusual case; connections are kept.
- 200 with a body wherever 204 would do (velocity, repeated goal, delivery); 201 for a new goal; OPTIONS 200.
- 404 where the trailing slash is missing; 405 also for methods that nobody knows.
- JSON indented, keys in reverse order, characters escaped, exponents in numbers, further fields of its own.
- XML with a declaration of its own prefix, comments, CDATA, array items nested under their field, other list roots.
- YAML in another layout, ended by the document marker that ``ros2 topic echo`` prints.
- Problems with every member of RFC 9457, and one of its own.
- A velocity ends the active goal; a goal off the map is accepted and ends; DELETE without a goal is 204.
- The odometry's frame is moved and turned against the map's; the robot settles slowly, and says so.
- SOAP: default namespaces, comments and CDATA in answers, faults in place of an empty GetGoalResponse, malformed XML
  answered by a fault; the WSDL imports its schema from ``?xsd=1`` and names actions as JAX-WS RI does.
- It lists deliveries, answers 400 where a number in the target is none, and describes itself in OpenAPI 3.0 and in
  WADL with nested resources.
"""

from collections.abc import Callable

from proof.table1.independent_robots.baroque.rest import Rest, Soap
from proof.table1.independent_robots.baroque.server import Loop
from proof.table1.independent_robots.body import Body, Build

BUILD = Build(
    linear_m_s=0.3,
    angular_rad_s=1.8,
    cruise_m_s=0.29,
    turn_rad_s=1.7,
    acceleration=0.6,
    spin=4.0,
    hold_s=0.7,
    bounds=(-5.0, -5.0, 9.0, 7.0),
    start=(2.0, -1.0, 0.5),
    odom=(2.0, -1.0, 0.5),
)


def serve(
    rest_port: int, soap_port: int, kind: type[Body] = Body, build: Build = BUILD
) -> tuple[str, str, Callable[[], None]]:
    """Start the robot; ``kind`` may be a body with a fault, and ``build`` another robot.

    Returns:
        REST's base URL, the publishers' WSDL, and a function that stops the robot.
    """
    body = kind(build, yields=True)
    loop = Loop()
    rest_at = loop.listen(Rest(body), rest_port)
    soap = Soap(body)
    soap.base = loop.listen(soap, soap_port)
    return rest_at, f"{soap.base}/turtlesim_publisher_ws?wsdl", loop.stop
