"""What the self-test needs of this pack: how a good lamp is started."""

import sys
from pathlib import Path

from conformance.mutation.self_test import GoodDevice, SelfTest

_LAMP = Path(__file__).with_name("lamp.py")
SELFTEST = SelfTest(devices=(GoodDevice("lamp", lambda _: [sys.executable, str(_LAMP), "0"]),))
