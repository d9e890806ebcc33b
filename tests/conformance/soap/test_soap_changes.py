"""What SOAP operations write, create and remove is read back: right devices are not blamed, faulty ones are."""

import re

import pytest
from feeder import WSDL, XSD, Feeder, feeder
from small_device import certified
from soap_devices import SOAP_11, camera, serving

from conformance.rules.soap.test_soap import answered
from conformance.scenarios.soap_survey import Kind, SoapProbe
from conformance.transport.exchange import NoAnswer, Request, Unanswered

pytestmark = pytest.mark.side_by_side
_STYLES = ("", "limits", "slow", "expires", "drifts")
# Faults that one device has beside each other, each with the requirement and what its finding has to name.
_FAULTS = (
    {
        "refused applied": ("refused-keeps", "as Label, and"),
        "third recipe lost": ("created-is-there", "AddRecipe"),
        "label cut": ("written-is-read", 'Label "007'),
    },
    {
        "refused label applied": ("refused-keeps", "as Label, and"),
        "nil stays": ("written-is-read", "as Note instead of"),
        "bins share": ("written-is-read", "as Weight instead of"),
        "delete takes all": ("created-is-there", "before DeleteRecipe"),
    },
    {
        "label ignored": ("written-is-read", "as Label instead of"),
        "NaN is zero": ("written-is-read", '"NaN" as Offset'),
        "slots crossed": ("created-is-there", "which was asked for"),
        "delete does nothing": ("deleted-is-gone", "after DeleteRecipe"),
    },
    {
        "quiet stays": ("written-is-read", "true as Quiet instead of false"),
        "latin": ("written-is-read", 'Label "Gr'),
        "rate whole": ("written-is-read", "as Rate"),
        "second delete does nothing": ("deleted-is-gone", "after DeleteRecipe"),
    },
    {
        "escaped twice": ("written-is-read", "&amp;"),
        "no maxInclusive": ("invalid-refused", "'10' at Tray"),
        "id twice": ("created-is-there", "where an earlier thing is"),
    },
    {"lost after refusal": ("written-is-read", "SetSettings"), "no maxLength": ("invalid-refused", "p' at Title")},
    {
        "utf-16 lost": ("written-is-read", 'Label "Gr??'),
        "delete takes another": ("created-is-there", "before DeleteRecipe"),
    },
    {
        "mandatory label applied": ("refused-keeps", "as Label, and"),
        "empty label stays": ("written-is-read", "as Label instead of"),
    },
    {
        "last slot is far": ("response-valid", "'90'"),
        "fails at times": ("valid-accepted", "GetSettings"),
        "mode burst refused": ("valid-accepted", "SetSettings"),
    },
    {"refused creates": ("refused-keeps", "which is new")},
)


def _certified(device, folder, *more):
    with serving(device) as url:
        return certified(f"{url}/feeder.wsdl", folder, *more, "--call", "POST /feederPort/DeleteRecipe")


@pytest.mark.parametrize("style", _STYLES)
def test_a_right_device_is_not_blamed_and_is_left_as_it_was(style, tmp_path):
    device = feeder(style)
    before = dict(device.settings)
    if not style:  # what the user has there is not removed, though it is listed first
        device.recipes["r900000"] = "the user's"
    outcome = _certified(device, tmp_path, "--call", "*")
    # That a device limits a number, which its WSDL allows, is a warning.
    limits = {"soap/written-is-read": "warn"} if style == "limits" else {}
    assert (outcome.exit_code, outcome.blamed) == (0, limits), outcome.text
    if not style:
        assert device.settings == before
        assert device.recipes == {"r900000": "the user's"}
        assert device.bins == {"1": "3", "2": "4"}
        for name in ("written-is-read", "refused-keeps", "created-is-there", "deleted-is-gone"):
            assert outcome.requirement(f"soap/{name}")["verdict"] == "pass"


def test_a_device_may_refuse_the_ends_of_a_built_in_type(tmp_path):
    device = feeder("narrow")
    device.xsd = re.sub(r'("Rate"><xs:restriction base="xs:)double">.*?</xs', r'\1int"></xs', device.xsd)
    selected = ("--call", "*", "--select", "soap/valid-accepted", "--select", "soap/written-is-read")
    outcome = _certified(device, tmp_path, *selected)
    assert (outcome.exit_code, outcome.blamed) == (0, {}), outcome.text
    assert outcome.requirement("soap/valid-accepted")["verdict"] == "pass"


class _ByAction(Feeder):
    """A feeder that calls the operation that SOAPAction names."""

    action = ""

    def app(self, environ, start):
        self.action = environ.get("HTTP_SOAPACTION", "").strip('"').rpartition("/")[2]
        return super().app(environ, start)

    def answer(self, name, payload):
        is_other = name.startswith("Get") and self.action in {"GetSettings", "GetRecipes"}
        return super().answer(self.action if is_other else name, payload)


def test_operations_that_are_called_by_soap_action_are_one_finding(tmp_path):
    outcome = _certified(_ByAction("feeder", WSDL, XSD, {}), tmp_path, "--call", "*", "--select", "soap/response-valid")
    (finding,) = outcome.requirement("soap/response-valid")["failures"]
    assert "R1127" in finding["observed"]


@pytest.mark.parametrize("faults", _FAULTS, ids=", ".join)
def test_faults_are_found_by_the_requirement_that_they_break(faults, tmp_path):
    if _missed(faults, _certified(feeder("", *faults), tmp_path / "out", "--call", "*")):
        # Several at a time, on a busy machine, leave out writes for which there is no time.
        assert _missed(faults, _certified(feeder("", *faults), tmp_path / "again", "--call", "*")) == []


def _missed(faults, outcome):
    """Return the faults of which no failure of their requirement tells."""
    return [
        fault
        for fault, (name, said) in faults.items()
        if said not in "".join(one["message"] for one in outcome.requirement(f"soap/{name}")["failures"])
    ]


@pytest.mark.parametrize(("values", "allowed"), [('RecipeId = ["r900000"]', ("--call", "*")), ("", ())])
def test_what_the_suite_did_not_create_is_not_removed(values, allowed, tmp_path):
    """With an id in [values] as much is judged as without it. Else nothing may be created; a list names the thing."""
    device, statement = feeder(), tmp_path / "values.toml"
    device.recipes["r900000"] = "the user's"
    statement.write_text(f"[values]\n{values}\n", encoding="utf-8")
    outcome = _certified(device, tmp_path / "out", str(statement), *allowed)
    assert (outcome.exit_code, outcome.blamed) == (0, {}), outcome.text
    assert device.recipes == {"r900000": "the user's"}
    assert (outcome.requirement("soap/deleted-is-gone")["verdict"] == "pass") is bool(values)


def test_operations_whose_names_say_nothing_are_judged_as_before(tmp_path):
    device = camera()
    device.wsdl, device.xsd = (text.replace("GetStatus", "Report") for text in (device.wsdl, device.xsd))
    device.answers = {"Report": device.answers["GetStatus"].replace("GetStatus", "Report")}
    with serving(device) as url:
        outcome = certified(f"{url}/camera.wsdl", tmp_path, "--call", "Report")
    assert (outcome.exit_code, outcome.blamed) == (0, {}), outcome.text
    for name in ("answered", "message", "response-valid", "recovers"):
        assert outcome.requirement(f"soap/{name}")["verdict"] == "pass"
    assert outcome.requirement("soap/written-is-read")["verdict"] not in {"pass", "fail", "warn"}


@pytest.mark.parametrize(("kind", "cases"), [(NoAnswer.TIMEOUT, 1), (NoAnswer.CIRCUIT_OPEN, 0)])
def test_a_message_that_was_not_sent_is_no_message_without_a_response(kind, cases):
    unanswered = Unanswered(Request("POST", "http://camera/"), "no response", kind)
    probe = SoapProbe("POST /camera/Get", Kind.USUAL, "a valid message", SOAP_11, None, unanswered=unanswered)
    assert len(list(answered.judge((probe,)))) == cases
