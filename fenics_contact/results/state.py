"""The equilibrium of a scene, its energies, and both in words."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np

from fenics_contact._base.checks import GivenVector
from fenics_contact._base.costs import Costs, costs_of
from fenics_contact._base.display import counted, displayed, in_lines
from fenics_contact._base.libraries import MPI
from fenics_contact._fem.forms import temperature_of
from fenics_contact._pairing.points import NodeNumbers
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import InvalidInputError, collectively
from fenics_contact.feti.averages import nodal_mean, nodal_sum
from fenics_contact.feti.direct import DirectSolution
from fenics_contact.feti.torn import TornSystem
from fenics_contact.qp.solution import Solution
from fenics_contact.results.adjoint_starts import NoAdjointStart
from fenics_contact.results.by_name import ByName
from fenics_contact.results.constraints import ConstraintForces
from fenics_contact.results.contact import ContactResult, RowValues, pairs_in_words
from fenics_contact.results.fields import (
    GatheredFields,
    body_mesh,
    cell_values,
    contact_fields,
    displacement_function,
    most_stressed,
    nodal_function,
    principal_stress,
    stress,
    stress_fields,
    von_mises,
)
from fenics_contact.results.forces import (
    Balance,
    NodalForces,
    PairResultants,
    Resultants,
    force_balance,
    foundation_forces,
    nodal_forces,
    pair_resultants,
    support_reactions,
)
from fenics_contact.results.on_bodies import OnBodies
from fenics_contact.results.preloads import Preloads
from fenics_contact.results.resolution import PeakUncertainty, in_words
from fenics_contact.results.rigid_motions import RigidMotion, UnheldMotion, rigid_motion
from fenics_contact.results.springs import SpringForces
from fenics_contact.results.tools import ToolResult, tool_results

if TYPE_CHECKING:
    import dolfinx

    from fenics_contact._accuracy.state_errors import BalancedTolerance, StateErrors
    from fenics_contact._fem.mechanics import Response
    from fenics_contact.feti.dual import DualSystem
    from fenics_contact.results.at_points import PointFields


@dataclass(frozen=True)
class Energies:
    """Energies of all bodies, [force · length].

    Attributes:
        strain: Stored energy, of linear materials ½ uᵀK u; NaN where materials dissipate.
        load: Work of the loads, of dead ones fᵀu; NaN where pressures follow their surfaces.
        friction: Σ Ψ ‖slip‖, the dissipation by friction if the whole load step acts at once: what slips to
            and fro within it counts by where it ends, take more load steps and add up. Where parts of a step
            have histories of their own (`AutomaticSteps.finer_history`), the sum over these.
        dual: Value of the dual functional, −½ (f − Bᵀλ)ᵀK⁺(f − Bᵀλ) − λᵀc − Φ(λ); None for nonlinear
            materials.
        surface: Stored by surfaces that give way, λᵀC(λ) − Φ(λ) with the closures C = Φ', and by springs
            between surfaces, N²/(2k); zero without any. Where pairs wear the depth Δw of the load step counts
            as a closure: λᵀΔw − Φ is not stored, but what `primal` needs to agree with `dual`.
    """

    strain: float
    load: float
    friction: float
    dual: float | None = None
    surface: float = 0.0

    @property
    def norm(self) -> float:
        """Energy norm of the displacement, √(uᵀK u), [√(force · length)]."""
        return float(np.sqrt(max(2.0 * self.strain, 0.0)))

    @property
    def total_potential(self) -> float:
        """The energy stored in the bodies less the work of the loads."""
        return self.strain - self.load

    @property
    def primal(self) -> float:
        """Functional that the displacement minimises for given slip bounds: all but `dual` together."""
        return self.total_potential + self.friction + self.surface

    def __str__(self) -> str:
        """List the energies, one per line."""
        names = ["strain", "load", "friction", "total_potential", "primal", "dual"]
        if self.surface:
            names.insert(3, "surface")
        known = [(name, getattr(self, name)) for name in names if getattr(self, name) is not None]
        return "\n".join(f"{name.replace('_', ' '):16s}{value:14.6e}" for name, value in known)


def compute_energies(
    torn: TornSystem,
    displacement: np.ndarray,
    multiplier: np.ndarray,
    friction: float,
    rigid: np.ndarray | float = 0.0,
) -> Energies:
    """Compute all energies. Collective.

    `displacement`: torn displacement of this rank; `multiplier`: λ, owned.
    """
    internal = torn.load - torn.force(multiplier)  # = K u
    strained = 0.5 * internal @ (displacement - rigid)
    mine = np.array([strained, multiplier @ torn.right, *torn.compliance.energies(multiplier)])
    strain, prescribed, given_way, work = (float(total) for total in torn.numbering.comm.allreduce(mine))
    load = torn.load_work(displacement)
    return Energies(strain, load, friction, -strain - prescribed - work, given_way - work)


#: A largest relative residual, a share of the discretisation error, or None for the default.
Tolerance: TypeAlias = "float | BalancedTolerance | None"

Joints = TypeVar("Joints", bound=ByName[Any])


def checked_tolerance(tolerance: object) -> float | BalancedTolerance | None:
    """Return a valid tolerance."""
    if tolerance is None:
        return None
    if isinstance(tolerance, float | int | np.floating):
        if 0.0 < tolerance < 1.0:
            return float(tolerance)
        raise InvalidInputError(f"tolerance must lie between 0 and 1, got {float(tolerance):g}: give 1e-6")
    from fenics_contact._accuracy.state_errors import BalancedTolerance  # imported already if one was given

    if isinstance(tolerance, BalancedTolerance):
        return tolerance
    raise InvalidInputError(
        f"tolerance must be a number, BalancedTolerance(...) or None, got {type(tolerance).__name__}: give a "
        "relative residual such as 1e-6, or leave it out"
    )


def comm_of(state: State, *_: Any, **__: Any) -> MPI.Comm:
    """Return the communicator of a state."""
    return state.torn.decomposition.comm


@displayed
@dataclass(frozen=True, eq=False, kw_only=True)
class State(OnBodies):
    """Displacements, contact forces and how they were computed: a `LinearState` or a `DeformedState`.

    No attribute solves anything. Fields on the bodies' own meshes are built on first access, by all ranks
    together.

    Attributes:
        torn: The torn system: subdomains, rows and contact points, with the loads on it.
        solution: Multiplier, residuals and history of the solver.
        torn_displacement: This rank's torn displacement as the solver returned it, shape (torn_size,),
            [length]; that of whole bodies is `conforming_displacement`.
        contact: Result on the contact surfaces, replicated.
        energies: Energies of all bodies.
        seconds: Wall time of this rank by phase, of all work up to this state that shares its timer.
        tolerance: Tolerance of the solution, a relative residual or `BalancedTolerance`; None where no solver
            iterated.
        known_errors: Errors estimated so far, by a balanced solve or by `LinearState.estimate_errors`; None
            before, and where materials are nonlinear.
        peak_uncertainties: What meshes leave uncertain about the largest pressure of pairs; where materials
            are nonlinear, without what nodes that do not match make of it.

    Example:
        >>> state = solve_scene(scene, comm)  # doctest: +SKIP
        >>> state.displacement["block"]  # a dolfinx Function on the block's own mesh  # doctest: +SKIP
        >>> state.contact.count(Status.SLIP)  # doctest: +SKIP
    """

    torn: TornSystem
    solution: Solution | DirectSolution
    torn_displacement: np.ndarray
    contact: ContactResult
    energies: Energies
    seconds: Mapping[str, float]
    tolerance: Tolerance = None
    known_errors: StateErrors | None = field(default=None, repr=False)
    peak_uncertainties: tuple[PeakUncertainty, ...] = field(default=(), repr=False)
    missed: dict[int, tuple[object, float]] = field(default_factory=dict, repr=False)

    def __str__(self) -> str:
        """List what was found and what it cost, without communication: any rank may print alone."""
        return in_lines(self, 25, 200)

    def _facts(self) -> dict[str, str]:
        contact, counts, solution = self.contact, self.counts, self.solution
        pairs = pairs_in_words(self.scene, contact)
        shown = {f"contact {number}": line for number, line in enumerate(pairs[:8])}
        if len(pairs) > 8:
            shown["more"] = f"{len(pairs) - 8} further contact pairs"
        return {
            "unknowns": f"{counts['torn_unknowns']} in {counted(counts['subdomains'], 'subdomain')}",
            "contact": f"{counted(contact.points.count, 'point')}, {contact.counts_in_words}",
            "largest force": f"{np.linalg.norm(contact.force, axis=1).max(initial=0.0):.6g}",
            "strain energy": f"{self.energies.strain:.6g}",
            "total potential": f"{self.energies.total_potential:.6g}",
            "work": f"{counted(counts['solver_steps'], 'step')}, "
            f"{counted(counts['f_products'], 'product')} with F",
            "residuals": f"natural {solution.natural_residual:.1e}, gluing {solution.gluing_residual:.1e}",
            "seconds": ", ".join(f"{name} {spent:.2f}" for name, spent in self.seconds.items()),
            **self._errors_in_words(),
            **({"peak pressure": in_words(self.peak_uncertainties)} if self.peak_uncertainties else {}),
            **shown,
        }

    @abstractmethod
    def _errors_in_words(self) -> dict[str, str]:
        """Return what is known of errors, by name."""

    @property
    @abstractmethod
    def rows(self) -> RowValues:
        """Multipliers, residuals and steps of the natural map by row."""

    @property
    @abstractmethod
    def conforming_displacement(self) -> np.ndarray:
        """Displacement, continuous across subdomains, used by all fields, shape (torn_size,), [length].

        Copies of a node agree, being their mean weighted by stiffness, and prescribed values are met exactly;
        distances and slips of contact points are those of `torn_displacement`. Collective on first use.
        """

    @property
    def unheld(self) -> tuple[UnheldMotion, ...]:
        """Rigid motions that nothing resists and nothing loads. Collective on first use.

        Along these the bodies stay where they are, on average over their volume. Among them are those by
        which contact opens that touches, but carries no force: bodies that are unloaded, or a joint that a
        load pulls with just the force that clamps it. These go back to their first distances, as far as they
        then do not overlap.
        """
        return ()

    @property
    def scene(self) -> Scene:
        """The scene in the geometry of this state, with loads and supports of the end of its load step."""
        return self.torn.scene

    @property
    def geometry(self) -> Scene:
        """The scene."""
        return self.scene

    @property
    def comm(self) -> MPI.Comm:
        """The communicator over which its subdomains are spread."""
        return comm_of(self)

    @cached_property
    def contact_places(self) -> np.ndarray:
        """Positions of the contact points' slave nodes before deformation, shape (n, dim), [length]."""
        return np.asarray(self.scene.points[self.contact.points.slave])

    @cached_property
    @collectively("State.displacement", comm_of)
    def displacement(self) -> dict[str, dolfinx.fem.Function]:
        """Displacement of each body as a Function on its own mesh, [length]. Collective on first use."""
        decomposition = self.torn.decomposition
        return {
            name: displacement_function(
                body_mesh(decomposition, name, body), body.mesh.at_nodes_apart(self._at_nodes(name))
            )
            for name, body in self.scene.bodies.items()
        }

    @cached_property
    @collectively("State.von_mises", comm_of)
    def von_mises(self) -> dict[str, dolfinx.fem.Function]:
        """Von Mises stress of each body, constant on cells, [force / length²]. Collective on first use."""
        return {
            name: von_mises(
                self.displacement[name], body, comm_of(self), temperature_of(self.scene.loads, name)
            )
            for name, body in self.scene.bodies.items()
        }

    @cached_property
    @collectively("State.stress", comm_of)
    def stress(self) -> dict[str, dolfinx.fem.Function]:
        """Stress tensor of each body, its mean on each cell, shape (3, 3), [force / length²].

        Plane bodies have the component normal to the plane, too. Collective on first use.
        """
        return {
            name: stress(self.displacement[name], body, comm_of(self), temperature_of(self.scene.loads, name))
            for name, body in self.scene.bodies.items()
        }

    @cached_property
    @collectively("State.principal_stress", comm_of)
    def principal_stress(self) -> dict[str, dolfinx.fem.Function]:
        """Principal values σ₁ ≥ σ₂ ≥ σ₃ of `stress`, shape (3,), [force / length²].

        Collective on first use.
        """
        return {
            name: principal_stress(self.stress[name], body.mesh.apart[0])
            for name, body in self.scene.bodies.items()
        }

    @cached_property
    @collectively("State.contact_pressure", comm_of)
    def contact_pressure(self) -> dict[str, dolfinx.fem.Function]:
        """Contact pressure of each body as a Function on its own mesh, [force / length²].

        At the nodes of slave surfaces it is that of the contact points, at all other nodes, also on masters,
        zero. Collective on first use.
        """
        return self._contact_functions("contact_pressure")

    def _contact_functions(self, key: str) -> dict[str, dolfinx.fem.Function]:
        return {
            name: nodal_function(
                u.function_space.mesh,
                key,
                self.scene.bodies[name].mesh.at_nodes_apart(self._contact_fields(name)[key]),
            )
            for name, u in self.displacement.items()
        }

    @collectively("State.gather_displacement", comm_of)
    def gather_displacement(self, body: str) -> np.ndarray:
        """Return the displacement of a body's nodes on every rank, (n_nodes, dim), [length]. Collective."""
        comm, mine = self.torn.decomposition.comm, self._at_nodes(body)
        known = ~np.isnan(mine[:, 0])
        total = comm.allreduce(np.where(known[:, None], mine, 0.0))
        count = comm.allreduce(known.astype(float))
        return np.asarray(total / count[:, None])

    def _at_nodes(self, body: str) -> np.ndarray:
        """Return the displacement of a body's nodes, NaN at those not on this rank. Collective at first."""
        tearing = self.torn.decomposition.tearing
        nodes = tearing.global_nodes(body, np.arange(self.scene.bodies[body].mesh.n_nodes))
        return np.asarray(self._nodal_displacement[nodes])

    @cached_property
    def _nodal_displacement(self) -> np.ndarray:
        return nodal_mean(self.torn.decomposition, self.conforming_displacement)

    @collectively("State.gather_von_mises", comm_of)
    def gather_von_mises(self, body: str) -> np.ndarray:
        """Return the von Mises stress of a body's cells on every rank, shape (n_cells,). Collective."""
        return cell_values(self.von_mises[body], self.scene.bodies[body].mesh.apart[0])

    @collectively("State.gather_stress", comm_of)
    def gather_stress(self, body: str) -> np.ndarray:
        """Return the mean stress of a body's cells on every rank, shape (n_cells, 3, 3). Collective."""
        return cell_values(self.stress[body], self.scene.bodies[body].mesh.apart[0])

    @collectively("State.gather_nodal_stress", comm_of)
    def gather_nodal_stress(self, body: str) -> np.ndarray:
        """Return the stress of a body at its nodes, averaged within one material, on every rank. Collective.

        Recovered from displacements around each node: on surfaces more accurate than means of cells.

        Returns:
            Shape (n_materials, n_nodes, 3, 3), materials in the order of `Body.materials`; NaN where a node
            has no cell of the material, [force / length²].
        """
        return self._nodal_stress[body]

    @cached_property
    def _nodal_stress(self) -> dict[str, np.ndarray]:
        # Recovery is part of estimates, which a state with a fixed tolerance need not import.
        from fenics_contact.results.fields import nodal_stress

        meshes = {name: u.function_space.mesh for name, u in self.displacement.items()}
        on_cells = self.stress if self.scene.is_nonlinear else {}
        return nodal_stress(self.torn, self._nodal_displacement, meshes, on_cells)

    @collectively("State.gather_at_points", comm_of)
    def gather_at_points(self, body: str) -> PointFields:
        """Return stress and strain at the points of the quadrature of a body's cells, on every rank.

        Collective. Gauss points, two or three in each direction; one point, three or four in triangles and
        tetrahedra.

        Example:
            >>> state.gather_at_points("block").stress.shape  # cells, points, 3, 3  # doctest: +SKIP
        """
        from fenics_contact.results.at_points import point_fields

        moved = self.gather_displacement(body)
        return point_fields(self.torn, body, self.displacement[body], moved, self.responses)

    @property
    def responses(self) -> tuple[Response, ...]:
        """What the materials of each subdomain of this rank answer, none where all are linear."""
        return ()

    @collectively("State.gather_fields", comm_of)
    def gather_fields(self, body: str) -> GatheredFields:
        """Return all fields of a body on every rank. Collective."""
        decomposition = self.torn.decomposition
        first = decomposition.tearing.subdomain_offset[decomposition.tearing.body_names.index(body)]
        subdomain = np.asarray(decomposition.partitions[body], dtype=np.int32) + np.int32(first)
        on_cells = stress_fields(self.gather_stress(body))
        on_nodes = stress_fields(most_stressed(self.gather_nodal_stress(body)), "nodal_")
        if hanging := self.scene.bodies[body].mesh.hanging:
            on_nodes = {name: hanging.placed(values) for name, values in on_nodes.items()}
        return GatheredFields(
            {"displacement": self.gather_displacement(body), **self._contact_fields(body), **on_nodes},
            {**on_cells, "von_mises": self.gather_von_mises(body), "subdomain": subdomain},
        )

    def functions(self, body: str) -> list[dolfinx.fem.Function]:
        """Return displacement and von Mises stress of a body, spread over the ranks. Collective."""
        return [self.displacement[body], self.von_mises[body]]

    def _contact_fields(self, body: str) -> dict[str, np.ndarray]:
        return contact_fields(self.contact, self.scene, self.torn.decomposition.tearing, body)

    @collectively("State.reactions", comm_of)
    def reactions(self, about: GivenVector | np.ndarray | None = None) -> Resultants:
        """Return force and moment that every support exerts on its body. Collective.

        By number in the scene's order, or by name: all supports of a surface together. They balance the other
        forces (see `balance`), and are as accurate as the tolerance of the solver. A component that several
        supports prescribe at a node is shared by its areas on their surfaces.

        Args:
            about: Point for all moments, shape (dim,), [length]; by default the centroid of the surface of
                each support.

        Example:
            >>> print(state.reactions())  # doctest: +SKIP
            >>> state.reactions()["lid top"].force  # of the surface "top" of the body "lid"  # doctest: +SKIP
            >>> state.reactions()[0].torque((0, 0, 0), (0, 0, 1))  # doctest: +SKIP
        """
        return support_reactions(self.torn, self._nodal_forces, about)

    @collectively("State.nodal_reactions", comm_of)
    def nodal_reactions(self, body: str) -> np.ndarray:
        """Return the force of all supports together on each node of a body, on every rank. Collective.

        Returns:
            Shape (n_nodes, dim), zero on free components, [force].
        """
        numbers = NodeNumbers.of(self.scene)
        first = numbers.first_of(body)
        return self._nodal_forces.reaction[first : first + self.scene.bodies[body].mesh.n_nodes]

    @collectively("State.gather_internal_forces", comm_of)
    def gather_internal_forces(self, body: str) -> np.ndarray:
        """Return the force that holds each node of a body against its stress, on every rank. Collective.

        That of loads, supports and joints such as ties, not that of contact: CalculiX's RF.

        Returns:
            Shape (n_nodes, dim), [force].
        """
        first = NodeNumbers.of(self.scene).first_of(body)
        return self._internal_forces[first : first + self.scene.bodies[body].mesh.n_nodes]

    @cached_property
    def _internal_forces(self) -> np.ndarray:
        from fenics_contact.results.at_points import forces_at_rest

        torn, forces = self.torn, self._nodal_forces
        rows = nodal_sum(torn.decomposition, torn.force(self.solution.multiplier))
        at_rest = [
            forces_at_rest(torn, name, self.displacement[name].function_space.mesh)
            for name in self.scene.bodies
        ]
        return forces.load - rows - torn.points.on_nodes(forces.contact) + np.concatenate(at_rest)

    @collectively("State.foundations", comm_of)
    def foundations(self, about: GivenVector | np.ndarray | None = None) -> Resultants:
        """Return force and moment that every elastic foundation exerts on its body. Collective.

        By number in the scene's order, or by name: "slab bottom".

        Args:
            about: Point for all moments, shape (dim,), [length]; by default the centroid of each surface.
        """
        return foundation_forces(self.scene, self._nodal_forces, about)

    @collectively("State.rigid_motions", comm_of)
    def rigid_motions(self) -> tuple[RigidMotion, ...]:
        """Return displacement and rotation of the points of all rigid surfaces, in the scene's order.

        Collective.
        """
        known = self._known_motions
        return tuple(
            rigid_motion(
                self.scene, each, self.gather_displacement(each.body), known.get((each.body, each.surface))
            )
            for each in self.scene.rigid_surfaces
        )

    @property
    def _known_motions(self) -> Mapping[tuple[str, str], np.ndarray]:
        """U, then θ, of rigid surfaces by body and surface, where they are known."""
        return {}

    @collectively("State.springs", comm_of)
    def springs(self) -> SpringForces:
        """Return force and elongation of every `Spring` by its name. Collective.

        Example:
            >>> state.springs()["rod"].tension  # doctest: +SKIP
        """
        return self._of_joints(SpringForces)

    @collectively("State.constraints", comm_of)
    def constraints(self) -> ConstraintForces:
        """Return the forces of every `LinearConstraint` by its name. Collective.

        Example:
            >>> state.constraints()["geared"].force  # doctest: +SKIP
        """
        return self._of_joints(ConstraintForces)

    @collectively("State.preloads", comm_of)
    def preloads(self) -> Preloads:
        """Return force, moment and shortening of the sections of all preloads, by name. Collective.

        Example:
            >>> print(state.preloads())  # doctest: +SKIP
            >>> state.preloads()["bolt"].force  # doctest: +SKIP
        """
        return self._of_joints(Preloads)

    @collectively("State.tools", comm_of)
    def tools(self) -> dict[str, ToolResult]:
        """Return motion, force and moment of every `RigidTool` by its name. Collective.

        Example:
            >>> state.tools()["indenter"].displacement  # doctest: +SKIP
        """
        return tool_results(self.torn, self._nodal_forces, self.rigid_motions())

    @collectively("State.resultants", comm_of)
    def resultants(self, about: GivenVector | np.ndarray | None = None) -> PairResultants:
        """Return force and moment on the slave of every contact pair and tie. Collective.

        By number in the scene's order, or by name: that of the slave, or of both surfaces.

        Args:
            about: Point for all moments, shape (dim,), [length]; by default the centroid of each slave
                surface.

        Example:
            >>> grip = state.resultants().friction["hub bore"]  # doctest: +SKIP
            >>> grip.torque((0, 0, 0), (0, 0, 1))  # friction torque about an axis  # doctest: +SKIP
        """
        return pair_resultants(self.torn, self._nodal_forces, about)

    @collectively("State.balance", comm_of)
    def balance(self, about: GivenVector | np.ndarray | None = None) -> Balance:
        """Return loads, reactions and forces of rigid obstacles and what is missing between them. Collective.

        Args:
            about: Point for all moments, shape (dim,), [length]; by default the middle of all bodies' box.
        """
        return force_balance(self.torn, self._nodal_forces, about, self._least_force)

    @property
    @abstractmethod
    def _least_force(self) -> float:
        """A force below which bodies count as free of forces, [force]. Collective."""

    def _of_joints(self, kind: type[Joints]) -> Joints:
        """Return the results of a kind of joints. Collective."""
        return kind.of(self.torn, self._nodal_forces, self.solution.multiplier, self.torn_displacement)

    @cached_property
    def _nodal_forces(self) -> NodalForces:
        return nodal_forces(self.torn, self.solution.multiplier, self.torn_displacement)

    @property
    def costs(self) -> Costs:
        """Messages, reductions, copied tables and operations of this rank so far, by phase.

        Those of all work on the subdomains of this state, whichever state it was for. A model of time on
        other machines and more ranks is made of them.

        Example:
            >>> print(state.costs)  # doctest: +SKIP
            >>> sum(comm.allgather(state.costs.total.message_bytes))  # of all ranks  # doctest: +SKIP
        """
        return costs_of(self.torn.decomposition.comm)

    @property
    def reusable(self) -> DualSystem | None:
        """The dual system, whose unchanged parts the next one reuses; None where there is none."""
        return None

    def adjoint_start(self, multiplier: np.ndarray) -> NoAdjointStart:
        """Return what adjoints of states nearby start from, given one of this state, owned. Collective."""
        return NoAdjointStart()

    @property
    def products(self) -> int:
        """Products with F so far; those of a deformed state's adjoint do not count."""
        return self.solution.products

    @property
    def counts(self) -> dict[str, int]:
        """Sizes and work, such as torn unknowns, multipliers by kind, products, steps."""
        torn = self.torn
        return {
            "torn_unknowns": torn.decomposition.torn_unknowns,
            "subdomains": torn.decomposition.tearing.n_subdomains,
            "equality_multipliers": torn.n_equality,
            "normal_multipliers": torn.points.count,
            "tangential_multipliers": torn.tangential_rows.size,
            "f_products": self.solution.products,
            "solver_steps": self.solution.iterations,
        }
