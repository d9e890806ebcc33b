"""Faults in a robot's behaviour, which a proxy in front of the robot could not cause.

Each is a class of bodies for the independent robot ``baroque``. A mutant behind a proxy alters messages; these robots
send consistent messages and behave otherwise.
"""

from pathlib import Path

from proof.table1.faulty_bodies.missions import MISSIONS
from proof.table1.faulty_bodies.velocities import READINGS, VELOCITIES

FAULTY_BODIES = {**VELOCITIES, **READINGS, **MISSIONS}
#: Statements of faulty bodies that declare other values than ``baroque.toml``, by fault.
STATEMENTS = {path.stem: path for path in Path(__file__).parent.glob("*.toml")}
#: Faults that a statement may excuse: such a body need not fail, but must not pass.
UNSEEN = frozenset({"dead-base"})
