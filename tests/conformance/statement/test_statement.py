"""A statement is read as it stands, and refused with the offending value."""

from dataclasses import replace

import pytest

from conformance.contract.pack import Contract
from conformance.packs.table1.limits import Noise
from conformance.packs.table1.robot.robot import STILL, Velocity, is_near
from conformance.packs.table1.statement import Statement
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import StatementError, load_statement

CONTRACT = Contract.load()
ONLY_REST = replace(CONTRACT, publishers_path=None, subscribers_path=None)


def _load(tmp_path, text):
    path = tmp_path / "robot.toml"
    path.write_text(text, encoding="utf-8")
    return load_statement(path, CONTRACT)


def test_a_full_statement(tmp_path):
    statement = _load(
        tmp_path,
        """
        [robot]
        name = "R2"
        [endpoints]
        rest = "http://r2:7003/api"
        publishers_wsdl = "r2.wsdl"
        ca_file = "ca.pem"
        request_rate = 20
        [claims]
        profile = "paper"
        classes = ["safety"]
        [limits]
        linear_m_s = 1
        hold_s = 0.5
        [motion]
        arena = [0, 0, 10, 5]
        goals = [[1, 2, 0]]
        [ros]
        domain_id = 7
        [load]
        max_rate = 100
        [slo.pose]
        p99_ms = 5
        """,
    )
    assert statement.robot == {"name": "R2"}
    assert statement.endpoints.publishers_wsdl == str(tmp_path / "r2.wsdl")
    assert statement.endpoints.ca_file == str(tmp_path / "ca.pem")
    assert statement.claims_of(CONTRACT) == ("rest-resources", "rest-delivery", "soap-delivery", "safety")
    assert (statement.limits.linear_m_s, statement.limits.hold_s, statement.limits.settle_s) == (1.0, 0.5, 2.0)
    assert (statement.motion.arena, statement.ros.domain_id) == ((0.0, 0.0, 10.0, 5.0), 7)
    assert statement.load.max_rate == 100
    assert statement.slo["pose"].limits == {"p99_ms": 5.0}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "[robto]\nname = 'x'",
            "unknown key 'robto'; known are api, auth, calls, claims, endpoints, limits, load, motion, robot, ros",
        ),
        ("[limts]\nhold_s = 1", "; did you mean 'limits'?"),
        ("[endpoints]\nrset = 'x'", "[endpoints] unknown key 'rset'; known are api_key,"),
        ("[endpoints]\nrest = 7003", "[endpoints] rest = 7003 must be a string"),
        (
            "[auth]\nlogin = 'POST https://sso.example/token'\ntoken = '/t'",
            "[auth] login = 'POST https://sso.example/token' must be a method and a path on the device, such as",
        ),
        ("[auth]\nlogin = 'POST /t'\ntoken = 't'", "[auth] token = 't' must be a JSON pointer"),
        ("[endpoints]\ntimeout_s = -1", "[endpoints] timeout_s = -1 must be a positive number"),
        ("[claims]\nprofile = 'half'", "[claims] profile = 'half' must be one of paper, full"),
        ("[claims]\nclasses = ['rest']", "[claims] classes[0] = 'rest' must be one of rest-resources, rest-delivery,"),
        ("[claims]\nclasses = 'http'", "[claims] classes = 'http' must be a list, each item a string"),
        ("[limits]\nlinear_m_s = 'fast'", "[limits] linear_m_s = 'fast' must be a finite number or 2 numbers"),
        ("[limits]\nlinear_m_s = true", "[limits] linear_m_s = True must be a finite number or 2 numbers"),
        ("[limits]\nlinear_m_s = -1", "[limits] linear_m_s = -1 must be a number, and not negative"),
        ("[limits]\nangular_rad_s = nan", "[limits] angular_rad_s = nan must be a number, and not negative"),
        ("[limits]\nlinear_m_s = [0.1, 0.7]", "[limits] linear_m_s = [0.1, 0.7] must be the least velocity, at most 0"),
        ("[limits]\nlinear_m_s = [0, 0]", "[limits] linear_m_s = [0.0, 0.0] must be the least velocity, at most 0"),
        ("[limits]\nlinear_m_s = [-1, inf]", "[limits] linear_m_s = [-1.0, inf] must be the least velocity, at most 0"),
        *(
            (f"[limits]\n{line}", f"[limits] {line} must be a number {bounds}")
            for line, bounds in (
                ("settle_s = nan", "from 0 to 5"),
                ("settle_s = inf", "from 0 to 5"),
                ("settle_s = 5.1", "from 0 to 5"),
                ("hold_s = 0.1", "from 0.2 to 10"),
                ("hold_s = 11", "from 0.2 to 10"),
                ("tolerance = 1000", "from 0 to 0.25"),
                ("tolerance_abs = 0.11", "from 0 to 0.1"),
                ("tolerance_linear_m_s = 0.11", "from 0 to 0.1"),
                ("tolerance_angular_rad_s = 0.21", "from 0 to 0.2"),
                ("goal_m = 0.6", "from 0.01 to 0.5"),
                ("goal_rad = 0.6", "from 0.01 to 0.5"),
                ("goal_s = 121", "from 1 to 120"),
                ("plan_step_m = 11", "from 0.01 to 10"),
            )
        ),
        ("[limits]\nodometry_hz = 0", "[limits] odometry_hz = 0 must be a number from 2 to 1000"),
        ("[limits]\ntime_scale = 1e-6", "[limits] time_scale = 1e-06 must be a number from 0.1 to 25"),
        ("[endpoints]\nrequest_rate = 1e-9", "[endpoints] request_rate = 1e-09 must be a number from 1 to 100000"),
        ("[motion]\nturns_on_the_spot = false", "[motion] turns_on_the_spot = false and min_radius_m must be declared"),
        ("[motion]\nmin_radius_m = 0.4", "[motion] turns_on_the_spot = false and min_radius_m must be declared"),
        ("[limits.noise]\nposition_m = 0.06", "position_m = 0.06 must be a number from 0 to 0.05"),
        ("[limits.noise]\nangular_rad_s = 0.2", "angular_rad_s = 0.2 must be"),
        ("[motion]\narena = [1, 2]", "[motion] arena = [1, 2] must be 4 numbers"),
        ("[motion]\ngoals = [[1, 2, 'x']]", "[motion] goals[0][2] = 'x' must be a finite number"),
        ("[motion]\nactuated = ['linear.w']", "[motion] actuated[0] = 'linear.w' must be one of angular.x, angular.y,"),
        ("[ros]\ndomain_id = 500", "[ros] domain_id = 500 must be a whole number from 0 to 232"),
        (
            "[load]\nmax_rates = 3",
            "[load] unknown key 'max_rates'; known are max_duration_s, max_rate, operations, pairs",
        ),
        ("[load]\nmax_rate = 'fast'", "[load] max_rate = 'fast' must be a positive number"),
        ("claims = 'full'", "claims = 'full' must be a table: [claims]"),
        ("[[", "is no TOML"),
    ],
)
def test_a_wrong_statement_is_refused_by_name(tmp_path, text, message):
    with pytest.raises(StatementError) as error:
        _load(tmp_path, text)
    assert f"{tmp_path / 'robot.toml'}" in str(error.value)
    assert message in str(error.value)


def test_a_statement_that_is_not_there(tmp_path):
    with pytest.raises(StatementError, match=r"robot\.toml cannot be read: No such file"):
        load_statement(tmp_path / "robot.toml", CONTRACT)


def test_a_figure_is_declared_when_the_statement_names_it_whatever_its_value(tmp_path):
    silent = Statement().limits
    assert (silent.linear_declared, silent.angular_declared) == (False, False)
    assert silent.hold_s is None
    same = _load(tmp_path, f"[limits]\nlinear_m_s = {silent.linear_m_s}").limits
    assert same.linear_m_s == silent.linear_m_s
    assert (same.linear_declared, same.angular_declared) == (True, False)


def test_noise_rate_and_clock_are_declared_among_the_limits(tmp_path):
    text = "[limits]\nodometry_hz = 10\ntime_scale = 2\n[limits.noise]\nposition_m = 0.01\nlinear_m_s = 0.02"
    limits = _load(tmp_path, text).limits
    assert (limits.odometry_hz, limits.time_scale) == (10, 2)
    assert limits.noise == Noise(position_m=0.01, linear_m_s=0.02)
    declared = dict.fromkeys(("tolerance_abs", "tolerance_linear_m_s", "tolerance_angular_rad_s"), 0.02)
    declared |= {
        "tolerance": 0.05,
        "goal_m": 0.25,
        "goal_rad": 0.25,
        "noise_position_m": 0.01,
        "noise_linear_m_s": 0.02,
    }
    assert limits.tolerances == declared
    assert Statement().limits.odometry_hz is None


def test_absolute_tolerances_are_declared_apart_or_by_one_figure(tmp_path):
    both = _load(tmp_path, "[limits]\ntolerance_abs = 0.1").limits
    assert (both.tolerance_linear_m_s, both.tolerance_angular_rad_s) == (0.1, 0.1)
    apart = _load(tmp_path, "[limits]\ntolerance_abs = 0.05\ntolerance_angular_rad_s = 0.2").limits
    assert (apart.tolerance_linear_m_s, apart.tolerance_angular_rad_s) == (0.05, 0.2)
    assert is_near(apart, Velocity(0.04, angular_z=0.19), STILL)
    assert not is_near(apart, Velocity(0.06), STILL)
    assert not is_near(apart, Velocity(angular_z=0.21), STILL)


def test_limits_may_differ_between_the_directions_and_from_those_of_the_navigation(tmp_path):
    text = "[limits]\nlinear_m_s = [-0.1, 0.7]\nangular_rad_s = 2\nlateral_m_s = 0.3\nnavigation_linear_m_s = 1"
    statement = _load(tmp_path, text)
    limits = statement.limits
    assert [limits.range_of(component) for component in (0, 1, 5)] == [(-0.1, 0.7), (-0.3, 0.3), (-2, 2)]
    assert (limits.linear_m_s, limits.navigation_m_s, limits.navigation_rad_s) == (0.7, 1, 2)
    assert statement.figures["limits"] == {
        "linear_m_s": 0.7, "linear_least_m_s": -0.1, "linear_greatest_m_s": 0.7, "angular_rad_s": 2, "settle_s": 2,
        "lateral_m_s": 0.3, "navigation_linear_m_s": 1,
    }  # fmt: skip
    back = _load(tmp_path, "[limits]\nlinear_m_s = [-0.7, 0]").limits
    assert (back.linear_m_s, back.range_of(0)) == (0.7, (-0.7, 0))


@pytest.mark.parametrize(
    ("text", "resolved"),
    [
        ("linear_m_s = 0.4\ntolerance_linear_m_s = 0.1", True),
        ("linear_m_s = 0.39\ntolerance_linear_m_s = 0.1", False),
        ("angular_rad_s = 0.7\ntolerance_angular_rad_s = 0.2", False),
        ("linear_m_s = 0.4\ntolerance_linear_m_s = 0.08\n[limits.noise]\nlinear_m_s = 0.03", False),
        ("angular_rad_s = 0", True),
    ],
)
def test_where_rest_could_pass_for_motion_that_is_said(tmp_path, text, resolved):
    assert ("resolved" in _load(tmp_path, f"[limits]\n{text}").why_not_tested) is not resolved


def test_without_claims_the_classes_follow_from_the_addresses():
    only_rest = Statement(endpoints=Endpoints(rest="http://r2"))
    # What judges several interfaces is not judged by one of them: that would be milder than to claim it.
    assert only_rest.claims_of(CONTRACT) == ("rest-resources", "rest-delivery", "rest-formats", "http", "safety")
    assert only_rest.lacking(CONTRACT)["strict-input"] == ("publishers", "subscribers")
    assert "strict-input" in only_rest.claims_of(ONLY_REST)
    assert "soap-delivery" not in only_rest.claims_of(ONLY_REST)
    both = Endpoints(rest="http://r2", publishers_wsdl="x", subscribers_wsdl="y")
    assert Statement(endpoints=both).claims_of(CONTRACT) == tuple(CONTRACT.classes)
