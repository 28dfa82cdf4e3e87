"""Stiff beside soft, between bodies and within one; thin plates and belts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    ContactPair,
    Coulomb,
    RigidSphere,
    Scene,
    State,
    Status,
    Support,
    Surface,
    TotalForce,
    Traction,
)
from fenics_contact.gallery import block, box_lattice, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStress
from fenics_contact.mesh import quadratic
from tests.equilibrium.contrast import FRICTION, Blocks, Regions
from tests.equilibrium.hertz import Hertz, errors
from tests.hard.scenes.parts import FLOOR
from tests.scenes import crowned
from tools.hard_cases.trial import Trial, bisected, boxes, cut_trial, failing_trial, ragged, trial

GROUP = "stiffness"


def contrast(case: Blocks | Regions, ratio: float) -> Trial:
    """Two blocks, or a block of two materials, with a ratio of stiffness."""
    scene = case.scene(ratio)

    def pressed(state: State) -> None:
        assert state.contact.count(Status.STICK) + state.contact.count(Status.SLIP) > 10

    return Trial(scene, cut=boxes(scene, (2, 2, 2)), other=ragged(scene, 5), checks=pressed)


for _ratio in (1e3, 1e6):
    for _soft in ("upper", "lower"):
        for _slave in ("upper", "lower"):
            _pair = f"the soft one the {_soft} {'slave' if _slave == _soft else 'master'}"
            trial(GROUP, f"a block on one {_ratio:.0e} times as stiff or soft, {_pair}")(
                partial(contrast, Blocks(_soft, _slave, FRICTION), _ratio)
            )


def two_materials(axis: int, ratio: float) -> Scene:
    """A block of two materials on a friction floor, the plane between them within subdomains."""
    return Regions("b", axis, True, FRICTION).scene(ratio)


def in_boxes(axis: int, ratio: float) -> Trial:
    scene = two_materials(axis, ratio)
    # Jumps are small beside the largest displacement, that of the soft part: to the stiff one they are not.
    uneven: dict[str, Any] = {"amplification": 1e4, "agreement": 1e-3} if ratio > 1e5 else {}
    return Trial(scene, cut=boxes(scene, (2, 2, 2)), other=boxes(scene, (2, 3, 2)), **uneven)


def in_ragged_pieces(axis: int, ratio: float, cause: str) -> Trial:
    scene = two_materials(axis, ratio)
    cut = ragged(scene, 5)
    if cause:
        return failing_trial(scene, cause, cut=cut)
    return Trial(scene, cut=cut, other=ragged(scene, 3), amplification=1e4 if ratio > 1e5 else 10.0)


for _ratio in (1e3, 1e6):
    for _axis, _words in ((2, "one above the other"), (0, "side by side")):
        _cause = "the active set does not settle" if (_axis, _ratio) == (0, 1e6) else ""
        _sentence = f"two materials {_words} within subdomains on a friction floor, contrast {_ratio:.0e}"
        trial(GROUP, f"{_sentence}, boxes")(partial(in_boxes, _axis, _ratio))
        trial(GROUP, f"{_sentence}, cut by METIS")(partial(in_ragged_pieces, _axis, _ratio, _cause))


def fine_on_coarse(ratio: float, cells: int) -> Trial:
    """A fine crowned slave on a coarse master that is softer by a ratio, with friction."""
    lower, upper = (
        block((0, 0, 0), (1, 1, 1), (3, 3, 3)),
        block((0.05, 0.05, 1), (0.95, 0.95, 1.9), (cells,) * 3),
    )
    soft, stiff = IsotropicElasticity(1.0, 0.3), IsotropicElasticity(ratio, 0.3)
    scene = Scene(
        {"lower": Body(lower, soft), "upper": Body(crowned(upper, 0.005), stiff)},
        [Support("lower", "z0")],
        [Traction("upper", "z1", (0.003, 0.0, -0.01))],
        [ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), FRICTION, discretisation="node")],
    )
    return Trial(scene, cut=boxes(scene, (2, 2, 2)), other=ragged(scene, 4))


for _ratio in (10.0, 1000.0):
    trial(
        GROUP, f"a fine slave on a master four times as coarse and {_ratio:g} times as soft, with friction"
    )(partial(fine_on_coarse, _ratio, 12))


@dataclass(frozen=True)
class Pad:
    """A quarter of an elastic pad pressed on a rigid ball; Hertz gives pressure and radius for every ν.

    Attributes:
        poisson: ν.
        cell: Type of cell.
    """

    poisson: float
    cell: str

    @property
    def trial(self) -> Trial:
        """The pad, with the measured errors as a remark."""
        fine = np.linspace(0.0, RADIUS, 5)
        ticks = np.concatenate([fine, RADIUS + np.geomspace(0.035, 0.9, 6)])
        if self.cell == "hexahedron27":  # every other plane, so that there are as many nodes
            mesh = quadratic(box_lattice([ticks[::2], ticks[::2], -ticks[::-2]]))
        else:
            mesh = box_lattice([ticks, ticks, -ticks[::-1]], self.cell)
        total = 4 * self.modulus * RADIUS**3 / 3
        scene = Scene(
            {"body": Body(mesh, IsotropicElasticity(YOUNG, self.poisson))},
            [Support("body", "x0", (0.0, None, None)), Support("body", "y0", (None, 0.0, None))],
            [TotalForce("body", "z0", (0.0, 0.0, total / 4))],
            [ContactPair(Surface("body", "z1"), RigidSphere((0.0, 0.0, 1.0), 1.0))],
        )
        return Trial(
            scene, cut=boxes(scene, (1, 2, 2)), other=bisected(scene, 7), ranks=(), remark=self.remark
        )

    @property
    def modulus(self) -> float:
        """E / (1 − ν²)."""
        return float(YOUNG / (1 - self.poisson**2))

    def remark(self, state: State) -> str:
        """Say how far peak pressure and radius are off."""
        theory = Hertz(RADIUS, 2 * self.modulus * RADIUS / np.pi, 0.0)
        peak, radius = errors(state, theory, (0, 1), 2 / 5)
        return f"peak pressure {100 * peak:+.0f} %, contact radius {100 * radius:+.0f} % off Hertz"


#: Of the contact, beside a ball of radius one; Young's modulus of the pad.
RADIUS, YOUNG = 0.1, 1000.0
KINDS = {"hexahedron": "hexahedra", "tetrahedron": "tetrahedra", "hexahedron27": "quadratic hexahedra"}
for _cell, _words in KINDS.items():
    for _poisson in (0.3, 0.49, 0.499, 0.4999):
        trial(GROUP, f"a pad of {_words} with Poisson's ratio {_poisson:g} on a rigid ball")(
            lambda poisson=_poisson, cell=_cell: Pad(poisson, cell).trial
        )


#: Bending against stretching of cells this flat is as one to a million.
FLAT = "the conditioning of flat cells: the linear systems of the faces are not solved to the end"


def plate(thickness: float, gap: float = 0.0) -> BodyMesh:
    """A plate of cells of edge one."""
    return block((0.0, 0.0, gap), (8.0, 4.0, gap + thickness), (8, 4, 1))


STEEL = IsotropicElasticity(1e5, 0.3)


def dragged(thickness: float) -> Scene:
    """A plate pressed on its floor and dragged along at one edge."""
    pair = ContactPair(Surface("plate", "z0"), FLOOR, Coulomb(0.3))
    return Scene(
        {"plate": Body(plate(thickness), STEEL)},
        [Support("plate", "x1", (1e-4, None, None))],
        [Traction("plate", "z1", (0.0, 0.0, -1.0))],
        [pair],
    )


def drawn(thickness: float) -> Scene:
    """A plate drawn over another one that lies fixed."""
    lower, upper = plate(thickness), plate(thickness, gap=thickness)
    smaller = upper.points * np.array([0.8, 0.8, 1.0]) + np.array([0.5, 0.4, 0.0])
    return Scene(
        {"lower": Body(lower, STEEL), "upper": Body(upper.moved(smaller), STEEL)},
        [Support("lower", "z0"), Support("upper", "x1", (1e-4, 0.0, None))],
        [Traction("upper", "z1", (0.0, 0.0, -1.0))],
        [ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), Coulomb(0.3), discretisation="node")],
    )


def borne(state: State, load: float = 32.0) -> None:
    """Require the floor to bear what presses on the plate."""
    np.testing.assert_allclose(state.contact.force[:, 2].sum(), load, rtol=1e-5)


FLAT_OPTIONS: dict[str, Any] = {"amplification": 1e4, "agreement": 1e-4}
trial(GROUP, "a plate of cells of aspect 10 dragged over its floor")(
    lambda: cut_trial(dragged(0.1), checks=borne, **FLAT_OPTIONS)
)
trial(GROUP, "a plate of cells of aspect 10 drawn over another one")(
    lambda: cut_trial(drawn(0.1), **FLAT_OPTIONS)
)
trial(GROUP, "a plate of cells of aspect 100 dragged over its floor, in two boxes")(
    lambda: cut_trial(dragged(0.01), checks=borne, other=None, **FLAT_OPTIONS)
)
trial(GROUP, "a plate of cells of aspect 100 drawn over another one, in two boxes each")(
    lambda: cut_trial(drawn(0.01), other=None, **FLAT_OPTIONS)
)


@trial(GROUP, "a plate of cells of aspect 100 drawn over another one, in three pieces each")
def a_plate_in_three_pieces() -> Trial:
    scene = drawn(0.01)
    return failing_trial(scene, FLAT, cut=bisected(scene, 3))


@trial(GROUP)
def a_plate_of_cells_of_aspect_1000_dragged_over_its_floor_in_one_subdomain() -> Trial:
    scene = dragged(1e-3)
    return failing_trial(scene, FLAT, cut=boxes(scene, (1, 1, 1)), other=None, checks=borne)


@trial(GROUP)
def a_plate_of_cells_of_aspect_1000_dragged_over_its_floor_in_two_subdomains() -> Trial:
    return failing_trial(dragged(1e-3), FLAT)


@trial(GROUP)
def a_plate_of_cells_of_aspect_1000_drawn_over_another_one() -> Trial:
    return failing_trial(drawn(1e-3), FLAT)


@trial(GROUP)
def a_clamped_plate_of_aspect_1000_that_bends_down_on_its_floor() -> Trial:
    pair = ContactPair(Surface("plate", "z0"), FLOOR, Coulomb(0.3))
    weight = BodyForce("plate", (0.0, 0.0, -1.0))
    scene = Scene({"plate": Body(plate(1e-3, 0.01), STEEL)}, [Support("plate", "x0")], [weight], [pair])
    return failing_trial(scene, FLAT)


def belt(thickness: float, angle: float, around: int) -> BodyMesh:
    """A ring segment around the origin, from the top (x0) clockwise (x1)."""
    mesh = rectangle((0.0, 0.0), (angle, thickness), (around, 1))
    turn, radius = mesh.points[:, 0], 1.0 + mesh.points[:, 1]
    return mesh.moved(np.column_stack([radius * np.sin(turn), radius * np.cos(turn)]))


def capstan(thickness: float, angle: float, friction: float, around: int) -> Trial:
    """A belt drawn over a disc; one end is loaded by a unit force, the other drawn round the disc."""
    mesh = belt(thickness, angle, around)
    outward = (np.cos(angle) / thickness, -np.sin(angle) / thickness)
    scene = Scene(
        {"belt": Body(mesh, PlaneStress(2e4 / thickness, 0.3))},
        [Support("belt", "x0", (lambda x: -0.03 * x[:, 1], None))],
        [Traction("belt", "x1", outward)],
        [ContactPair(Surface("belt", "y0"), RigidSphere((0.0, 0.0), 1.0), Coulomb(friction))],
    )

    def wrapped(state: State) -> None:
        assert state.contact.count(Status.SLIP) > 0.9 * state.contact.points.count

    # Slip everywhere, and bending next to nothing: small residuals leave room for the forces of single nodes.
    return cut_trial(scene, cut=boxes(scene, (4, 1)), checks=wrapped, agreement=1e-3)


for _thickness, _angle, _name, _friction in (
    (0.02, np.pi / 2, "a quarter turn", 0.3),
    (0.01, np.pi / 2, "a quarter turn", 0.5),
    (0.01, np.pi, "half a turn", 0.1),
    (0.01, np.pi, "half a turn", 0.3),
    (0.01, np.pi, "half a turn", 0.5),
):
    trial(GROUP, f"a belt of {_thickness:g} of the radius, {_name} round a disc, friction {_friction:g}")(
        partial(capstan, _thickness, _angle, _friction, 120)
    )


@trial(GROUP, "a belt of 0.01 of the radius, half a turn round a disc, friction 0.5, finer, in three pieces")
def a_fine_belt() -> Trial:
    scene = capstan(0.01, np.pi, 0.5, 200).scene
    return failing_trial(scene, "the residual stagnates while all points slip", cut=bisected(scene, 3))
