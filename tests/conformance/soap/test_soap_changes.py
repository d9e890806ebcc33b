"""What SOAP operations write, create and remove is read back: right devices are not blamed, faulty ones are."""

import pytest
from feeder import feeder
from small_device import certified
from soap_devices import serving

_FAULTS = {
    "refused applied": "refused-keeps",
    "refused label applied": "refused-keeps",
    "refused resets": "refused-keeps",
    "label ignored": "written-is-read",
    "burst is slow": "written-is-read",
    "quiet stays": "written-is-read",
    "rate whole": "written-is-read",
    "lost after refusal": "written-is-read",
    "latin": "written-is-read",
    "escaped twice": "written-is-read",
    "always the first bin": "written-is-read",
    "bins share": "written-is-read",
    "stale at times": "written-is-read",
    "fails at times": "valid-accepted",
    "mode burst refused": "valid-accepted",
    "third recipe lost": "created-is-there",
    "delete takes all": "created-is-there",
    "delete does nothing": "deleted-is-gone",
    "second delete does nothing": "deleted-is-gone",
}


def _certified(device, tmp_path):
    with serving(device) as url:
        return certified(f"{url}/feeder.wsdl", tmp_path, "--call", "*", "--call", "POST /feederPort/DeleteRecipe")


@pytest.mark.parametrize("style", ["", "limits", "slow", "expires", "drifts"])
def test_a_right_device_is_not_blamed_and_is_left_as_it_was(style, tmp_path):
    device = feeder(style)
    before = dict(device.settings)
    outcome = _certified(device, tmp_path)
    assert (outcome.exit_code, outcome.blamed) == (0, {}), outcome.text
    if not style:
        assert device.settings == before
        assert device.recipes == {}
        verdicts = {one["id"]: one["verdict"] for one in outcome.result["requirements"]}
        names = ("written-is-read", "created-is-there", "deleted-is-gone")
        assert {verdicts[f"soap/{name}"] for name in names} == {"pass"}


@pytest.mark.parametrize("fault", _FAULTS)
def test_a_fault_is_found(fault, tmp_path):
    outcome = _certified(feeder(fault=fault), tmp_path)
    assert f"soap/{_FAULTS[fault]}" in outcome.blamed, outcome.text
