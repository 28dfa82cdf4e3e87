"""How random bodies lie to each other, and which of their surfaces may touch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from fenics_contact import (
    BodyMesh,
    ContactPair,
    Coulomb,
    RigidCylinder,
    RigidPlane,
    RigidSphere,
    Surface,
    Tie,
    Tresca,
)
from tests.scenes import Friction, RigidObstacle
from tools.random_scenes.bodies import Grown, box, in_plane, round_body
from tools.random_scenes.dice import Dice


@dataclass
class Arrangement:
    """Bodies in their places.

    Attributes:
        dim: 2 or 3.
        level: What stresses are like, [force / length²].
        bodies: Bodies by name, lowest first.
        contacts: Who may touch whom.
        ties: Who is bonded to whom.
        floor: Whether the lowest body lies on a rigid obstacle.
    """

    dim: int
    level: float
    bodies: dict[str, Grown] = field(default_factory=dict)
    contacts: list[ContactPair] = field(default_factory=list)
    ties: list[Tie] = field(default_factory=list)
    floor: bool = False


Arrange = Callable[[Dice, Arrangement], None]


def friction(dice: Dice, level: float) -> Friction:
    """Choose a law of friction, with coefficients from 0 to 2."""
    law = dice.weighted({"none": 3.5, "coulomb": 4.5, "tresca": 2.0})
    if law == "none":
        dice.say("frictionless")
        return None
    if law == "tresca":
        bound = level * dice.weighted({0.0: 0.5, dice.between(0.0, 0.3): 3.0, dice.between(0.3, 3.0): 1.5})
        dice.say(f"Tresca {bound:.3g}")
        return Tresca(bound)
    mu = dice.weighted({0.0: 0.5, 0.3: 2.0, 1.0: 1.0, 2.0: 0.5, dice.between(0.0, 2.0): 4.0})
    dice.say(f"Coulomb {mu:.3g}")
    return Coulomb(mu)


def gap(dice: Dice, size: float) -> float:
    """Choose the distance between two bodies; a negative one is explained by faceting, or refused."""
    kind = dice.weighted({"touching": 5.0, "near": 2.0, "far": 1.0, "a little inside": 0.7, "inside": 0.1})
    value = {
        "touching": 0.0, "near": dice.power(-6.0, -2.0), "far": dice.power(-1.5, -0.5),
        "a little inside": -dice.power(-8.0, -3.5), "inside": -0.2,
    }[kind] * size  # fmt: skip
    dice.say(f"gap {value:.2g}")
    return float(value)


def mortar_or_node(dice: Dice, *meshes: BodyMesh) -> str:
    """Choose a discretisation that the cells allow."""
    kind = "mortar" if all(mesh.order == 1 for mesh in meshes) and dice.chance(0.45) else "node"
    dice.say(kind)
    return kind


def pair(
    dice: Dice, made: Arrangement, upper: str, lower: str, sides: tuple[str, str] | None = None
) -> ContactPair:
    """Let the lower side of a body meet the upper side of another, either of them the slave."""
    a, b = made.bodies[upper], made.bodies[lower]
    below, above = sides or (a.below, b.above)
    slave, master = Surface(upper, below), Surface(lower, above)
    if dice.chance(0.3):
        slave, master = master, slave
        dice.say("lower one is slave")
    kind = mortar_or_node(dice, a.mesh, b.mesh)
    return ContactPair(slave, master, friction(dice, made.level), kind)


def obstacle(dice: Dice, dim: int, size: float) -> RigidObstacle:
    """Choose an obstacle that touches the origin from below."""
    kind = dice.weighted({"plane": 5.0, "ball": 1.0, "bar": 1.0 if dim == 3 else 0.0})
    radius = size * dice.power(0.0, 1.5)
    centre = np.append(np.zeros(dim - 1), -radius)
    dice.say(f"rigid {kind}")
    if kind == "ball":
        return RigidSphere(tuple(centre), radius)
    if kind == "bar":
        angle = dice.between(0.0, 3.0)
        return RigidCylinder(tuple(centre), (np.cos(angle), np.sin(angle), 0.0), radius)
    return RigidPlane(tuple(np.zeros(dim)), tuple(np.eye(dim)[-1]))


def on_floor(dice: Dice, made: Arrangement) -> None:
    """One body on an obstacle, perhaps in a corner."""
    round_one = dice.chance(0.25)
    height = gap(dice, 0.3)
    grown = round_body(dice, made.dim, height) if round_one else box(dice, made.dim, height)
    made.bodies["body"], made.floor = grown, True
    base: RigidObstacle = (
        RigidPlane(tuple(np.zeros(made.dim)), tuple(np.eye(made.dim)[-1]))
        if round_one
        else obstacle(dice, made.dim, float(np.linalg.norm(grown.high - grown.low)))
    )
    made.contacts.append(ContactPair(Surface("body", grown.below), base, friction(dice, made.level)))
    if not round_one and dice.chance(0.2):
        wall = grown.high * np.eye(made.dim)[0]
        wall[0] += max(gap(dice, 0.3), 0.0)
        away = tuple(-np.eye(made.dim)[0])
        dice.say("and a wall")
        made.contacts.append(
            ContactPair(Surface("body", "x1"), RigidPlane(tuple(wall), away), friction(dice, made.level))
        )


def _shift(dice: Dice, upper: Grown, lower: Grown) -> np.ndarray:
    """Choose how far the upper body lies beside the lower one; at times it barely meets it."""
    room = 0.5 * (upper.high - upper.low + lower.high - lower.low)[:-1]
    share = dice.weighted({0.0: 2.0, 0.3: 5.0, 0.9: 1.0})
    return np.array([dice.between(-share, share) for _ in room]) * room


def _on_top(dice: Dice, made: Arrangement, name: str, lower: str, *, may_be_round: bool = True) -> None:
    """Grow one more body on another one and pair them, or bond them."""
    under = made.bodies[lower]
    height = gap(dice, 0.3)
    ball = may_be_round and dice.chance(0.2)
    grown = (round_body if ball else box)(dice, made.dim, float(under.high[-1]) + height)
    angle = dice.between(0.0, 3.0) if made.dim == 3 and dice.chance(0.25) else 0.0
    if angle:
        dice.say("turned on its base")
    made.bodies[name] = in_plane(grown, angle, _shift(dice, grown, under))
    if height == 0.0 and not ball and dice.chance(0.15):
        slave, master = Surface(name, grown.below), Surface(lower, under.above)
        kind = mortar_or_node(dice, grown.mesh, under.mesh)
        sliding = dice.chance(0.3)
        dice.say(f"tied{' but sliding' if sliding else ''}")
        made.ties.append(Tie(slave, master, sliding, kind))  # type: ignore[arg-type]
    else:
        made.contacts.append(pair(dice, made, name, lower))


def two(dice: Dice, made: Arrangement) -> None:
    """One body on another."""
    made.bodies["lower"] = box(dice, made.dim, 0.0)
    _on_top(dice, made, "upper", "lower")


def two_on_floor(dice: Dice, made: Arrangement) -> None:
    """One body on another on a rigid floor."""
    made.bodies["lower"], made.floor = box(dice, made.dim, 0.0), True
    plane = RigidPlane(tuple(np.zeros(made.dim)), tuple(np.eye(made.dim)[-1]))
    made.contacts.append(
        ContactPair(Surface("lower", made.bodies["lower"].below), plane, friction(dice, made.level))
    )
    _on_top(dice, made, "upper", "lower")


def three(dice: Dice, made: Arrangement) -> None:
    """A stack of three, or two side by side on a third."""
    made.bodies["lower"] = box(dice, made.dim, 0.0)
    _on_top(dice, made, "middle", "lower", may_be_round=False)
    if dice.chance(0.6):
        _on_top(dice, made, "upper", "middle")
    else:
        dice.say("side by side")
        _on_top(dice, made, "beside", "lower")


def side_by_side(dice: Dice, made: Arrangement) -> None:
    """Two bodies that touch along a vertical face, both perhaps on a rigid floor."""
    left, right = box(dice, made.dim, 0.0), box(dice, made.dim, 0.0)
    way = np.zeros(made.dim - 1)
    way[0] = left.high[0] - right.low[0] + gap(dice, 0.3)
    made.bodies["left"], made.bodies["right"] = left, in_plane(right, 0.0, way)
    made.contacts.append(pair(dice, made, "right", "left", ("x0", "x1")))
    if dice.chance(0.5):
        made.floor = True
        plane = RigidPlane(tuple(np.zeros(made.dim)), tuple(np.eye(made.dim)[-1]))
        law = friction(dice, made.level)
        for name in ("left", "right"):
            made.contacts.append(ContactPair(Surface(name, made.bodies[name].below), plane, law))


def alone(dice: Dice, made: Arrangement) -> None:
    """A body that touches nothing."""
    made.bodies["body"] = box(dice, made.dim, 0.0)


ARRANGEMENTS: dict[Arrange, float] = {
    on_floor: 5.0, two: 6.0, two_on_floor: 2.0, three: 2.0, side_by_side: 1.5, alone: 0.5,
}  # fmt: skip
