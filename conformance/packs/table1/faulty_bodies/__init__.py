"""Faults in what a robot does: behind its web services, where no proxy between it and a client could put them.

Each is a class of bodies for the independent robot ``baroque``. A proxy changes what is said of a robot; these robots
say what they do, and do something else than they were asked to.
"""

from conformance.packs.table1.faulty_bodies.missions import MISSIONS
from conformance.packs.table1.faulty_bodies.readings import READINGS
from conformance.packs.table1.faulty_bodies.velocities import VELOCITIES

FAULTY_BODIES = {**VELOCITIES, **READINGS, **MISSIONS}
