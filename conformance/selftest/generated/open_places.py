"""What the contract leaves open: changes that rules make and that break no clause, each with the reason.

They are no mutants, and are not judged. A rule is narrow, and coverage.md shows how many changes it covers.
"""

import re
from dataclasses import dataclass
from functools import cached_property


@dataclass(frozen=True)
class Rule:
    """Changes that break no clause.

    Attributes:
        pattern: of their names, a regular expression that matches all of one.
        reason: why, with the clause that leaves it open.
    """

    pattern: str
    reason: str

    @cached_property
    def compiled(self) -> re.Pattern[str]:
        """The pattern, compiled."""
        return re.compile(self.pattern)


RULES = (
    Rule(
        r"(freeze|delay|scale|ulp|swap):[gG]etPlan:answer(\.return)?\.plan(\.poses\[\])?\.header\.stamp(\.\w+)?:\w+"
        r"|negate:[gG]etPlan:answer(\.return)?\.plan(\.poses\[\])?\.header\.stamp\.sec:\w+",
        "When a plan was made is the planner's affair: the contract asks for its frame and its poses "
        "(contract.md#plans), and each question makes a new one, so that no two formats have to agree on it.",
    ),
    Rule(
        r"(default|scale|single|ulp|ignore|lag|clamp|round):[gG]etPlan:request\.tolerance:\w+",
        "A path that ends at the asked pose itself is within every tolerance (contract.md#plans): where plans are made "
        "so, no answer becomes another by another tolerance. Of a planner that makes use of it, plan-end judges the "
        "path by the tolerance that was sent.",
    ),
    Rule(
        r"ulp:putGoal:answer\.goal\.target_pose\.pose\.(position|orientation)\.\w+:\w+",
        "What a robot answers to a goal is what it has made of it: it may bring a quaternion to unit length, and take "
        "a pose from one frame to another and back (contract.md#goals asks for the goal, not for its last bit).",
    ),
    Rule(
        r"(default|scale|negate|ulp|ignore|lag|clamp):ExecuteCoffeeRequest:request\.arg0\.message_code:soap",
        "ExecuteCoffeeRequest publishes code 4, whatever code it is given (contract.md#soap-publishers).",
    ),
    Rule(
        r"body-bom:\w+:body:xml",
        "A document of XML may begin with a byte order mark (XML 1.0 4.3.3), and every receiver has to take it "
        "(BP R4001); what forbids one is RFC 8259 8.1, of JSON.",
    ),
    Rule(
        r"body-bom:\w+:body:text",
        "A stream of YAML may begin with a byte order mark, which is no part of its content (YAML 1.2.2 5.2); that "
        "there is none is said of JSON (contract.md#json, RFC 8259 8.1).",
    ),
    Rule(
        r"(default|scale|single|ulp|ignore|lag|clamp|round)(@[\w-]+)?:putGoal:request\."
        r"(goal_id|header|goal\.target_pose\.header)\.stamp\.\w+:\w+",
        "When a goal was put is a robot's own to say, as where it is left out: what is shown again are the id and the "
        "pose (contract.md#goals).",
    ),
    Rule(
        r"body-empty(@[\w-]+)?:putGoal:body:\w+",
        "A goal that is taken is answered by a status (contract.md#goals); nothing says that the answer has content.",
    ),
    Rule(r"status:putDelivery:2\d\d-2\d\d", "A delivery answers 2xx, and 204 is only preferred (contract.md#rest)."),
    Rule(
        r"header-(drop|change):put\w+:Vary",
        "Vary tells caches which answers are fit for whom: it is asked for on a response that may be cached "
        "(RFC 9110 12.5.5), and the answer to a PUT is none (9.3.4).",
    ),
    Rule(
        r"header-charset:[a-z]\w+:Content-Type-of-errors",
        "An error is JSON, whose media type has no charset parameter: one that is added has no effect (RFC 8259 11).",
    ),
    Rule(
        r"reorder:[gG]et(Sensors|NavigationServices):answer(\.return)?:\w+",
        "What is on the robot's graph has no order (contract.md#sensors-and-services).",
    ),
    Rule(
        r"status:\w+:(400|422)-4\d\d",
        "Input that is no JSON is 400 and of the wrong shape 422, and other 4xx conform too (contract.md#input-json).",
    ),
)


def reason_for(name: str) -> str:
    """Why a change of this name breaks no clause; empty where it breaks one."""
    return next((rule.reason for rule in RULES if rule.compiled.fullmatch(name)), "")
