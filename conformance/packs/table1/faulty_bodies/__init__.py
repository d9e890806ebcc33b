"""Faults in a robot's behaviour, which a proxy in front of the robot could not cause.

Each is a class of bodies for the independent robot ``baroque``. A mutant behind a proxy alters messages; these robots
send consistent messages and behave otherwise.
"""

from conformance.packs.table1.faulty_bodies.missions import MISSIONS
from conformance.packs.table1.faulty_bodies.readings import READINGS
from conformance.packs.table1.faulty_bodies.velocities import VELOCITIES

FAULTY_BODIES = {**VELOCITIES, **READINGS, **MISSIONS}
