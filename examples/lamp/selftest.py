"""The self-test configuration of the lamp's contract pack: how to start a lamp that conforms."""

import sys
from pathlib import Path

from conformance.mutation.self_test import GoodDevice, SelfTest

LAMP = GoodDevice("lamp", lambda _: [sys.executable, str(Path(__file__).with_name("lamp.py")), "0"])
SELFTEST = SelfTest(devices=(LAMP,))
