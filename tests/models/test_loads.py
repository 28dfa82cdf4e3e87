"""Loads given as numbers, functions of position or UFL mean the same, and have the right resultants."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import ufl

from fenics_contact import Body, BodyForce, Pressure, Scene, ThermalStrain, TotalForce, Traction, Ufl, gravity
from fenics_contact._scene.loads import Load
from fenics_contact.errors import InvalidInputError
from tests.models.bodies import bent, box, steel
from tests.models.elements import CELLS, load_by_node, whole


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
            r"UFL value of BodyForce on body 'cell' must have shape \(3,\), got \(\): return a vector of 3",
        ),
        (
            ThermalStrain("cell", Ufl(lambda x: x)),
            r"UFL value of ThermalStrain on body 'cell' must have shape \(\), got \(3,\): return a scalar",
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
        InvalidInputError, match=r"TotalForce.value must be numbers, got .*: a resultant cannot depend on pos"
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
