"""The delivery's fields are those of the contract's files."""

import re

from conformance.contract.pack import Contract
from conformance.papers_robot import delivery


def test_the_path_of_the_openapi_description():
    paths = Contract.load().openapi["paths"]
    path = next(path for path in paths if "/depot_x/" in path)
    assert tuple(re.findall(r"/(\w+)/\{", path))[1:] == delivery.PATH_NAMES
    code = next(item for item in paths[path]["put"]["parameters"] if item["name"] in {"code", "message_code"})
    assert code["schema"]["enum"] == [delivery.COURIER, delivery.COFFEE]


def test_every_form_has_the_same_fields():
    assert set(delivery.MESSAGE_FIELDS) == set(delivery.XSD_FIELDS)
    assert tuple(delivery.EXAMPLE) == delivery.COORDINATES
