"""The names file: defaults, changes, and errors that name the key."""

import pytest

from conformance.contract.toml_file import TomlFileError
from reference_robot.names import DEFAULT_NAMES_FILE, RosNames, load_names


def test_the_file_that_comes_with_the_robot_agrees_with_the_defaults():
    assert load_names() == load_names(DEFAULT_NAMES_FILE) == RosNames()


def test_a_file_changes_only_what_it_names(tmp_path):
    file = tmp_path / "names.toml"
    file.write_text('[topics]\nodom = "/base/odom"\n[velocity]\nmessage = "TwistStamped"\n')
    names = load_names(file)
    assert names.topics.odom == "/base/odom"
    assert names.velocity.message == "TwistStamped"
    assert names.topics.scan == "scan"


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ('[topics]\nodometry = "odom"\n', r"\[topics\] unknown key 'odometry'; known are .*odom"),
        ('[topcis]\nodom = "odom"\n', "topcis"),
        ("[topics]\nodom = 7\n", r"\[topics\] odom = 7 must be a string that is not empty"),
        ('[topics]\nodom = " "\n', r"\[topics\] odom = ' '"),
        ('topics = "odom"\n', r"topics = 'odom' must be a table: \[topics\]"),
        ('[velocity]\nmessage = "Velocity"\n', r"\[velocity\] message = 'Velocity' must be one of .*Twist"),
        ("[topics\n", "no TOML"),
    ],
)
def test_what_is_wrong_in_a_file_is_named(tmp_path, text, named):
    file = tmp_path / "names.toml"
    file.write_text(text)
    with pytest.raises(TomlFileError, match=named) as caught:
        load_names(file)
    assert str(file) in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(TomlFileError, match=r"nothing\.toml"):
        load_names(tmp_path / "nothing.toml")
