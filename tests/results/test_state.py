"""What a state holds: contact, fields, areas, slips, words and pictures."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    RigidPlane,
    Scene,
    State,
    Status,
    Support,
    Surface,
    TotalForce,
    Traction,
    Tresca,
    _dolfinx,
    box_partition,
    contact_area,
    contact_width,
    solve_scene,
    solve_steps,
    write_vtu,
)
from fenics_contact._equilibrium.steps import stored_state
from fenics_contact.errors import ConvergenceError, InvalidInputError, MissingRequirementError
from fenics_contact.gallery import block, cylinder, half_disc, hemisphere, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.qp import FaceNewton
from fenics_contact.results.area import _reach
from fenics_contact.results.contact import pairs_in_words
from fenics_contact.results.deformed_state import AnyState
from fenics_contact.results.dual_solve import contact_result
from fenics_contact.results.fields import cell_values
from fenics_contact.results.forces import nodal_forces
from fenics_contact.theory import hertz_line, hertz_point
from tests.equilibrium.checks import assert_solved
from tests.equilibrium.rank_cases import TENSION, uniaxial
from tests.pictures.plane_states import plane_block
from tests.pictures.states import pulled, touching_blocks
from tests.scenes import (
    SOFT,
    STIFF,
    block_on_plane,
    crowned,
    partitions,
    pressed_block,
    two_blocks,
)

TOLERANCE = 1e-9


def solved(scene) -> AnyState:
    state = solve_scene(
        scene, MPI.COMM_SELF, partitions=partitions(scene), solver=FaceNewton(tolerance=TOLERANCE)
    )
    assert_solved(state, TOLERANCE)
    return state


@pytest.mark.parametrize(
    "scene",
    [block_on_plane(Coulomb(0.6)), two_blocks(Tresca(1.0), "tetrahedron"), pressed_block(Coulomb(0.5))],
    ids=["Coulomb", "Tresca", "prescribed displacement"],
)
def test_the_primal_energy_is_the_dual_energy_and_contains_the_friction(scene) -> None:
    state = solved(scene)
    energies = state.energies
    assert energies.primal == pytest.approx(energies.dual, rel=1e-7)
    assert energies.strain > 0.01
    assert energies.friction > 1e-5 * energies.strain
    assert energies.primal == energies.total_potential + energies.friction
    lengths = np.linalg.norm(state.contact.slip, axis=1)
    assert energies.friction == pytest.approx(state.contact.slip_bound @ lengths, rel=1e-12)
    told = dict(line.rsplit(maxsplit=1) for line in str(energies).splitlines())
    assert float(told["total potential"]) == pytest.approx(energies.total_potential, rel=1e-5)
    assert len(told) == 6


def test_pressures_integrate_to_the_load() -> None:
    state = solved(block_on_plane(Coulomb(0.6)))
    contact = state.contact
    assert contact.points.area.sum() == pytest.approx(2.0, rel=1e-2)  # slightly more than the flat face has
    assert contact.pressure @ contact.points.area == pytest.approx(4.0, rel=1e-9)
    assert contact.force.sum(axis=0) == pytest.approx([-2.0, -0.6, 4.0], rel=1e-8)
    assert contact.pressure.max() > 2.0  # the mean


def test_statuses_say_what_forces_and_ways_say() -> None:
    contact = solved(block_on_plane(Coulomb(0.6))).contact
    open_, stick, slip = (contact.status == status for status in (Status.OPEN, Status.STICK, Status.SLIP))
    assert min(open_.sum(), stick.sum(), slip.sum()) > 0
    size, way = contact.normal_force.max(), np.abs(contact.slip).max()
    friction, sliding = np.linalg.norm(contact.friction_force, axis=1), np.linalg.norm(contact.slip, axis=1)
    assert contact.gap[open_].min() > 1e-6 * way
    assert contact.normal_force[open_].max() == 0
    assert np.abs(contact.gap[~open_]).max() < 1e-6 * way
    assert contact.normal_force[~open_].min() > 0
    assert sliding[stick].max() < 1e-6 * way
    assert np.all(friction[stick] < contact.slip_bound[stick])
    assert sliding[slip].min() > 1e-6 * way
    assert friction[slip] == pytest.approx(contact.slip_bound[slip], abs=1e-6 * size)


def test_a_scene_without_contact_is_a_linear_solve() -> None:
    scene = uniaxial("hexahedron")
    state = solve_scene(scene, MPI.COMM_SELF, partitions=partitions(scene), tolerance=1e-10)
    assert_solved(state, TOLERANCE)
    assert state.contact.points.count == 0
    assert state.contact.force.shape == (0, 3)
    assert state.counts["normal_multipliers"] == state.counts["tangential_multipliers"] == 0
    assert state.counts["solver_steps"] <= 2
    assert state.counts["f_products"] < 50
    assert ("1 step, " if state.counts["solver_steps"] == 1 else "2 steps, ") in repr(state)
    assert state.energies.friction == 0
    elongation = state.gather_displacement("bar")[:, 0].max()
    assert state.energies.load == pytest.approx(TENSION * elongation, rel=1e-8)


def test_counts_and_seconds_are_told() -> None:
    state = solved(two_blocks(Coulomb(0.38)))
    counts = state.counts
    assert counts["subdomains"] == 4
    assert counts["torn_unknowns"] == sum(s.mesh.size for s in state.system.torn.subdomains)
    assert counts["normal_multipliers"] == 35
    assert counts["tangential_multipliers"] == 70
    assert 10 < counts["f_products"] < 300
    assert counts["f_products"] <= state.system.products
    assert counts["solver_steps"] == len(state.solution.history) > 1
    assert {"decompose", "assemble", "factor", "solve", "state"} <= set(state.seconds)
    assert all(seconds >= 0 for seconds in state.seconds.values())


def test_places_of_contact_points_are_those_of_their_slave_nodes() -> None:
    state = solved(two_blocks(Coulomb(0.38)))
    slave = state.scene.contacts[0].slave
    mesh = state.scene.bodies[slave.body].mesh
    wanted = mesh.points[np.unique(mesh.surfaces[slave.name])]
    places = state.contact_places
    assert places.shape == (state.contact.points.count, 3)
    assert len(wanted) == len(places) > 10
    np.testing.assert_array_equal(np.unique(places, axis=0), np.unique(wanted, axis=0))


def test_forces_are_never_below_zero_whatever_the_tolerance_leaves_and_still_balance() -> None:
    state = solved(block_on_plane(Coulomb(0.6)))
    torn, multiplier = state.torn, state.solution.multiplier.copy()
    ways = np.where(state.contact.status == Status.OPEN, state.contact.gap, np.inf)
    opened = np.sort(np.argsort(-np.where(np.isfinite(ways), ways, -1.0))[:2])
    rows = np.searchsorted(torn.numbering.owned, torn.normal_rows[opened])
    multiplier[rows] = [-7e-4, 1e-6]
    unclean = replace(state.rows, multiplier=multiplier)
    contact = contact_result(state.torn, unclean, state.torn_displacement)
    assert contact.normal_force.min() == 0.0
    assert np.array_equal(contact.normal_force > 0.0, contact.status != Status.OPEN)
    acting = nodal_forces(state.torn, multiplier, state.torn_displacement).contact
    left = np.einsum("nd,nd->n", (acting - contact.force)[opened], contact.points.normal[opened])
    assert left == pytest.approx([-7e-4, 1e-6], rel=1e-9)


def test_no_attribute_of_a_state_solves_anything() -> None:
    state = solved(block_on_plane(Coulomb(0.6)))
    before = state.system.products
    names = [name for name in dir(type(state)) if not name.startswith("_")]
    assert len([getattr(state, name) for name in names]) > 20
    assert state.system.products == before
    assert state.estimate_errors(geometry=False) is state.known_errors
    assert state.system.products == before + 1


# What is said of each contact pair.
RUBBING = r"\w+ \w+ on \w+ \w+: \d+ points, \d+ open, \d+ stick, \d+ slip; normal force \S+ N, friction \d"
SMOOTH = r"\w+ \w+ on rigid plane: \d+ points, \d+ open, [1-9]\d* closed; normal force [1-9.]"


@pytest.mark.parametrize(
    ("scene", "told"),
    [(two_blocks(Coulomb(0.6)), RUBBING), (pressed_block(None), SMOOTH)],
    ids=["two bodies with friction", "rigid plane without"],
)
def test_a_pair_is_told_by_its_surfaces_and_its_points_by_what_they_can_do(scene: Scene, told: str) -> None:
    state = solve_scene(scene, MPI.COMM_SELF, partitions=partitions(scene))
    (words,) = pairs_in_words(scene, state.contact, "N", "MPa")
    assert re.match(told, words), words
    assert re.search(r" \S+ N, pressure up to \S+ MPa$", words), words
    # These surfaces are flat.
    pressing = re.search(r"normal force (\S+) N", words)
    assert pressing is not None
    assert float(pressing[1]) == pytest.approx(state.contact.normal_force.sum(), rel=1e-5)


# Cellwise fields come in the order of the body's own cells, whatever order and ranks dolfinx gave them.
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_cell_values_come_in_the_order_of_the_body(cell: str) -> None:
    body = block((0, 0, 0), (1, 2, 3), (3, 2, 2), cell)
    mesh = _dolfinx.rank_mesh(MPI.COMM_SELF, body.points, body.cells, np.zeros(body.n_cells, int), cell)
    function = _dolfinx.fem.Function(_dolfinx.scalar_space(mesh, 0))
    x, y, z = function.function_space.tabulate_dof_coordinates().T
    function.x.array[:] = x + 10 * y + 100 * z
    middle = body.points[body.cells].mean(axis=1)
    np.testing.assert_allclose(cell_values(function, body.cells), middle @ [1, 10, 100])


RANKS = """
    import numpy as np
    from mpi4py import MPI
    from fenics_contact import _dolfinx
    from fenics_contact.results.fields import cell_values
    from fenics_contact.gallery import block

    comm = MPI.COMM_WORLD
    body = block((0, 0, 0), (1, 2, 3), (3, 2, 2))
    rank = np.ones(body.n_cells, dtype=int)
    mesh = _dolfinx.rank_mesh(comm, body.points, body.cells, rank, "hexahedron")
    function = _dolfinx.fem.Function(_dolfinx.scalar_space(mesh, 0))
    middle = body.points[body.cells].mean(axis=1) @ [1, 10, 100]
    x, y, z = function.function_space.tabulate_dof_coordinates().T
    function.x.array[:] = x + 10 * y + 100 * z
    np.testing.assert_allclose(cell_values(function, body.cells), middle)
    owned = comm.gather(mesh.topology.index_map(3).size_local)
    if comm.rank == 0:
        print(*owned)
"""


def test_cell_values_are_gathered_from_ranks_of_which_one_has_no_cell(mpirun: Callable[..., str]) -> None:
    assert mpirun(RANKS, 2).split() == ["0", "12"]


# A state as pyvista's MultiBlock holds what its files hold, on every rank.
STATES = {
    "hexahedron": lambda: touching_blocks("hexahedron"),
    "tetrahedron": lambda: touching_blocks("tetrahedron"),
    "quadrilateral": lambda: plane_block("quadrilateral"),
    "triangle": lambda: plane_block("triangle"),
    "hexahedron27": lambda: pulled("hexahedron27"),
    "tetrahedron10": lambda: pulled("tetrahedron10"),
    "quadrilateral9": lambda: pulled("quadrilateral9"),
    "triangle6": lambda: pulled("triangle6"),
}


@pytest.mark.parametrize("cell", list(STATES))
def test_the_blocks_hold_the_fields_of_the_files(cell: str, tmp_path: Path) -> None:
    state = STATES[cell]()
    blocks, files = state.to_pyvista(), pv.read(write_vtu(state, tmp_path))
    assert blocks.keys() == list(state.scene.bodies) == files.keys()
    for name, body in state.scene.bodies.items():
        ours, theirs = blocks[name], files[name]
        np.testing.assert_array_equal(ours.celltypes, theirs.celltypes)
        np.testing.assert_array_equal(ours.cell_connectivity, theirs.cell_connectivity)
        np.testing.assert_allclose(ours.points, theirs.points)
        for mine, written in ((ours.point_data, theirs.point_data), (ours.cell_data, theirs.cell_data)):
            assert set(mine.keys()) == set(written.keys())
            assert len(mine.keys()) >= 2
            for key in mine.keys():
                np.testing.assert_allclose(mine[key], written[key], err_msg=key)
        assert np.abs(ours.point_data["displacement"]).max() > 0
        sizes = ours.compute_cell_sizes()
        volume = sizes["Volume" if body.mesh.dim == 3 else "Area"].sum()
        assert volume == pytest.approx(body.mesh.volume), "the nodes of a cell are out of order"


def test_points_are_moved_by_the_factor_asked_for() -> None:
    state = touching_blocks()
    name = next(iter(state.scene.bodies))
    still, moved = state.to_pyvista()[name], state.to_pyvista(deformed=3.0)[name]
    np.testing.assert_allclose(moved.points - still.points, 3.0 * state.gather_displacement(name), atol=1e-12)
    assert np.ptp(moved.points - still.points) > 0
    with pytest.raises(InvalidInputError, match=r"deformed must be finite, got nan: give the factor"):
        state.to_pyvista(np.nan)


def test_without_pyvista_the_error_names_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(MissingRequirementError, match=r"needs pyvista.*pip install 'fenics_contact\[viz\]'"):
        touching_blocks().to_pyvista()


PYVISTA_RANKS = """
    import numpy as np
    from mpi4py import MPI
    from fenics_contact import solve_scene
    from fenics_contact import Coulomb
    from tests.scenes import partitions, two_blocks

    scene = two_blocks(Coulomb(0.4))
    state = solve_scene(scene, MPI.COMM_WORLD, partitions=partitions(scene), tolerance=1e-6)
    for name, block in zip(state.scene.bodies, state.to_pyvista()):
        numbers = [block.point_data["displacement"].sum(), block.cell_data["von_mises"].sum()]
        numbers = MPI.COMM_WORLD.gather([block.n_points, block.n_cells, *np.round(numbers, 4)])
        if MPI.COMM_WORLD.rank == 0:
            for line in numbers:
                print(*line)
"""


def test_every_rank_holds_all_of_it(mpirun: Callable[..., str]) -> None:
    lines = [line.split() for line in mpirun(PYVISTA_RANKS, 2).splitlines()]
    expected = [
        [
            block.n_points,
            block.n_cells,
            block.point_data["displacement"].sum(),
            block.cell_data["von_mises"].sum(),
        ]
        for block in touching_blocks().to_pyvista()
        for _ in range(2)
    ]
    np.testing.assert_allclose(np.array(lines, dtype=float), expected, atol=2e-4, rtol=1e-4)


# The contact area is that of theory, a smooth function of the load, and exact where all is closed.
MODULUS = 1000.0 / (1 - 0.3**2)
SOLID, PLANE = IsotropicElasticity(1000.0, 0.3), PlaneStrain(1000.0, 0.3)


def ball(force: float, size: int = 12) -> State:
    """A quarter of a half ball on a rigid plane."""
    guides = [Support("ball", "x0", (0, None, None)), Support("ball", "y0", (None, 0, None))]
    scene = Scene(
        {"ball": Body(hemisphere(10.0, size), SOLID)},
        guides,
        [TotalForce("ball", "top", (0, 0, -force / 4))],
        [ContactPair(Surface("ball", "contact"), RigidPlane((0, 0, 0), (0, 0, 1)))],
    )
    return solve_scene(scene, MPI.COMM_WORLD, solver=FaceNewton(tolerance=1e-8))


@pytest.mark.slow
@pytest.mark.claim
def test_the_area_under_a_ball_is_that_of_hertz() -> None:
    found, nodal = [], []
    for force in (100.0, 200.0, 300.0, 400.0, 500.0):
        state, exact = ball(force), hertz_point(force, (0.1, 0.1), MODULUS).area / 4
        found.append(abs(contact_area(state) / exact - 1))
        closed = state.contact.status > 0
        nodal.append(abs(state.contact.points.area[closed].sum() / exact - 1))
    assert max(found) < 0.1
    assert np.mean(found) < 0.3 * np.mean(nodal), "counting nodes is as good"


def test_the_footprint_of_a_ball_is_round_with_the_radius_of_hertz() -> None:
    state, exact = ball(500.0, 8), hertz_point(500.0, (0.1, 0.1), MODULUS)
    along, diagonal = (contact_width(state, axis, "ball contact") for axis in ((1, 0, 0), (1, 1, 0)))
    assert along == pytest.approx(exact.semi_axes[0], rel=0.02)
    assert diagonal == pytest.approx(exact.semi_axes[0], rel=0.06)
    assert contact_area(state, "ball contact on rigid plane") == pytest.approx(exact.area / 4, rel=0.06)


@pytest.mark.parametrize("discretisation", ["mortar", "node"])
@pytest.mark.parametrize("cells", [9, 13])
def test_contact_ends_where_the_master_ends(cells: int, discretisation: str) -> None:
    """A plate pressed all over a smaller stamp whose edges lie within its facets."""
    plate, stamp = block((0, 0, 1), (5, 4, 2), (cells, 7, 2)), block((1, 0.5, 0), (3.3, 2.7, 1), (6, 5, 3))
    scene = Scene(
        {"plate": Body(plate, SOLID), "stamp": Body(stamp, SOLID)},
        [Support("stamp", "z0"), Support("plate", "z1", (0.0, 0.0, -0.01))],
        contacts=[ContactPair(Surface("plate", "z0"), Surface("stamp", "z1"), None, discretisation)],
    )
    state = solve_scene(scene, MPI.COMM_WORLD)
    assert state.contact.count(Status.OPEN) == 0
    near = 1e-9 if discretisation == "mortar" else 0.06
    assert contact_area(state) == pytest.approx(2.3 * 2.2, rel=near)
    for axis, size, facet in (((1, 0, 0), 2.3, 5 / cells), ((0, 1, 0), 2.2, 4 / 7)):
        assert abs(contact_width(state, axis) - size) < 1.2 * facet


@pytest.mark.parametrize("discretisation", ["mortar", "node"])
def test_contact_reaches_over_nodes_that_supports_hold(discretisation: str) -> None:
    """A pin in a tube with an overlap: the ring of nodes at its clamped end has no contact points."""
    pin, tube = cylinder(1.0, 1.5, 3, 4), cylinder(2.0, 1.5, 4, 3, hole=1.0)
    sides = Surface("pin", "outer"), Surface("tube", "inner")
    pair = ContactPair(*sides, discretisation=discretisation, interference=0.01)
    scene = Scene(
        {"pin": Body(pin, SOLID), "tube": Body(tube, SOLID)},
        [Support("pin", "bottom"), Support("tube", "outer")],
        contacts=[pair],
    )
    state = solve_scene(scene, MPI.COMM_WORLD)
    assert state.contact.points.count == 24 * 4
    assert contact_area(state) == pytest.approx(3.0 * np.pi, rel=0.02)
    assert contact_width(state, (0, 0, 1)) == pytest.approx(1.5, rel=1e-9)


def test_a_width_reaches_over_what_is_open_between() -> None:
    """A bridge on its two feet, whose footprints lie apart; nothing touches once it is lifted."""
    mesh = block((0.0, 0.0, 0.0), (6.0, 2.0, 1.0), (6, 2, 1))
    bottom = mesh.surfaces["z0"]
    middle = np.abs(mesh.points[bottom].mean(axis=1)[:, 0] - 3.0) < 2.0
    mesh = replace(mesh, surfaces={**mesh.surfaces, "feet": bottom[~middle]})
    pair = ContactPair(Surface("bridge", "feet"), RigidPlane((0, 0, 0), (0, 0, 1)))
    widths = []
    for push in (-0.01, 0.01):
        supports = [Support("bridge", "z1", (0.0, 0.0, push))]
        state = solve_scene(Scene({"bridge": Body(mesh, SOLID)}, supports, contacts=[pair]), MPI.COMM_WORLD)
        widths.append([contact_width(state, axis) for axis in np.eye(3)])
    np.testing.assert_allclose(widths[0], (6.0, 2.0, 0.0), atol=1e-12)
    assert contact_area(state) == 0.0
    np.testing.assert_array_equal(widths[1], 0.0)
    with pytest.raises(InvalidInputError, match="the direction of a contact width must be 3 finite numbers"):
        contact_width(state, (1, 0))


def test_the_width_under_a_disc_is_that_of_hertz() -> None:
    force = 200.0
    scene = Scene(
        {"disc": Body(half_disc(10.0, 12), PLANE)},
        [Support("disc", "x0", (0, None))],
        [TotalForce("disc", "top", (0, -force / 2))],
        [ContactPair(Surface("disc", "contact"), RigidPlane((0, 0), (0, 1)))],
    )
    state = solve_scene(scene, MPI.COMM_WORLD, solver=FaceNewton(tolerance=1e-8))
    half_width = hertz_line(force, 0.1, MODULUS).half_width
    assert contact_area(state, "disc contact") == pytest.approx(half_width, rel=0.05)
    assert contact_width(state, (2.0, 0.0)) == pytest.approx(contact_area(state), rel=5e-3)
    rise = half_width**2 / 20.0  # of the circle, as small displacements leave the surface round
    assert contact_width(state, (0.0, 1.0)) == pytest.approx(rise, rel=0.1)


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron", "quadrilateral"])
def test_a_face_that_is_pressed_all_over_touches_all_over(cell: str) -> None:
    plane = cell == "quadrilateral"
    mesh = rectangle((0, 0), (3, 1), (3, 2)) if plane else block((0, 0, 0), (3, 2, 1), (3, 2, 2), cell)
    down, side = ((0.0, -1.0), "y") if plane else ((0.0, 0.0, -1.0), "z")
    held = ((0.0, None), (0.0, 1.0)) if plane else ((0.0, None, None), (0.0, 0.0, 1.0))
    supports = [Support("block", "x0", held[0])]
    if not plane:
        supports.append(Support("block", "y0", (None, 0.0, None)))
    floor = RigidPlane((0.0,) * mesh.dim, held[1])
    scene = Scene(
        {"block": Body(mesh, PLANE if plane else SOLID)},
        supports,
        [TotalForce("block", f"{side}1", down)],
        [ContactPair(Surface("block", f"{side}0"), floor)],
    )
    state = solve_scene(scene, MPI.COMM_WORLD)
    assert contact_area(state) == pytest.approx(3.0 if plane else 6.0, rel=1e-12)
    assert state.contact.travel(np.array(down)) == 0.0
    assert state.contact.travel(-np.array(down)) == np.inf


def test_the_rim_lies_where_pressure_and_gap_of_a_smooth_contact_place_it() -> None:
    inside, length, size = np.array([0.1, 0.5, 0.9, 1.7]), 2.0, 3.0
    pressure, spread = size * np.sqrt(inside), 4 / 3 * size * (length - inside) ** 1.5
    np.testing.assert_allclose(_reach(pressure, spread, np.full(4, length)), inside / length, rtol=1e-9)


# Slip is how far a slave node moved along its master in the last step, whether friction minds or not.
WALL = RigidPlane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))


def pushed(friction: Coulomb | None, discretisation: str = "node") -> Scene:
    """A crowned block pressed on another one and pushed along it, beside a wall without friction."""
    lower = block((0.0, 0.0, -0.7), (2.1, 1.1, 0.0), (7, 3, 2))
    upper = crowned(block((0.3, 0.0, 0.0), (1.8, 1.1, 0.9), (5, 3, 3)), 0.03)
    return Scene(
        {"lower": Body(lower, STIFF), "upper": Body(upper, SOFT)},
        [Support("lower", "z0"), Support("upper", "z1", (0.02, 0.003, -0.04))],
        contacts=[
            ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), friction, discretisation),
            ContactPair(Surface("upper", "y0"), WALL),
        ],
    )


def cut(scene: Scene) -> dict[str, np.ndarray]:
    return {name: box_partition(body.mesh, (2, 3, 1)) for name, body in scene.bodies.items()}


def moved_along(state: State) -> np.ndarray:
    """Return the relative displacement along the tangents, from the displacements of the bodies."""
    displacement = np.vstack([state.gather_displacement(name) for name in state.scene.bodies])
    points = state.contact.points
    return np.einsum("nad,nd->na", points.tangents, points.jump @ displacement)


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
@pytest.mark.parametrize("friction", [None, Coulomb(0.2)])
def test_slip_is_the_relative_displacement_with_and_without_friction(
    friction: Coulomb | None, discretisation: str
) -> None:
    scene = pushed(friction, discretisation)
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene))
    contact, expected = state.contact, moved_along(state)
    size = np.abs(expected).max()
    assert size > 0.01
    for pair in (0, 1):
        mine = contact.on_pair(pair)
        assert {Status.OPEN, Status.SLIP} & set(contact.status[mine])
        assert np.abs(expected[mine]).max() > 0.1 * size
        np.testing.assert_allclose(contact.slip[mine], expected[mine], atol=1e-3 * size)
    np.testing.assert_array_equal(contact.slip_before, 0.0)
    assert not contact.friction_force[contact.on_pair(1)].any()


def test_slip_without_friction_counts_from_the_last_step() -> None:
    scene = pushed(None)
    base, way = scene.supports[0], [(0.02, 0.0), (0.05, 0.01), (0.01, -0.02)]
    steps = [LoadStep(f"{x}, {y}", supports=[base, Support("upper", "z1", (x, y, -0.04))]) for x, y in way]
    states = solve_steps(
        ContactProblem(replace(scene, supports=[base]), MPI.COMM_SELF, partitions=cut(scene), tolerance=1e-8),
        steps,
    )
    before = np.zeros_like(states[0].contact.slip)
    for state in states:
        contact, total = state.contact, moved_along(state)
        size = np.abs(total).max()
        np.testing.assert_allclose(contact.total_slip, total, atol=1e-6 * size)
        np.testing.assert_allclose(contact.slip, total - before, atol=1e-6 * size)
        before = total
        assert np.abs(contact.slip).max() > 0.01
    assert np.abs(states[2].contact.slip_before).max() > 0.01


# `ContactProblem`: what it keeps from one answer to the next, and what it does not.
SCENE = block_on_plane(Coulomb(0.6))
HEAVIER = replace(SCENE, loads=[Traction("block", "z1", (1.05, 0.3, -2.1))])


def posed(**more: Any) -> ContactProblem:
    return ContactProblem(SCENE, MPI.COMM_SELF, partitions=partitions(SCENE), tolerance=1e-8, **more)


def test_a_problem_solved_once_is_a_scene_solved_in_one_call() -> None:
    problem = posed()
    state = problem.solve()
    once = solve_scene(SCENE, MPI.COMM_SELF, partitions=partitions(SCENE), tolerance=1e-8)
    assert problem.state is state
    np.testing.assert_array_equal(state.contact.force, once.contact.force)
    assert state.counts == once.counts


def test_subdomains_stay_and_seconds_add_up() -> None:
    problem = posed()
    first = problem.solve()
    decomposition, spent = problem.decomposition, dict(problem.timer.seconds)
    second = problem.solve(HEAVIER)
    assert second.torn.decomposition is decomposition is first.torn.decomposition
    assert problem.timer.seconds["decompose"] == spent["decompose"]
    assert problem.timer.seconds["solve"] > spent["solve"]


def test_a_failure_leaves_the_last_answer() -> None:
    problem = posed(solver=FaceNewton(max_products=3000))
    state = problem.solve()
    problem.solver = FaceNewton(max_products=1)
    with pytest.raises(ConvergenceError, match=r"none of them was left for a step.*raise max_products"):
        problem.solve(HEAVIER, start=None)
    assert problem.state is state


def test_other_supports_than_those_of_the_first_scene_are_other_rows_of_the_same_subdomains() -> None:
    problem, held = posed(), replace(SCENE, supports=[*SCENE.supports, Support("block", "z1")])
    first = problem.solve()
    again = problem.solve(held)
    known = solve_scene(held, MPI.COMM_WORLD)
    np.testing.assert_allclose(
        again.gather_displacement("block"), known.gather_displacement("block"), atol=1e-4
    )
    assert again.torn.decomposition is not first.torn.decomposition


def test_a_problem_that_follows_a_state_goes_on_from_it() -> None:
    state = posed().solve()
    following = ContactProblem.following(state, tolerance=1e-8)
    again = following.solve()
    assert again.torn.decomposition is state.torn.decomposition
    assert again.counts["f_products"] < 5 < state.counts["f_products"]


def test_a_stored_state_is_restored_beside_the_last_answer() -> None:
    problem = posed()
    light = problem.solve()
    heavy = problem.solve(HEAVIER)
    found = problem.restore(stored_state(light), SCENE)
    assert problem.state is heavy
    np.testing.assert_allclose(found.contact.force, light.contact.force, atol=1e-9)
    assert found.solution.products == 1
