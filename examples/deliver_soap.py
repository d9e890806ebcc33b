"""Order the paper's coffee over SOAP: ``python examples/deliver_soap.py [WSDL]``."""

import sys

import zeep

WSDL = "http://127.0.0.1:5555/turtlesim_publisher_ws?wsdl"
COFFEE = {
    "message_code": 4,
    "source_x": 76.02,
    "source_y": 41.35,
    "destination_x": 60.633,
    "destination_y": 37.51,
    "depot_x": 68.269,
    "depot_y": 38.718,
}

robot = zeep.Client(sys.argv[1] if len(sys.argv) > 1 else WSDL).service
robot.ExecuteCoffeeRequest(COFFEE)
print("The robot fetches the coffee.")
