"""The physical effects that parts of a scene call for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from fenics_contact._base.display import counted


class EffectName(StrEnum):
    """The effects that a scene can contain."""

    ELASTICITY = "elasticity"
    AXISYMMETRY = "axisymmetry"
    TORSION = "torsion"
    NONLINEAR_MATERIAL = "nonlinear material"
    PRESCRIBED_DISPLACEMENT = "prescribed displacement"
    ROLLER = "roller"
    RIGID_SURFACE = "rigid surface"
    FOUNDATION = "elastic foundation"
    SPRING = "spring"
    LINEAR_CONSTRAINT = "linear constraint"
    RIGID_TOOL = "rigid tool"
    BODY_FORCE = "body force"
    SURFACE_LOAD = "surface load"
    POINT_FORCE = "force at nodes"
    FOLLOWING_PRESSURE = "following pressure"
    THERMAL_STRAIN = "thermal strain"
    INITIAL_STRESS = "initial stress"
    TIE = "tied surfaces"
    CYCLIC_SYMMETRY = "cyclic symmetry"
    PRELOAD = "bolt preload"
    CONTACT = "contact"
    CLOSURE = "surfaces that give way"
    FLUID = "fluid that enters where contact opens"
    WEAR = "wear"
    STICK_STIFFNESS = "elastic slip"
    TRESCA = "Tresca friction"
    COULOMB = "Coulomb friction"
    FRICTION_CURVE = "friction that pressure limits or changes"


#: What is there once, and several times, of each effect.
_REASONS = {
    EffectName.ELASTICITY: ("elastic body", "elastic bodies"),
    EffectName.AXISYMMETRY: (
        "body of revolution, all per revolution",
        "bodies of revolution, all per revolution",
    ),
    EffectName.TORSION: ("body may twist about its axis", "bodies may twist about their axis"),
    EffectName.NONLINEAR_MATERIAL: ("body deforms much or yields", "bodies do"),
    EffectName.PRESCRIBED_DISPLACEMENT: ("support", "supports"),
    EffectName.ROLLER: ("surface slides", "surfaces slide"),
    EffectName.RIGID_SURFACE: ("surface stays rigid", "surfaces stay rigid"),
    EffectName.FOUNDATION: ("surface rests on springs", "surfaces rest on springs"),
    EffectName.SPRING: ("spring acts between surfaces", "springs act between surfaces"),
    EffectName.LINEAR_CONSTRAINT: (
        "set of equations between displacements of nodes",
        "sets of equations between displacements of nodes",
    ),
    EffectName.RIGID_TOOL: ("tool moves as one piece", "tools move as one piece each"),
    EffectName.BODY_FORCE: ("load on a volume", "loads on volumes"),
    EffectName.SURFACE_LOAD: ("load on a surface", "loads on surfaces"),
    EffectName.POINT_FORCE: ("set of nodes is loaded", "sets of nodes are"),
    EffectName.FOLLOWING_PRESSURE: ("pressure follows its surface", "pressures follow their surfaces"),
    EffectName.THERMAL_STRAIN: ("change of temperature", "temperatures"),
    EffectName.INITIAL_STRESS: ("body has stress at the start", "bodies have"),
    EffectName.TIE: ("pair stays together", "pairs stay together"),
    EffectName.CYCLIC_SYMMETRY: ("sector repeats", "sectors repeat"),
    EffectName.PRELOAD: ("section is drawn together", "sections are drawn together"),
    EffectName.CONTACT: ("pair may touch", "pairs may touch"),
    EffectName.CLOSURE: ("pair has a law of closure", "pairs have one"),
    EffectName.FLUID: ("pair is a seal", "pairs are seals"),
    EffectName.WEAR: ("pair loses material", "pairs lose material"),
    EffectName.STICK_STIFFNESS: ("pair has a stick stiffness", "pairs have one"),
    EffectName.TRESCA: ("pair has a fixed slip bound", "pairs have a fixed slip bound"),
    EffectName.COULOMB: (
        "pair has a friction coefficient above zero",
        "pairs have a friction coefficient above zero",
    ),
    EffectName.FRICTION_CURVE: ("pair has a shear limit or a table", "pairs have one"),
}


@dataclass(frozen=True)
class Effect:
    """One physical effect in a scene, and the reason for it."""

    name: EffectName
    reason: str


def listed(names: Iterable[EffectName]) -> tuple[Effect, ...]:
    """List effects that bodies and parts have, in the order of `EffectName`, with how many have each."""
    counts = Counter(names)
    return tuple(Effect(name, counted(counts[name], *_REASONS[name])) for name in EffectName if counts[name])
