"""One subdomain: its own mesh on one rank, its stiffness, load and kernel."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from hashlib import blake2b
from typing import TYPE_CHECKING, ClassVar, Protocol, TypeAlias

import numpy as np
import scipy.sparse as sp

from fenics_contact import _dolfinx
from fenics_contact._base.csr import Csr
from fenics_contact._base.display import displayed
from fenics_contact._fem.composition import Composition, composition
from fenics_contact._fem.forms import FormLibrary
from fenics_contact._fem.load_forms import has_work, loaded_cells
from fenics_contact._fem.model_checks import check_kernel, kernel_of
from fenics_contact._kinematics.base import Kinematics
from fenics_contact._scene.body import Body
from fenics_contact._scene.foundations import ElasticFoundation
from fenics_contact._scene.load_part import SurfaceLoad
from fenics_contact._scene.loads import (
    Load,
    PointForce,
    initial_stress,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.by_shape import BY_MATRIX, ByMatrix, ByShape, Families
from fenics_contact.feti.factor import fixing_nodes
from fenics_contact.feti.following import AnyFollowing, Following
from fenics_contact.feti.foundations import by_resistance, by_stiffness, foundation_stiffness
from fenics_contact.feti.nearby import ToleranceIndex
from fenics_contact.materials.elastic import Material, is_isotropic
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.collapsed import expanded
from fenics_contact.mesh.faces import coordinate_rounding, corners_of, match_faces

if TYPE_CHECKING:
    from fenics_contact._fem.mechanics import Mechanics


class LocalOperator(Protocol):
    """A factored subdomain. Its *interface* are the dofs that B touches.

    With K⁺ a symmetric generalised inverse of the stiffness K and S the Schur complement of K on the
    interface b.
    """

    @property
    def flops(self) -> tuple[int, int]:
        """Floating point operations of `apply_flexibility` and of `apply_stiffness`."""

    @property
    def interface_stiffness(self) -> sp.csr_matrix:
        """K_bb, shape (n_b, n_b)."""

    def apply_flexibility(self, force: np.ndarray, displacement: np.ndarray) -> None:
        """Write (K⁺)_bb times an interface force, shape (n_b,), into ``displacement``."""

    def apply_flexibility_exactly(self, force: np.ndarray, displacement: np.ndarray) -> None:
        """Write the same in double precision, however it is stored."""

    def apply_stiffness(self, displacement: np.ndarray, force: np.ndarray) -> None:
        """Write S, or a close approximation, times an interface displacement into ``force``."""

    def extend(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the displacement of least energy for one of the interface, and the interface force for it.

        Both in double precision. Returns the displacement, w itself on the interface and −K_ii⁻¹ K_ib w
        inside, shape (n,), and S w, shape (n_b,).
        """

    def invert(self, right: np.ndarray) -> np.ndarray:
        """Return K⁺ times a vector, shape (n,)."""

    def row_flexibility(self, rows: sp.csr_matrix) -> np.ndarray:
        """Return bᵀ (K⁺)_bb b for each row b of a matrix with interface columns, shape (n_rows,)."""


def interface_dofs(
    touched: np.ndarray, kernel: np.ndarray, points: np.ndarray, rank_tolerance: float = 1e-6
) -> np.ndarray:
    """Return the dofs that B touches, and a few more if fixing these does not prevent rigid motions.

    With the interface fixed the inside must have no rigid motion, or K_ii would be singular.
    `rank_tolerance`: singular values of the kernel's trace on an interface below this count as zero: the
    modes have length one.
    """
    modes, _ = np.linalg.qr(kernel)
    trace = np.linalg.svd(modes[touched], compute_uv=False)
    # A body on an elastic bed may have no contact at all, but the interface must not be empty.
    if not touched.any() or np.count_nonzero(trace > rank_tolerance) < kernel.shape[1]:
        touched = touched.copy()
        touched.reshape(len(points), -1)[fixing_nodes(points)] = True
    return np.flatnonzero(touched)


@displayed
@dataclass(frozen=True)
class SubdomainMesh:
    """The part of a subdomain that does not depend on the geometry: mesh, numbering, tagged facets.

    Blocks of dofs, one dof per component, are numbered as dolfinx numbers them. `nodes`: nodes of the body,
    by block: block b sits on node ``nodes[b]``; `space`: dolfinx function space of displacements on a mesh of
    its own, or one that subdomains with cells connected alike share: nodes are where who assembled last has
    moved them; `facets`: surface of the body -> (cells, local facets) on this mesh; `facets_of` adds to it.
    """

    number: int
    body: str
    cells: np.ndarray
    nodes: np.ndarray
    space: _dolfinx.fem.FunctionSpace
    facets: dict[str, tuple[np.ndarray, np.ndarray]]
    following: AnyFollowing

    #: Whether the cells are those of the body.
    has_own_cells: ClassVar[bool] = True

    def blocks_of_cells(self, cells: np.ndarray) -> np.ndarray:
        """Return the blocks at the nodes of each of the cells, given those of the body, (n_cells, k)."""
        order = np.argsort(self.nodes)
        return np.asarray(order[np.searchsorted(self.nodes, cells[self.cells], sorter=order)])

    def portion(self, whole: BodyMesh) -> np.ndarray:
        """Return its cells among those of the body at each of its nodes, (n_blocks,)."""
        own = np.bincount(self.blocks_of_cells(whole.cells).ravel(), minlength=len(self.nodes))
        return np.asarray(own / whole.cells_at_nodes[self.nodes])

    def by_input_node(self, values: np.ndarray) -> np.ndarray:
        """Return values by input node of the dolfinx mesh of those by block, (n_blocks, ...)."""
        return values[np.argsort(self.nodes)]

    def from_input_node(self, values: np.ndarray) -> np.ndarray:
        """Return what does the same work on values by block as these on values by input node, (n, ...)."""
        return values[np.argsort(np.argsort(self.nodes))]

    def acted(self, nodes: np.ndarray) -> np.ndarray:
        """Return which input nodes of the dolfinx mesh lie on some nodes of the body, bool, (n,)."""
        return np.isin(self.nodes, nodes)[np.argsort(self.nodes)]

    def on_space(self, values: np.ndarray) -> np.ndarray:
        """Return values of dolfinx's dofs by those of the dofs, (size,)."""
        return values

    def force_of(self, assembled: np.ndarray) -> np.ndarray:
        """Return a vector of the dofs by one that dolfinx has assembled."""
        return assembled

    def matrix_of(self, assembled: sp.csr_matrix) -> sp.csr_matrix:
        """Return a matrix of the dofs by one that dolfinx has assembled."""
        return assembled

    def answering(self, mechanics: Mechanics) -> Mechanics:
        """Return the mechanics of the dofs by those of dolfinx's."""
        return mechanics

    @property
    def components(self) -> int:
        """Displacement components of a node, the length of a block."""
        return int(self.space.dofmap.index_map_bs)

    @property
    def size(self) -> int:
        """Number of dofs."""
        return self.components * len(self.nodes)

    def facets_of(self, body: Body, surface: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the part of a surface of the body that lies on this mesh: cells, local facets."""
        if surface not in self.facets:
            self.facets[surface] = self._matched(body, corners_of(body.mesh.surfaces[surface], body.mesh.dim))
        return self.facets[surface]

    def _matched(self, body: Body, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        used = np.sort(self.nodes)
        inside = np.isin(facets, used).all(axis=1)
        return _dolfinx.match_facets(self.space.mesh, np.searchsorted(used, facets[inside]))


@displayed
@dataclass(frozen=True)
class MixedMesh(SubdomainMesh):
    """A subdomain whose cells of several shapes are hexahedra: values at its nodes are at the nodes of these.

    `on_input`: values by input node of the dolfinx mesh by those by block, shape (n_input, n_blocks);
    `on_dofs`: values of dolfinx's dofs by those of the subdomain's, shape (n, components · n_blocks).
    """

    has_own_cells = False

    on_input: sp.csr_matrix
    on_dofs: sp.csr_matrix

    def by_input_node(self, values: np.ndarray) -> np.ndarray:
        """Return values by input node of the dolfinx mesh of those by block."""
        return np.asarray(self.on_input @ values)

    def from_input_node(self, values: np.ndarray) -> np.ndarray:
        """Return what does the same work on values by block as these on values by input node."""
        return np.asarray(self.on_input.T @ values)

    def acted(self, nodes: np.ndarray) -> np.ndarray:
        """Return which input nodes of the dolfinx mesh depend on some nodes of the body alone."""
        return np.asarray(abs(self.on_input) @ (~np.isin(self.nodes, nodes)).astype(float) == 0.0)

    def on_space(self, values: np.ndarray) -> np.ndarray:
        """Return values of dolfinx's dofs by those of the dofs."""
        return np.asarray(self.on_dofs @ values)

    def force_of(self, assembled: np.ndarray) -> np.ndarray:
        """Return a vector of the dofs by one that dolfinx has assembled."""
        return np.asarray(self.on_dofs.T @ assembled)

    def matrix_of(self, assembled: sp.csr_matrix) -> sp.csr_matrix:
        """Return a matrix of the dofs by one that dolfinx has assembled."""
        return (self.on_dofs.T @ assembled @ self.on_dofs).tocsr()

    def answering(self, mechanics: Mechanics) -> Mechanics:
        """Return the mechanics of the dofs by those of dolfinx's."""
        from fenics_contact._fem.mechanics import DependentDofs  # of large deformations alone

        return DependentDofs(mechanics, self.on_dofs)

    def _matched(self, body: Body, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        columns = _dolfinx.facet_corners(body.mesh.cell_type)
        faces = body.mesh.cells[self.cells][:, columns].reshape(-1, columns.shape[1])
        here = np.flatnonzero(match_faces(faces, facets) >= 0)
        return here // len(columns), here % len(columns)


@displayed
@dataclass(frozen=True)
class Subdomain:
    """A subdomain with its matrices for one geometry and one load.

    Those that differ only in their loads share one `matrix`. `load`: f_s; `kernel`: R_s: zero-energy modes as
    columns; `typical_stiffness`: mean diagonal entry of K_s without foundations; `resisted`: motions that
    foundations, springs of a tool or hoop strains alone resist, as columns, shape (dim n, r); `resistance`:
    RᵀK R of each of these, shape (r,); `shape`: what the stiffness is compared by.
    """

    mesh: SubdomainMesh
    material: Composition
    foundations: tuple[ElasticFoundation, ...]
    loads: tuple[Load, ...]
    points: np.ndarray
    load: np.ndarray
    kernel: np.ndarray
    typical_stiffness: float
    matrix: CachedMatrix
    resisted: np.ndarray
    resistance: np.ndarray
    springs: tuple[float, ...] = ()
    shape: ByMatrix = BY_MATRIX

    @property
    def stiffness(self) -> sp.csr_matrix:
        """K_s, shape (dim n, dim n); reassembled if it was freed."""
        return self.matrix.get()


class CachedMatrix:
    """A matrix that can be rebuilt, so that it need not be stored while unused."""

    def __init__(self, make: Callable[[], sp.csr_matrix]) -> None:
        """Build it when it is first needed."""
        self._make = make
        self._matrix: sp.csr_matrix | None = None

    def get(self) -> sp.csr_matrix:
        """Return the matrix, rebuilt if necessary, and store it."""
        if self._matrix is None:
            self._matrix = self._make()
        return self._matrix

    @property
    def held(self) -> bool:
        """Whether it is stored now."""
        return self._matrix is not None

    def forget(self) -> None:
        """Free the memory."""
        self._matrix = None


class Alone:
    """Subdomains whose matrices serve no others."""

    def add(self, subdomain: Subdomain) -> None:
        """Add none."""

    def same_as(self, mesh: SubdomainMesh, parts: Composition, points: np.ndarray) -> Subdomain | None:
        """Return none."""
        return None

    def shape(self, mesh: SubdomainMesh, body: Body, parts: Composition, points: np.ndarray) -> ByMatrix:
        """Return what the stiffness of a subdomain at points is compared by."""
        return BY_MATRIX


ALONE = Alone()


class Assembled(Alone):
    """Subdomains assembled so far; their matrices serve others that are the same but for a translation."""

    def __init__(self) -> None:
        """Start empty."""
        # By space: subdomains with cells connected and numbered alike share one.
        self._known: dict[int, ToleranceIndex[Subdomain]] = defaultdict(ToleranceIndex)
        self._families = Families()

    def add(self, subdomain: Subdomain) -> None:
        """Add a subdomain whose matrix depends on cells, numbering, materials and shape alone."""
        self._families.add(subdomain.shape.family)
        shape = _from_own_origin(subdomain.points)
        self._known[id(subdomain.mesh.space)].add(float(np.abs(shape).sum()), subdomain)

    def same_as(self, mesh: SubdomainMesh, parts: Composition, points: np.ndarray) -> Subdomain | None:
        """Return one with the same cells, numbering and materials, and the same points but for a translation.

        Coordinates may differ in their last digits: no mesh knows its shape better than these.
        """
        shape, rounding = _from_own_origin(points), coordinate_rounding(points)
        room = shape.size * rounding
        for other in self._known[id(mesh.space)].near(float(np.abs(shape).sum()), room):
            apart = np.abs(_from_own_origin(other.points) - shape).max()
            follow_alike = mesh.following.same_as(other.mesh.following)
            if apart <= rounding and other.material.same_as(parts) and follow_alike:
                return other
        return None

    def shape(self, mesh: SubdomainMesh, body: Body, parts: Composition, points: np.ndarray) -> ByMatrix:
        """Return the shape where the material has no directions and no node follows others."""
        plain = len(parts.materials) == 1 and is_isotropic(parts.materials[0]) and mesh.has_own_cells
        if not plain or mesh.following.apart.shape[0] or mesh.components != points.shape[1]:
            return BY_MATRIX
        cells = partial(mesh.blocks_of_cells, body.mesh.cells)
        return ByShape(self._families.of((body.element, parts.materials), points, cells()), cells)


def cut_out(
    number: int,
    body_name: str,
    body: Body,
    cells: np.ndarray,
    spaces: dict[bytes, _dolfinx.fem.FunctionSpace],
) -> SubdomainMesh:
    """Build the mesh of one subdomain.

    `spaces`: those built so far, to which its own is added. Subdomains whose cells are connected alike share
    one: whoever assembles on it moves its nodes first.
    """
    mesh = body.mesh
    used, local = np.unique(mesh.cells[cells], return_inverse=True)
    local = local.reshape(len(cells), -1).astype(np.int32)
    key = blake2b(f"{body.element.name} {body.components}".encode() + local.tobytes()).digest()
    several = expanded(local.astype(np.int64), len(used), mesh.dim)
    if key not in spaces:
        points = mesh.points[used]
        if several is not None:
            local, points = several[0], several[1] @ points
        own = _dolfinx.local_mesh(points, local, mesh.cell_type)
        spaces[key] = _dolfinx.coefficient(own, "u", body.components).function_space
    space = spaces[key]
    input_nodes, dofs = _dolfinx.node_dofs(space)
    cells = cells[_dolfinx.input_cells(space.mesh)]
    if several is not None:
        by_dof = np.empty(len(dofs), dtype=np.int64)
        by_dof[dofs] = input_nodes
        on_dofs = sp.kron(several[1][by_dof], sp.identity(body.components), format="csr")
        following = Following.of(mesh, used, body.components)
        return MixedMesh(number, body_name, cells, used, space, {}, following, several[1], on_dofs)
    nodes = np.empty(len(used), dtype=np.int64)
    nodes[dofs] = used[input_nodes]
    return SubdomainMesh(
        number, body_name, cells, nodes, space, {}, Following.of(mesh, nodes, body.components)
    )


def assemble(
    mesh: SubdomainMesh,
    body: Body,
    loads: Sequence[Load],
    forms: FormLibrary,
    earlier: Subdomain | None = None,
    foundations: Sequence[ElasticFoundation] = (),
    *,
    assembled: Alone = ALONE,
) -> Subdomain:
    """Assemble K_s, f_s and R_s for the present coordinates of ``body``.

    `assembled`: others, whose matrices are used where they are the same; this one is added.
    """
    parts = composition(body, mesh.cells)
    beds = tuple(each for each in foundations if each.body == mesh.body)
    points = body.mesh.points[mesh.nodes]
    acting = tuple(load for load in loads if _acts(load, mesh, body))
    if not _depends_on_shape_alone(body, parts, forms, beds):
        assembled = ALONE
    now = parts, points, beds, body.springs
    if earlier is not None and _same_stiffness(earlier, *now):
        assembled.add(earlier)
    else:
        earlier = _with_stiffness(mesh, body, forms, *now, assembled)
    if earlier.loads == acting:
        return earlier
    force = np.zeros(mesh.size)
    for load in acting:
        for forces in load.at_points:
            force += _at_points(forces, mesh, body)
        if load.at_points or not has_work(load, parts.materials):
            continue
        facets, acted = None, None
        if isinstance(load, SurfaceLoad):
            facets = mesh.facets_of(body, load.surface)
            acted = mesh.acted(body.mesh.surfaces[load.surface])
        places = mesh.by_input_node(points)
        cells, of_cells = loaded_cells(load, parts, body, mesh.cells), None
        for stress in load.stresses:
            of_cells = initial_stress([stress], body)[mesh.cells]
        absolute = load.is_ufl or _varies(parts, body, forms)
        coordinates = places if absolute else _from_own_origin(places)
        _dolfinx.update_coordinates(mesh.space.mesh, coordinates)
        for thickness, on in _by_thickness(load, mesh, body, facets):
            form = forms.load(load, parts, body.element, mesh.space, places, on, acted, cells, of_cells)
            force += thickness * mesh.force_of(_dolfinx.assemble_vector(form))
    _check_finite(force, mesh)
    return replace(earlier, loads=acting, load=mesh.following.force(force))


_Facets: TypeAlias = tuple[np.ndarray, np.ndarray] | None


def _by_thickness(
    load: Load, mesh: SubdomainMesh, body: Body, facets: _Facets
) -> Iterator[tuple[float, _Facets]]:
    """Yield the thicknesses of what a load acts on, and its facets there; ones without a thickness."""
    if load.by_materials or not body.has_thickness:
        yield 1.0, facets  # the material has it
        return
    thickness = body.thickness_of_cells
    if facets is None:
        yield float(thickness[body.mesh.regions[load.on_region][0] if load.on_region else 0]), None
        return
    here = thickness[mesh.cells[facets[0]]]
    for each in np.unique(here):
        yield float(each), (facets[0][here == each], facets[1][here == each])


def _at_points(load: PointForce, mesh: SubdomainMesh, body: Body) -> np.ndarray:
    """Return the share of a subdomain in forces at nodes, by dof: that of its cells among those at a node."""
    loaded = np.isin(mesh.nodes, body.mesh.nodes_of(load.nodes))
    share = mesh.portion(body.mesh)[loaded, None]
    force = np.zeros((len(mesh.nodes), body.components))
    force[loaded] = load.at(body.mesh.points[mesh.nodes[loaded]], body.components) * share
    return force.ravel()


def _acts(load: Load, mesh: SubdomainMesh, body: Body) -> bool:
    if load.body != mesh.body:
        return False
    if load.at_points:
        return bool(np.isin(load.nodes_in(body.mesh), mesh.nodes).any())
    if load.on_region:
        return bool(np.isin(mesh.cells, body.mesh.regions[load.on_region]).any())
    return not isinstance(load, SurfaceLoad) or len(mesh.facets_of(body, load.surface)[0]) > 0


def _same_stiffness(
    earlier: Subdomain,
    parts: Composition,
    points: np.ndarray,
    beds: tuple[ElasticFoundation, ...],
    springs: tuple[float, ...],
) -> bool:
    same = earlier.foundations == beds and earlier.springs == springs
    return same and earlier.material.same_as(parts) and np.array_equal(earlier.points, points)


def _with_stiffness(
    mesh: SubdomainMesh,
    body: Body,
    forms: FormLibrary,
    parts: Composition,
    points: np.ndarray,
    foundations: tuple[ElasticFoundation, ...],
    springs: tuple[float, ...],
    assembled: Alone,
) -> Subdomain:
    """Return the subdomain without loads."""
    kernel = kernel_of_body(body, points, parts.materials).reshape(mesh.size, -1)
    nothing = np.zeros(mesh.size)
    twin = assembled.same_as(mesh, parts, points)
    if twin is not None:
        return replace(twin, mesh=mesh, loads=(), points=points, load=nothing, kernel=kernel)
    shape = assembled.shape(mesh, body, parts, points)
    space, element = mesh.space, body.element
    by_input_node = mesh.by_input_node(points)
    if not _varies(parts, body, forms):
        by_input_node = _from_own_origin(by_input_node)

    def stiffness() -> sp.csr_matrix:
        _dolfinx.update_coordinates(space.mesh, by_input_node)
        indptr, indices, data = _dolfinx.assemble_csr(forms.stiffness(parts, element, space))
        elastic = mesh.matrix_of(Csr((data, indices, indptr)))
        whole = (elastic + bed).tocsr() if bed.nnz else elastic
        return mesh.following.stiffness(body.sprung(whole, points))

    bed = foundation_of(mesh, body, foundations)
    matrix = CachedMatrix(stiffness)
    modes = np.concatenate([kernel, body.sprung_modes(points).reshape(mesh.size, -1)], axis=1)
    kernel, resisted, resistance = by_resistance(body.sprung(bed, points), modes)
    nearly = body.kinematics.nearly_rigid(points).reshape(mesh.size, -1)
    if nearly.shape[1] and not body.is_rigid:
        resisted, resistance = by_stiffness(matrix.get(), np.hstack([resisted, nearly]), kernel)

    def typical() -> float:
        K = matrix.get()
        _check_finite(K.data, mesh)
        check_kernel(K, kernel, f"subdomain {mesh.number} of body {mesh.body!r}")
        return float((K.diagonal() - bed.diagonal()).mean())

    found = Subdomain(
        mesh, parts, foundations, (), points, nothing, kernel, shape.typical_stiffness(typical), matrix,
        resisted, resistance, springs, shape,
    )  # fmt: skip
    assembled.add(found)
    return found


def _depends_on_shape_alone(
    body: Body, parts: Composition, forms: FormLibrary, beds: Sequence[ElasticFoundation]
) -> bool:
    """Return whether the stiffness depends on cells, numbering, materials and shape, but not on the place."""
    special = bool(beds) or body.is_rigid or bool(body.springs)
    return body.kinematics.is_homogeneous and not (special or _varies(parts, body, forms))


def foundation_of(mesh: SubdomainMesh, body: Body, foundations: Sequence[ElasticFoundation]) -> sp.csr_matrix:
    """Return the stiffness of the foundations under a subdomain, shape (size, size)."""
    beds = [each for each in foundations if each.body == mesh.body]
    if not beds:
        return Csr((mesh.size, mesh.size))
    dofs = (mesh.components * mesh.nodes[:, None] + np.arange(mesh.components)).ravel()
    return foundation_stiffness(beds, body, mesh.cells)[dofs][:, dofs].tocsr()


def _varies(parts: Composition, body: Body, forms: FormLibrary) -> bool:
    """Return whether the materials of a mesh depend on position."""
    return any(forms.varies(material, body.element) for material in parts.materials)


def _from_own_origin(points: np.ndarray) -> np.ndarray:
    """Return coordinates relative to one of the points: as exact far from the origin as near it."""
    return np.asarray(points - points[0])


def kernel_of_body(body: Body, points: np.ndarray, materials: Sequence[Material]) -> np.ndarray:
    """Return the modes without energy of a body at points, (n, dim, n_modes)."""
    return body.kernel(points, lambda places: common_kernel(materials, places, body.kinematics))


def common_kernel(materials: Sequence[Material], points: np.ndarray, kinematics: Kinematics) -> np.ndarray:
    """Return the modes without energy of a body of several materials at points, (n, components, n_modes)."""
    # A motion without energy has none in any of the materials.
    every = (kernel_of(material, points, kinematics) for material in materials)
    return min(every, key=lambda modes: modes.shape[-1])


def _check_finite(values: np.ndarray, mesh: SubdomainMesh) -> None:
    if not np.isfinite(values).all():
        raise InvalidInputError(
            f"subdomain {mesh.number} of body {mesh.body!r} must be finite, got NaN: check material and loads"
        )
