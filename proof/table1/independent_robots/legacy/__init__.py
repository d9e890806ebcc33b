"""A robot that behaves as the paper's own stack does: JAX-WS RI for SOAP, Jersey 1 for REST, Double.parseDouble.

It claims ``rest-delivery`` and ``soap-delivery`` alone, which the contract lets such a robot have. What it does:

- REST: 204 for a delivery; a path number is what Java takes for one (``NaN``, ``Infinity``, ``1e400``, ``0x1p3``,
  a trailing ``d``); letters are 404 with an HTML page; any code goes.
- SOAP: a missing primitive and an unparsable double become 0; unknown elements, their order and their number are of
  no interest; NaN goes; no DTD is refused that expat itself takes.
- Faults as JAX-WS RI makes them: prefix ``S``, an unused declaration of SOAP 1.2, ``S:Client`` for an unknown
  operation, ``S:Server`` for a missing arg0; malformed XML is a fault.
- A GET of the service without ``?wsdl`` is a page for people.
"""

from collections.abc import Callable

from proof.table1.independent_robots.legacy.services import Delivery, Soap, start


def serve(rest_port: int, soap_port: int) -> tuple[str, str, Callable[[], None]]:
    """Start the robot. Return REST's base URL, the publishers' WSDL, and a function that stops the robot."""
    rest_at, stop_rest = start(Delivery(), rest_port)
    soap = Soap()
    soap.base, stop_soap = start(soap, soap_port)

    def stop() -> None:
        stop_rest()
        stop_soap()

    return rest_at, f"{soap.base}/turtlesim_publisher_ws?wsdl", stop
