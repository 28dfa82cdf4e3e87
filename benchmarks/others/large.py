"""Problems of large deformations, on meshes of half the size each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from time import process_time

import numpy as np
from mpi4py import MPI
from scipy.optimize import brentq

from benchmarks.others.rows import Row
from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    LoadStep,
    RigidPlane,
    Scene,
    Support,
    Surface,
    gallery,
    solve_steps,
)
from fenics_contact.materials import MooneyRivlin, NeoHooke
from fenics_contact.mesh import quadratic
from fenics_contact.results.deformed_state import AnyState


@dataclass(frozen=True)
class Path:
    """A quantity along load steps, on several meshes.

    Attributes:
        scene: Makes the scene by the fineness of its mesh, a power of two.
        steps: The load steps.
        measure: Returns the quantity of a state.
        finest: Largest fineness; a quarter and half of it are solved, too.
    """

    scene: Callable[[int], Scene]
    steps: Sequence[LoadStep]
    measure: Callable[[AnyState], float]
    finest: int

    def values(self) -> tuple[np.ndarray, int, int, float]:
        """Return the quantity by mesh and step, unknowns and Newton steps of the last, processor seconds."""
        began, found = process_time(), []
        for fineness in (self.finest // 4, self.finest // 2, self.finest):
            scene = self.scene(fineness)
            states = solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-8), self.steps)
            found.append([self.measure(state) for state in states])
        unknowns = 2 * sum(body.mesh.n_nodes for body in scene.bodies.values())
        steps = sum(state.solution.iterations for state in states)
        return np.array(found), unknowns, steps, process_time() - began


def rubber_cylinder(fineness: int) -> Scene:
    """A quarter of a rubber cylinder of diameter 400 mm above the lower of two rigid plates, plane strain."""
    disc = quadratic(gallery.half_disc(200.0, fineness, grading=0.5))
    skin = np.concatenate([disc.surfaces["contact"], disc.surfaces["side"]])
    shapes = {"skin": disc.shapes["contact"]}
    disc = replace(
        disc, surfaces={"skin": skin, "x0": disc.surfaces["x0"], "top": disc.surfaces["top"]}, shapes=shapes
    )
    rubber = MooneyRivlin(0.293, 0.177, 1410.0, mean_dilatation=True)
    plate = ContactPair(Surface("cylinder", "skin"), RigidPlane((0.0, 0.0), (0.0, 1.0)))
    return Scene({"cylinder": Body(disc, rubber)}, [Support("cylinder", "x0", (0.0, None))], contacts=[plate])


def closed(way: float) -> LoadStep:
    """Return the step in which plates are closer by a way: the plane between them moves half of it."""
    held = [Support("cylinder", "x0", (0.0, None)), Support("cylinder", "top", (None, -0.5 * way))]
    return LoadStep(f"{way:g} mm", supports=held)


def rubber_rows() -> list[Row]:
    """The cylinder of Sussman and Bathe: force per length by closing."""
    printed = {60.0: 0.1, 100.0: 0.26, 140.0: 0.5, 175.0: 0.9, 200.0: 1.4}
    path = Path(
        rubber_cylinder, [closed(way) for way in printed],
        lambda state: 2e-3 * float(state.contact.normal_force.sum()), 16,
    )  # fmt: skip
    others = {200.0: "solids4foam, finite volumes 1.27"}
    return rows_by_halving(
        path,
        {
            f"force at {way:g} mm [kN/mm]": (force, "Sussman and Bathe, off a plot", 0.1, others.get(way, ""))
            for way, force in printed.items()
        },
    )


#: Corners of the die's inside and outside, mm; cells go from one to the other.
INSIDE = np.array([(50.0, 0.0), (50, 70), (45, 85), (45, 115), (48, 135), (48, 205), (0, 220)])
OUTSIDE = np.array([(60.0, 0.0), (60, 70), (60, 85), (60, 115), (60, 135), (60, 230), (0, 230)])


def die(fineness: int) -> BodyMesh:
    """Mesh the die: a tube that narrows from radius 50 to 45 mm, widens to 48, and has a conical roof."""
    lengths = np.linalg.norm(np.diff(INSIDE, axis=0), axis=1)
    counts = np.maximum(np.round(lengths / 50.0 * fineness), 1).astype(int)
    number = np.concatenate(
        [*(k + np.arange(count) / count for k, count in enumerate(counts)), [len(counts)]]
    )
    strip = gallery.rectangle_lattice((np.linspace(0.0, 1.0, 3), number))
    across, along = strip.points.T
    inside, outside = (
        np.column_stack([np.interp(along, np.arange(len(side)), axis) for axis in side.T])
        for side in (INSIDE, OUTSIDE)
    )
    return strip.moved(inside + across[:, None] * (outside - inside))


def billet_in_die(fineness: int) -> Scene:
    """An elastic billet of radius 50 and height 65 mm at the lower end of the die."""
    billet = gallery.rectangle((0.0, 0.0), (50.0, 65.0), (fineness, round(1.3 * fineness)))
    skin = np.concatenate([billet.surfaces["x1"], billet.surfaces["y1"]])
    billet = replace(billet, surfaces={**billet.surfaces, "skin": skin})
    bodies = {
        "billet": Body(billet, NeoHooke(5000.0, 0.45), axisymmetric=True),
        "die": Body(die(fineness), NeoHooke(2e5, 0.3), axisymmetric=True),
    }
    pair = ContactPair(Surface("billet", "skin"), Surface("die", "x0"), discretisation="mortar")
    return Scene(bodies, pushed(0.0), contacts=[pair])


def pushed(way: float) -> list[Support]:
    """Return what holds the die, and the billet whose lower end has been moved up by a way."""
    held = [Support("die", "x1"), Support("die", "y0"), Support("die", "y1", (0.0, None))]
    return [*held, Support("billet", "y0", (None, way))]


def squeezed_height(stretch: float) -> float:
    """Return the axial stretch of the billet where its radius has a stretch and nothing holds its ends.

    μ (λ² − 1) + Λ ln(λ s²) = 0 for neo-Hooke's material with Lamé's constants Λ, μ.
    """
    bulk, shear = 5000.0 * 0.45 / (1.45 * 0.1), 5000.0 / 2.9
    return float(
        brentq(lambda z: shear * (z**2 - 1.0) + bulk * (np.log(z) + 2.0 * np.log(stretch)), 0.5, 2.0)
    )


def billet_rows() -> list[Row]:
    """SSNV504: way of the middle of the billet's upper end by that of its lower end."""
    printed = {5.0: 5.0, 20.0: 20.825, 50.0: 55.88, 70.0: 78.69, 135.0: np.nan, 140.0: 144.895}

    def lifted(state: AnyState) -> float:
        points = state.scene.bodies["billet"].mesh.points
        top = int(np.argmin(np.linalg.norm(points - np.array([0.0, 65.0]), axis=1)))
        return float(state.gather_displacement("billet")[top, 1])

    rows = rows_by_halving(
        Path(billet_in_die, [LoadStep(f"{way:g} mm", supports=pushed(way)) for way in printed], lifted, 16),
        {
            f"u_z of the upper end at {way:g} mm [mm]": (
                np.nan, "", 0.0, "" if np.isnan(known) else f"code_aster's balance of volumes {known:g}"
            )
            for way, known in printed.items()
        },
    )  # fmt: skip
    free = {5.0: 5.0, 135.0: 135.0 + 65.0 * (squeezed_height(0.96) - 1.0)}
    return [
        replace(row, reference=free[way], source="closed form, ends free", margin=1e-9)
        if way in free
        else row
        for way, row in zip(printed, rows, strict=True)
    ]


def rows_by_halving(path: Path, known: dict[str, tuple[float, str, float, str]]) -> list[Row]:
    """Return a row for each step, whose bar is what the last halving of the cells has changed."""
    values, unknowns, steps, seconds = path.values()
    return [
        Row(
            quantity, values[-1, k], abs(values[-1, k] - values[-2, k]), reference, source, margin, others,
            unknowns, steps, seconds / len(known), tuple((float(value), 0) for value in values[:, k]),
        )
        for k, (quantity, (reference, source, margin, others)) in enumerate(known.items())
    ]  # fmt: skip
