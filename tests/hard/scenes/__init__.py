"""All scenes of the hard cases; importing this fills `TRIALS`."""

from tests.hard.scenes import floating, friction, meshes, partition, stiffness, touching, units
from tools.hard_cases.trial import TRIALS

__all__ = ["TRIALS", "floating", "friction", "meshes", "partition", "stiffness", "touching", "units"]
