"""Loads, moments, temperatures and supports of bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import ufl
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    LoadStep,
    Pressure,
    Scene,
    State,
    Support,
    ThermalStrain,
    TotalForce,
    Traction,
    Ufl,
    box_partition,
    gravity,
    solve_scene,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import (
    AnisotropicElasticity,
    IsotropicElasticity,
    Material,
    OrthotropicElasticity,
    OrthotropicPlaneStress,
    PlaneStrain,
    PlaneStress,
    material_axes,
)
from fenics_contact.mesh import quadratic
from tests.materials.bodies import bent, box, in_halves, steel
from tests.materials.elements import CELLS, PLANE, SPACE, load_by_node, whole
from tests.scenes import Load


def force(cell: str, *loads: Load, straight: bool = False) -> np.ndarray:
    """Nodal forces on a bent box, shape (n, dim)."""
    mesh = box(cell) if straight else bent(box(cell))
    return load_by_node(whole(Body(mesh, steel(mesh.dim, expansion=1e-3)), loads))


def three_ways(kind: Any, dim: int, scalar: bool, linear: bool) -> list[Load]:
    """The same load as numbers, as a function of position and in UFL; the first only if it is uniform."""
    numbers = np.array([0.5, -1.0, 2.0])[:dim]
    place = ("body", "x1") if kind in (Traction, Pressure) else ("body",)
    uniform = 1.5 if scalar else tuple(numbers)

    def factor(x: Any) -> Any:
        return 1.0 + 2.0 * x[0] - x[1] if linear else 1.0 + 0.0 * x[0]

    def of_position(points: np.ndarray) -> np.ndarray:
        assert points.shape[1] == dim
        return 1.5 * factor(points.T) if scalar else factor(points.T)[:, None] * numbers

    def in_ufl(x: Any) -> Any:
        return 1.5 * factor(x) if scalar else [factor(x) * float(number) for number in numbers]

    ways = [kind(*place, of_position), kind(*place, Ufl(in_ufl))]
    return ways if linear else [kind(*place, uniform), *ways]


def renamed(load: Load) -> Load:
    """The load on the body "cell"."""
    surface = () if isinstance(load, BodyForce | ThermalStrain) else (load.surface,)
    return type(load)("cell", *surface, load.value)  # type: ignore[call-arg]


@pytest.mark.parametrize("linear", [False, True], ids=["uniform", "linear"])
@pytest.mark.parametrize("kind", [Traction, Pressure, BodyForce, ThermalStrain])
@pytest.mark.parametrize("cell", CELLS)
def test_all_ways_to_give_a_load_agree_where_they_coincide(cell: str, kind: Any, linear: bool) -> None:
    """A linear function is interpolated exactly at the nodes."""
    dim = box(cell).dim
    ways = three_ways(kind, dim, kind in (Pressure, ThermalStrain), linear)
    first, *others = (force(cell, renamed(load)) for load in ways)
    assert np.abs(first).max() > 0.01
    for other in others:
        np.testing.assert_allclose(other, first, atol=1e-13 * np.abs(first).max())


@pytest.mark.parametrize("cell", CELLS)
def test_resultants_are_what_was_given(cell: str) -> None:
    mesh = bent(box(cell))
    given = (0.5, -1.0, 2.0)[: mesh.dim]
    total = force(cell, TotalForce("cell", "x1", given)).sum(axis=0)
    np.testing.assert_allclose(total, given, rtol=1e-12)
    weight = force(cell, gravity("cell", 2.0, given)).sum(axis=0)
    np.testing.assert_allclose(weight, 2.0 * mesh.volume * np.array(given), rtol=1e-12)
    side = 1.0  # length, or area, of the straight side
    pull = force(cell, Traction("cell", "x1", given), straight=True).sum(axis=0)
    np.testing.assert_allclose(pull, np.array(given) * side, rtol=1e-12)


@pytest.mark.parametrize("cell", CELLS)
def test_pressure_presses_against_the_outward_normal(cell: str) -> None:
    total = force(cell, Pressure("cell", "x1", 3.0), straight=True).sum(axis=0)
    np.testing.assert_allclose(total, np.eye(box(cell).dim)[0] * -3.0, atol=1e-13)


@pytest.mark.parametrize("cell", CELLS)
def test_uniform_pressure_all_around_has_no_resultant_and_no_moment(cell: str) -> None:
    mesh = bent(box(cell))
    around = [Pressure("cell", surface, 3.0) for surface in mesh.surfaces]
    forces = force(cell, *around)
    assert np.abs(forces).max() > 0.1
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-13)
    moments = mesh.points.T @ forces
    np.testing.assert_allclose(moments, moments.T, atol=1e-12)


@pytest.mark.parametrize("cell", CELLS)
def test_pressure_that_grows_with_depth_carries_what_floats(cell: str) -> None:
    """Archimedes: the resultant of p = −y all around is the volume, upwards."""
    mesh = bent(box(cell))
    around = [Pressure("cell", surface, Ufl(lambda x: -x[1])) for surface in mesh.surfaces]
    lift = force(cell, *around).sum(axis=0)
    np.testing.assert_allclose(lift, np.eye(mesh.dim)[1] * mesh.volume, atol=1e-12)


@pytest.mark.parametrize("cell", CELLS)
def test_thermal_strain_puts_no_net_force_on_a_body(cell: str) -> None:
    forces = force(cell, ThermalStrain("cell", lambda points: points[:, 0] ** 2))
    assert np.abs(forces).max() > 0.01
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-13)


def test_loads_of_one_kind_add_up() -> None:
    single = [
        force("hexahedron", ThermalStrain("cell", value)) for value in (2.0, lambda points: points[:, 1])
    ]
    both = force("hexahedron", ThermalStrain("cell", 2.0), ThermalStrain("cell", lambda points: points[:, 1]))
    np.testing.assert_allclose(both, sum(single), atol=1e-14)


def test_loads_are_equal_when_their_numbers_or_functions_are() -> None:
    def function(points: np.ndarray) -> np.ndarray:
        return points

    assert Traction("a", "s", (1, 2, 3)) == Traction("a", "s", np.array([1.0, 2.0, 3.0]))
    assert hash(Traction("a", "s", [1, 2, 3])) == hash(Traction("a", "s", (1.0, 2.0, 3.0)))
    assert BodyForce("a", function) == BodyForce("a", function)
    assert BodyForce("a", function) != BodyForce("a", lambda points: points)
    assert Pressure("a", "s", Ufl(function)) == Pressure("a", "s", Ufl(function))


@pytest.mark.parametrize(
    ("load", "message"),
    [
        (
            Traction("cell", "x1", lambda points: points[:, 0]),
            r"given as Traction on body 'cell' must return finite numbers of shape \(\d+, 3\) .* got shape",
        ),
        (
            Pressure("cell", "x1", lambda points: points),
            r"given as Pressure on body 'cell' must return finite numbers of shape \(\d+,\)",
        ),
        (
            BodyForce("cell", lambda points: points / 0),
            r"something other than finite numbers: it receives all points",
        ),
        (
            BodyForce("cell", Ufl(lambda x: x[0])),
            r"BodyForce on 'cell' needs shape \(3,\), got \(\): a vector of 3",
        ),
        (
            ThermalStrain("cell", Ufl(lambda x: x)),
            r"ThermalStrain on 'cell' needs shape \(\), got \(3,\): a scalar",
        ),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero:RuntimeWarning", "ignore:invalid value:RuntimeWarning")
def test_a_function_that_returns_something_else_is_refused(load: Load, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        force("hexahedron", load)


@pytest.mark.parametrize(
    "load",
    [
        Traction("body", "x1", (1.0, 0.0)),
        BodyForce("body", (1.0, 0.0)),
        TotalForce("body", "x1", (1.0, 0.0)),
    ],
)
def test_a_load_must_have_as_many_components_as_its_body(load: Load) -> None:
    message = r"value of body 'body' must hold three, for x, y and z, got \(1.0, 0.0\): give 3 of them"
    with pytest.raises(InvalidInputError, match=message):
        Scene({"body": Body(box("hexahedron"), steel(3))}, loads=[load])


def test_a_load_of_three_components_does_not_suit_a_plane_body() -> None:
    message = r"Traction.value of body 'plate' must hold two entries, for x and y, as the body is plane, got"
    with pytest.raises(InvalidInputError, match=message):
        Scene({"plate": Body(box("triangle"), steel(2))}, loads=[Traction("plate", "x1", (1, 0, 0))])


def test_scalar_loads_must_be_numbers_or_functions() -> None:
    with pytest.raises(
        InvalidInputError, match=r"Pressure.value must be a finite number, got \(1, 2\): give a n"
    ):
        Pressure("body", "x1", (1, 2))  # type: ignore[arg-type]
    with pytest.raises(
        InvalidInputError, match=r"ThermalStrain.temperature_change must be a finite number, got"
    ):
        ThermalStrain("body", float("nan"))
    with pytest.raises(
        InvalidInputError, match=r"TotalForce.value must be three finite numbers .* on position is a Traction"
    ):
        TotalForce("body", "x1", lambda points: points)  # type: ignore[arg-type]


def test_a_material_without_expansion_does_not_take_a_temperature() -> None:
    message = (
        r"ThermalStrain needs a thermal expansion of every material of body 'body', got none for Isotropic"
    )
    with pytest.raises(InvalidInputError, match=message):
        Scene({"body": Body(box("hexahedron"), steel(3))}, loads=[ThermalStrain("body", 10.0)])


def test_ufl_may_use_everything_that_ufl_has() -> None:
    pull = force(
        "hexahedron",
        Traction("cell", "x1", Ufl(lambda x: ufl.as_vector([ufl.exp(x[1]), 0, 0]))),
        straight=True,
    )
    assert pull[:, 0].sum() == pytest.approx(np.e - 1, rel=1e-4)


# A force with a moment, or at a point, is spread over its surface with exactly that resultant.

#: Quadratic cells and the linear ones of their shapes.
QUADRATIC = {
    "quadrilateral9": "quadrilateral",
    "triangle6": "triangle",
    "hexahedron27": "hexahedron",
    "tetrahedron10": "tetrahedron",
}


def curved(cell: str) -> BodyMesh:
    """A bent body of linear cells, or of quadratic ones whose edges are curved."""
    return bent(box(cell) if cell in CELLS else quadratic(box(QUADRATIC[cell])))


def nodal(mesh: BodyMesh, load: TotalForce | Traction) -> np.ndarray:
    return load_by_node(whole(Body(mesh, steel(mesh.dim)), [load]))


def moment(forces: np.ndarray, arms: np.ndarray) -> np.ndarray:
    if forces.shape[1] == 2:
        return np.array([np.sum(arms[:, 0] * forces[:, 1] - arms[:, 1] * forces[:, 0])])
    return np.cross(arms, forces).sum(axis=0)


@pytest.mark.parametrize("far", [0.0, 1e4])
@pytest.mark.parametrize("cell", [*CELLS, *QUADRATIC])
def test_force_and_moment_are_what_was_given(cell: str, far: float) -> None:
    mesh = curved(cell)
    mesh = mesh.moved(mesh.points + far)
    force, about = np.array([0.5, -1.0, 2.0])[: mesh.dim], np.array([1.0, -3.0, 2.0])[: mesh.dim] + far
    turn: Any = (0.7, -0.3, 0.4) if mesh.dim == 3 else 0.7
    # Coordinates far from the origin have fewer digits behind the point.
    near = 1e-12 * (np.linalg.norm(force) + np.linalg.norm(turn)) * (1 + 0.1 * far)
    for given in (turn, None):
        forces = nodal(mesh, TotalForce("cell", "x1", force, given, about))
        np.testing.assert_allclose(forces.sum(axis=0), force, rtol=0, atol=near)
        expected = np.atleast_1d(0.0 * np.asarray(turn) if given is None else given)
        np.testing.assert_allclose(moment(forces, mesh.points - about), expected, rtol=0, atol=near)
    turned = nodal(mesh, TotalForce("cell", "x1", 0.0 * force, turn))
    np.testing.assert_allclose(turned.sum(axis=0), 0.0, atol=near)
    np.testing.assert_allclose(moment(turned, mesh.points - about), turn, rtol=0, atol=near)
    off = np.setdiff1d(np.arange(mesh.n_nodes), mesh.surfaces["x1"])
    assert not np.any(turned[off])
    assert np.abs(turned).max() > 0.01


@pytest.mark.parametrize("cell", CELLS)
def test_a_force_at_the_centroid_is_spread_evenly(cell: str) -> None:
    mesh = box(cell)
    force = (0.5, -1.0, 2.0)[: mesh.dim]
    middle = (2.0, 0.5, 0.5)[: mesh.dim]
    even = nodal(mesh, TotalForce("cell", "x1", force))
    np.testing.assert_allclose(
        even, nodal(mesh, Traction("cell", "x1", force)), rtol=1e-15
    )  # on an area of one
    np.testing.assert_allclose(nodal(mesh, TotalForce("cell", "x1", force, at=middle)), even, atol=1e-14)


def test_a_torque_on_a_flat_face_is_a_traction_around_its_middle() -> None:
    mesh = block((0, 0, 0), (1, 2, 4), (2, 4, 6))
    second = 2 * 4 * (2**2 + 4**2) / 12
    around = Traction(
        "cell", "x1", lambda x: np.stack([0 * x[:, 0], 2 - x[:, 2], x[:, 1] - 1], axis=1) / second
    )
    torque = nodal(mesh, TotalForce("cell", "x1", (0.0, 0.0, 0.0), moment=(1.0, 0.0, 0.0)))
    np.testing.assert_allclose(torque, nodal(mesh, around), atol=1e-14)
    bending = TotalForce("cell", "x1", (0.0, 0.0, 0.0), moment=(0.0, 0.0, 1.0))
    linear = Traction("cell", "x1", lambda x: np.outer(-(x[:, 1] - 1) / (4 * 2**3 / 12), (1, 0, 0)))
    np.testing.assert_allclose(nodal(mesh, bending), nodal(mesh, linear), atol=1e-14)


@pytest.mark.parametrize(
    ("plane", "given", "words"),
    [
        (
            True,
            {"moment": (0.0, 0.0, 1.0)},
            "TotalForce.moment on surface 'x1' of body 'a' must be one number, positive from",
        ),
        (
            False,
            {"moment": 1.0},
            "must be three numbers, about x, y and z, got 1.0",
        ),
        (False, {"moment": (1.0, 2.0)}, r"must be three numbers, about x, y and z, got \(1.0, 2.0\)"),
        (
            True,
            {"at": (0.0, 0.0, 1.0)},
            r"TotalForce.at of the force on .* must have 2 coordinates, got \(0.0, 0",
        ),
        (False, {"at": (0.0, 0.0)}, "must have 3 coordinates"),
        (False, {"moment": (0.0, np.nan, 0.0)}, "TotalForce.moment must be finite numbers, got .*nan"),
        (True, {"moment": np.inf}, "TotalForce.moment must be finite numbers, got inf"),
        (False, {"at": (0.0, np.nan, 0.0)}, "TotalForce.at must be finite numbers"),
        (
            False,
            {"at": 3.0},
            "TotalForce.at must be a sequence .each a number. or None, got 3.0: point at which",
        ),
        (False, {"moment": "big"}, "TotalForce.moment must be .* got 'big': moment besides that of"),
    ],
)
def test_what_does_not_fit_the_space_is_refused(plane: bool, given: dict[str, Any], words: str) -> None:
    mesh = rectangle((0, 0), (1, 1), (2, 2)) if plane else block((0, 0, 0), (1, 1, 1), (2, 2, 2))
    with pytest.raises(InvalidInputError, match=words):
        Scene(
            {"a": Body(mesh, steel(mesh.dim))},
            [Support("a", "x0")],
            [TotalForce("a", "x1", (0.0,) * mesh.dim, **given)],
        )


def test_a_moment_needs_more_than_a_line() -> None:
    mesh = block((0, 0, 0), (1, 1, 1e-7), (1, 1, 1))
    with pytest.raises(
        InvalidInputError, match=r"surface 'x1' of 'cell' must not be a line for a moment: choose"
    ):
        nodal(mesh, TotalForce("cell", "x1", (0.0, 0.0, 0.0), moment=(0.0, 1.0, 0.0)))


# Temperature changes: free expansion has no stress, held expansion has the one of the book.
YOUNG, POISSON, EXPANSION, WARMER = 100.0, 0.3, 1e-3, 40.0
UNIFORM: list[Any] = [WARMER, lambda points: np.full(len(points), WARMER), Ufl(lambda x: WARMER + 0 * x[0])]


def rollers(dim: int, *more: str) -> list[Support]:
    """The sides of a box that meet at the origin stay in their planes, and those named in ``more``."""
    names = [("x", 0), ("y", 1), ("z", 2)][:dim]
    return [
        Support("body", f"{axis}{end}", tuple(0.0 if c == component else None for c in range(dim)))
        for axis, component in names
        for end in (0, 1)
        if end == 0 or f"{axis}1" in more
    ]


def heated(material: Material, cell: str, change: Any, *held: str) -> State:
    """A straight box of two subdomains at another temperature."""
    mesh = box(cell)
    partition = box_partition(mesh, (2, 1, 1)[: mesh.dim])
    loads = [ThermalStrain("body", change)]
    scene = Scene({"body": Body(mesh, material)}, rollers(mesh.dim, *held), loads)
    return solve_scene(scene, MPI.COMM_SELF, partitions={"body": partition}, tolerance=1e-10)


@pytest.mark.parametrize("change", UNIFORM, ids=["number", "function", "UFL"])
@pytest.mark.parametrize("cell", SPACE)
def test_a_free_body_expands_evenly_and_without_stress(cell: str, change: Any) -> None:
    state = heated(IsotropicElasticity(YOUNG, POISSON, EXPANSION), cell, change)
    expected = EXPANSION * WARMER * box(cell).points
    np.testing.assert_allclose(state.gather_displacement("body"), expected, atol=1e-10 * expected.max())
    assert state.gather_von_mises("body").max() < 1e-8 * YOUNG * EXPANSION * WARMER


@pytest.mark.parametrize("cell", SPACE)
def test_a_free_orthotropic_body_expands_along_its_axes(cell: str) -> None:
    axes = np.array(material_axes((1, 0.5, 0), (0, 1, 0)))
    along = np.array([1e-3, -2e-4, 3e-3])
    wood = OrthotropicElasticity(
        (11.0, 0.9, 0.5), (0.37, 0.42, 0.6), (0.7, 0.6, 0.05), tuple(map(tuple, axes)), tuple(along)
    )
    mesh = bent(box(cell))
    strain = WARMER * axes.T @ np.diag(along) @ axes
    supports = [Support("body", name, _linear(strain)) for name in ("x0", "x1")]
    scene = Scene({"body": Body(mesh, wood)}, supports, [ThermalStrain("body", WARMER)])
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
    np.testing.assert_allclose(state.gather_displacement("body"), mesh.points @ strain, atol=1e-9)
    assert state.gather_von_mises("body").max() < 1e-9
    assert abs(strain[0, 1]) > 0.01, "the axes are not turned: nothing was tested"


@pytest.mark.parametrize("cell", SPACE)
def test_a_free_anisotropic_body_also_shears(cell: str) -> None:
    axes = np.array(material_axes((1, 0.5, 0), (0, 1, 0.3)))
    own = 1e-3 * np.array([[1.0, 0.3, -0.2], [0.3, -0.5, 0.4], [-0.2, 0.4, 2.0]])
    roots = np.random.default_rng(3).uniform(-1.0, 1.0, (6, 6)) + 3.0 * np.eye(6)
    crystal = AnisotropicElasticity(
        roots @ roots.T,  # type: ignore[arg-type]
        tuple(map(tuple, axes)),
        (*np.diag(own), own[1, 2], own[0, 2], own[0, 1]),
    )
    mesh = bent(box(cell))
    strain = WARMER * axes.T @ own @ axes
    supports = [Support("body", name, _linear(strain)) for name in ("x0", "x1")]
    scene = Scene({"body": Body(mesh, crystal)}, supports, [ThermalStrain("body", WARMER)])
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
    np.testing.assert_allclose(state.gather_displacement("body"), mesh.points @ strain, atol=1e-9)
    assert state.gather_von_mises("body").max() < 1e-8


def _linear(strain: np.ndarray) -> Any:
    return tuple(lambda points, row=row: points @ row for row in strain)


@pytest.mark.parametrize("cell", PLANE)
def test_a_free_orthotropic_plate_expands_along_its_axes(cell: str) -> None:
    angle, along = 0.5, np.array([1e-3, 4e-3])
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    plate = OrthotropicPlaneStress((110.0, 9.0), 0.4, 7.0, angle, tuple(along))
    mesh, strain = bent(box(cell)), WARMER * axes.T @ np.diag(along) @ axes
    supports = [Support("body", name, _linear(strain)) for name in ("x0", "x1")]
    scene = Scene({"body": Body(mesh, plate)}, supports, [ThermalStrain("body", WARMER)])
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
    np.testing.assert_allclose(state.gather_displacement("body"), mesh.points @ strain, atol=1e-9)
    assert state.gather_von_mises("body").max() < 1e-7
    assert abs(strain[0, 1]) > 0.01, "the axes are not turned: nothing was tested"


@pytest.mark.parametrize("cell", CELLS)
def test_a_bar_between_walls_is_pressed(cell: str) -> None:
    """σ = −E α ΔT along the bar, free across it; in plane strain the same divided by 1 − ν² and (1 + ν)."""
    if cell in PLANE:
        state = heated(PlaneStress(YOUNG, POISSON, EXPANSION), cell, WARMER, "x1")
        across = EXPANSION * WARMER * (1 + POISSON)
    else:
        state = heated(IsotropicElasticity(YOUNG, POISSON, EXPANSION), cell, WARMER, "x1")
        across = EXPANSION * WARMER * (1 + POISSON)
    stress = YOUNG * EXPANSION * WARMER
    np.testing.assert_allclose(state.gather_von_mises("body"), stress, rtol=1e-8)
    height = box(cell).points[:, 1]
    np.testing.assert_allclose(state.gather_displacement("body")[:, 1], across * height, atol=1e-10)


@pytest.mark.parametrize("cell", PLANE)
def test_a_slice_of_a_long_body_expands_in_its_plane_and_is_pressed_along(cell: str) -> None:
    """Free in the plane: strain (1 + ν) α ΔT, stress −E α ΔT normal to it."""
    state = heated(PlaneStrain(YOUNG, POISSON, EXPANSION), cell, WARMER)
    expected = (1 + POISSON) * EXPANSION * WARMER * box(cell).points
    np.testing.assert_allclose(state.gather_displacement("body"), expected, atol=1e-10)
    np.testing.assert_allclose(state.gather_von_mises("body"), YOUNG * EXPANSION * WARMER, rtol=1e-8)


@pytest.mark.parametrize("cell", PLANE)
def test_a_free_plate_expands_evenly_and_without_stress(cell: str) -> None:
    state = heated(PlaneStress(YOUNG, POISSON, EXPANSION), cell, WARMER)
    expected = EXPANSION * WARMER * box(cell).points
    np.testing.assert_allclose(state.gather_displacement("body"), expected, atol=1e-10)
    assert state.gather_von_mises("body").max() < 1e-8 * YOUNG * EXPANSION * WARMER


def test_a_linear_temperature_bends_a_free_body_without_stress() -> None:
    """ΔT = g y: u = α g (x y, (y² − x²)/2), which bilinear cells can only approach."""
    g, found = 10.0, []
    for n in (4, 8):
        mesh = rectangle((0, 0), (1, 1), (n, n))
        material = PlaneStress(YOUNG, POISSON, EXPANSION)
        loads = [ThermalStrain("body", lambda points: g * points[:, 1])]
        roller, pin = Support("body", "x0", (0.0, None)), Support("body", "y0", (None, _bent_down(g)))
        scene = Scene({"body": Body(mesh, material)}, [roller, pin], loads)
        state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
        found.append(state.gather_von_mises("body").mean() / (YOUNG * EXPANSION * g))
    assert found[1] < 0.6 * found[0] < 0.1


def _bent_down(g: float) -> Any:
    return lambda points: -EXPANSION * g * points[:, 0] ** 2 / 2


def test_two_materials_that_expand_differently_press_each_other() -> None:
    """A bar of two halves between walls, which expand alike across: one stress in both."""
    mesh = in_halves(block((0, 0, 0), (2, 1, 1), (4, 2, 2)))
    left, right = (
        OrthotropicElasticity((E,) * 3, (0.0,) * 3, (E / 2,) * 3, thermal_expansion=(along, 5e-4, 0.0))
        for E, along in ((100.0, 1e-3), (300.0, 2e-3))
    )
    stress = WARMER * (1e-3 + 2e-3) / (1 / 100.0 + 1 / 300.0)
    for boxes in ((2, 1, 1), (1, 1, 2)):  # each half a subdomain, and both halves in each subdomain
        body = Body(mesh, {"left": left, "right": right})
        scene = Scene({"body": body}, rollers(3, "x1"), [ThermalStrain("body", WARMER)])
        state = solve_scene(
            scene, MPI.COMM_SELF, partitions={"body": box_partition(mesh, boxes)}, tolerance=1e-10
        )
        np.testing.assert_allclose(state.gather_von_mises("body"), stress, rtol=1e-8)


def test_without_a_temperature_nothing_thermal_is_compiled() -> None:
    mesh = box("hexahedron")
    body = Body(mesh, IsotropicElasticity(YOUNG, POISSON, EXPANSION))
    supports = [Support("body", "x0"), Support("body", "x1", (0.01, None, None))]
    state = solve_scene(Scene({"body": body}, supports), MPI.COMM_SELF, tolerance=1e-10)
    names = [name[0] for name in state.torn.decomposition.forms.compiled]
    assert names == ["stiffness"]


# Supports prescribe numbers or functions of position, component by component.
POINTS = np.array([[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]])


def test_values_are_numbers_functions_or_nan_where_free() -> None:
    support = Support("body", "x0", (None, 2.0, lambda points: points[:, 0] + points[:, 2]))
    np.testing.assert_array_equal(support.values(POINTS), [[np.nan, 2.0, 2.0], [np.nan, 2.0, 8.0]])
    plane = Support("body", "x0", (lambda points: points[:, 1], None))
    np.testing.assert_array_equal(plane.values(POINTS[:, :2]), [[1.0, np.nan], [4.0, np.nan]])


@pytest.mark.parametrize("function", [lambda points: points, lambda points: np.full(len(points), np.nan)])
def test_a_function_must_return_a_number_a_point(function: object) -> None:
    support = Support("body", "x0", (None, function, None))  # type: ignore[arg-type]
    with pytest.raises(
        InvalidInputError, match="component 1 of the support of surface 'x0' must return finite"
    ):
        support.values(POINTS)


@pytest.mark.parametrize("cell", CELLS)
def test_a_linear_displacement_all_around_is_taken_on_inside(cell: str) -> None:
    mesh = bent(box(cell))
    A = np.array([[0.01, 0.02, 0.0], [-0.01, 0.03, 0.01], [0.0, 0.02, -0.02]])[: mesh.dim, : mesh.dim]
    components = tuple(lambda points, row=row: points @ row for row in A)
    supports = [Support("body", surface, components) for surface in mesh.surfaces]
    state = solve_scene(
        Scene({"body": Body(mesh, steel(mesh.dim))}, supports), MPI.COMM_SELF, tolerance=1e-10
    )
    inside = np.setdiff1d(
        np.arange(mesh.n_nodes), np.concatenate([f.ravel() for f in mesh.surfaces.values()])
    )
    assert len(inside)
    np.testing.assert_allclose(state.gather_displacement("body"), mesh.points @ A.T, atol=1e-12)


def test_a_support_of_three_components_does_not_suit_a_plane_body() -> None:
    message = r"Support.value of body 'plate' must hold two entries, for x and y, as the body is plane, got"
    with pytest.raises(InvalidInputError, match=message):
        Scene({"plate": Body(box("triangle"), steel(2))}, [Support("plate", "x0", (0.0, 0.1, 0.0))])


@pytest.mark.parametrize("cell", CELLS)
def test_a_support_holds_all_directions_of_its_body_by_default(cell: str) -> None:
    mesh = box(cell)
    scene = Scene({"body": Body(mesh, steel(mesh.dim))}, [Support("body", "x0")])
    assert scene.supports == (Support("body", "x0", (0.0,) * mesh.dim),)
    held = np.unique(mesh.surfaces["x0"])
    assert scene.fixed("body")[held].all()
    assert not np.delete(scene.fixed("body"), held, axis=0).any()


def test_a_plane_body_that_is_held_by_default_is_solved() -> None:
    body = Body(box("triangle"), steel(2))
    pull = Traction("plate", "x1", (1.0, 0.0))
    states = [
        solve_scene(Scene({"plate": body}, [support], [pull]), MPI.COMM_SELF)
        for support in (Support("plate", "x0"), Support("plate", "x0", (0.0, 0.0)))
    ]
    moved = [state.gather_displacement("plate") for state in states]
    assert np.abs(moved[0]).max() > 0.0
    np.testing.assert_array_equal(*moved)


def test_a_load_step_holds_a_plane_body_by_default() -> None:
    scene = Scene({"plate": Body(box("triangle"), steel(2))}, [Support("plate", "x0", (0.1, 0.0))])
    assert LoadStep("back", supports=[Support("plate", "x0")]).applied_to(scene).supports[0].value == (
        0.0,
        0.0,
    )


# Plates and slices under uniaxial tension have the strains and the stress of the book (patch test).
PLANE_YOUNG, PLANE_POISSON, TENSION = 100.0, 0.3, 2.0


def irregular(cell: str) -> BodyMesh:
    """A rectangle whose inner nodes are displaced."""
    mesh = box(cell, (4, 3, 1))
    inside = np.setdiff1d(
        np.arange(mesh.n_nodes), np.concatenate([f.ravel() for f in mesh.surfaces.values()])
    )
    points = mesh.points.copy()
    points[inside] += 0.08 * np.sin(np.arange(2 * len(inside))).reshape(-1, 2)
    return mesh.moved(points)


def pulled(material: Material, cell: str) -> State:
    mesh = irregular(cell)
    scene = Scene(
        {"plate": Body(mesh, material)},
        [Support("plate", "x0", (0.0, None)), Support("plate", "y0", (None, 0.0))],
        [Traction("plate", "x1", (TENSION, 0.0))],
    )
    return solve_scene(
        scene, MPI.COMM_SELF, partitions={"plate": box_partition(mesh, (2, 1))}, tolerance=1e-10
    )


def strains(state: State) -> np.ndarray:
    """Strain along and across, of every node."""
    points = state.scene.bodies["plate"].mesh.points
    away = np.all(points > 0.1, axis=1)
    return np.asarray(state.gather_displacement("plate")[away] / points[away])


@pytest.mark.parametrize("cell", PLANE)
def test_a_plate_is_stretched_and_contracts(cell: str) -> None:
    state = pulled(PlaneStress(PLANE_YOUNG, PLANE_POISSON), cell)
    expected = np.array([1, -PLANE_POISSON]) * TENSION / PLANE_YOUNG
    np.testing.assert_allclose(strains(state), np.tile(expected, (len(strains(state)), 1)), rtol=1e-8)
    np.testing.assert_allclose(state.gather_von_mises("plate"), TENSION, rtol=1e-8)


@pytest.mark.parametrize("cell", PLANE)
def test_a_slice_is_stretched_less_and_pulled_along(cell: str) -> None:
    """ε = (1 − ν²) σ/E and −ν (1 + ν) σ/E; the stress normal to the plane is ν σ."""
    state = pulled(PlaneStrain(PLANE_YOUNG, PLANE_POISSON), cell)
    expected = np.array([1 - PLANE_POISSON**2, -PLANE_POISSON * (1 + PLANE_POISSON)]) * TENSION / PLANE_YOUNG
    np.testing.assert_allclose(strains(state), np.tile(expected, (len(strains(state)), 1)), rtol=1e-8)
    mises = TENSION * np.sqrt(1 - PLANE_POISSON + PLANE_POISSON**2)
    np.testing.assert_allclose(state.gather_von_mises("plate"), mises, rtol=1e-8)


@pytest.mark.parametrize("cell", PLANE)
def test_an_orthotropic_plate_is_as_stiff_as_the_axis_that_is_pulled(cell: str) -> None:
    for angle, young, poisson in ((0.0, 110.0, 0.4), (np.pi / 2, 9.0, 0.4 * 9.0 / 110.0)):
        state = pulled(OrthotropicPlaneStress((110.0, 9.0), 0.4, 7.0, angle), cell)
        expected = np.array([1, -poisson]) * TENSION / young
        np.testing.assert_allclose(strains(state), np.tile(expected, (len(strains(state)), 1)), rtol=1e-7)
