"""What an answer holds: complete or not, whatever the elements around it are called."""

import re

import pytest

from conformance.api.soap import content
from conformance.api.soap.messages import ordinary
from conformance.documents.wsdl import read_file
from conformance.documents.xml import parse
from conformance.documents.xml_names import clark
from conformance.papers_robot.files import CONTRACT_DIR

CONTRACT = read_file(CONTRACT_DIR / "subscribers.wsdl")
SPACE = CONTRACT.target_namespace


def returned(operation: str):
    """The declaration of what an operation returns, and an ordinary message of it as text."""
    wrapper = CONTRACT.shape(clark(SPACE, f"{operation}Response"))
    return wrapper.children[0], ordinary(wrapper, optional=True).written().decode()


def problem(operation: str, old: str, new: str) -> str:
    expected, document = returned(operation)
    spoiled = re.sub(old, new, document, count=1)
    assert spoiled != document
    return next(content.incomplete(content.content_of(parse(spoiled.encode()), expected), expected), "")


@pytest.mark.parametrize("operation", ["GetPose", "GetVelocity", "GetGoal", "GetPlan"])
def test_what_the_schema_makes_is_complete(operation):
    expected, document = returned(operation)
    assert list(content.incomplete(content.content_of(parse(document.encode()), expected), expected)) == []


@pytest.mark.parametrize(
    ("operation", "old", "new", "told"),
    [
        ("GetPose", "<orientation>.*?</orientation>", "", "orientation is missing"),
        ("GetPose", "<covariance>[^<]*</covariance>", "", "35 of 36"),
        ("GetVelocity", "(<x>)[^<]*", r"\1NaN", "not a finite number"),
        ("GetVelocity", "(<x>)[^<]*", r"\1<y/>", "elements where a value should be"),
        ("GetVelocity", "(<angular>.*?</angular>)", r"\1\1", "stands 2 times"),
        ("GetPose", "(<nanosec>)[^<]*", r"\g<1>4294967296", "outside unsignedInt"),
        ("GetPose", "(<sec>)[^<]*", r"\g<1>1.5", "not an integer"),
    ],
)
def test_what_is_incomplete_is_told(operation, old, new, told):
    assert told in problem(operation, old, new)


def test_elements_of_the_robots_own_are_let_be():
    assert problem("GetVelocity", "(<angular>)", r"\1<own>1</own>") == ""


def test_a_list_may_lie_in_one_element():
    expected, document = returned("GetPose")
    inside = "".join(re.findall("<covariance>[^<]*</covariance>", document)[:36])
    laid_out = document.replace(inside, f"<covariance>{inside}</covariance>", 1)
    assert laid_out != document
    assert list(content.incomplete(content.content_of(parse(laid_out.encode()), expected), expected)) == []
