"""What a deck asks for of temperatures, in the files that CalculiX writes: NT, HFL and RFL."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fenics_contact.decks.results import DeckResults, Tables
from fenics_contact.decks.tables import Print
from fenics_contact.heat.state import HeatState, flux_at
from fenics_contact.output.frd import FrdField
from fenics_contact.results.at_points import AtPoints, QuadraturePoints, added_up


@dataclass(frozen=True, eq=False)
class FluxAtPoints(AtPoints):
    """Heat flux, (n_cells, n_points, 3), and the heat that bodies conduct away from nodes, (n_nodes, 1)."""

    flux: np.ndarray
    heat: np.ndarray

    @classmethod
    def of(cls, state: HeatState, name: str) -> FluxAtPoints:
        """Return those of a body."""
        body, field = state.scene.bodies[name], state.scene.field.bodies[name]
        mesh, cell, points = body.mesh, field.element.cell, QuadraturePoints(field, np.zeros(0))
        flux, slopes, _ = flux_at(body, cell, state.temperature[name], points.positions)
        heat = -body.thickness * np.einsum("cq,cqi,cqai->ca", points.weights, flux, slopes)
        flux = np.pad(flux, ((0, 0), (0, 0), (0, 3 - mesh.dim)))
        return cls(points.positions, cell, flux, added_up(mesh, heat[..., None]))


@dataclass(frozen=True, eq=False)
class HeatResults(DeckResults):
    """The results of a deck that conducts heat."""

    kinds: ClassVar[Mapping[str, Mapping[str, str]]] = {
        "NODEFILE": {"NT": "NDTEMP", "RFL": "RFL"}, "ELFILE": {"HFL": "FLUX"}, "CONTACTFILE": {},
    }  # fmt: skip
    printed: ClassVar[Mapping[str, Sequence[str]]] = {
        "NODEPRINT": ("NT", "RFL"), "ELPRINT": ("HFL",), "CONTACTPRINT": (),
    }  # fmt: skip
    otherwise: ClassVar[Mapping[str, str]] = {"NDTEMP": "temperatures", "FLUX": "heat fluxes"}

    def made(self, state: HeatState, kinds: Sequence[str]) -> list[FrdField]:
        """Return fields of a state on all nodes by their kinds."""
        points = {name: FluxAtPoints.of(state, name) for name in state.scene.bodies}
        every = {
            "NDTEMP": {name: (T[:, None], np.ones(len(T))) for name, T in state.temperature.items()},
            "FLUX": {n: at.at_nodes(at.flux, state.scene.bodies[n].mesh) for n, at in points.items()},
            "RFL": {name: (at.heat, np.zeros(len(at.heat))) for name, at in points.items()},
        }
        found = []
        for kind in kinds:
            totals, counts = ({n: own[k] for n, own in every[kind].items()} for k in (0, 1))
            values = self.numbering.summed(totals) / np.maximum(self.numbering.summed(counts), 1.0)
            found.append(FrdField(kind, self.numbering.mesh.numbers, values))
        return found

    def progress(self, state: HeatState) -> tuple[int, float, int]:
        """Return the number of linear systems, the relative residual of the last, and no closed points."""
        return state.iterations, float(state.solution.natural_residual), 0

    def tables(self, state: HeatState, time: float) -> Tables:
        """Return what makes the tables of a state."""
        return HeatTables(self, state, time)


@dataclass(frozen=True, eq=False)
class HeatTables(Tables):
    """The tables of temperatures as CalculiX prints them."""

    def of(self, asked: Print, variable: str) -> Iterator[str]:
        """Yield the tables of a variable."""
        if variable == "NT":
            yield from self._values("NDTEMP", "temperatures", asked)
        elif variable == "RFL":
            yield from self._summed("RFL", "heat generation", "total heat generation", asked)
        else:
            head = f"heat flux (elem, integ.pnt.,qx,qy,qz) for set {asked.where}"
            yield self._head(head) + self._at_points(asked, "flux")

    def _points(self, body: str) -> AtPoints:
        return FluxAtPoints.of(self.state, body)
