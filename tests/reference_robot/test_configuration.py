"""The robot's file: defaults, changes, and errors that name the key."""

import pytest

from conformance.contract.toml_file import TomlFileError
from reference_robot.names import DEFAULT_NAMES_FILE, RosNames, load_names
from reference_robot.webservices.configuration import Configuration, load_configuration


def test_the_file_that_comes_with_the_robot_agrees_with_the_defaults():
    assert load_names() == load_names(DEFAULT_NAMES_FILE) == RosNames()
    assert load_configuration(None) == Configuration()


def test_a_file_changes_only_what_it_names(tmp_path):
    file = tmp_path / "robot.toml"
    file.write_text('[topics]\nodom = "/base/odom"\n[velocity]\nmessage = "TwistStamped"\n[web]\nhold = 2\n')
    for names in (load_names(file), load_configuration(file)):
        assert (names.topics.odom, names.velocity.message) == ("/base/odom", "TwistStamped")
        assert names.topics.scan == "scan"
    assert (names.web.hold, names.web.settle) == (2.0, 0.6)


NAMES = [
    ('[topics]\nodometry = "odom"\n', r"\[topics\] unknown key 'odometry'; known are .*odom"),
    ('[topcis]\nodom = "odom"\n', "topcis"),
    ("[topics]\nodom = 7\n", r"\[topics\] odom = 7 must be a string that is not empty"),
    ('[topics]\nodom = " "\n', r"\[topics\] odom = ' '"),
    ('topics = "odom"\n', r"topics = 'odom' must be a table: \[topics\]"),
    ('[velocity]\nmessage = "Velocity"\n', r"\[velocity\] message = 'Velocity' must be one of .*Twist"),
    ("[robot]\n", "robot"),
    ("[topics\n", "no TOML"),
]
WEB = [
    ("[web]\nmax_speed = 1.0\n", r"\[web\] unknown key 'max_speed'"),
    ("[web]\nhold = 0\n", r"\[web\] hold = 0 must be a positive number"),
    ('[web]\nhold = "1"\n', r"\[web\] hold = '1'"),
    ("[web]\nhold = true\n", r"\[web\] hold = True"),
    ("[web]\nhold = nan\n", r"\[web\] hold = nan"),
    ("web = 1\n", "web"),
]


@pytest.mark.parametrize(
    ("read", "text", "named"),
    [*((load_names, *case) for case in NAMES), *((load_configuration, *case) for case in NAMES + WEB)],
)
def test_what_is_wrong_in_a_file_is_named(tmp_path, read, text, named):
    file = tmp_path / "robot.toml"
    file.write_text(text)
    with pytest.raises(TomlFileError, match=named) as caught:
        read(file)
    assert str(file) in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(TomlFileError, match=r"nothing\.toml"):
        load_names(tmp_path / "nothing.toml")
