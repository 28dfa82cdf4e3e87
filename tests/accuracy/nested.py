"""Structured meshes that hold each other, and errors against the solution on the finest of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact import State
from fenics_contact.materials.elastic import lame
from tests.accuracy.true_error import error_by_cell

#: Coordinates of the mesh lines along each axis.
Lines = Sequence[np.ndarray]


def bisected(line: np.ndarray) -> np.ndarray:
    """Every cell cut in two."""
    return np.sort(np.concatenate([line, (line[1:] + line[:-1]) / 2]))


def refined(values: np.ndarray, coarse: Lines, fine: Lines) -> np.ndarray:
    """Interpolate nodal values of a lattice at the nodes of a finer one, bi- or trilinearly: exactly.

    Args:
        values: Shape (n_nodes, k), nodes numbered with the last axis first.
        coarse: Its lines.
        fine: Lines of the finer lattice, all of the coarse one among them.
    """
    values = values.reshape(*(len(line) for line in coarse), -1)
    for axis, (old, new) in enumerate(zip(coarse, fine, strict=True)):
        left = np.clip(np.searchsorted(old, new, side="right") - 1, 0, len(old) - 2)
        share = ((new - old[left]) / (old[left + 1] - old[left])).reshape(-1, *[1] * (values.ndim - axis - 1))
        values = np.take(values, left, axis) * (1 - share) + np.take(values, left + 1, axis) * share
    return values.reshape(-1, values.shape[-1])


@dataclass(frozen=True)
class Solved:
    """A state on lattices.

    Attributes:
        state: The state.
        lines: Body name -> lines of its lattice.
        estimate: Its estimate.
    """

    state: State
    lines: Mapping[str, Lines]
    estimate: float

    @property
    def norm(self) -> float:
        """√(uᵀK u)."""
        return float(np.sqrt(2 * self.state.energies.strain))


def difference(coarse: Solved, fine: Solved, young: float, poisson: float) -> float:
    """Energy norm of the difference of two solutions, all of whose bodies are of one isotropic material."""
    total = 0.0
    for name, lines in fine.lines.items():
        mesh = fine.state.scene.bodies[name].mesh
        known = refined(coarse.state.gather_displacement(name), coarse.lines[name], lines)
        wrong = fine.state.gather_displacement(name) - known
        total += (error_by_cell(mesh, wrong, lambda x: 0.0, *lame(young, poisson)) ** 2).sum()
    return float(np.sqrt(total))


def true_errors(series: Sequence[Solved], reference: Solved, young: float, poisson: float) -> np.ndarray:
    """Errors of solutions on meshes each of which halves the one before, against a solution on a finer one.

    The reference has an error too. It is taken to be smaller than the last error by the ratio of the mesh
    sizes, and perpendicular to the differences, as it is for Galerkin's method.
    """
    found = np.array([difference(each, reference, young, poisson) for each in series])
    sizes = [
        min(np.diff(line).min() for line in next(iter(s.lines.values()))) for s in (series[-1], reference)
    ]
    left = found[-1] ** 2 / ((sizes[0] / sizes[1]) ** 2 - 1)
    return np.sqrt(found**2 + left)
