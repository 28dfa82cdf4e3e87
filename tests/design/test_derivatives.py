"""Derivatives of projections, mortar, surfaces, volumes, materials and loads by the places of nodes."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import BodyMesh, SurfaceDesign
from fenics_contact._pairing.coupling_derivatives import CouplingDerivatives
from fenics_contact._pairing.mortar.gathering import CondensedDualBasis
from fenics_contact._pairing.mortar.points import MortarPoints
from fenics_contact._pairing.points import tangent_frames
from fenics_contact._surfaces.facets import (
    FacetedSurface,
    Relief,
    faceted_surface,
    heights,
    outside,
    shape_functions,
)
from fenics_contact._surfaces.projection import Projection, project
from fenics_contact._surfaces.true_surface import by_shape, height_over, reconstructed, true_surface
from fenics_contact.design import MovedSurface, Objective
from fenics_contact.design import load_derivatives as work_derivative
from fenics_contact.design import surface_derivatives as projection_derivative
from fenics_contact.design.contact_derivatives import mortar_points_pulled_back
from fenics_contact.design.motion import volume_by_points
from fenics_contact.design.surface_derivatives import (
    PointDerivatives,
    areas_pulled_back,
    frames_pulled_back,
    normals_pulled_back,
    projection_pulled_back,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, half_disc, rectangle, side_of
from fenics_contact.materials import IsotropicElasticity, OrthotropicElasticity
from fenics_contact.mesh import quadratic
from fenics_contact.shapes import Torus
from tests.design.aims import aims
from tests.design.blocks import problem
from tests.design.objectives import objectives
from tests.design.quotients import Line, miss_without
from tests.design.two_materials import two_materials
from tests.pairing.mortar_surfaces import SOLID, halved, lattice, shell

CELLS = ("hexahedron", "tetrahedron")
#: What is known of the master: its facets, the shape they stand for, or its nodes, which suggest one.
KNOWN = ("facets", "shape", "nodes")
TORUS = Torus((0.0, 0.75, 3.0), (1.0, 0.0, 0.0), 7.0, 4.0)
UP = np.array([0.0, 0.0, 1.0])
STEP = 1e-6
SHAPES = {"gap": (), "normal": (3,), "tangents": (2, 3), "weight": ("corners",)}


@dataclass(frozen=True)
class Setting:
    """A master of bilinear or triangular facets and points on either side of it."""

    points: np.ndarray
    facets: np.ndarray
    slave: np.ndarray
    mirrored: np.ndarray | None = None
    relief: Relief | None = None

    @property
    def master(self) -> FacetedSurface:
        return replace(faceted_surface(self.points, self.facets, self.mirrored), relief=self.relief)

    def moved(self, by_master: np.ndarray, by_slave: np.ndarray) -> Setting:
        return replace(self, points=self.points + by_master, slave=self.slave + by_slave)

    def hit(self) -> Projection:
        master = self.master
        found = project(self.slave, np.tile(-UP, (len(self.slave), 1)), master)
        assert np.array_equal(found.point, np.arange(len(self.slave)))
        return found

    def projected(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return the facets hit, and gap, normal, tangents and weights of every point."""
        hit = self.hit()
        weight, _ = shape_functions(hit.local, self.master.corners)
        frames = tangent_frames(hit.normal)
        return hit.facet, {"gap": hit.gap, "normal": hit.normal, "tangents": frames, "weight": weight}


@cache
def setting(cell: str, known: str = "facets") -> Setting:
    """A wavy master, or where its shape is known a torus; all but facets end in a plane of symmetry."""
    rng = np.random.default_rng(7)
    mesh = block((0.0, 0.0, -1.0), (2.0, 1.5, 0.0), (5, 4, 1), cell)
    x, y, z = mesh.points.T
    wavy = np.column_stack([x + 0.04 * np.sin(3 * y), y, z + (z + 1) * 0.15 * np.sin(2 * x) * np.cos(3 * y)])
    wavy = wavy + 0.01 * rng.standard_normal(wavy.shape)
    places = rng.uniform([0.3, 0.3], [1.7, 1.2], (30, 2))
    height = 0.15 * np.sin(2 * places[:, 0]) * np.cos(3 * places[:, 1]) + rng.uniform(-0.05, 0.2, 30)
    facets, slave = mesh.surfaces["z1"], np.column_stack([places, height])
    if known == "facets":
        return Setting(wavy, facets, slave)
    if known == "shape":
        slave[:, 2] = height_over(slave * [1, 1, 0], np.tile(UP, (30, 1)), TORUS) + rng.uniform(
            -0.05, 0.2, 30
        )
        top = np.unique(facets)
        wavy[top] += height_over(wavy[top], np.tile(UP, (len(top), 1)), TORUS)[:, None] * UP
    mirrored = np.zeros(wavy.shape, dtype=bool)
    mirrored[x == 0.0, 0] = True
    surface = faceted_surface(wavy, facets, mirrored)
    whole = by_shape(surface, TORUS) if known == "shape" else reconstructed(surface)
    return Setting(wavy, facets, slave, mirrored, whole.relief)


def derivatives_by_points(here: Setting, term: str, rng: np.random.Generator) -> PointDerivatives:
    """Random derivatives by one term, none by the others."""
    count, corners = len(here.slave), here.facets.shape[1]
    sizes = {name: tuple(corners if n == "corners" else n for n in shape) for name, shape in SHAPES.items()}
    parts = {name: np.zeros((count, *size)) for name, size in sizes.items()}
    parts[term] = rng.standard_normal(parts[term].shape)
    return PointDerivatives(**parts)


def both_ways(here: Setting, term: str, what: str) -> tuple[float, float]:
    """Return the adjoint's derivative along a random motion of one side, and the difference quotient."""
    rng = np.random.default_rng(11)
    hit, nodes = here.hit(), here.master.nodes
    by = derivatives_by_points(here, term, rng)
    by_slave, by_master = projection_pulled_back(here.master, hit.facet, hit.local, hit.gap, by)
    move_master, move_slave = np.zeros_like(here.points), np.zeros_like(here.slave)
    if what == "master":
        move_master[nodes] = rng.standard_normal((len(nodes), 3))
    else:
        move_slave = rng.standard_normal(here.slave.shape)
    values = []
    for sign in (1, -1):
        facet, found = here.moved(sign * STEP * move_master, sign * STEP * move_slave).projected()
        assert np.array_equal(facet, hit.facet)
        values.append(found[term])
    quotient = np.sum(getattr(by, term) * (values[0] - values[1])) / (2 * STEP)
    return float(np.sum(by_slave * move_slave) + np.sum(by_master * move_master[nodes])), float(quotient)


@pytest.mark.parametrize("known", KNOWN)
@pytest.mark.parametrize("cell", CELLS)
def test_points_lie_on_both_sides_and_inside_facets(cell: str, known: str) -> None:
    here = setting(cell, known)
    hit = here.hit()
    assert np.count_nonzero(hit.gap < -0.01) > 2
    assert np.count_nonzero(hit.gap > 0.01) > 10
    assert len(np.unique(hit.facet)) > 8
    # A point in the middle of a facet would hide errors in its local coordinates.
    assert np.abs(hit.local).max() > 0.6
    assert outside(hit.local, here.master.corners).max() == 0.0
    above = heights(here.master, hit.facet, hit.local)
    assert (np.abs(above.value).max() > 1e-3) == (np.abs(above.by_local).max() > 1e-3) == (known != "facets")
    assert here.master.mirrored.any() == (known != "facets")


@pytest.mark.parametrize("what", ["master", "slave"])
@pytest.mark.parametrize("term", SHAPES)
@pytest.mark.parametrize("known", KNOWN)
@pytest.mark.parametrize("cell", CELLS)
def test_each_term_agrees_with_central_differences(cell: str, known: str, term: str, what: str) -> None:
    adjoint, quotient = both_ways(setting(cell, known), term, what)
    assert abs(adjoint) > 0.1
    assert adjoint == pytest.approx(quotient, rel=1e-6)


@pytest.mark.parametrize("known", ["shape", "nodes"])
@pytest.mark.parametrize("cell", CELLS)
def test_the_gap_changes_with_the_slopes_of_the_true_surface(
    monkeypatch: pytest.MonkeyPatch, cell: str, known: str
) -> None:
    here = setting(cell, known)
    monkeypatch.setattr(
        projection_derivative,
        "slopes_pulled_back",
        lambda surface, facet, by: tuple(np.zeros((3, *surface.points.shape))),
    )
    adjoint, quotient = both_ways(here, "gap", "master")
    assert abs(adjoint - quotient) > 1e-2 * abs(quotient)
    adjoint, quotient = both_ways(here, "gap", "slave")
    assert adjoint == pytest.approx(quotient, rel=1e-6)


@pytest.mark.parametrize("known", ["shape", "nodes"])
@pytest.mark.parametrize("cell", CELLS)
def test_the_gap_changes_by_the_second_order_beside_its_derivative(cell: str, known: str) -> None:
    here, rng = setting(cell, known), np.random.default_rng(12)
    hit, nodes = here.hit(), here.master.nodes
    by = derivatives_by_points(here, "gap", rng)
    by_slave, by_master = projection_pulled_back(here.master, hit.facet, hit.local, hit.gap, by)
    move_master, move_slave = np.zeros_like(here.points), rng.standard_normal(here.slave.shape)
    move_master[nodes] = rng.standard_normal((len(nodes), 3))
    slope = np.sum(by_slave * move_slave) + np.sum(by_master * move_master[nodes])
    rests = []
    for step in (1e-4, 2e-4):
        facet, found = here.moved(step * move_master, step * move_slave).projected()
        assert np.array_equal(facet, hit.facet)
        rests.append(abs(np.sum(by.gap * (found["gap"] - hit.gap)) - step * slope))
    assert np.log2(rests[1] / rests[0]) > 1.9


@pytest.mark.parametrize("given", [False, True])
def test_frames_turn_with_their_normals(given: bool) -> None:
    """About the axis that is least aligned, or one that is given."""
    rng = np.random.default_rng(3)
    axes = np.eye(3)[rng.integers(0, 3, 40)] if given else None
    normals = rng.standard_normal((40, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    by_tangents, turn = rng.standard_normal((40, 2, 3)), rng.standard_normal((40, 3))
    turn -= np.einsum("nd,nd->n", turn, normals)[:, None] * normals

    def frames(step: float) -> np.ndarray:
        moved = normals + step * turn
        return tangent_frames(moved / np.linalg.norm(moved, axis=1)[:, None], axes)

    quotients = np.einsum("nad,nad->n", by_tangents, frames(STEP) - frames(-STEP)) / (2 * STEP)
    adjoint = np.einsum("nd,nd->n", frames_pulled_back(normals, by_tangents, axes), turn)
    assert np.abs(quotients).min() > 1e-3
    assert adjoint == pytest.approx(quotients, rel=1e-5, abs=1e-7)


@pytest.mark.parametrize("cell", CELLS)
def test_normals_in_a_plane_of_symmetry_turn_within_it(cell: str) -> None:
    rng = np.random.default_rng(4)
    known = setting(cell).master
    mirrored = np.zeros(known.points.shape, dtype=bool)
    side = known.points[:, 0] < 0.1
    mirrored[side, 0] = True
    by, way = rng.standard_normal((2, *known.points.shape))

    def normals(step: float) -> np.ndarray:
        return faceted_surface(known.points + step * way, known.facets, mirrored).normals

    assert not normals(0.0)[side, 0].any()
    quotient = np.sum(by * (normals(STEP) - normals(-STEP))) / (2 * STEP)
    surface = faceted_surface(known.points, known.facets, mirrored)
    found = np.sum(normals_pulled_back(surface, by) * way)
    assert abs(found) > 0.1
    assert found == pytest.approx(quotient, rel=1e-6)
    plain = faceted_surface(known.points, known.facets)
    assert abs(np.sum(normals_pulled_back(plain, by) * way) - found) > 1e-3 * abs(found)


@pytest.mark.parametrize("known", KNOWN)
@pytest.mark.parametrize("cell", CELLS)
def test_pushing_a_point_along_the_normal_opens_its_gap_and_nothing_else(cell: str, known: str) -> None:
    here = setting(cell, known)
    hit = here.hit()
    for term in SHAPES:
        by = derivatives_by_points(here, term, np.random.default_rng(5))
        by_slave, _ = projection_pulled_back(here.master, hit.facet, hit.local, hit.gap, by)
        along = np.einsum("nd,nd->n", by_slave, hit.normal)
        assert along == pytest.approx(by.gap, abs=1e-10)


@pytest.mark.parametrize("known", KNOWN)
@pytest.mark.parametrize("cell", CELLS)
def test_moving_everything_together_changes_nothing(cell: str, known: str) -> None:
    here = setting(cell, known)
    hit = here.hit()
    for term in SHAPES:
        by = derivatives_by_points(here, term, np.random.default_rng(5))
        by_slave, by_master = projection_pulled_back(here.master, hit.facet, hit.local, hit.gap, by)
        assert np.abs(by_slave).max() > 0.1
        assert by_slave.sum(axis=0) + by_master.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-10)


# Derivatives of nodal normals, nodal areas and volumes by the nodes agree with difference quotients.
PLANE_CELLS = ("quadrilateral", "triangle")
Reverse = Callable[[FacetedSurface, np.ndarray], np.ndarray]
REVERSE: dict[str, Reverse] = {"normals": normals_pulled_back, "areas": areas_pulled_back}


def crumpled(cell: str, order: int = 1) -> BodyMesh:
    """A block without any plane face, or a rectangle without any straight edge."""
    rng = np.random.default_rng(2)
    if cell in PLANE_CELLS:
        mesh = rectangle((0.0, 0.0), (2.0, 1.5), (4, 3), cell)
    else:
        mesh = block((0.0, 0.0, 0.0), (2.0, 1.5, 1.0), (4, 3, 3), cell)
    if order == 2:
        mesh = quadratic(mesh)
    return mesh.moved(mesh.points + 0.04 / order**2 * rng.standard_normal(mesh.points.shape))


@pytest.mark.parametrize("what", REVERSE)
@pytest.mark.parametrize("cell", [*CELLS, *PLANE_CELLS])
def test_normals_and_areas_agree_with_central_differences(cell: str, what: str) -> None:
    rng = np.random.default_rng(4)
    mesh = crumpled(cell)
    last = "z1" if mesh.dim == 3 else "y1"
    facets = np.concatenate([mesh.surfaces[last], mesh.surfaces["x1"]])
    surface = faceted_surface(mesh.points, facets)
    by, move = rng.standard_normal(getattr(surface, what).shape), rng.standard_normal(mesh.points.shape)
    up, down = (faceted_surface(mesh.points + sign * STEP * move, facets) for sign in (1, -1))
    quotient = np.sum(by * (getattr(up, what) - getattr(down, what))) / (2 * STEP)
    adjoint = np.sum(REVERSE[what](surface, by) * move[surface.nodes])
    assert abs(adjoint) > 0.1
    assert adjoint == pytest.approx(quotient, rel=1e-7)


@pytest.mark.parametrize("cell", [*CELLS, *PLANE_CELLS])
def test_areas_on_which_a_pressure_bears_agree_with_central_differences(cell: str) -> None:
    rng = np.random.default_rng(4)
    mesh, name = crumpled(cell, 2), "x1"
    surface = true_surface(mesh, name, "faceted")
    by, move = rng.standard_normal(surface.areas.shape), rng.standard_normal(mesh.points.shape)
    up, down = (
        true_surface(mesh.moved(mesh.points + sign * STEP * move), name, "faceted") for sign in (1, -1)
    )
    quotient = by @ (up.areas - down.areas) / (2 * STEP)
    adjoint = np.sum(areas_pulled_back(surface, by) * move[surface.nodes])
    assert abs(adjoint) > 0.1
    assert adjoint == pytest.approx(quotient, rel=1e-7)


@pytest.mark.parametrize("cell", CELLS)
def test_nodal_areas_grow_with_the_square_of_a_plane_surface(cell: str) -> None:
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.5, 1.0), (4, 3, 1), cell)
    surface = faceted_surface(mesh.points, mesh.surfaces["z0"])
    gradient = areas_pulled_back(surface, np.ones(len(surface.nodes)))
    assert np.sum(gradient * surface.points) == pytest.approx(2 * 2.0 * 1.5)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cell", [*CELLS, *PLANE_CELLS])
def test_the_volume_agrees_with_central_differences(cell: str, order: int) -> None:
    mesh = crumpled(cell, order)
    move = np.random.default_rng(6).standard_normal(mesh.points.shape)
    up, down = (mesh.moved(mesh.points + sign * STEP * move).volume for sign in (1, -1))
    adjoint = np.sum(volume_by_points(mesh) * move)
    assert abs(adjoint) > 0.1
    assert adjoint == pytest.approx((up - down) / (2 * STEP), rel=1e-7)


@pytest.mark.parametrize("cell", CELLS)
def test_a_body_that_grows_by_its_own_coordinates_grows_by_three_times_its_volume(cell: str) -> None:
    mesh = crumpled(cell)
    assert np.sum(volume_by_points(mesh) * mesh.points) == pytest.approx(3 * mesh.volume, rel=1e-12)


@pytest.mark.parametrize("cell", CELLS)
def test_inner_nodes_do_not_change_the_volume(cell: str) -> None:
    mesh = crumpled(cell)
    gradient = volume_by_points(mesh)
    outside = np.unique(np.concatenate([facets.ravel() for facets in mesh.surfaces.values()]))
    inside = np.setdiff1d(np.arange(mesh.n_nodes), outside)
    assert len(inside) > 5
    assert np.all(gradient[inside] == 0.0)
    assert np.abs(gradient[outside]).max(axis=1).min() > 1e-3


# The surface that a design moves, between the nodes of the mesh.
def arc(alpha: list[float], *, known: bool = True) -> MovedSurface:
    """A half disc of radius 2 with few nodes."""
    mesh = half_disc(2.0, 4, symmetry="")
    given = mesh if known else mesh.with_shapes({})
    return MovedSurface(SurfaceDesign("disc", side_of(mesh, "contact"), len(alpha)), given, np.array(alpha))


def test_between_the_nodes_it_lies_on_the_true_shape() -> None:
    places = np.linspace(0, 1, 41)[:, None]
    middle = arc([0.0]).mesh.shapes["contact"]
    radius = [
        np.abs(middle.distance(arc([0.0], known=known).before(places))).max() for known in (True, False)
    ]
    assert radius[0] < 1e-12 < 1e-5 < radius[1]


def test_a_constant_net_gives_a_parallel_surface_and_nodes_move_exactly() -> None:
    surface = arc([0.1, 0.1, 0.1])
    places = np.linspace(0, 1, 41)[:, None]
    np.testing.assert_allclose(surface.movement(places), 0.1, rtol=1e-14)
    away = surface.mesh.shapes["contact"].distance(surface.after(places))
    np.testing.assert_allclose(away, 0.1, rtol=0.03)  # the directions are those of facets
    design = surface.design
    wanted = surface.mesh.points[design.lattice.nodes] + design.displacement(surface.alpha)
    np.testing.assert_allclose(surface.after(surface.parameters), wanted, atol=1e-14)


def test_nodes_that_form_no_grid_and_other_variables_are_refused() -> None:
    surface = arc([0.0, 0.1])
    lattice = surface.design.lattice
    turned = replace(surface.design, surface=replace(lattice, parameters=1 - lattice.parameters))
    with pytest.raises(InvalidInputError, match="must form a grid in its parameters"):
        replace(surface, design=turned)
    with pytest.raises(InvalidInputError, match=r"must have shape \(2,\), got \(3,\)"):
        replace(surface, alpha=np.zeros(3))


# Derivatives of a block of two materials that is heated and drawn by a force that varies in space.
JUDGES = objectives("block") | {
    name: aims("block", "z0")[name] for name in ("largest stress", "friction work")
}


@cache
def line() -> Line:
    blocks = problem(two_materials())
    alpha = 0.01 * np.random.default_rng(1).standard_normal(blocks.size)
    return Line(blocks, alpha, np.random.default_rng(6).standard_normal(blocks.size), 1e-5)


@pytest.mark.parametrize("objective", JUDGES)
def test_the_adjoint_agrees_with_central_differences(objective: str) -> None:
    assert line().is_smooth()
    assert line().steepness(JUDGES[objective]) > 0.02
    assert line().miss(JUDGES[objective]) < 1e-5


def test_only_materials_of_subdomains_that_there_are_have_forms() -> None:
    """The block is cut into a part of both materials and one of wood alone."""
    here = line()
    here.point(JUDGES["energy"])
    parts = {tuple(map(type, part.material.materials)) for part in here.state().torn.subdomains}
    assert parts == {(IsotropicElasticity, OrthotropicElasticity), (OrthotropicElasticity,)}
    names = [name[1:-1] for name in here.problem.geometry.forms.compiled if name[0] == "work by shape"]
    assert sorted(names, key=len) == sorted(parts, key=len)


def test_ranks_with_parts_of_other_materials_have_the_forms_of_all(mpirun: Callable[..., str]) -> None:
    script = """
        import json, sys
        import numpy as np
        from mpi4py import MPI
        from tests.design.blocks import problem
        from tests.design.objectives import objectives
        from tests.design.two_materials import two_materials

        comm, alpha = MPI.COMM_WORLD, np.array(json.loads(sys.argv[1]))
        point = problem(two_materials(), comm).evaluate_by(objectives("block")["energy"], alpha)
        parts = comm.allgather([len(part.material.materials) for part in point.state.torn.subdomains])
        if comm.rank == 0:
            sys.stdout.write(f"{parts} {point.gradient.tolist()}")
    """
    parts, gradient = mpirun(script, 2, json.dumps(line().alpha.tolist())).split("]] ")
    assert parts == "[[2], [1"
    expected = line().point(JUDGES["energy"]).gradient
    np.testing.assert_allclose(json.loads(gradient), expected, atol=1e-6 * np.abs(expected).max())


def test_heat_and_the_force_count() -> None:
    """Without their derivatives the adjoint misses."""

    def left_out(patch: pytest.MonkeyPatch) -> None:
        patch.setattr(work_derivative, "moving_loads", lambda torn, moving: [])

    judge: Objective = JUDGES["energy"]
    assert miss_without(left_out, line(), judge) > 1e-3


# The reverse mode through points of mortar contact between true surfaces, with planes of symmetry.
MORTAR_STEP, SHARE = 1e-6, 0.3


def in_touch(kind: str, cells: int, radius: float, *, convex: bool) -> FacetedSurface:
    """A warped piece of a cylinder that ends on a plane of symmetry at z = 0."""
    plain = shell(kind, cells, radius, convex=convex, span=(0.3, 1.5) if convex else (0.5, 2.0))
    warp = 0.004 * np.random.default_rng(cells).standard_normal(plain.points.shape)
    mirrored = np.zeros(warp.shape, dtype=bool)
    mirrored[plain.points[:, 2] == 0.0, 2] = True
    return reconstructed(placed(plain, plain.points + np.where(mirrored, 0.0, warp), mirrored))


def placed(surface: FacetedSurface, points: np.ndarray, mirrored: np.ndarray) -> FacetedSurface:
    plain = replace(faceted_surface(points, surface.facets, mirrored), cut=surface.cut)
    return plain.with_areas_of_pieces()


def moved(surface: FacetedSurface, by: np.ndarray) -> FacetedSurface:
    """The surface with other nodes, those on the plane of symmetry within it."""
    plain = placed(surface, surface.points + np.where(surface.mirrored, 0.0, by), surface.mirrored)
    return replace(plain, relief=surface.relief)


def couple(slave: FacetedSurface, master: FacetedSurface) -> MortarPoints:
    return MortarPoints.of(slave, master, np.ones(len(slave.nodes), dtype=bool), SHARE)


@dataclass(frozen=True)
class MortarSetting:
    """Two surfaces, the nodes with multipliers, and random derivatives by the points there."""

    slave: FacetedSurface
    master: FacetedSurface
    chosen: np.ndarray
    by: CouplingDerivatives

    def scalar(self, slave: FacetedSurface, master: FacetedSurface) -> float:
        met, by = couple(slave, master), self.by
        found = met.coupling
        assert np.array_equal(found.node, self.chosen)
        weights = np.einsum("nr,nr->", by.left, met.weight @ np.concatenate([by.own, by.right]))
        return float(by.area @ found.area + weights + np.sum(by.normal * found.normal) + by.gap @ met.gap)


@cache
def mortar_setting(kinds: tuple[str, str]) -> MortarSetting:
    slave, master = in_touch(kinds[0], 6, 1.0, convex=True), in_touch(kinds[1], 8, 1.05, convex=False)
    chosen, rng = couple(slave, master).coupling.node, np.random.default_rng(3)
    by = CouplingDerivatives(
        rng.standard_normal(len(chosen)), rng.standard_normal((len(chosen), 2)),
        rng.standard_normal((len(master.nodes), 2)), rng.standard_normal((len(chosen), 3)),
        rng.standard_normal(len(chosen)), rng.standard_normal((len(slave.nodes), 2)),
    )  # fmt: skip
    return MortarSetting(slave, master, chosen, by)


@pytest.mark.parametrize("kinds", SOLID, ids="-".join)
def test_gaps_are_closable_from_both_sides_and_at_the_rim_means(kinds: tuple[str, str]) -> None:
    here = mortar_setting(kinds)
    gaps = couple(here.slave, here.master).closable
    assert gaps is not None
    assert gaps.kept.any()
    assert {0.0, SHARE} == set(gaps.share)
    alone = (gaps.share == 0.0) & ~gaps.kept
    assert alone.any(), "what faces them has nodes that face nothing"
    own = dict(zip(gaps.here.point, gaps.here.gap, strict=True))
    assert gaps.value[alone] == pytest.approx([own[node] for node in here.chosen[alone]], abs=1e-15)
    met = couple(here.slave, here.master)
    assert isinstance(met.gathering, CondensedDualBasis)
    assert gaps.kept[met.gathering.gathers].all()
    assert here.slave.mirrored.any()
    assert here.master.mirrored.any()


@pytest.mark.parametrize("which", ["slave", "master"])
@pytest.mark.parametrize("kinds", [*SOLID, ("triangles6", "quads9"), ("quads", "triangles6")], ids="-".join)
def test_the_derivative_by_nodes_agrees_with_central_differences(kinds: tuple[str, str], which: str) -> None:
    here, rng = mortar_setting(kinds), np.random.default_rng(11)
    ways = [rng.standard_normal(each.points.shape) for each in (here.slave, here.master)]
    ways[which == "slave"] *= 0.0
    by = mortar_points_pulled_back(couple(here.slave, here.master), here.by, MPI.COMM_SELF)
    terms = [
        np.where(surface.mirrored, 0.0, part * way)
        for surface, part, way in zip((here.slave, here.master), by, ways, strict=True)
    ]
    ahead, behind = (
        here.scalar(moved(here.slave, s * ways[0]), moved(here.master, s * ways[1]))
        for s in (MORTAR_STEP, -MORTAR_STEP)
    )
    found, size = sum(map(np.sum, terms)), sum(np.abs(term).sum() for term in terms)
    assert size > 1.0
    assert abs(found - (ahead - behind) / (2 * MORTAR_STEP)) < 1e-6 * size


# Gaps where a surface turns away from the other one in a crease.
def turning_away(kind: str, master: bool) -> tuple[FacetedSurface, FacetedSurface]:
    """A line that turns away by 45 degrees within a facet of the other, which it touches."""
    x = halved(np.linspace(0.0, 1.0, 8)[:, None])[:, 0] if kind == "edges3" else np.linspace(0.0, 1.0, 8)
    ends = np.array([[-0.1, 0.0], [0.23, 0.0], [0.47, 0.0], [0.76, 0.29], [1.1, 0.63]])
    ends[:, 1] *= 1.0 if master else -1.0
    bent = lattice(halved(ends) if kind == "edges3" else ends, kind, master)
    flat = lattice(np.column_stack([x, 0.0 * x]), kind, not master)
    return (flat, bent) if master else (bent, flat)


@pytest.mark.parametrize("master", [True, False])
@pytest.mark.parametrize("kind", ["edges", "edges3"])
def test_bodies_that_only_touch_do_not_overlap_at_creases(kind: str, master: bool) -> None:
    slave, other = turning_away(kind, master)
    met = couple(slave, other)
    assert met.gap.min() > -1e-9
    assert met.gap.max() > 0.1
    means = met.coupling.gap.min()
    assert means < -1e-3 if master else means > -1e-9, "not even the means"


@pytest.mark.parametrize("kind", ["edges", "edges3"])
def test_gaps_at_creases_are_continuous_while_bodies_part(kind: str) -> None:
    slave, other = turning_away(kind, True)
    heights = np.linspace(-0.05, 0.05, 101)
    gaps = np.array([couple(moved(slave, np.array([0.0, up])), other).gap for up in heights])
    steps = np.abs(np.diff(gaps, axis=0)) / np.diff(heights)[:, None]
    assert 0.5 < steps.max() < 2.0


@pytest.mark.parametrize("kind", ["edges", "edges3"])
def test_gaps_at_creases_have_the_derivative_of_those_of_nodes(kind: str) -> None:
    rng = np.random.default_rng(5)
    slave, master = (  # not only touching, where many points are as low as their lowest node
        moved(side, 1e-3 * rng.standard_normal(side.points.shape)) for side in turning_away(kind, True)
    )
    met = couple(slave, master)
    assert met.closable is not None
    assert met.closable.nodal.any()
    count = len(met.coupling.node)
    none = np.zeros((count, 0)), np.zeros((len(master.nodes), 0)), np.zeros((count, 2))
    by = CouplingDerivatives(np.zeros(count), *none, rng.standard_normal(count))
    ways = [rng.standard_normal(each.points.shape) for each in (slave, master)]
    pulled = mortar_points_pulled_back(met, by, MPI.COMM_SELF)
    ends = [
        by.gap @ couple(moved(slave, s * ways[0]), moved(master, s * ways[1])).gap
        for s in (MORTAR_STEP, -MORTAR_STEP)
    ]
    found = sum(np.sum(part * way) for part, way in zip(pulled, ways, strict=True))
    assert found == pytest.approx((ends[0] - ends[1]) / (2 * MORTAR_STEP), rel=1e-5)
