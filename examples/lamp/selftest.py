"""The self-test configuration of the lamp's contract pack: how to start a lamp that conforms, and a mutant."""

import sys
from pathlib import Path

from conformance.mutation.changes import inputs, rest
from conformance.mutation.fields import field
from conformance.mutation.self_test import GoodDevice, SelfTest
from conformance.mutation.table import Table

LAMP = GoodDevice("lamp", lambda _: [sys.executable, str(Path(__file__).with_name("lamp.py")), "0"])
MUTANTS = Table()
mutant = MUTANTS.of_class("lamp", "rest")

mutant("lamp-clamps", "out-of-range", "A brightness above 1 is accepted as 1.").rewritten(
    rest("PUT", "/lamp"), inputs(field("brightness", lambda value: min(value, 1.0)))
)
SELFTEST = SelfTest(devices=(LAMP,), mutants=tuple(MUTANTS))
