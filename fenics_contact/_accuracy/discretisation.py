"""Recovery-based estimate of the discretisation error of a displacement."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeAlias

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact import _dolfinx
from fenics_contact._accuracy.recovery import find_sites, recovered_gradients
from fenics_contact._base.display import displayed
from fenics_contact._base.libraries import MPI
from fenics_contact._fem.composition import Composition
from fenics_contact._fem.forms import FormLibrary
from fenics_contact._fem.model_checks import stiffness_of_cell
from fenics_contact._fem.templates import (
    Template,
    Written,
    scalar_constants,
    volume_measure,
)
from fenics_contact._kinematics.element import Element
from fenics_contact._kinematics.integration import FULL
from fenics_contact._scene.body import Body
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.averages import nodal_mean
from fenics_contact.feti.subdomain import Subdomain
from fenics_contact.feti.torn import TornSystem
from fenics_contact.materials.elastic import Material
from fenics_contact.mesh.cell_types import CELL_TYPES, CellType, quadrature, shape_gradients, shape_values
from fenics_contact.mesh.collapsed import as_hexahedra, places_of
from fenics_contact.mesh.quality import determinants


def moduli(forms: FormLibrary, material: Material, element: Element) -> np.ndarray:
    """Return C of C g : g, twice the energy per volume of a displacement gradient g.

    A material only defines a bilinear form of displacements, and its stress may be any UFL. On a cell with
    the displacement g x it stores C g : g times the volume. Some materials resist displacements, too: that
    contribution scales with the square of the cell size and is eliminated by two sizes. The result has shape
    (dim², dim²), g_kj at index dim k + j, [force / length²].
    """
    parts, cell = Composition((material,)), element.cell

    def bind(space: _dolfinx.fem.FunctionSpace) -> _dolfinx.fem.Form:
        return forms.stiffness(parts, element, space)

    def on_cell_of(size: float) -> np.ndarray:
        K, points = stiffness_of_cell(size * cell.nodes, element, bind)
        n, dim = points.shape
        motions = np.einsum("ki,nj->nikj", np.eye(dim), points).reshape(n * dim, dim * dim)
        return np.asarray(motions.T @ K @ motions / (cell.reference_volume * size**dim))

    return np.asarray((4 * on_cell_of(0.5) - on_cell_of(1.0)) / 3)


def energy_of_difference(
    moduli: np.ndarray, cell_type: str, points: np.ndarray, displacement: np.ndarray, gradient: np.ndarray
) -> np.ndarray:
    """Return ∫ C (g − ∇u) : (g − ∇u) over each of some cells of one material."""
    cell = CELL_TYPES[cell_type]
    integrate = _over_simplices if cell.is_affine else _by_quadrature
    return integrate(moduli, cell, points, displacement, gradient)


def _over_simplices(
    moduli: np.ndarray, cell: CellType, points: np.ndarray, displacement: np.ndarray, gradient: np.ndarray
) -> np.ndarray:
    """The difference d is linear: ∫ C d : d = |K| (Σ C d_v : d_v + C Σd_v : Σd_v) / (m (m + 1))."""
    n, m, _ = points.shape
    (slopes,) = shape_gradients(cell, cell.vertices[:1])
    of_cells, jacobian = _cell_gradients(points, displacement, slopes)
    difference = (gradient - of_cells[:, None]).reshape(n, m, -1)
    difference = np.concatenate([difference, difference.sum(axis=1, keepdims=True)], axis=1)
    density = np.einsum("nva,nva->n", difference @ moduli, difference)
    return np.asarray(cell.reference_volume * jacobian * density / (m * (m + 1)))


def _by_quadrature(
    moduli: np.ndarray, cell: CellType, points: np.ndarray, displacement: np.ndarray, gradient: np.ndarray
) -> np.ndarray:
    """Exact where the map from the reference cell is affine."""
    positions, weights = quadrature(cell)
    values, slopes = shape_values(cell, positions), shape_gradients(cell, positions)
    total = np.zeros(len(points))
    for weight, value, slope in zip(weights, values, slopes, strict=True):  # a few points, all cells at once
        of_cells, jacobian = _cell_gradients(points, displacement, slope)
        difference = (np.tensordot(gradient, value, axes=(1, 0)) - of_cells).reshape(len(points), -1)
        total += weight * jacobian * np.einsum("na,na->n", difference @ moduli, difference)
    return total


def _cell_gradients(
    points: np.ndarray, displacement: np.ndarray, slopes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return ∇u and the Jacobian determinant of cells at one point, shapes (n, dim, dim) and (n,)."""
    jacobian = np.matmul(points.transpose(0, 2, 1), slopes)
    determinant, adjugate = determinants(jacobian), _adjugate(jacobian)
    along = np.matmul(displacement.transpose(0, 2, 1), slopes)
    return np.matmul(along, adjugate) / determinant[:, None, None], determinant


def _adjugate(matrices: np.ndarray) -> np.ndarray:
    """Return inverse times determinant of small matrices, shape (n, dim, dim)."""
    if matrices.shape[1] == 2:
        (a, b), (c, d) = matrices.transpose(1, 2, 0)
        return np.stack([np.stack([d, -b], axis=1), np.stack([-c, a], axis=1)], axis=1)
    a, b, c = matrices.transpose(1, 0, 2)
    return np.stack([_cross(b, c), _cross(c, a), _cross(a, b)], axis=2)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of rows; NumPy's own is dominated by its overhead."""
    ahead, behind = [1, 2, 0], [2, 0, 1]
    return np.asarray(a[:, ahead] * b[:, behind] - a[:, behind] * b[:, ahead])


#: Degree of the quadrature on linear cells, where both gradients are of first degree in each coordinate; it
#: is doubled on quadratic ones.
DEGREE = 2


def compile_energy(forms: FormLibrary, material: Material, element: Element) -> Template:
    """Compile the energy of a material unless that was done. Collective."""
    key = ("energy of a difference", material, element)
    name = ("energy of a difference", type(material), element.name)
    return forms.templates.get(key, name, partial(_write, material, element))


def _write(material: Material, element: Element) -> Written:
    """Return ∫ C (g − ∇u) : (g − ∇u) over each cell, with the rows of g and u as coefficients."""
    dim = element.dim
    u, *rows = element.fields(element.components + 1)
    q = ufl.TestFunction(element.cellwise())
    parameters = scalar_constants(element, len(material.parameters))
    difference = ufl.as_tensor([[row[j] for j in range(dim)] for row in rows]) - ufl.grad(u)
    # At the points of reduced integration the gradient is better than elsewhere.
    measure = volume_measure(replace(element, integration=FULL), DEGREE)

    def energy(trial: Expr) -> Expr:
        return material.stiffness(trial, trial, parameters)

    density = element.kinematics.of_gradient(energy, difference, element.x, element.constant)
    return element.integrand(density * q) * measure, parameters, (u, *rows)


def energy_on_subdomain(
    form: Template,
    material: Material,
    subdomain: Subdomain,
    blocks: np.ndarray,
    displacement: np.ndarray,
    gradient: np.ndarray,
) -> np.ndarray:
    """Return ∫ C (g − ∇u) : (g − ∇u) over every cell of a subdomain, as if all were of one material."""
    space = subdomain.mesh.space
    mesh, width = space.mesh, subdomain.mesh.components
    _dolfinx.update_coordinates(mesh, subdomain.mesh.by_input_node(subdomain.points))
    fields = []
    for values in (displacement, *(gradient[:, :, k] for k in range(width))):
        fields.append(_dolfinx.fem.Function(space))
        fields[-1].x.array.reshape(-1, width)[blocks, : values.shape[2]] = values
    of_cells = _dolfinx.scalar_space(mesh, 0)
    energies = _dolfinx.assemble_vector(form.bind([of_cells], material.parameters, fields))
    return np.asarray(energies[_dolfinx.cell_dofs(of_cells).ravel()])


#: Name of a body -> cells of this rank, and a value of each.
OfCells: TypeAlias = Mapping[str, tuple[np.ndarray, np.ndarray]]


@displayed
@dataclass(frozen=True, eq=False)
class DiscretisationError:
    """Estimates of the discretisation error in the norm √∫ C ε : ε, [√(force · length)].

    Attributes:
        total: That of all bodies together.
        by_body: Body name -> its part; the sum of squares is that of `total`.
    """

    total: float
    by_body: Mapping[str, float]
    _comm: MPI.Comm = field(repr=False)
    _sizes: Mapping[str, int] = field(repr=False)
    _own: OfCells = field(repr=False)

    @property
    def own_cells(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Body name -> this rank's cells and their parts."""
        return {name: (cells, np.sqrt(squares)) for name, (cells, squares) in self._own.items()}

    def by_cell(self, body: str) -> np.ndarray:
        """Return the part of each cell of a body in the body's order, shape (n_cells,), replicated.

        Collective.

        Raises:
            InvalidInputError: If there is no such body.
        """
        return of_every_cell(self._comm, self._sizes, self.own_cells, body)


def of_every_cell(comm: MPI.Comm, sizes: Mapping[str, int], own: OfCells, body: str) -> np.ndarray:
    """Return the values of all cells of a body, shape (n_cells,), replicated. Collective."""
    if body not in sizes:
        raise InvalidInputError(
            f"body must be one of {sorted(sizes)}, got {body!r}: take a name of the scene"
        )
    values = np.zeros(sizes[body])
    cells, known = own[body]
    values[cells] = known
    return np.asarray(comm.allreduce(values))


def discretisation_error(torn: TornSystem, displacement: np.ndarray) -> DiscretisationError:
    """Estimate the discretisation error of a displacement. Collective.

    On each cell η² = ∫ C (ε* − ε) : (ε* − ε) with the strain ε of the displacement and the strain ε* of a
    recovered gradient, which is continuous within one material of one body (see `recovery`). Thermal strains
    are in both and cancel.

    It is not a bound. The ratio of estimate to error tends to 1 where the solution is smooth. It was measured
    between 0.7 and 1.1 for contact on two or more nodes, at 0.7 where clamped corners and edges between
    materials dominate, and at 0.9 for quadrilaterals that lock at ν = 0.499. A body one cell thick does not
    resolve how strains vary across it: there the estimate may be a quarter of the error; for a body of one
    cell it is meaningless. Where a mesh locks completely, the error exceeds the displacement and the estimate
    does not follow. The geometry error of facets on a curved surface is not included.
    """
    scene, comm = torn.scene, torn.decomposition.comm
    energies = {name: CellEnergies(torn, body) for name, body in scene.bodies.items()}
    parts = Parts(scene.bodies)
    for subdomain, [(u, g)] in recovered_fields(torn, displacement):
        parts.add(subdomain, energies[subdomain.mesh.body].by_cell(subdomain, u, g))
    own = parts.joined()
    sums = comm.allreduce(np.array([values.sum() for _, values in own.values()]))
    by_body = {name: float(np.sqrt(value)) for name, value in zip(own, sums, strict=True)}
    sizes = {name: body.mesh.n_cells for name, body in scene.bodies.items()}
    return DiscretisationError(float(np.sqrt(sums.sum())), by_body, comm, sizes, own)


def recovered_fields(
    torn: TornSystem, *fields: np.ndarray
) -> Iterator[tuple[Subdomain, list[tuple[np.ndarray, np.ndarray]]]]:
    """Yield each of this rank's subdomains with fields and their recovered gradients. Collective.

    Yields of each field its values at the nodes of the cells, shape (n_cells, nodes of a cell, dim), and the
    gradients there, shape (n_cells, nodes of a cell, dim, dim).
    """
    nodal = np.hstack([nodal_mean(torn.decomposition, field) for field in fields])
    columns = [slice(k * torn.components, (k + 1) * torn.components) for k in range(len(fields))]
    for order in sorted({body.mesh.order for body in torn.scene.bodies.values()}):
        sites = find_sites(torn, order)
        values = nodal[sites.node]
        gradients = recovered_gradients(sites, values)
        for subdomain in torn.subdomains:
            if subdomain.mesh.number in sites.of_cells:
                of_cells = sites.of_cells[subdomain.mesh.number]
                yield subdomain, [(values[:, own][of_cells], gradients[:, own][of_cells]) for own in columns]


class Parts:
    """Values of cells, collected subdomain by subdomain."""

    def __init__(self, bodies: Iterable[str]) -> None:
        """Start with none."""
        self._cells = {name: [np.zeros(0, dtype=np.int64)] for name in bodies}
        self._values = {name: [np.zeros(0)] for name in bodies}

    def add(self, subdomain: Subdomain, values: np.ndarray) -> None:
        """Add the values of the cells of a subdomain, shape (n_cells,)."""
        self._cells[subdomain.mesh.body].append(subdomain.mesh.cells)
        self._values[subdomain.mesh.body].append(values)

    def joined(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Return this rank's cells of each body and their values."""
        return {
            name: (np.concatenate(cells), np.concatenate(self._values[name]))
            for name, cells in self._cells.items()
        }


@dataclass(frozen=True, eq=False)
class ErrorProducts:
    """Products in energy of the estimated errors of two fields on this rank's cells, by body.

    Each is a pair of cells and values as of `Parts`. `first`: ∫ C e : e, e the error of the first field's
    gradient; `product`: ∫ C e₁ : e₂.
    """

    first: OfCells
    second: OfCells
    product: OfCells


def error_products(torn: TornSystem, first: np.ndarray, second: np.ndarray) -> ErrorProducts:
    """Estimate ∫ C e₁ : e₂ of the errors of two torn fields on each cell, see `discretisation_error`.

    With the second scaled by s so that both have the same energy it follows from three energies,

        2 s ∫ C e₁ : e₂ = ∫ C (e₁ + s e₂) : (e₁ + s e₂) − ∫ C e₁ : e₁ − s² ∫ C e₂ : e₂.

    Collective.
    """
    bodies = torn.scene.bodies
    energies = {name: CellEnergies(torn, body) for name, body in bodies.items()}
    known = list(recovered_fields(torn, first, second))
    squares = [[energies[part.mesh.body].by_cell(part, *field) for field in fields] for part, fields in known]
    sums = np.zeros(2) + sum(np.array([own.sum() for own in pair]) for pair in squares)
    mine, theirs = torn.decomposition.comm.allreduce(sums)
    scale = float(np.sqrt(mine / theirs)) if mine > 0.0 and theirs > 0.0 else 1.0
    results = tuple(Parts(bodies) for _ in range(3))
    for (part, ((u, g), (w, h))), (own, other) in zip(known, squares, strict=True):
        both = energies[part.mesh.body].by_cell(part, u + scale * w, g + scale * h)
        product = (both - own - scale**2 * other) / (2.0 * scale)
        for result, values in zip(results, (own, other, product), strict=True):
            result.add(part, values)
    return ErrorProducts(*(result.joined() for result in results))


class CellEnergies:
    """Energies of differences of gradients in one body. Collective."""

    def __init__(self, torn: TornSystem, body: Body) -> None:
        forms, element = torn.decomposition.forms, body.element
        self._body = body
        self._ways: list[np.ndarray | Template] = [
            compile_energy(forms, material, element)
            if forms.varies(material, element)
            else moduli(forms, material, element)
            for material in body.materials
        ]

    def moved(self, body: Body) -> CellEnergies:
        """Return those of the body where its nodes lie elsewhere."""
        result = copy(self)
        result._body = body
        return result

    def by_cell(
        self,
        subdomain: Subdomain,
        displacement: np.ndarray,
        gradient: np.ndarray,
        among: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return ∫ C (g − ∇u) : (g − ∇u) over each cell of a subdomain, shape (n_cells,)."""
        mesh, whole = subdomain.mesh, self._body.mesh
        nodes, kind = whole.cells[mesh.cells], self._body.material_of_cells[mesh.cells]
        result = np.zeros(len(nodes))
        # Where materials meet, a node has several recovered gradients: one material at a time.
        wanted = np.ones(len(nodes), dtype=bool) if among is None else among[mesh.cells]
        for number in np.unique(kind[wanted]):
            cells, way = np.flatnonzero(wanted & (kind == number)), self._ways[number]
            u, g = (as_hexahedra(each[cells], nodes[cells], whole.dim) for each in (displacement, gradient))
            if isinstance(way, np.ndarray):
                places = places_of(whole.points, nodes[cells])
                result[cells] = energy_of_difference(way, whole.cell_type, places, u, g)
            else:
                blocks = _dolfinx.vtk_cell_dofs(mesh.space)[cells]
                material = self._body.materials[number]
                result[cells] = energy_on_subdomain(way, material, subdomain, blocks, u, g)[cells]
        # Moduli are insensitive to rotations, so some eigenvalues are zero up to rounding.
        return np.maximum(result, 0.0)
