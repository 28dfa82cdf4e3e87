"""All scenes of large deformations; importing this fills `CASES`."""

from tests.hard.deformed import limits, materials, slender, sliding, turning
from tests.hard.deformed.case import CASES

__all__ = ["CASES", "limits", "materials", "slender", "sliding", "turning"]
