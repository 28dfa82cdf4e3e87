"""The parts of errors of quantities of bodies that deform much or yield: by the tangent of the end state."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from fenics_contact._accuracy.discretisation import ErrorProducts, OfCells
from fenics_contact._accuracy.tangent_products import TangentCells, tangent_products
from fenics_contact._adaptive.boundary_errors import Change
from fenics_contact._adaptive.contact_residuals import Faced, where_they_are
from fenics_contact._adaptive.indicator import stress_indicator
from fenics_contact._adaptive.state_parts import StateParts
from fenics_contact._fem.composition import composition
from fenics_contact._fem.mechanics import MaterialStep
from fenics_contact._fem.separate_cells import SeparateCells, values_of_dofs, values_of_nodes
from fenics_contact._scene.body import Body
from fenics_contact.design.adjoint import Adjoint
from fenics_contact.design.sensitivity import require_differentiable
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.feti.subdomain import Subdomain
from fenics_contact.mesh.collapsed import as_hexahedra
from fenics_contact.results.deformed_state import DeformedState
from fenics_contact.results.state import comm_of


class DeformedParts(StateParts):
    """Those of a state of large deformations or nonlinear materials.

    Materials with a history answer to the whole load step from what they were at its start: the adjoint is
    that of the last step alone, and what earlier ones have left is taken as it is.
    """

    state: DeformedState

    @cached_property
    def without_adjoint(self) -> str:  # type: ignore[override]
        """Why there is none, in words: the end of the load step need not say how a state depends on it."""
        try:
            require_differentiable(self.state)
        except InvalidInputError as error:
            return str(error)
        return ""

    @property
    def faced(self) -> Faced:
        """Bodies of large deformations are found where they are."""
        return where_they_are if self.state.scene.deforms_much else super().faced

    def products(self, adjoint: np.ndarray) -> ErrorProducts:
        """Return those by the tangents at the state."""
        torn, known = self.state.torn, {}
        with together(comm_of(self.state)):
            for (part, step, u), place in zip(self._each, torn.decomposition.parts, strict=True):
                cells = self._cells(part, torn.scene.bodies[part.mesh.body])
                w = values_of_dofs(part.mesh.space, part.mesh.on_space(adjoint[place]))
                known[part.mesh.number] = TangentCells(cells, cells.tangent(u, w, step))
        return tangent_products(torn, known, self.state.conforming_displacement, adjoint)

    def change_of_work(self) -> Change:
        return self._change

    def by_gaps(self, adjoint: Adjoint) -> float:
        """Nodes lie on the true surfaces, and those that move far are searched between smooth ones."""
        return 0.0 if self.state.scene.deforms_much else super().by_gaps(adjoint)

    def indicators(self) -> OfCells:
        comm, shares = comm_of(self.state), {}
        for name, body in self.state.scene.bodies.items():
            indicator = stress_indicator(self.state, name)
            cells = np.arange(body.mesh.n_cells if comm.rank == 0 else 0)  # each cell counts once
            shares[name] = cells, indicator[cells]
        return shares

    @cached_property
    def _each(self) -> list[tuple[Subdomain, MaterialStep, np.ndarray]]:
        """This rank's subdomains with the step of their materials and the displacements of their cells."""
        found, state, torn = [], self.state, self.state.torn
        end = state.equilibrium.evaluation
        heat = end.load.heat or (None,) * len(torn.subdomains)
        parts = zip(torn.subdomains, torn.decomposition.parts, end.at.history, heat, strict=True)
        for part, place, history, warmer in parts:
            mesh = part.mesh
            u = values_of_dofs(mesh.space, mesh.on_space(state.conforming_displacement[place]))
            if warmer is not None:
                warmer = values_of_nodes(mesh.space, warmer)
            found.append((part, MaterialStep(history, end.load.time - end.at.time, None, warmer), u))
        return found

    def _cells(self, part: Subdomain, body: Body) -> SeparateCells:
        """Return the cells of a subdomain with the nodes of a body, which may be moved."""
        mesh, forms = part.mesh, self.state.torn.decomposition.forms
        points = mesh.by_input_node(body.mesh.points[mesh.nodes])
        points = values_of_nodes(mesh.space, points)
        return SeparateCells.of(
            forms, lambda order: composition(body, mesh.cells[order]), body.element, points
        )

    def _change(
        self, part: Subdomain, after: Body, u: np.ndarray, v: np.ndarray, among: np.ndarray
    ) -> np.ndarray:
        """Return the change of ∫ P : ∇v over each cell, see `between_facets`."""
        ((step, own),) = ((s, u) for each, s, u in self._each if each.mesh.number == part.mesh.number)
        before = self.state.scene.bodies[part.mesh.body]
        first, last = (self._cells(part, body).forces(own, step) for body in (before, after))
        along = as_hexahedra(v, before.mesh.cells[part.mesh.cells], before.mesh.dim)
        return np.where(among[part.mesh.cells], np.einsum("nai,nai->n", last - first, along), 0.0)
