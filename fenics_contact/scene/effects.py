"""The physical effects in a scene. Only what these need is built."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from fenics_contact.display import counted
from fenics_contact.scene.loads import BodyForce, ThermalStrain
from fenics_contact.scene.materials import is_nonlinear
from fenics_contact.scene.pairs import Coulomb, Tresca
from fenics_contact.scene.rigid_surfaces import RigidSurface

if TYPE_CHECKING:
    from fenics_contact.scene.parts import SceneParts


class EffectName(StrEnum):
    """The effects that a scene can contain."""

    ELASTICITY = "elasticity"
    NONLINEAR_MATERIAL = "nonlinear material"
    PRESCRIBED_DISPLACEMENT = "prescribed displacement"
    RIGID_SURFACE = "rigid surface"
    BODY_FORCE = "body force"
    SURFACE_LOAD = "surface load"
    FOLLOWING_PRESSURE = "following pressure"
    THERMAL_STRAIN = "thermal strain"
    TIE = "tied surfaces"
    CONTACT = "contact"
    TRESCA = "Tresca friction"
    COULOMB = "Coulomb friction"


@dataclass(frozen=True)
class Effect:
    """One physical effect in a scene, and the reason for it.

    Attributes:
        name: Which one.
        reason: What in the scene causes it.
    """

    name: EffectName
    reason: str


def effects_of(scene: SceneParts) -> tuple[Effect, ...]:
    """List the effects in a scene, in the order of `EffectName`."""
    return tuple(_effects_in(scene))


def _effects_in(scene: SceneParts) -> Iterator[Effect]:
    names = EffectName
    yield Effect(names.ELASTICITY, counted(len(scene.bodies), "elastic body", "elastic bodies"))
    nonlinear = sum(any(map(is_nonlinear, body.materials)) for body in scene.bodies.values())
    if nonlinear:
        yield Effect(names.NONLINEAR_MATERIAL, counted(nonlinear, "body deforms much or yields", "bodies do"))
    rigid = sum(isinstance(support, RigidSurface) for support in scene.supports)
    if len(scene.supports) > rigid:
        yield Effect(
            names.PRESCRIBED_DISPLACEMENT, counted(len(scene.supports) - rigid, "support", "supports")
        )
    if rigid:
        yield Effect(names.RIGID_SURFACE, counted(rigid, "surface stays rigid", "surfaces stay rigid"))
    volume = [load for load in scene.loads if isinstance(load, BodyForce)]
    thermal = [load for load in scene.loads if isinstance(load, ThermalStrain)]
    surface = len(scene.loads) - len(volume) - len(thermal)
    if volume:
        yield Effect(names.BODY_FORCE, counted(len(volume), "load on a volume", "loads on volumes"))
    if surface:
        yield Effect(names.SURFACE_LOAD, counted(surface, "load on a surface", "loads on surfaces"))
    following = len(scene.following_pressures)
    if following:
        words = counted(following, "pressure follows its surface", "pressures follow their surfaces")
        yield Effect(names.FOLLOWING_PRESSURE, words)
    if thermal:
        yield Effect(names.THERMAL_STRAIN, counted(len(thermal), "change of temperature", "temperatures"))
    if scene.ties:
        yield Effect(names.TIE, counted(len(scene.ties), "pair stays together", "pairs stay together"))
    if scene.contacts:
        yield Effect(names.CONTACT, counted(len(scene.contacts), "pair may touch", "pairs may touch"))
    for name, law, what in (
        (names.TRESCA, Tresca, "a fixed slip bound"),
        (names.COULOMB, Coulomb, "a friction coefficient above zero"),
    ):
        count = sum(pair.has_friction and isinstance(pair.friction, law) for pair in scene.contacts)
        if count:
            yield Effect(name, counted(count, f"pair has {what}", f"pairs have {what}"))
