import pytest

from conformance.api.rest.accept import quality


@pytest.mark.parametrize(
    ("media_type", "accept", "expected"),
    [
        ("application/json", None, 1.0),
        ("application/json", "", 1.0),
        ("application/json", "*/*", 1.0),
        ("application/json", "text/plain", 0.0),
        ("application/json", "APPLICATION/JSON ; Q=0.3", 0.3),
        ("application/json", "*/*, application/json;q=0.1", 0.1),
        ("text/plain", "*/*;q=0.1, text/*;q=0.2", 0.2),
        ("text/plain", "text/plain;q=0, text/*", 0.0),
        ("application/xml", ", application/xml;version=1;q=0.5,", 0.5),
        ("application/json", "application/json;q=2", 0.0),
    ],
)
def test_the_most_specific_range_tells(media_type, accept, expected):
    assert quality(media_type, accept) == expected
