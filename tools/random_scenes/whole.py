"""A scene on bodies in one piece, written down a second time with NumPy alone: stiffness, loads, supports.

Shape functions come from monomials and the places of the nodes, materials from their engineering constants,
integrals from Gauss's points: two a direction on linear cells and three on quadratic ones, which the answer
depends on where cells are no parallelepipeds.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import scipy.sparse as sp

from fenics_contact import Body, BodyForce, BodyMesh, Pressure, Scene, ThermalStrain, TotalForce
from fenics_contact.materials import (
    IsotropicElasticity,
    OrthotropicElasticity,
    OrthotropicPlaneStress,
    PlaneStrain,
    PlaneStress,
    rigid_body_modes,
)
from fenics_contact.mesh import CellType
from fenics_contact.mesh.cell_types import CELL_TYPES, FACET_TYPES, quadrature
from tests.scenes import Load

#: Components of a strain in the order of its vector, shear strains doubled.
PAIRS = {2: [(0, 0), (1, 1), (0, 1)], 3: [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]}
#: Those of a body of revolution among the ones in space: (r, r), (z, z), (r, z) and around the axis.
REVOLVED = [0, 1, 5, 2]


def elasticity(material: Any, dim: int) -> np.ndarray:
    """Return C in the order of `PAIRS`, from the constants that a user gives."""
    match material:
        case IsotropicElasticity() | PlaneStrain():
            E, nu = material.young_modulus, material.poisson_ratio
            C = _isotropic(E, nu, dim)
        case PlaneStress():
            E, nu = material.young_modulus, material.poisson_ratio
            C = E / (1 - nu**2) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, 0.5 * (1 - nu)]])
        case OrthotropicElasticity():
            E, n, G = material.young_moduli, material.poisson_ratios, material.shear_moduli
            S = np.diag([1 / E[0], 1 / E[1], 1 / E[2], 1 / G[2], 1 / G[1], 1 / G[0]])
            for (i, j), ratio in {(0, 1): n[0], (0, 2): n[1], (1, 2): n[2]}.items():
                S[i, j] = S[j, i] = -ratio / E[i]
            C = _turned(np.linalg.inv(S), np.array(material.orientation))
        case OrthotropicPlaneStress():
            (E1, E2), nu, G12 = material.young_moduli, material.poisson_ratio, material.shear_modulus
            S = np.array([[1 / E1, -nu / E1, 0], [-nu / E1, 1 / E2, 0], [0, 0, 1 / G12]])
            c, s = np.cos(material.angle), np.sin(material.angle)
            C = _turned(np.linalg.inv(S), np.array([[c, s], [-s, c]]))
        case _:
            raise AssertionError(material)
    return np.asarray(C)


def _isotropic(E: float, nu: float, dim: int) -> np.ndarray:
    lame, shear = E * nu / ((1 + nu) * (1 - 2 * nu)), 0.5 * E / (1 + nu)
    C = np.zeros((len(PAIRS[dim]),) * 2)
    C[:dim, :dim] = lame
    C += shear * np.diag([2.0] * dim + [1.0] * (len(C) - dim))
    return C


def _turned(C: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Turn C, given in axes that are rows, by the strains ε_ij of the six or three unit strains."""
    dim = len(axes)
    to_axes = np.empty((len(C), len(C)))
    for column, (i, j) in enumerate(PAIRS[dim]):
        unit = np.zeros((dim, dim))
        unit[i, j] = unit[j, i] = 1.0 if i == j else 0.5
        seen = axes @ unit @ axes.T
        to_axes[:, column] = [seen[a, b] * (1.0 if a == b else 2.0) for a, b in PAIRS[dim]]
    return np.asarray(to_axes.T @ C @ to_axes)


def thermal_strain(material: Any, dim: int) -> np.ndarray:
    """Return the strain of one degree in the order of `PAIRS`, in plane strain with what its ends add."""
    alpha = material.thermal_expansion
    assert not isinstance(alpha, tuple)
    factor = 1.0 + material.poisson_ratio if isinstance(material, PlaneStrain) else 1.0
    return np.array([alpha * factor] * dim + [0.0] * (len(PAIRS[dim]) - dim))


def _exponents(cell: CellType) -> np.ndarray:
    lattice = np.array(list(product(range(cell.order + 1), repeat=cell.dim)))
    return lattice[lattice.sum(axis=1) <= cell.order] if cell.is_simplex else lattice


def shapes(cell: CellType, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return values (q, k) and gradients (q, k, d) of the shape functions at places (q, d)."""
    exponents = _exponents(cell)
    inverse = np.linalg.inv(np.prod(cell.nodes[:, None] ** exponents, axis=2))
    values = np.prod(places[:, None] ** exponents, axis=2) @ inverse
    slopes = []
    for d in range(cell.dim):
        lower = exponents.copy()
        lower[:, d] = np.maximum(lower[:, d] - 1, 0)
        slopes.append((exponents[:, d] * np.prod(places[:, None] ** lower, axis=2)) @ inverse)
    return values, np.stack(slopes, axis=2)


@cache
def gauss(cell: CellType) -> tuple[np.ndarray, np.ndarray]:
    """Return places and weights; simplices are integrated as squashed squares and cubes."""
    count = cell.order + 1 + (1 if cell.is_simplex else 0)
    ticks, weights = np.polynomial.legendre.leggauss(count)
    ticks, weights = 0.5 * (ticks + 1), 0.5 * weights
    places = np.array(list(product(ticks, repeat=cell.dim)))
    weight = np.array([np.prod(w) for w in product(weights, repeat=cell.dim)])
    if cell.is_simplex and cell.dim == 2:
        x, y = places.T
        return np.column_stack([x, y * (1 - x)]), weight * (1 - x)
    if cell.is_simplex:
        x, y, z = places.T
        return np.column_stack([x, y * (1 - x), z * (1 - x) * (1 - y)]), weight * (1 - x) ** 2 * (1 - y)
    return places, weight


@dataclass(frozen=True)
class Integrated:
    """Shape functions (q, k), gradients (q, c, k, d) and weights (q, c) of the cells of a mesh.

    Of bodies of revolution also shape functions over the radius, (q, c, k), and whether they may twist.
    """

    values: np.ndarray
    gradients: np.ndarray
    weights: np.ndarray
    hoop: np.ndarray | None = None
    torsion: bool = False

    @property
    def strains(self) -> np.ndarray:
        """Strains by displacements of nodes, (q, c, strains, k, d)."""
        rows = strain_rows(self.gradients)
        if self.hoop is None:
            return rows
        around = np.zeros_like(rows[:, :, :1])
        around[:, :, 0, :, 0] = self.hoop
        section = np.concatenate([rows, around], axis=2)
        if not self.torsion:
            return section
        B = np.zeros((*self.hoop.shape[:2], 6, self.hoop.shape[2], 3))
        B[:, :, REVOLVED, :, :2] = section
        B[:, :, 3, :, 2] = self.gradients[..., 1]
        B[:, :, 4, :, 2] = self.gradients[..., 0] - self.hoop
        return B


def integrated(mesh: BodyMesh, axisymmetric: bool = False, torsion: bool = False) -> Integrated:
    """Evaluate everything at the Gauss points of all cells."""
    cell = CELL_TYPES[mesh.cell_type]
    # No rule integrates 1 / r exactly, and the answer depends on it.
    rule = quadrature(cell, 2 * cell.order) if axisymmetric and cell.is_simplex else gauss(cell)
    places, weight = rule
    values, local = shapes(cell, places)
    corners = mesh.points[mesh.cells]
    corners = corners - corners[:, :1]
    jacobian = np.einsum("qka,ckd->qcda", local, corners)
    gradients = np.einsum("qka,qcad->qckd", local, np.linalg.inv(jacobian))
    weights = weight[:, None] * np.linalg.det(jacobian)
    if not axisymmetric:
        return Integrated(values, gradients, weights)
    radius = np.einsum("qk,ck->qc", values, mesh.points[mesh.cells][:, :, 0])
    hoop = values[:, None] / radius[:, :, None]
    return Integrated(values, gradients, 2 * np.pi * radius * weights, hoop, torsion)


def strain_rows(gradients: np.ndarray) -> np.ndarray:
    """Return strains by displacements of nodes, (..., strains, k, d), from gradients (..., k, d)."""
    dim = gradients.shape[-1]
    B = np.zeros((*gradients.shape[:-2], len(PAIRS[dim]), *gradients.shape[-2:]))
    for row, (i, j) in enumerate(PAIRS[dim]):
        B[..., row, :, i] += gradients[..., j]
        if i != j:
            B[..., row, :, j] += gradients[..., i]
    return B


class Whole:
    """One stiffness matrix, one load, all supports.

    Attributes:
        offset: Number of the first node of each body among all nodes.
        points: Coordinates of all nodes, (n_nodes, dim).
        components: Of a displacement: as many as coordinates, three where bodies of revolution may twist.
        K: Stiffness, dof components n + d for component d of node n.
        springs: The part of it that foundations have.
        load: (n_nodes, components).
        prescribed: (n_nodes, components), NaN where free.
        body_of: Number of the body of each node.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene, self.dim, self.components = scene, scene.dim, scene.components
        counts = [part.mesh.n_nodes for part in scene.bodies.values()]
        self.offset = dict(zip(scene.bodies, np.cumsum([0, *counts[:-1]]).tolist(), strict=True))
        self.body_of = np.repeat(np.arange(len(counts)), counts)
        self.points = np.concatenate([part.mesh.points for part in scene.bodies.values()])
        self.load = np.zeros((len(self.points), self.components))
        parts = []
        for name, part in scene.bodies.items():
            found = integrated(part.mesh, part.axisymmetric, part.torsion)
            C = np.array([_stiffness_of(material, part) for material in part.materials])
            C = C[part.material_of_cells]
            parts.append(_stiffness(part.mesh, found, C))
            nodes = slice(self.offset[name], self.offset[name] + part.mesh.n_nodes)
            for load in scene.loads:
                if load.body == name:
                    self.load[nodes] += _nodal(part, found, C, load)
        self.springs = self._springs()
        self.K = sp.block_diag(parts, format="csr") + self.springs
        self.prescribed = np.full(self.load.shape, np.nan)
        if scene.axisymmetric:
            self.prescribed[np.ix_(on_axis(self.points), [0, 2][: self.components - 1])] = 0.0
        for support in scene.supports:
            mesh = scene.bodies[support.body].mesh
            nodes = np.unique(mesh.surfaces[support.surface]) + self.offset[support.body]
            for component, value in enumerate(support.value):
                if value is not None:
                    assert not callable(value)
                    self.prescribed[nodes, component] = value

    def _springs(self) -> sp.csr_matrix:
        """Return the stiffness of foundations, of facets as they are."""
        springs = sp.csr_matrix((self.load.size,) * 2)
        for foundation in self.scene.foundations:
            mesh = self.scene.bodies[foundation.body].mesh
            facets = mesh.surfaces[foundation.surface]
            values, normal = facet_integrals(mesh, facets, self.scene.axisymmetric)
            area = np.linalg.norm(normal, axis=2)
            normal = np.pad(normal, ((0, 0), (0, 0), (0, self.components - self.dim)))
            if np.ndim(foundation.stiffness):
                tensor = np.einsum("qf,d,de->qfde", area, foundation.stiffness, np.eye(self.components))
            else:
                tensor = np.einsum("qfd,qfe,qf->qfde", normal, normal, foundation.stiffness / area)
            tensor = tensor / (area.sum() if foundation.total else 1.0)
            blocks = np.einsum("qk,ql,qfde->fkdle", values, values, tensor)
            nodes = self.components * (facets + self.offset[foundation.body])
            dofs = nodes[..., None] + np.arange(self.components)
            rows, columns = np.broadcast_arrays(dofs[:, :, :, None, None], dofs[:, None, None, :, :])
            springs = springs + sp.csr_matrix(
                (blocks.ravel(), (rows.ravel(), columns.ravel())), shape=springs.shape
            )
        return springs

    @property
    def free(self) -> np.ndarray:
        """Whether a component of a node is not prescribed, (n_nodes, dim)."""
        return np.isnan(self.prescribed)

    def nodes(self, name: str) -> slice:
        """Return the nodes of a body."""
        return slice(self.offset[name], self.offset[name] + self.scene.bodies[name].mesh.n_nodes)


def on_axis(points: np.ndarray) -> np.ndarray:
    """Return which points lie on the axis of revolution, (n,)."""
    return np.asarray(points[..., 0] <= 1e-9 * np.ptp(points.reshape(-1, 2), axis=0).max())


def rigid_motions(scene: Scene, name: str) -> np.ndarray:
    """Return those of a body, about its middle and in its size, (n_nodes * dim, motions)."""
    points = scene.bodies[name].mesh.points
    centred = points - points.mean(axis=0)
    modes = rigid_body_modes(centred / np.abs(centred).max()).reshape(points.size, -1)
    if scene.components > scene.dim:
        along, around = np.zeros((2, len(points), 3))
        along[:, 1], around[:, 2] = 1.0, points[:, 0] / points[:, 0].max()
        return np.column_stack([along.ravel(), around.ravel()])
    return modes[:, 1:2] if scene.axisymmetric else modes


def _stiffness_of(material: Any, part: Body) -> np.ndarray:
    if part.torsion:
        return elasticity(material, 3)
    if part.axisymmetric:
        return elasticity(material, 3)[np.ix_(REVOLVED, REVOLVED)]
    return elasticity(material, part.mesh.dim)


def _stiffness(mesh: BodyMesh, found: Integrated, C: np.ndarray) -> sp.csr_matrix:
    B = found.strains
    q, c, s, k, d = B.shape
    B = B.reshape(q, c, s, k * d)
    blocks = np.einsum("qc,qcsi,cst,qctj->cij", found.weights, B, C, B, optimize=True)
    dofs = (d * mesh.cells[:, :, None] + np.arange(d)).reshape(c, -1)
    rows, columns = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
    size = d * mesh.n_nodes
    return sp.coo_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size)).tocsr()


def _nodal(part: Any, found: Integrated, C: np.ndarray, load: Load) -> np.ndarray:
    """Return the nodal forces of a load, (n_nodes, dim)."""
    mesh, components = part.mesh, 3 if part.torsion else part.mesh.dim
    force = np.zeros((mesh.n_nodes, components))
    if isinstance(load, ThermalStrain):
        dim = 3 if part.axisymmetric else mesh.dim
        strain = np.array([thermal_strain(material, dim) for material in part.materials])
        strain = strain[:, REVOLVED] if part.axisymmetric and not part.torsion else strain
        stress = np.einsum("cst,ct->cs", C, strain[part.material_of_cells]) * load.value
        work = np.einsum("qc,qcskd,cs->ckd", found.weights, found.strains, stress)
        np.add.at(force, mesh.cells, work)
    elif isinstance(load, BodyForce):
        share = np.einsum("qk,qc->ck", found.values, found.weights)
        np.add.at(force, mesh.cells, share[:, :, None] * np.array(load.value))
    else:
        facets = mesh.surfaces[load.surface]
        values, normal = facet_integrals(mesh, facets, part.axisymmetric)
        area = np.linalg.norm(normal, axis=2)
        if isinstance(load, Pressure):
            pressing = np.pad(-load.value * normal, ((0, 0), (0, 0), (0, components - mesh.dim)))
            given = np.einsum("qk,qfd->fkd", values, pressing)
        elif callable(load.value):
            at_nodes = load.value(mesh.points[facets].reshape(-1, mesh.dim)).reshape(*facets.shape, -1)
            given = np.einsum("qk,ql,qf,fld->fkd", values, values, area, at_nodes)
        else:
            value = np.array(load.value) / (area.sum() if isinstance(load, TotalForce) else 1.0)
            value = np.pad(value, (0, components - len(value)))
            given = np.einsum("qk,qf,d->fkd", values, area, value)
            if part.torsion and isinstance(load, TotalForce) and load.moment is not None:
                radius = (values @ mesh.points[facets][:, :, 0].T).reshape(area.shape)
                twisting = load.moment * radius * area / (radius**2 * area).sum()
                given[:, :, 2] += np.einsum("qk,qf->fk", values, twisting)
        np.add.at(force, facets, given)
    return force


def facet_integrals(
    mesh: BodyMesh, facets: np.ndarray, axisymmetric: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Return shape functions (q, k) and weighted outward normals (q, f, d) at the Gauss points of facets.

    Those of bodies of revolution are of whole turns.
    """
    kind = FACET_TYPES[facets.shape[1], mesh.dim]
    places, weight = gauss(kind)
    values, local = shapes(kind, places)
    corners = mesh.points[facets]
    tangents = np.einsum("qka,fkd->qfad", local, corners - corners[:, :1])
    if mesh.dim == 3:
        normal = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    else:
        normal = np.stack([tangents[:, :, 0, 1], -tangents[:, :, 0, 0]], axis=2)
    if axisymmetric:
        normal = 2 * np.pi * (values @ corners[:, :, 0].T)[:, :, None] * normal
    return values, weight[:, None, None] * normal


def surface_area(mesh: BodyMesh, facets: np.ndarray, axisymmetric: bool) -> np.ndarray:
    """Return the force of a unit pressure on each node of a mesh, (n_nodes,)."""
    values, normal = facet_integrals(mesh, facets, axisymmetric)
    areas = np.zeros(mesh.n_nodes)
    np.add.at(areas, facets, np.einsum("qk,qf->fk", values, np.linalg.norm(normal, axis=2)))
    return areas
