"""Fatigue by closed cycles of load steps: critical planes, Ruiz' parameters, lives, designs that last."""

from typing import TYPE_CHECKING

from fenics_contact._base.late_names import late_names

if TYPE_CHECKING:
    from fenics_contact.fatigue.criteria import FatemiSocie, Findley, SmithWatsonTopper
    from fenics_contact.fatigue.cycle import CycleFatigue, RuizParameters, assess_cycle, ruiz_parameters
    from fenics_contact.fatigue.life import LifeCurve
    from fenics_contact.fatigue.objective import FatigueNorm
    from fenics_contact.fatigue.planes import CriticalPlanes, find_critical_planes

__all__ = [
    "CriticalPlanes",
    "CycleFatigue",
    "FatemiSocie",
    "FatigueNorm",
    "Findley",
    "LifeCurve",
    "RuizParameters",
    "SmithWatsonTopper",
    "assess_cycle",
    "find_critical_planes",
    "ruiz_parameters",
]

__getattr__, __dir__ = late_names(__name__)
