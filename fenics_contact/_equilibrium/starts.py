"""First guesses of multipliers: from the state of a neighbouring load or geometry, or of coarser meshes."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fenics_contact._scene.scene import Scene
from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.errors.kinds import safe_log
from fenics_contact.feti.averages import at_copies
from fenics_contact.feti.carried import carried_over, put_contact
from fenics_contact.feti.dual import DualSystem
from fenics_contact.feti.torn import TornSystem
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import CELL_TYPES, shape_values
from fenics_contact.mesh.refinement import Refinement
from fenics_contact.mesh.transfer import MeshTransfer
from fenics_contact.qp.face_newton import FaceNewton
from fenics_contact.qp.in_turn import InTurn
from fenics_contact.qp.solution import DualSolution, continued
from fenics_contact.qp.solve import DualSolver
from fenics_contact.results.dual_solve import solve_dual
from fenics_contact.results.state import State

_LOG = logging.getLogger(__name__)


def known_system(state: State | None) -> DualSystem | None:
    """Return the dual system of a state, whose unchanged parts the next one reuses."""
    return state.reusable if state else None


def checked_start(scene: Scene, start: State | None, refinements: Mapping[str, Refinement] | None) -> Start:
    """Return what multipliers are guessed from: a state on the meshes of a scene, or on coarser ones."""
    if start is None:
        if refinements is not None:
            raise InvalidInputError(
                "refinements need the state on the meshes that were refined, got none: give it by start="
            )
        return NoStart()
    if refinements is not None:
        coarse = CoarseStart(start, refinements)
        coarse.check(scene)
        return coarse
    cells = [[body.mesh.cells.shape for body in each.bodies.values()] for each in (start.scene, scene)]
    if cells[0] != cells[1]:
        raise InvalidInputError(
            f"start must have {cells[1]} (cells, nodes), got {cells[0]}: give refinements= or start=None"
        )
    return SameMeshes(start)


class NoStart:
    """A solution that starts from nothing."""

    is_coarser = False
    #: The state on the meshes of the scene, of which parts may be reused.
    here = None

    def first_guess(self, system: DualSystem) -> None:
        """Return multipliers on the rows of a system, owned, None without any. Collective."""


@dataclass(frozen=True, eq=False)
class SameMeshes:
    """A state on the meshes of the scene as start."""

    here: State

    is_coarser = False

    def first_guess(self, system: DualSystem) -> np.ndarray | None:
        old = self.here.reusable
        return carried_over(old.torn, self.here.solution.multiplier, system.torn) if old else None


def solve_from_coarse(
    system: DualSystem, solver: DualSolver, start: DualSolution | np.ndarray | None
) -> DualSolution:
    """Solve, but begin cold where Newton's method needs a rescue from a start. Collective.

    So that a start costs hardly more than none: a rescue takes more products than a solve from nothing.
    """
    if not isinstance(start, np.ndarray) or not isinstance(solver, FaceNewton | InTurn):
        return solve_dual(system, solver, start)
    try:
        return solve_dual(system, solver.without_rescue, start)
    except ConvergenceError as failure:
        history = failure.history
    spent = history[-1].products if history else 0
    if system.problem.comm.rank == 0:
        safe_log(_LOG.info, "the start from coarser meshes led nowhere in %d products: begun cold", spent)
    found = solve_dual(system, solver)
    steps = tuple(continued(history, found.history, spent))
    return replace(found, products=found.products + spent, history=steps, iterations=len(steps))


@dataclass(frozen=True, eq=False)
class CoarseStart:
    """A state as start on meshes that were refined from its own, by nested iteration.

    Displacements u and tractions of contact are interpolated. The gluing forces follow from those, by the
    factor L = D⁻¹ B_Eᵀ (B_E D⁻¹ B_Eᵀ)⁻¹ of the preconditioner:

        λ_E = Lᵀ (f̂ − S u − B_Cᵀ λ_C),

    with the loads f̂ condensed on the interface and the Schur complements S. If u is the solution, so is λ_E;
    else the error of λ is of the size of that of u, both in energy, whatever the number of subdomains.
    `refinements`: body name -> refinement of its mesh, or how it became another one of the same family;
    bodies that are not named have kept theirs.

    References:
        R. E. Bank, T. Dupont: An optimal order process for solving finite element equations. Mathematics of
        Computation 36 (1981) 35-51 (the start from the coarser mesh).
    """

    state: State
    refinements: Mapping[str, Refinement | MeshTransfer]

    is_coarser = True
    here = None

    def fits(self, scene: Scene) -> bool:
        """Return whether the refinements may lead to the meshes of a scene."""
        coarse = self.state.scene
        if list(scene.bodies) != list(coarse.bodies) or not set(self.refinements) <= set(scene.bodies):
            return False
        meshes = {name: (coarse.bodies[name].mesh, body.mesh) for name, body in scene.bodies.items()}
        others = (meshes[name] for name in meshes if name not in self.refinements)
        kept = [np.array_equal(before.cells, after.cells) for before, after in others]
        return all(kept) and all(each.fits(*meshes[name]) for name, each in self.refinements.items())

    def check(self, scene: Scene) -> None:
        """Reject a start that does not fit the meshes of a scene."""
        if not self.fits(scene):
            raise InvalidInputError(
                "refinements must lead from the meshes of the state to those of the scene, got others, of "
                f"{sorted(self.refinements)}: give those with which the scene was made"
            )

    def first_guess(self, system: DualSystem) -> np.ndarray:
        """Return the first guess on the rows of a system, owned; about one product. Collective."""
        torn, problem = system.torn, system.problem
        moved, start = self.displacement(torn), self.at_contact(torn)
        glued = torn.numbering.owned < torn.n_equality
        if torn.groups.compliance.any():
            soft = torn.compliance.soft
            glued[soft] = False
            start[soft] = -torn.closed(torn.right - torn.jump(moved))[soft] / torn.compliance.constant
        # In equilibrium, K⁺ yields a displacement whose forces S u are those of loads and multipliers.
        left = problem.coarse.load - problem.coarse.apply(start)
        balanced = start + problem.coarse.with_load(left).particular()
        _, force = system.inverse.energy(system.bent(balanced) - moved[system.inverse.interface])
        force += torn.force(np.where(glued, 0.0, balanced - start))[system.inverse.interface]
        ties = np.flatnonzero(glued & (torn.numbering.owned >= torn.n_gluing))
        entries = np.ones(len(ties)), (ties, np.arange(len(ties)))
        lifting = system.preconditioner.lifting(sp.csr_matrix(entries, shape=(len(start), len(ties))))
        guess = np.where(glued, balanced + lifting.multiplier(force), start)
        left = np.zeros(len(moved))
        left[system.inverse.interface] = force
        left -= torn.force(np.where(glued, guess - balanced, 0.0))
        missing = problem.coarse.load - problem.coarse.apply(guess)
        return system.soft_motions.balanced(guess, np.flatnonzero(glued), missing, left)

    def displacement(self, torn: TornSystem) -> np.ndarray:
        """Return the interpolated displacement on this rank's torn dofs. Collective."""
        scene = torn.scene
        nodal = np.concatenate(
            [self._to_fine(scene, name, self.state.gather_displacement(name)) for name in scene.body_names]
        )
        return at_copies(torn.decomposition, nodal)

    def at_contact(self, torn: TornSystem) -> np.ndarray:
        """Return forces at contact, owned, zero on all other rows. Collective."""
        found = np.zeros(len(torn.numbering.owned))
        put_contact(torn, found, *self.contact_forces(torn))
        return found

    def contact_forces(self, torn: TornSystem) -> tuple[np.ndarray, np.ndarray]:
        """Return normal forces, (n,), and friction in space, (n, dim), of interpolated tractions."""
        points, contact = torn.points, self.state.contact
        pressing = contact.normal_force[:, None]
        friction = pressing * contact.points.normal - contact.force
        forces = self.at_points(torn, np.hstack([pressing, friction]) / contact.area[:, None])
        forces *= points.area[:, None]
        return np.maximum(forces[:, 0], 0.0), forces[:, 1:]

    def at_points(self, torn: TornSystem, known: np.ndarray) -> np.ndarray:
        """Return values at contact points by those at the points of the state, both (n, k)."""
        points, contact, coarse = torn.points, self.state.contact, self.state.torn
        found = np.zeros((points.count, known.shape[1]))
        for number, pair in enumerate(torn.scene.contacts):
            mine, body = np.flatnonzero(points.pair == number), pair.slave.body
            first, before = (each.decomposition.tearing.first_of(body) for each in (torn, coarse))
            nodes, values = contact.points.of_surface(number, known)
            nodal = np.zeros((self.state.scene.bodies[body].mesh.n_nodes, known.shape[1]))
            nodal[nodes - before] = values
            mesh = self.state.scene.bodies[body].mesh
            if mesh.hanging:
                nodal = mesh.hanging.filled_in(nodal, mesh.surfaces[pair.slave.name], nodes - before)
            found[mine] = self._to_fine(torn.scene, body, nodal)[points.slave[mine] - first]
        return found

    def _to_fine(self, scene: Scene, name: str, nodal: np.ndarray) -> np.ndarray:
        """Return values at the nodes of a fine mesh for those at the nodes of the coarse one."""
        if name not in self.refinements:
            return nodal
        refinement, coarse = self.refinements[name], self.state.scene.bodies[name].mesh
        return interpolated(coarse, refinement, scene.bodies[name].mesh, nodal)


#: What multipliers are guessed from.
Start = NoStart | SameMeshes | CoarseStart


def interpolated(
    coarse: BodyMesh, refinement: Refinement | MeshTransfer, fine: BodyMesh, nodal: np.ndarray
) -> np.ndarray:
    """Return values at the nodes of a fine mesh for those at the nodes of the coarse one, (n_nodes, ...).

    The meshes are those of scenes, where sections may have cut what was refined as a whole: cells have the
    same numbers, nodes have not.
    """
    _, first = np.unique(fine.cells, return_index=True)
    cell, place = np.divmod(first, fine.cells.shape[1])
    kind = CELL_TYPES[coarse.cell_type]
    parents, positions = refinement.located(cell, kind.nodes[place])
    weights = shape_values(kind, positions)
    return np.asarray(np.einsum("nv,nv...->n...", weights, nodal[coarse.cells[parents]]))
