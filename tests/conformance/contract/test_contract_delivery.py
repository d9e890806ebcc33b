"""The delivery's fields are those of the contract's files."""

import re

from conformance.contract.pack import Contract
from conformance.packs.table1.delivery import (
    COFFEE,
    COORDINATES,
    COURIER,
    EXAMPLE,
    MESSAGE_FIELDS,
    PATH_NAMES,
    XSD_FIELDS,
)


def test_the_path_of_the_openapi_description():
    paths = Contract.load().openapi["paths"]
    path = next(path for path in paths if "/depot_x/" in path)
    assert tuple(re.findall(r"/(\w+)/\{", path))[1:] == PATH_NAMES
    code = next(item for item in paths[path]["put"]["parameters"] if item["name"] in {"code", "message_code"})
    assert code["schema"]["enum"] == [COURIER, COFFEE]


def test_every_form_has_the_same_fields():
    assert set(MESSAGE_FIELDS) == set(XSD_FIELDS)
    assert tuple(EXAMPLE) == COORDINATES
