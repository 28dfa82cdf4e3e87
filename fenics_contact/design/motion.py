"""The mesh follows its design surface.

Volume of a body as a function of its nodes.

How a scene moves with a design: its surfaces, the mesh behind them, and the way back of derivatives.

Integrals over a body as objectives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import ufl

from fenics_contact import _dolfinx
from fenics_contact._base.display import counted, displayed
from fenics_contact._base.libraries import MPI, PETSc, check_not_forked
from fenics_contact._base.sparse import dispose_with
from fenics_contact._fem.forms import temperature_of
from fenics_contact._fem.templates import Template, volume_measure
from fenics_contact._kinematics.element import Element, plain_element
from fenics_contact._kinematics.measure import PLAIN, Measure
from fenics_contact._pairing.points import NodeNumbers
from fenics_contact._scene.body import Body
from fenics_contact._scene.parts import mirrored, planes_of
from fenics_contact._scene.scene import Scene
from fenics_contact._surfaces.facets import gauss_points, within_planes
from fenics_contact.design.design import SurfaceDesign, checked_variables
from fenics_contact.design.forms import (
    Density,
    Integrand,
    ShapeForms,
    sets_in_use,
    subdomain_fields,
    sum_over_subdomains,
)
from fenics_contact.design.load_derivatives import field_by_places
from fenics_contact.design.objective import Partials, Weighable, require_linear
from fenics_contact.errors import InvalidDesignError, InvalidInputError, together
from fenics_contact.feti.decomposition import Decomposition
from fenics_contact.feti.subdomain import Subdomain
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.hanging import require_none
from fenics_contact.results.fields import body_mesh
from fenics_contact.results.state import State


@dataclass(frozen=True)
class _Nodes:
    """Some nodes: where they are in arrays of all and in distributed vectors of them alone."""

    comm: MPI.Comm
    rows: PETSc.IS
    here: np.ndarray

    @classmethod
    def chosen(cls, space: _dolfinx.fem.FunctionSpace, marks: np.ndarray) -> _Nodes:
        """Return the marked ones, marks of shape (n_nodes,). Collective."""
        nodes, dofs = _dolfinx.node_dofs(space)
        own = (dofs < space.dofmap.index_map.size_local) & marks[nodes]
        rows = _dolfinx.global_dofs(space, dofs[own])
        order, comm = np.argsort(rows), space.mesh.comm
        return cls(comm, PETSc.IS().createGeneral(rows[order].astype(PETSc.IntType), comm), nodes[own][order])

    def add(self, vector: PETSc.Vec, values: np.ndarray) -> None:
        """Add a vector to values at all nodes, shape (n_nodes,), on every rank. Collective."""
        for places, part in self.comm.allgather((self.here, vector.array_r)):
            values[places] += part


class _Component:
    """One component of the motion: at some nodes it is free, at others given, at the rest zero."""

    def __init__(
        self, space: _dolfinx.fem.FunctionSpace, matrix: PETSc.Mat, given: np.ndarray, free: np.ndarray
    ) -> None:
        """Factor the matrix of the free nodes. Collective."""
        self._given, self._free = _Nodes.chosen(space, given), _Nodes.chosen(space, free)
        inner = matrix.createSubMatrix(self._free.rows, self._free.rows)
        self._coupling = matrix.createSubMatrix(self._free.rows, self._given.rows)
        self._ksp = PETSc.KSP().create(inner.getComm())
        self._ksp.setOperators(inner)
        self._ksp.setType(PETSc.KSP.Type.PREONLY)
        self._ksp.getPC().setType(PETSc.PC.Type.LU)
        self._ksp.getPC().setFactorSolverType("mumps")
        self._ksp.setUp()
        owned = (self._ksp.getPC(), self._ksp, inner, self._coupling, self._free.rows, self._given.rows)
        # The mesh owns the communicator, which must not be freed before them.
        dispose_with(self, *owned, comm=space.mesh.comm, keep=space)

    def extend(self, values: np.ndarray) -> None:
        """Fill in the free nodes, of values at all nodes. Collective."""
        known, right = self._coupling.createVecs()
        solution = right.duplicate()
        known.array_w[:] = -values[self._given.here]
        self._coupling.mult(known, right)
        self._ksp.solve(right, solution)
        self._free.add(solution, values)
        for vector in (known, right, solution):
            vector.destroy()

    def pull_back(self, values: np.ndarray) -> None:
        """Add to derivatives at the given nodes those at the free ones that follow them. Collective."""
        known, right = self._coupling.createVecs()
        adjoint = right.duplicate()
        right.array_w[:] = -values[self._free.here]
        self._ksp.solve(right, adjoint)
        self._coupling.multTranspose(adjoint, known)
        self._given.add(known, values)
        for vector in (known, right, adjoint):
            vector.destroy()


@displayed
class MeshMotion:
    """Each component of the mesh displacement is as smooth as the mesh allows, in small cells above all.

    It minimises ∫ ∇v·∇v det(J)^(−χ) dx, J the Jacobian of the cells, prescribed on the design surface, zero
    where held: large cells give way and small ones keep their shape. On equal cells it is harmonic. Sides
    along which the surface moves stay flat. All is integrated over the reference mesh: the motion is linear
    in the surface displacement, and one factorisation serves all designs and, transposed, all gradients.
    `held`: components of nodes that do not move.

    References:
        Stein, Tezduyar and Benson, Mesh moving techniques for fluid-structure interactions with large
        displacements, J. Appl. Mech. 70 (2003), 58-63: stiffness by the Jacobian.
    """

    def _facts(self) -> dict[str, np.ndarray]:
        return {"moving": self.moving, "held": self.held}

    def __init__(
        self,
        decomposition: Decomposition,
        name: str,
        body: Body,
        moving: np.ndarray,
        held: np.ndarray,
        cut: tuple[np.ndarray, np.ndarray] | None = None,
        *,
        stiffening: float = 2.0,
    ) -> None:
        """Assemble and factor the stiffness of a mesh. Collective on the decomposition's communicator.

        `held`: components of nodes that do not move: all of them, or on a plane of symmetry the one across
        it; `cut`: where planes are not normal to the axes, which nodes lie on which plane, and their normals:
        there the mesh moves as it would without them, less the component across them, and the rest follows
        once more.
        """
        both = int(np.count_nonzero(held[moving].all(axis=1)))
        if both:
            nodes = counted(both, f"node of body {name!r} lies", f"nodes of body {name!r} lie")
            raise InvalidInputError(
                f"the design surface must keep away from supports, but {nodes} on both: choose another"
            )
        self.moving, self.held = moving, held
        mesh = body_mesh(decomposition, name, body)
        space = _dolfinx.scalar_space(mesh, 1)
        template = Template(mesh.comm, _stiffness(plain_element(body.mesh.cell_type), stiffening), ())
        matrix = _dolfinx.assemble_matrix(template.bind([space, space], ()))
        given = np.zeros(body.mesh.n_nodes, dtype=bool)
        given[moving] = True
        known: dict[bytes, _Component] = {}
        for column in held.T:
            key = column.tobytes()
            known[key] = known.get(key) or _Component(space, matrix, given, ~(given | column))
        self._components = [known[column.tobytes()] for column in held.T]
        self._cut, self._sliding = cut, np.zeros(0, dtype=np.int64)
        if cut is not None:
            tilted = cut[0][:, held.shape[1] :].any(axis=1)
            self._sliding = np.flatnonzero(tilted & ~given & ~held.all(axis=1))
            given[self._sliding] = True
            self._following = [_Component(space, matrix, given, ~(given | column)) for column in held.T]
        matrix.destroy()

    def extend(self, displacement: np.ndarray) -> np.ndarray:
        """Return the displacement of all nodes, shape (n_nodes, dim), from the moving ones'. Collective."""
        check_not_forked()
        result = np.zeros(self.held.shape)
        result[self.moving] = displacement
        for component, values in zip(self._components, result.T, strict=True):
            component.extend(values)
        if len(self._sliding) == 0:
            return result
        along = self._within(result[self._sliding])
        result[:] = 0.0
        result[self.moving], result[self._sliding] = displacement, along
        for component, values in zip(self._following, result.T, strict=True):
            component.extend(values)
        return result

    def _within(self, vectors: np.ndarray) -> np.ndarray:
        """Return vectors of the sliding nodes without their components across the planes."""
        assert self._cut is not None
        marks, planes = self._cut
        return within_planes(vectors, marks[self._sliding], planes)

    def pull_back(self, gradient: np.ndarray) -> np.ndarray:
        """Return the transpose of `extend` applied to nodal derivatives, (n_moving, dim). Collective."""
        check_not_forked()
        result = np.array(gradient, dtype=float)
        following = np.zeros((len(self.moving), result.shape[1]))
        if len(self._sliding):
            for component, values in zip(self._following, result.T, strict=True):
                component.pull_back(values)
            following = result[self.moving]
            along = self._within(result[self._sliding])
            result[:] = 0.0
            result[self._sliding] = along
        for component, values in zip(self._components, result.T, strict=True):
            component.pull_back(values)
        return np.asarray(result[self.moving] + following)


def _stiffness(element: Element, stiffening: float) -> ufl.Form:
    """Write ∫ ∇u · ∇v det(J)^(−χ) dx."""
    V, mesh = element.nodal, element.template
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    weight = abs(ufl.JacobianDeterminant(mesh)) ** (-stiffening)
    return weight * ufl.inner(ufl.grad(u), ufl.grad(v)) * volume_measure(element, 2)


def held_by_scene(scene: Scene, name: str, cut: np.ndarray) -> np.ndarray:
    """Return which components of the nodes of a body supports and joints hold in place, (n_nodes, dim).

    `cut`: which nodes lie on which plane of symmetry, along which they may move.
    """
    mesh, held = scene.bodies[name].mesh, cut[:, : scene.dim].copy()
    ends = [end for spring in scene.springs for end in spring.surfaces.values()]
    places = [(each.body, each.surface) for each in (*scene.supports, *scene.foundations)]
    for own, surface in (*places, *((end.body, end.name) for end in ends)):
        if own == name and surface in mesh.node_sets:
            held[mesh.node_sets[surface]] = True
        elif own == name:
            facets = mesh.surfaces[surface]
            held[facets[~cut[facets].all(axis=1).any(axis=1)]] = True
    for constraint in scene.constraints:
        for term in constraint.terms:
            if term.body == name:
                held[term.nodes_of(mesh)] = True
    for section in mesh.cuts.values():
        held[section.pairs] = True
    return held


def motion_of(decomposition: Decomposition, scene: Scene, design: SurfaceDesign) -> MeshMotion:
    """Return how the mesh of a body follows its design. Collective."""
    body, cut = scene.bodies[design.body], mirrored(scene, design.body)
    held = held_by_scene(scene, design.body, cut)
    held[design.nodes_beyond_transition(body.mesh, cut)] = True
    return moving_with(decomposition, scene, design.body, design.lattice.nodes, held)


def moving_with(
    decomposition: Decomposition, scene: Scene, name: str, moving: np.ndarray, held: np.ndarray
) -> MeshMotion:
    """Return how the mesh of a body follows some of its nodes, see `MeshMotion`. Collective."""
    planes = planes_of(scene)
    tilted = None if len(planes) == scene.dim else (mirrored(scene, name), planes)
    return MeshMotion(decomposition, name, scene.bodies[name], moving, held, tilted)


def moving_nodes(
    scene: Scene, designs: Sequence[SurfaceDesign], motions: Sequence[MeshMotion]
) -> dict[str, np.ndarray]:
    """Return which nodes of each body its designs move, body name -> marks, shape (n_nodes,)."""
    moving = {name: np.zeros(body.mesh.n_nodes, dtype=bool) for name, body in scene.bodies.items()}
    for design, motion in zip(designs, motions, strict=True):
        moving[design.body] |= ~motion.held.all(axis=1)
    return moving


def volume_of(scene: Scene, names: Sequence[str], numbers: NodeNumbers) -> tuple[float, np.ndarray]:
    """Return the volume of some bodies and its derivative by the nodes of all, (n_nodes, dim)."""
    total, by_points = 0.0, np.zeros((numbers.n_nodes, scene.dim))
    for name in names:
        body, mesh = scene.bodies[name], scene.bodies[name].mesh
        total += body.volume
        own = volume_by_points(mesh, body.kinematics.measure)
        by_points[numbers.global_nodes(name, np.arange(mesh.n_nodes))] = own
    return total, by_points


def volume_by_points(mesh: BodyMesh, measure: Measure = PLAIN) -> np.ndarray:
    """Return the derivative of the volume by every node, shape (n_nodes, 3), [length²]; in 2D of the area.

    Moving the boundary by v changes the volume by ∫ v·n dA, so that only boundary nodes count.
    """
    faces, _ = mesh.boundary
    result = np.zeros_like(mesh.points)
    for at in gauss_points(mesh.points, faces, measure):
        np.add.at(result, faces, at.values[:, None] * at.normals[:, None])
    return result


def require_movable(scene: Scene, what: str) -> None:
    """Reject scenes whose meshes cannot be moved; `what`: needs that."""
    for name, body in scene.bodies.items():
        require_none(
            body.mesh.followers, f"{what} with body {name!r}", "refine it everywhere, or take simplices"
        )
        if body.mesh.has_several_shapes:
            raise InvalidInputError(
                f"{what} needs bodies with one shape of cells, {name!r} has {body.mesh.cells_in_words}"
            )


def require_no_sectors(scene: Scene, what: str) -> None:
    """Reject cyclic symmetry; `what`: needs that."""
    if scene.sectors:
        raise InvalidInputError(
            f"{what} needs scenes without cyclic symmetry, got {scene.sectors[0].place}: model all, or a "
            "sector between planes of symmetry by Roller"
        )


def require_still_sectors(scene: Scene, moving: Mapping[str, np.ndarray]) -> None:
    """Reject designs that move a side of a sector, or have contact that goes on around it.

    `moving`: which nodes of each body move, as of `moving_nodes`.
    """
    touching = [side for pair in scene.contacts for side in pair.surfaces]
    for sector in scene.sectors:
        for side in sector.surfaces:
            mesh = scene.bodies[side.body].mesh
            nodes = mesh.nodes_of(side.name)
            moved = int(np.count_nonzero(moving[side.body][nodes]))
            own = (mesh.nodes_of(each.name) for each in touching if each.body == side.body)
            met = sum(len(np.intersect1d(nodes, theirs)) for theirs in own)
            if moved or met:
                found = f"{counted(moved, 'node')} that move and {counted(met, 'node')} in contact"
                raise InvalidInputError(
                    f"a design needs sides of sectors that stay and do not touch, {side.name!r} of "
                    f"{sector.place} has {found}: use a smaller transition, model the whole, or a sector "
                    "between planes of symmetry by Roller"
                )


class DesignGeometry:
    """The moving surfaces of a scene with their mesh motions, shared by all load cases of a design.

    `designs`: the moving surfaces; α is the concatenation of their variables.
    """

    def __init__(self, scene: Scene, decomposition: Decomposition, designs: Sequence[SurfaceDesign]) -> None:
        """Prepare the mesh motion. Collective on the decomposition's communicator."""
        require_movable(scene, "a design")
        self.designs = tuple(design.on(scene) for design in designs)
        self.size = sum(design.size for design in self.designs)
        self._bodies, self._decomposition = dict(scene.bodies), decomposition
        self.motions = [motion_of(decomposition, scene, design) for design in self.designs]
        self.moving = moving_nodes(scene, self.designs, self.motions)
        require_still_sectors(scene, self.moving)
        self.forms = ShapeForms(decomposition.comm, np.concatenate(list(self.moving.values())))
        self._points: tuple[np.ndarray, dict[str, np.ndarray]] = (np.zeros(0), {})
        self._last: tuple[np.ndarray, dict[str, Body]] = (np.zeros(0), {})

    def points_of(self, alpha: np.ndarray) -> dict[str, np.ndarray]:
        """Return the coordinates of the designed bodies; of the last design they are known. Collective."""
        alpha = checked_variables(alpha, self.size, self._decomposition.comm)
        if not np.array_equal(self._points[0], alpha):
            self._points = alpha.copy(), self._moved(alpha)
        return {name: points.copy() for name, points in self._points[1].items()}

    def _moved(self, alpha: np.ndarray) -> dict[str, np.ndarray]:
        points: dict[str, np.ndarray] = {}
        parts = np.split(alpha, np.cumsum([design.size for design in self.designs])[:-1])
        for design, motion, part in zip(self.designs, self.motions, parts, strict=True):
            start = points.get(design.body, self._bodies[design.body].mesh.points)
            points[design.body] = start + motion.extend(design.displacement(part))
        return points

    def scene_of(self, scene: Scene, alpha: np.ndarray) -> Scene:
        """Return a scene of these bodies in the shape of a design. Collective.

        The scenes of one design have the same meshes, so that they share matrices and factors.
        """
        if not np.array_equal(self._last[0], alpha):
            points = self.points_of(alpha)
            try:
                moved = scene.reshaped(points)
            except InvalidInputError as error:
                raise InvalidDesignError(f"the design cannot be meshed: {error}") from error
            self._last = np.array(alpha, dtype=float), dict(moved.bodies)
            return moved
        return replace(scene, bodies=self._last[1])

    def volume(self, scene: Scene) -> tuple[float, np.ndarray]:
        """Return the volume of the designed bodies, in the plane the area, and its gradient. Collective."""
        names = sorted({design.body for design in self.designs})
        total, by_points = volume_of(scene, names, self._decomposition.tearing)
        return total, self.pull_back(by_points)

    def pull_back(self, by_points: np.ndarray) -> np.ndarray:
        """Vector-Jacobian product of the nodes of all bodies with respect to α, replicated. Collective."""
        parts = []
        for design, motion in zip(self.designs, self.motions, strict=True):
            own = np.arange(self._bodies[design.body].mesh.n_nodes)
            nodes = self._decomposition.tearing.global_nodes(design.body, own)
            parts.append(design.pull_back(motion.pull_back(by_points[nodes])))
        return np.concatenate(parts)


Functions = Sequence["_dolfinx.fem.Function"]
Spaces = Sequence["_dolfinx.fem.FunctionSpace"]
#: Binds a functional to a subdomain, with Functions for its fields and spaces for its arguments.
Bind = Callable[[Subdomain, Functions, Spaces], "_dolfinx.fem.Form"]


@dataclass(frozen=True, eq=False)
class BodyIntegral:
    """∫ of a density over one body of a state.

    `of_cells`: its fields, rows for all cells of the body.
    """

    state: State
    forms: ShapeForms
    density: Density
    body: str
    of_cells: tuple[np.ndarray, ...] = ()

    def __call__(self, *numbers: float) -> float:
        """Integrate with values of the density's constants. Collective."""
        bind, state = self._prepare("value", numbers), self.state
        total = 0.0
        for subdomain, functions in subdomain_fields(state.torn, [state.torn_displacement]):
            if subdomain.mesh.body == self.body:
                total += _dolfinx.assemble_scalar(bind(subdomain, functions, []))
        return float(state.torn.decomposition.comm.allreduce(total))

    def derivatives(self, *numbers: float) -> dict[str, np.ndarray]:
        """Return the derivatives by displacements and shape, by UFL. Collective."""
        torn, u = self.state.torn, self.state.torn_displacement
        by_displacement = self._prepare("displacement", numbers)

        def assemble(bind: Bind, subdomain: Subdomain, functions: Functions) -> np.ndarray:
            if subdomain.mesh.body != self.body:
                return np.zeros(subdomain.mesh.size)
            return _dolfinx.assemble_vector(bind(subdomain, functions, [subdomain.mesh.space]))

        gradient = [assemble(by_displacement, *each) for each in subdomain_fields(torn, [u])]
        moving = np.zeros((torn.decomposition.tearing.n_nodes, torn.components))
        if not self.forms.nothing_moves:
            by_shape = self._prepare("shape", numbers)
            moving = sum_over_subdomains(torn, [u], partial(assemble, by_shape), self.forms.moving)
            moving = moving + self._by_heat(numbers)
        return {"by_displacement": np.concatenate(gradient), "by_shape": moving}

    def _by_heat(self, numbers: tuple[float, ...]) -> np.ndarray | float:
        """Return the derivative by the places at which temperatures are evaluated. Collective."""
        torn, heated = self.state.torn, temperature_of(self.state.scene.loads, self.body).of_position
        if not heated:
            return 0.0
        by_temperature, moving = self._prepare("temperature", numbers), self.forms.moving

        def assemble(subdomain: Subdomain, functions: Functions) -> np.ndarray:
            if subdomain.mesh.body != self.body:
                return np.zeros(subdomain.mesh.size)
            space = _dolfinx.scalar_space(subdomain.mesh.space.mesh, 1)
            by_values = _dolfinx.assemble_vector(by_temperature(subdomain, functions, [space]))
            parts = [field_by_places(torn, subdomain, load, space, by_values, moving) for load in heated]
            return np.sum(parts, axis=0)

        with together(torn.decomposition.comm):
            return sum_over_subdomains(torn, [self.state.torn_displacement], assemble, moving)

    def _prepare(self, by: str, numbers: tuple[float, ...]) -> Bind:
        """Compile the integral or a derivative, return a function that binds it to subdomains. Collective."""
        body = self.state.scene.bodies[self.body]
        element, temperature = body.element, temperature_of(self.state.scene.loads, self.body)
        for materials in sets_in_use(self.state.torn, self.body):
            self.forms.functional(self.density, materials, element, by, temperature)

        def bind(subdomain: Subdomain, functions: Functions, spaces: Spaces) -> _dolfinx.fem.Form:
            parts, mesh = subdomain.material, subdomain.mesh.space.mesh
            template = self.forms.functional(self.density, parts.materials, element, by, temperature)
            points = body.mesh.points[np.sort(subdomain.mesh.nodes)]
            known = [
                _dolfinx.cell_field(mesh, "of_cells", own[subdomain.mesh.cells]) for own in self.of_cells
            ]
            fields = [*functions, *known, *temperature.fields(mesh, points)]
            values = (*numbers, *temperature.numbers, *parts.parameters)
            return template.bind(spaces, values, fields, mesh=mesh, cells=parts.cells)

        return bind


def require_body(state: State, what: str, body: str) -> None:
    """Check the name of a body."""
    bodies = state.scene.bodies
    if body not in bodies:
        raise InvalidInputError(
            f"{what}.body must name a body of the scene, got {body!r}, there are {sorted(bodies)}"
        )


@dataclass(frozen=True)
class VolumeIntegral(Weighable):
    """J = ∫ integrand(u, x, σ) dx over one body.

    Attributes:
        name: Its name among compiled forms.
        integrand: Takes displacement, coordinates and stress (UFL; without thermal stress), returns a UFL
            scalar.
        body: Name of the body.

    Example:
        >>> import ufl
        >>> VolumeIntegral("motion", lambda u, x, stress: ufl.inner(u, u), "link2").body
        'link2'
    """

    name: str
    integrand: Integrand
    body: str

    def value(self, state: State, forms: ShapeForms) -> float:
        """Integrate. Collective."""
        return self._on(state, forms)()

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Differentiate the integral by UFL."""
        integral = self._on(state, forms)
        return Partials.of(state, integral(), **integral.derivatives())

    def _on(self, state: State, forms: ShapeForms) -> BodyIntegral:
        require_linear(state, self)
        require_body(state, "VolumeIntegral", self.body)
        return BodyIntegral(state, forms, Density(self.name, self.integrand), self.body)
