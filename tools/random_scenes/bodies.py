"""Random bodies: boxes and round ones of all types of cells, of one to some hundred, of odd sizes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fenics_contact import Body, BodyMesh
from fenics_contact.gallery import box_lattice, half_disc, hemisphere, rectangle_lattice
from fenics_contact.materials import (
    IsotropicElasticity,
    Material,
    OrthotropicElasticity,
    OrthotropicPlaneStress,
    PlaneStrain,
    PlaneStress,
    material_axes,
)
from fenics_contact.mesh import quadratic
from tools.random_scenes.dice import Dice

#: Cells along a side, hardly ever a power of two.
COUNTS = {1: 1.0, 2: 1.5, 3: 3.0, 4: 0.5, 5: 2.0, 7: 1.0}
#: Largest number of boxes of cells by cell type; simplices split each in 2 or 6.
LIMIT = {
    "hexahedron": 100, "tetrahedron": 18, "hexahedron27": 8,
    "quadrilateral": 49, "triangle": 35, "quadrilateral9": 15, "triangle6": 12,
}  # fmt: skip
PLANE = {"quadrilateral": 3.0, "triangle": 3.0, "quadrilateral9": 0.7, "triangle6": 0.7}
SPACE = {"hexahedron": 4.0, "tetrahedron": 2.0, "hexahedron27": 0.5}
#: Poisson's ratios; linear cells lock towards one half, which is no error of the solver.
RATIOS = {0.3: 4.0, 0.0: 1.0, 0.499: 0.7, 0.4999: 0.3, -0.3: 0.3}
SIDE = 1e-9


@dataclass(frozen=True)
class Grown:
    """A mesh with what stands on it knows of it.

    Attributes:
        mesh: The mesh.
        low: Lower corner of its bounding box.
        high: Upper corner of its bounding box.
        below: Name of the surface that may touch what is below.
    """

    mesh: BodyMesh
    low: np.ndarray
    high: np.ndarray
    below: str

    @property
    def above(self) -> str:
        """Name of the flat upper surface."""
        return "top" if "top" in self.mesh.surfaces else f"{'xyz'[self.mesh.dim - 1]}1"


def cell_type(dice: Dice, dim: int) -> str:
    """Choose a type of cells."""
    return dice.weighted(PLANE if dim == 2 else SPACE)


def counts(dice: Dice, dim: int, limit: int) -> list[int]:
    """Choose numbers of cells along the sides of a box."""
    found = [dice.weighted(COUNTS) for _ in range(dim)]
    while np.prod(found) > limit:
        largest = int(np.argmax(found))
        found[largest] = max(count for count in COUNTS if count < found[largest])
    return found


def box(dice: Dice, dim: int, bottom: float, largest: float = 3.0) -> Grown:
    """Mesh a box whose lower side lies at a height; its place along the other axes is open."""
    cell = cell_type(dice, dim)
    number = counts(dice, dim, LIMIT[cell])
    size = np.array([dice.between(0.4, largest) for _ in range(dim)])
    if dice.chance(0.3):
        size = np.maximum(np.round(size, 1), 0.2)
    if dice.chance(0.08):
        size[-1] *= 0.1
        dice.say("thin")
    low = np.append(-0.5 * size[:-1], bottom)
    ticks = [_ticks(dice, low[d], low[d] + size[d], number[d]) for d in range(dim)]
    lattice = rectangle_lattice if dim == 2 else box_lattice
    linear = cell.rstrip("0123456789")
    mesh = lattice(ticks, linear)
    dice.say(f"{cell} {'x'.join(str(n) for n in number)} of {' x '.join(f'{s:.3g}' for s in size)}")
    mesh = _shaken(dice, mesh, min(s / n for s, n in zip(size, number, strict=True)))
    if cell != linear:
        mesh = quadratic(mesh)
    below = f"{'xyz'[dim - 1]}0"
    return Grown(mesh, low, low + size, below)


def _ticks(dice: Dice, low: float, high: float, count: int) -> np.ndarray:
    if count == 1 or dice.chance(0.75):
        return np.linspace(low, high, count + 1)
    steps = np.array([dice.between(0.5, 2.0) for _ in range(count)])
    return low + (high - low) * np.append(0.0, np.cumsum(steps) / steps.sum())


def _shaken(dice: Dice, mesh: BodyMesh, width: float) -> BodyMesh:
    """Move the nodes inside of a body, which leaves its surfaces flat."""
    if not dice.chance(0.15) or mesh.cell_type == "tetrahedron":
        return mesh
    inside = np.setdiff1d(
        np.arange(mesh.n_nodes), np.concatenate([f.ravel() for f in mesh.surfaces.values()])
    )
    points = mesh.points.copy()
    points[inside] += dice.random.uniform(-0.12, 0.12, size=(len(inside), mesh.dim)) * width
    dice.say("with its inside shaken")
    return mesh.moved(points)


def round_body(dice: Dice, dim: int, bottom: float) -> Grown:
    """Mesh half a ball or half a disc whose pole lies at a height above the origin."""
    radius, n = dice.between(0.4, 2.0), dice.one_of((2, 3) if dim == 2 else (2,))
    symmetry = dice.one_of(("x", "") if dim == 2 else ("xy", "x", ""))
    grading = dice.between(0.0, 2.0)
    body = half_disc if dim == 2 else hemisphere
    mesh = body(radius, n, symmetry=symmetry, grading=grading)
    dice.say(f"half a {'disc' if dim == 2 else 'ball'} of {radius:.3g}, n={n} {symmetry!r}")
    mesh = mesh.moved(mesh.points + np.append(np.zeros(dim - 1), bottom))
    return Grown(mesh, mesh.points.min(axis=0), mesh.points.max(axis=0), "contact")


def with_surface(mesh: BodyMesh, name: str, facets: np.ndarray) -> BodyMesh:
    """Return a mesh with one more surface."""
    return replace(mesh, surfaces={**mesh.surfaces, name: facets})


def in_plane(grown: Grown, angle: float, shift: np.ndarray) -> Grown:
    """Turn a body about the vertical axis and shift it along the ground."""
    points = grown.mesh.points.copy()
    if grown.mesh.dim == 3:
        c, s = np.cos(angle), np.sin(angle)
        points[:, :2] = points[:, :2] @ np.array([[c, s], [-s, c]])
    points[:, :-1] += shift
    mesh = grown.mesh.moved(points)
    return Grown(mesh, mesh.points.min(axis=0), mesh.points.max(axis=0), grown.below)


def material(dice: Dice, dim: int, modulus: float) -> Material:
    """Choose a material with moduli about one number."""
    ratio = dice.weighted(RATIOS)
    expansion = 1e-3 if dice.chance(0.2) else None
    kind = dice.weighted({"isotropic": 5.0, "other": 1.0})
    dice.say(f"E={modulus:.3g} nu={ratio}{'' if kind == 'isotropic' else ' orthotropic'}")
    if dim == 2:
        if kind == "other":
            return OrthotropicPlaneStress(
                (modulus, 0.3 * modulus), 0.2, 0.2 * modulus, dice.between(0.0, 3.0)
            )
        return dice.one_of((PlaneStrain, PlaneStress))(modulus, ratio, expansion)
    if kind == "other":
        axes = material_axes(tuple(dice.direction(3)), tuple(dice.direction(3)))
        moduli = (modulus, 0.5 * modulus, 0.2 * modulus)
        return OrthotropicElasticity(
            moduli, (0.2, 0.25, 0.3), (0.2 * modulus, 0.15 * modulus, 0.1 * modulus), axes
        )
    return IsotropicElasticity(modulus, ratio, expansion)


def body(dice: Dice, mesh: BodyMesh, modulus: float) -> Body:
    """Give a mesh its material, or two of them by halves."""
    return in_halves(dice, mesh, lambda factor: material(dice, mesh.dim, factor * modulus))


def in_halves(
    dice: Dice, mesh: BodyMesh, choose: Callable[[float], Material], axisymmetric: bool = False
) -> Body:
    """Give a mesh one material, or two by halves, the second with a factor on its modulus."""
    first = choose(1.0)
    if mesh.n_cells < 2 or not dice.chance(0.15):
        return Body(mesh, first, axisymmetric)
    centres = mesh.points[mesh.cells].mean(axis=1)
    axis = int(dice.random.integers(mesh.dim))
    order = np.argsort(centres[:, axis], kind="stable")
    cut = 1 + int(dice.random.integers(mesh.n_cells - 1))
    regions = {"first": np.sort(order[:cut]), "second": np.sort(order[cut:])}
    second = choose(dice.power(-3.0, 3.0))
    return Body(replace(mesh, regions=regions), {"first": first, "second": second}, axisymmetric)
