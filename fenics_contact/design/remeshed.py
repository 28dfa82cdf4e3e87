"""A design problem whose bodies are meshed anew where a design would spoil their cells."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact._base.display import displayed
from fenics_contact._base.libraries import MPI
from fenics_contact._scene.discretisation import keeping_discretisation
from fenics_contact._scene.scene import Scene
from fenics_contact._surfaces.facets import shape_functions
from fenics_contact._surfaces.projection import project
from fenics_contact._surfaces.true_surface import true_surface
from fenics_contact.design.base import SingleProblem, with_objective
from fenics_contact.design.design import SurfaceDesign, checked_variables
from fenics_contact.design.memory import DesignPoint, record_of_values
from fenics_contact.design.problem import ShapeProblem
from fenics_contact.errors import InvalidDesignError, InvalidInputError, together
from fenics_contact.errors.kinds import safe_log, user_code
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.quality import jacobians
from fenics_contact.results.deformed_state import AnyState

#: Takes the mesh of a body in the shape of a design; returns another one with the same named surfaces and
#: the same nodes on its design surfaces.
Mesher = Callable[[BodyMesh], BodyMesh]
#: Nodes nearer than this part of the extent are the same.
SAME = 1e-9


def meshed(
    scene: Scene, designs: Sequence[SurfaceDesign], mesher: Mesher, comm: MPI.Comm
) -> tuple[Scene, tuple[SurfaceDesign, ...]]:
    """Return the scene with new meshes of the designed bodies, made on rank 0, and the designs on them."""
    names = sorted({design.body for design in designs})
    made: dict[str, BodyMesh] = {}
    with together(comm):
        if comm.rank == 0:
            with user_code("the mesher of a design"):
                made = {name: mesher(scene.bodies[name].mesh) for name in names}
            given = _with_given_gaps(scene)
            made = {name: _from_origin(scene, name, mesh, given) for name, mesh in made.items()}
    made = comm.bcast(made)
    bodies = {name: replace(scene.bodies[name], mesh=mesh) for name, mesh in made.items()}
    found = tuple(_found(design, scene.bodies[design.body].mesh, made[design.body]) for design in designs)
    kept = keeping_discretisation(scene)
    return replace(kept, bodies={**scene.bodies, **bodies}), found


def _with_given_gaps(scene: Scene) -> Mapping[str, set[str]]:
    """Return the bodies with surfaces in pairs that give their gaps: body -> names of these surfaces."""
    found: dict[str, set[str]] = {}
    for pair in scene.contacts:
        for side in pair.surfaces if pair.given_gap else ():
            found.setdefault(side.body, set()).add(side.name)
    return found


def _from_origin(scene: Scene, name: str, mesh: BodyMesh, given: Mapping[str, set[str]]) -> BodyMesh:
    """Return a new mesh that knows where its surfaces were before designs moved them.

    A given gap holds there, see `pairing.with_given_gaps`: what designs have added since is kept.
    """
    if name not in given:
        return mesh
    before = scene.bodies[name].mesh
    if mesh.shapes:
        raise InvalidInputError(
            f"a new mesh of {name!r}, whose pair gives its gap, must have no shapes of its own, got "
            f"{sorted(mesh.shapes)}: leave them out, those of the mesh before are kept"
        )
    away, nearest = cKDTree(before.points).query(mesh.points)
    new = away > SAME * float(np.ptp(before.points, axis=0).max())
    moved = before.points - before.origin.points
    way = moved[nearest]
    for surface in sorted(given[name] & set(mesh.surfaces)):
        nodes = np.unique(mesh.surfaces[surface])
        way[nodes[new[nodes]]] = _way_between(name, surface, before, mesh, nodes[new[nodes]])
    points = np.where(new[:, None], mesh.points - way, before.origin.points[nearest])
    kept = {key for key, facets in mesh.surfaces.items() if not new[facets].any()}
    shapes = {key: shape for key, shape in before.origin.shapes.items() if key in kept}
    return mesh.reshaped_from(points, shapes)


def _way_between(body: str, name: str, before: BodyMesh, after: BodyMesh, nodes: np.ndarray) -> np.ndarray:
    """Return how far designs have moved the places of new nodes of a surface, shape (n, dim), [length]."""
    old, new = (true_surface(mesh, name, "faceted") for mesh in (before, after))
    mine = np.searchsorted(new.nodes, nodes)
    hit = project(new.points[mine], -new.normals[mine], old)  # surfaces meet that face each other
    if len(hit.point) < len(nodes):
        raise InvalidInputError(
            f"a new mesh of {body!r} must keep {name!r}, whose gap is given, {len(nodes) - len(hit.point)} "
            f"of {len(nodes)} nodes do not face the one before: keep its rim, or all facets"
        )
    weights, _ = shape_functions(hit.local, old.corners)
    moved = (before.points - before.origin.points)[old.nodes]
    return np.asarray(np.einsum("nk,nkd->nd", weights, moved[old.facets[hit.facet]]))


def _found(design: SurfaceDesign, before: BodyMesh, after: BodyMesh) -> SurfaceDesign:
    """Return a design with the numbers of its nodes in another mesh."""
    places = before.points[design.lattice.nodes]
    distance, nodes = cKDTree(after.points).query(places)
    lost = int(np.count_nonzero(distance > SAME * np.ptp(places, axis=0).max()))
    if lost:
        raise InvalidInputError(
            f"a new mesh of {design.body!r} must keep the nodes of its design surface, {lost} of "
            f"{len(places)} are gone: keep the facets of the surface, as mesh_io.refilled does"
        )
    return replace(design, surface=replace(design.lattice, nodes=np.asarray(nodes)))


logger = logging.getLogger(__name__)


@displayed
@dataclass(frozen=True, eq=False)
class Remeshing:
    """A change of the mesh.

    `after`: J there on the new mesh: both are off by their discretisation errors.
    """

    alpha: np.ndarray
    before: float
    after: float

    @property
    def jump(self) -> float:
        """Change of J by the change of the mesh."""
        return self.after - self.before


@displayed
class Remeshed(SingleProblem):
    """J(α) of a `ShapeProblem`, on a new mesh wherever a design would spoil the cells of the one before.

    The mesh of a design moves until a cell has lost all but a share of its Jacobian. There the body, in the
    shape that it has, gets a new mesh, from which the design moves on, again if need be. The variables stay
    those of the net over the true surface: those of the problem given, also for an optimiser under way. Every
    design is evaluated on the mesh made nearest to it of those that allow it. Where the mesh changes, J jumps
    by a difference of two discretisation errors, see `Remeshing`. All meshes are kept with their factors.

    Attributes:
        problems: A problem for each mesh, the one given first.
        origins: Design in whose shape each mesh was made, shape (size,).
        remeshings: The changes so far.

    Example:
        >>> designs = SurfaceDesign("link1", links.first.crown, net=(7, 4))  # doctest: +SKIP
        >>> problem = ShapeProblem(ContactProblem(scene, comm), designs, TotalPotential())  # doctest: +SKIP
        >>> far = Remeshed(problem)  # doctest: +SKIP
        >>> result = minimize(far, np.zeros(far.size), bounds=(-3.0, 3.0))  # doctest: +SKIP
    """

    def __init__(
        self, problem: ShapeProblem, mesher: Mesher | None = None, *, share: float = 0.1, most: int = 100
    ) -> None:
        """Start with the mesh of a problem.

        Args:
            problem: The problem on its first mesh.
            mesher: Makes the new meshes, such as `readers.refilled`; by default the cells are kept as they
                are moved, and the motion of the mesh starts from there.
            share: Smallest share of its Jacobian that a cell may keep before a new mesh is made.
            most: Largest number of new meshes; a design that needs more is an `InvalidDesignError`.

        Raises:
            InvalidInputError: If the share is not between 0 and 1.
        """
        if not 0.0 < share < 1.0:
            raise InvalidInputError(f"share must lie between 0 and 1, got {share}: 0.1 is usual")
        self._mesher, self.share, self.most = mesher, share, most
        self.problems = [problem]
        self.origins: list[np.ndarray] = [np.zeros(problem.size)]
        self.remeshings: list[Remeshing] = []
        self.objective = problem.objective
        self._parents, self._memory = [0], record_of_values(self._again)

    def _facts(self) -> dict[str, Any]:
        return {"problem": self.problems[0], "remeshings": len(self.remeshings)}

    @property
    def _parts(self) -> Sequence[ShapeProblem]:
        return self.problems

    @property
    def seconds(self) -> dict[str, float]:
        """Wall time of this rank by phase, over all meshes."""
        phases = {phase for problem in self.problems for phase in problem.seconds}
        return {
            phase: sum(problem.seconds.get(phase, 0.0) for problem in self.problems)
            for phase in sorted(phases)
        }

    def evaluate(self, alpha: np.ndarray) -> DesignPoint:
        """Solve the state and its adjoint and return value and subgradient. Collective.

        Raises:
            InvalidDesignError: If the design is out of reach of all meshes, or has no equilibrium.
        """
        problem, moved = self._on_mesh(alpha)
        point = replace(problem.evaluate(moved), alpha=np.array(alpha, dtype=float))
        self._memory.record(point)
        return point

    def state_of(self, alpha: np.ndarray) -> AnyState:
        """Return the equilibrium of a design; raises as `evaluate` does. Collective."""
        problem, moved = self._on_mesh(alpha)
        return problem.state_of(moved)

    def scene_of(self, alpha: np.ndarray) -> Scene:
        """Return the scene in the shape of a design; raises as `evaluate` does. Collective."""
        problem, moved = self._on_mesh(alpha)
        return problem.scene_of(moved)

    def remarks(self, alpha: np.ndarray) -> tuple[str, ...]:
        """Return what to know of a design beside its value, see `ShapeProblem.remarks`. Collective."""
        problem, moved = self._on_mesh(alpha)
        return problem.remarks(moved)

    def volume(self, alpha: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the volume of the designed bodies, in the plane the area, and its gradient. Collective."""
        problem, moved = self._on_mesh(alpha)
        return problem.volume(moved)

    def gradient_near(self, alpha: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return a gradient near α, see `ShapeProblem.gradient_near`. Collective."""
        problem, moved = self._on_mesh(alpha)
        return self._aimed(problem).gradient_near(moved, moved + (end - alpha))

    def differentiate(self, state: AnyState) -> DesignPoint:
        """Return value and subgradient at a state of one of the meshes. Collective."""
        decomposition = state.torn.decomposition
        problem = next(one for one in self.problems if one.contact.decomposition is decomposition)
        return self._aimed(problem).differentiate(state)

    def fingerprint(self) -> dict[str, str]:
        """Identify the problem, for a checkpoint."""
        mesher = getattr(self._mesher, "__name__", str(type(self._mesher)))
        return {**self.problems[0].fingerprint(), "remeshing": f"{mesher}, {self.share}, {self.most}"}

    def memory(self) -> dict[str, np.ndarray]:
        """Return what the next state depends on, and the stored designs. Collective."""
        jumps = np.array([(one.before, one.after) for one in self.remeshings]).reshape(-1, 2)
        meshes = {"origins": np.array(self.origins), "parents": np.array(self._parents), "jumps": jumps}
        return {**{f"meshes.{key}": values for key, values in meshes.items()}, **super().memory()}

    def recall(self, memory: Mapping[str, np.ndarray]) -> None:
        """Continue from what `memory` returned: the meshes are made again. Collective."""
        origins, parents, jumps = (memory[f"meshes.{key}"] for key in ("origins", "parents", "jumps"))
        for origin, parent, jump in zip(origins[1:], parents[1:], jumps, strict=True):
            self._add(int(parent), origin)
            self.remeshings.append(Remeshing(origin, *(float(value) for value in jump)))
        super().recall(memory)

    def _again(self, alpha: np.ndarray) -> DesignPoint:
        """Return a design of an earlier run. Collective."""
        problem, moved = self._on_mesh(alpha)
        return replace(problem.at(moved), alpha=alpha)

    def _aimed(self, problem: ShapeProblem) -> ShapeProblem:
        """Return a problem with the objective of this one."""
        return problem if problem.objective is self.objective else with_objective(problem, self.objective)

    def _on_mesh(self, alpha: np.ndarray) -> tuple[ShapeProblem, np.ndarray]:
        """Return the problem on the nearest mesh that allows a design, and the design from there."""
        alpha = checked_variables(alpha, self.size, self.comm)
        order = np.argsort([np.linalg.norm(alpha - origin) for origin in self.origins], kind="stable")
        near = next((k for k in map(int, order) if self._reach(k, alpha) == 1.0), None)
        k = self._approach(int(order[0]), alpha) if near is None else near
        return self.problems[k], alpha - self.origins[k]

    def _approach(self, k: int, alpha: np.ndarray) -> int:
        """Make new meshes on the way from the k-th until one allows the design; return its number."""
        while (reach := self._reach(k, alpha)) < 1.0:
            if len(self.remeshings) == self.most or reach < 0.01:
                raise InvalidDesignError(
                    f"the design is out of reach of {len(self.problems)} meshes, the next allows {reach:.1%} "
                    f"of the rest (at most {self.most} are made): allow more, or give another mesher"
                )
            k = self._remesh(k, self.origins[k] + reach * (alpha - self.origins[k]))
        return k

    def _reach(self, k: int, alpha: np.ndarray) -> float:
        """Return the part of the way from the k-th mesh to a design on which cells keep their share."""
        problem = self.problems[k]
        points = problem.points_of(alpha - self.origins[k])
        meshes = [problem.scene.bodies[name].mesh for name in points]
        ways = [points[name] - mesh.points for name, mesh in zip(points, meshes, strict=True)]

        def kept(part: float) -> bool:
            return all(
                _share(mesh, mesh.points + part * way) >= self.share
                for mesh, way in zip(meshes, ways, strict=True)
            )

        if kept(1.0):
            return 1.0
        low, high = 0.0, 1.0
        for _ in range(12):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if kept(middle) else (low, middle)
        return low

    def _remesh(self, k: int, origin: np.ndarray) -> int:
        """Make a mesh in the shape of a design of the k-th; measure J on both."""
        before = self.problems[k].value_of(origin - self.origins[k])
        self._add(k, origin)
        after = self.problems[-1].value_of(np.zeros(self.size))
        self.remeshings.append(Remeshing(origin, before, after))
        safe_log(logger.info, "mesh %d: J = %.9g, %.9g before", len(self.remeshings), after, before)
        return len(self.problems) - 1

    def _add(self, k: int, origin: np.ndarray) -> None:
        problem = self.problems[k]
        scene, designs, partitions = problem.scene_of(origin - self.origins[k]), problem.designs, None
        if self._mesher is None:
            partitions = problem.contact.partitions
        else:
            scene, designs = meshed(scene, designs, self._mesher, self.comm)
        self.problems.append(problem.on(problem.contact.on(scene, partitions), designs))
        self.origins.append(np.array(origin, dtype=float))
        self._parents.append(k)


def _share(mesh: BodyMesh, points: np.ndarray) -> float:
    """Return the smallest Jacobian of a cell at new coordinates relative to that of the mesh."""
    new, old = (jacobians(at, mesh.cells).min(axis=1) for at in (points, mesh.points))
    return float((new / old).min())
