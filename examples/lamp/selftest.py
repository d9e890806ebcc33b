"""The self-test configuration of the lamp's contract pack: how to start a lamp that conforms, and its mutants."""

import sys
from pathlib import Path

from proof.mutation.changes import inputs, rest
from proof.mutation.fields import field, scaled, without
from proof.mutation.self_test import GoodDevice, SelfTest
from proof.mutation.table import Table

LAMP = GoodDevice("lamp", lambda _: [sys.executable, str(Path(__file__).with_name("lamp.py")), "0"])
MUTANTS = Table()
mutant = MUTANTS.of_class("lamp", "rest")
read = rest("GET", "/lamp")

mutant("lamp-no-target", "state", "The state has no target.").json(read, without("target"))
mutant("lamp-half-target", "target", "The state has half of the target.").json(read, field("target", scaled(0.5)))
mutant("lamp-old-target", "target", "The response to a PUT has half of the target.").json(
    rest("PUT", "/lamp"), field("target", scaled(0.5))
)
mutant("lamp-too-dark", "fades", "The lamp reaches 90 % of the target.").json(read, field("brightness", scaled(0.9)))
mutant("lamp-flickers", "in-between", "Every tenth state has brightness 1.").json(
    read, field("brightness", 1.0), nth=10
)
mutant("lamp-clamps", "out-of-range", "A brightness above 1 is accepted as 1.").rewritten(
    rest("PUT", "/lamp"), inputs(field("brightness", lambda value: min(value, 1.0)))
)
SELFTEST = SelfTest(devices=(LAMP,), mutants=tuple(MUTANTS))
