"""The parts of the error of a quantity, and the cells that have a share in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from fenics_contact._accuracy.discretisation import OfCells, of_every_cell
from fenics_contact._base.display import Table, tabled
from fenics_contact._base.libraries import MPI


@tabled
@dataclass(frozen=True, eq=False)
class ErrorEstimate:
    """Estimated parts of J − J_h, the exact value of a quantity less that of a state, in its unit.

    All are estimates with a sign, none is a bound.

    Attributes:
        value: J_h, that of the state.
        mesh: By the mesh; NaN if there is no adjoint, see ``without_adjoint``.
        uncancelled: The same if no parts of it cancelled, ≥ 0: where it is much larger than ``mesh``, that
            is uncertain.
        geometry: By facets of linear cells on boundaries whose true shape is known, which enclose less or
            more than the shape, and by contact surfaces that are not measured between the true shapes; to
            first order. What the quantity itself depends on the shape counts for energies and heat alone.
        solver: By the residuals of the solver, with friction at its own slip bounds, to first order.
        without_adjoint: Why there is no adjoint, in words; empty where there is one. All parts are NaN
            without one, and the shares of cells those of the energy norm, or of nonlinear materials
            `stress_indicator`.
    """

    #: The names of the parts of the sum.
    PARTS: ClassVar[tuple[str, ...]] = ("mesh", "geometry", "solver")

    value: float
    mesh: float
    uncancelled: float
    geometry: float
    solver: float
    without_adjoint: str
    _comm: MPI.Comm = field(repr=False)
    _sizes: Mapping[str, int] = field(repr=False)
    _own: OfCells = field(repr=False)

    @property
    def total(self) -> float:
        """J − J_h, the sum of all parts."""
        return float(sum(getattr(self, name) for name in self.PARTS))

    @property
    def known(self) -> float:
        """The sum of all parts; 0 where there is no adjoint, as nothing is known then."""
        return 0.0 if self.without_adjoint else self.total

    def by_cell(self, body: str) -> np.ndarray:
        """Return the share of each cell of a body in the mesh's part, shape (n_cells,), replicated.

        It is √(∫ C e : e ∫ C f : f) with the errors e of the state and f of the adjoint, for energies with
        half of ∫ C e : e: it has no sign and bounds what the cell adds. Collective.

        Raises:
            InvalidInputError: If there is no such body.
        """
        return of_every_cell(self._comm, self._sizes, self._own, body)

    @property
    def in_words(self) -> dict[str, str]:
        """Name of each part -> its size, and relative to the value."""
        parts = {name: getattr(self, name) for name in (*self.PARTS, "total")}
        return {"value": f"{self.value:.6g}", **{name: self._sized(part) for name, part in parts.items()}}

    def _sized(self, part: float) -> str:
        if np.isnan(part):
            return f"not known: {self.without_adjoint}"
        return f"{part:+.3g} ({100 * part / abs(self.value):+.2g} %)" if self.value else f"{part:+.3g}"

    def _tables(self) -> list[Table]:
        """Return a table with one line for each part."""
        return [Table(list(self.in_words.items()), 2, headed=False)]
