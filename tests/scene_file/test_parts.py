"""Parts of scene files: bodies, automatic contact and rigid surfaces."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Coulomb, FluidPressure, read_scene_file
from fenics_contact._scene import loads as loads_module
from fenics_contact._scene import obstacles, pairs, surface_laws
from fenics_contact._scene import supports as supports_module
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact._scene_file.source import SceneFileError
from fenics_contact._scene_file.values import Expression, VectorExpression
from fenics_contact.gallery import (
    LinkShape,
    ball,
    block,
    chain,
    cylinder,
    disc,
    half_disc,
    hemisphere,
    rectangle,
)
from fenics_contact.materials import (
    anisotropic,
    elastic,
    foam,
    hyperelastic,
    neo_hookean_metal,
    orthotropic,
    plastic,
    temperature_dependent,
)
from fenics_contact.qp import Mpgp, Smalse
from fenics_contact.shapes import Box, Cone
from tests.scene_file.texts import GOOD, changed

SELF = MPI.COMM_SELF
BLOCK = {"shape": "block", "lower": [0, 0, 0], "upper": [2, 1, 1], "counts": [4, 2, 2]}
STEEL = {"young_modulus": 2.1e5, "poisson_ratio": 0.3, "thermal_expansion": 1.2e-5}
YIELDING = {"young_modulus": 2.1e5, "poisson_ratio": 0.3, "yield_stress": 235, "isotropic_hardening": 2e3}
FLOOR = {"obstacle": "plane", "point": [0, 0, 0], "normal": [0, 0, 1]}


def file_of(*, mesh: dict[str, Any] = BLOCK, material: dict[str, Any] = STEEL, **more: Any) -> SceneFile:
    """A scene of one body "a"."""
    body = {"mesh": "m", "material": "s", **more.pop("body", {})}
    return read_scene_file(
        {"meshes": {"m": mesh}, "materials": {"s": material}, "bodies": {"a": body}, **more}, SELF
    )


def mesh_of(**mesh: Any) -> Any:
    plane = mesh["shape"] in ("rectangle", "half_disc", "disc")
    material = {**STEEL, "model": "plane_strain"} if plane else STEEL
    return file_of(mesh=mesh, material=material).scene.bodies["a"].mesh


def test_shapes_are_those_of_the_package() -> None:
    found = mesh_of(shape="hemisphere", radius=2.0, n=3, symmetry="x")
    np.testing.assert_array_equal(found.points, hemisphere(2.0, 3, symmetry="x").points)
    found = mesh_of(shape="half_disc", radius=2.0, n=3)
    np.testing.assert_array_equal(found.points, half_disc(2.0, 3).points)
    found = mesh_of(shape="disc", radius=2.0, n=3, hole=1.5, layers=1)
    np.testing.assert_array_equal(found.points, disc(2.0, 3, hole=1.5, layers=1).points)
    found = mesh_of(shape="ball", radius=2.0, n=2, grading=1.0)
    np.testing.assert_array_equal(found.points, ball(2.0, 2, grading=1.0).points)
    found = mesh_of(shape="cylinder", radius=2.0, length=3.0, n=2, n_length=2, axis=[0, 1, 0], degrees=90)
    straight = cylinder(2.0, 3.0, 2, 2)
    np.testing.assert_allclose(found.points, straight.points[:, [2, 1, 0]] * (1, 1, -1), atol=1e-12)
    found = mesh_of(shape="rectangle", lower=[0, 0], upper=[1, 2], counts=[2, 3], cell="triangle")
    np.testing.assert_array_equal(found.cells, rectangle((0, 0), (1, 2), (2, 3), "triangle").cells)


def test_a_grading_makes_cells_small_at_one_end() -> None:
    found = mesh_of(**{**BLOCK, "counts": [4, 4, 4], "grading": [2.0, -2.0, 0.0]})
    x, y, z = (np.diff(np.unique(found.points[:, axis].round(12))) for axis in range(3))
    assert np.all(np.diff(x) > 0)
    np.testing.assert_allclose(x / 2, y[::-1])
    np.testing.assert_allclose(z, 0.25)


def test_quadratic_cells_are_bent_onto_the_ball() -> None:
    found = mesh_of(shape="hemisphere", radius=2.0, n=3, quadratic=True)
    assert found.order == 2
    nodes = np.unique(found.surfaces["contact"])
    np.testing.assert_allclose(np.linalg.norm(found.points[nodes] - (0, 0, 2.0), axis=1), 2.0)


def test_a_mesh_is_scaled_then_turned_then_moved() -> None:
    found = mesh_of(**BLOCK, scale=2.0, axis=[0, 0, 3], degrees=90.0, translate=[1, 0, 0])
    x, y, z = block((0, 0, 0), (2, 1, 1), (4, 2, 2)).points.T
    np.testing.assert_allclose(found.points, np.column_stack([1 - 2 * y, 2 * x, 2 * z]))


def test_the_parts_of_a_chain_are_its_links() -> None:
    mesh = {"shape": "chain", "links": 3, "n_around": 24, "n_a": 2, "n_b": 6, "grading": 1.5}
    file = file_of(mesh=mesh, body={"part": "2"})
    links = chain([LinkShape(n_around=24, n_a=2, n_b=6, grading=1.5)] * 3).links
    np.testing.assert_array_equal(file.scene.bodies["a"].mesh.points, links[1].mesh.points)
    with pytest.raises(SceneFileError, match=r"bodies.a must have 'part', one of \['1', '2', '3'\]"):
        _ = file_of(mesh=mesh).scene


@pytest.mark.parametrize(
    ("given", "built"),
    [
        (STEEL, elastic.IsotropicElasticity(2.1e5, 0.3, 1.2e-5)),
        (
            {
                "model": "orthotropic", "young_moduli": [3, 2, 1], "poisson_ratios": [0.1, 0.2, 0.3],
                "shear_moduli": [1, 1, 1], "axis_1": [0, 2, 0], "axis_2": [-1, 1, 0],
            },
            orthotropic.OrthotropicElasticity(
                (3, 2, 1), (0.1, 0.2, 0.3), (1, 1, 1), orthotropic.material_axes((0, 1, 0), (-1, 0, 0))
            ),
        ),
        (
            {
                "model": "temperature_dependent", "young_modulus": [[20, 210.0], [500, 130.0]],
                "poisson_ratio": 0.3, "mean_expansion": [[20, 1e-5], [500, 2e-5]], "initial_temperature": 20,
            },
            temperature_dependent.TemperatureDependentElasticity(
                ((20.0, 210.0), (500.0, 130.0)), 0.3, ((20.0, 1e-5), (500.0, 2e-5)), 20.0
            ),
        ),
        (
            {"model": "anisotropic", "moduli": np.eye(6).tolist(), "axis_1": [0, 2, 0], "axis_2": [-1, 1, 0]},
            anisotropic.AnisotropicElasticity(
                np.eye(6), orthotropic.material_axes((0, 1, 0), (-1, 0, 0))  # type: ignore[arg-type]
            ),
        ),
        (
            YIELDING | {"model": "j2_plasticity", "kinematic_hardening": 1e3},
            plastic.J2Plasticity(2.1e5, 0.3, 235, 2e3, 1e3),
        ),
        (
            {
                "model": "j2_plasticity", "young_modulus": 2.1e5, "poisson_ratio": 0.3, "yield_stress": 235,
                "hardening_curve": [[0.02, 290], [0.1, 340]], "kinematic_curve": [[0.1, 9]],
            },
            plastic.J2Plasticity(
                2.1e5, 0.3, 235.0, hardening_curve=((0.02, 290.0), (0.1, 340.0)),
                kinematic_curve=((0.1, 9.0),),
            ),
        ),
        (
            YIELDING | {"model": "finite_plasticity", "saturation_stress": 300, "saturation_rate": 9},
            plastic.FinitePlasticity(2.1e5, 0.3, 235, 2e3, 300, 9),
        ),
        (
            {"model": "neo_hooke", "young_modulus": 10, "poisson_ratio": 0.4999, "mean_dilatation": True},
            hyperelastic.NeoHooke(10.0, 0.4999, mean_dilatation=True),
        ),
        (
            {"model": "mooney_rivlin", "c10": 1.0, "c01": 0.2, "bulk_modulus": 1e3},
            hyperelastic.MooneyRivlin(1.0, 0.2, 1e3),
        ),
        (
            {"model": "ogden", "shear_moduli": [2, -0.4], "exponents": [1.3, -2], "bulk_modulus": 9},
            hyperelastic.Ogden((2.0, -0.4), (1.3, -2.0), 9.0),
        ),
        (
            {"model": "ogden", "shear_moduli": [2], "exponents": [1.3], "bulk_modulus": 9},
            hyperelastic.Ogden((2.0,), (1.3,), 9.0),
        ),
        (
            {
                "model": "hyperfoam", "shear_moduli": [2] * 4, "exponents": [1, 2, 3, 4],
                "poisson_ratios": [0] * 4,
            },
            foam.Hyperfoam((2.0,) * 4, (1.0, 2.0, 3.0, 4.0), (0.0,) * 4),
        ),
        (
            {
                "model": "neo_hookean_plasticity", "young_modulus": 9, "poisson_ratio": 0.3,
                "yield_stress": 2, "kinematic_hardening": 1, "thermal_expansion": 1e-5,
            },
            neo_hookean_metal.NeoHookeanPlasticity(
                9.0, 0.3, 2.0, kinematic_hardening=1.0, thermal_expansion=1e-5
            ),
        ),
        (
            {"model": "st_venant_kirchhoff", "young_modulus": 10, "poisson_ratio": 0.2},
            hyperelastic.StVenantKirchhoff(10.0, 0.2),
        ),
    ],
    ids=[
        "isotropic", "ortho", "hot", "any", "j2", "curves", "finite", "neo", "mooney", "ogden", "one term",
        "foam", "metal", "st_venant",
    ],
)  # fmt: skip
def test_materials_are_those_of_the_package(given: dict[str, Any], built: elastic.Material) -> None:
    assert file_of(material=given).scene.bodies["a"].material == built


def test_plane_materials_have_a_thickness_and_others_none() -> None:
    plate = {"model": "plane_stress", "young_modulus": 3, "poisson_ratio": 0.1, "thickness": 2}
    flat = {"shape": "rectangle", "lower": [0, 0], "upper": [1, 1], "counts": [1, 1]}
    found = file_of(material=plate, mesh=flat).scene.bodies["a"]
    assert found.material == elastic.PlaneStress(3.0, 0.1, thickness=2.0)
    with pytest.raises(SceneFileError, match=r"a thickness is that of plane bodies, this one is in space"):
        _ = file_of(material=plate | {"model": "isotropic"}).scene


OWN = """
from dataclasses import dataclass
from fenics_contact.materials import IsotropicElasticity

@dataclass(frozen=True)
class Soft(IsotropicElasticity):
    layers: tuple[float, ...] = ()
"""


def test_a_material_of_ones_own_comes_from_a_python_file(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN)
    parameters = "{ young_modulus = 2.0, poisson_ratio = 0.1, layers = [1.0, 2.0] }"
    text = f"""
meshes.m = {{ shape = "block", lower = [0, 0, 0], upper = [1, 1, 1], counts = [1, 1, 1] }}
materials.s = {{ model = "own.py:Soft", parameters = {parameters} }}
bodies.a = {{ mesh = "m", material = "s" }}
"""
    path = tmp_path / "scene.toml"
    path.write_text(text)
    material: Any = read_scene_file(path, SELF).scene.bodies["a"].material
    assert (type(material).__name__, material.young_modulus, material.layers) == ("Soft", 2.0, (1.0, 2.0))
    for old, new, message in (
        ("own.py:Soft", "own.py:Hard", r"materials.s: '.*own.py' must define 'Hard', it defines \['Soft'\]"),
        ("layers =", "sheets =", "materials.s: parameters must be what 'own.py:Soft' takes"),
    ):
        path.write_text(text.replace(old, new))
        with pytest.raises(SceneFileError, match=message):
            _ = read_scene_file(path, SELF).scene
    (tmp_path / "own.py").write_text("1 / 0")
    path.write_text(text)
    with pytest.raises(SceneFileError, match="must run without errors, it raised ZeroDivisionError"):
        _ = read_scene_file(path, SELF).scene


def test_loads_and_supports_are_those_of_the_package() -> None:
    loads = [
        {"kind": "traction", "body": "a", "surface": "z1", "value": ["x", 0, 1.5]},
        {"kind": "total_force", "body": "a", "surface": "z1", "value": [1, 2, 3]},
        {"kind": "total_force", "body": "a", "surface": "z1", "value": [1, 2, 3], "at": [5, 0, 0]},
        {"kind": "total_moment", "body": "a", "surface": "z1", "value": [0, 0, 7]},
        {"kind": "pressure", "body": "a", "surface": "x1", "value": "2 * z"},
        {"kind": "body_force", "body": "a", "value": [0, 0, -1]},
        {"kind": "gravity", "body": "a", "density": 2.0, "acceleration": [0, 0, -10]},
        {"kind": "thermal", "body": "a", "value": 50},
    ]
    supports = [
        {"body": "a", "surface": "z0"},
        {"body": "a", "surface": "x0", "value": ["0.1 * y", "free", 0.5]},
    ]
    found = file_of(loads=loads, supports=supports).scene
    assert list(found.loads) == [
        loads_module.Traction("a", "z1", VectorExpression((Expression("x"), 0.0, 1.5))),
        loads_module.TotalForce("a", "z1", (1.0, 2.0, 3.0)),
        loads_module.TotalForce("a", "z1", (1.0, 2.0, 3.0), at=(5.0, 0.0, 0.0)),
        loads_module.TotalForce("a", "z1", (0.0, 0.0, 0.0), moment=(0.0, 0.0, 7.0)),
        loads_module.Pressure("a", "x1", Expression("2 * z")),
        loads_module.BodyForce("a", (0.0, 0.0, -1.0)),
        loads_module.gravity("a", 2.0, (0, 0, -10)),
        loads_module.ThermalStrain("a", 50.0),
    ]
    assert list(found.supports) == [
        supports_module.Support("a", "z0"),
        supports_module.Support("a", "x0", (Expression("0.1 * y"), None, 0.5)),
    ]


def contact_with(**keys: Any) -> pairs.ContactPair:
    contact = {"slave": {"body": "a", "surface": "z0"}, "master": FLOOR, **keys}
    (pair,) = file_of(contacts=[contact]).scene.contacts
    return pair


def test_gaps_and_interferences_are_those_of_the_package() -> None:
    assert contact_with().given_gap == ""
    pair = contact_with(gap=0.1)
    assert (pair.gap, pair.interference, pair.adjust) == (0.1, None, None)
    pair = contact_with(interference="measured", adjust=0.25)
    assert (pair.gap, pair.interference, pair.adjust) == (None, "measured", 0.25)
    formula = contact_with(interference="0.1 + 0.05 * x").gap_at(np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]))
    np.testing.assert_allclose(formula, [-0.1, -0.2])


@pytest.mark.parametrize(
    ("keys", "match"),
    [
        (
            {"gap": -0.1},
            r"contacts\.0\.gap must be a number of at least 0, a formula in x, y and z in quotes, or",
        ),
        ({"gap": "measured"}, r"contacts\.0\.gap: a formula may hold"),
        ({"interference": [0.1]}, r"contacts\.0\.interference must be 'measured', a number of at least 0, a"),
        ({"adjust": -1.0}, r"contacts\.0\.adjust must be a number of at least 0, got -1"),
        (
            {"gap": "x - 0.5"},
            r"contacts\.0\.gap: gap of a z0 on rigid plane must be zero or positive everywhere",
        ),
        (
            {"interference": "1 / x"},
            r"contacts\.0\.interference: the formula '1 / x' must have a finite value",
        ),
        ({"gap": 0.1, "interference": 0.1}, r"contacts\.0: a contact pair has a gap or an interference"),
    ],
)
def test_gaps_that_are_none_are_refused_at_their_key(keys: dict[str, Any], match: str) -> None:
    with pytest.raises(SceneFileError, match=match):
        contact_with(**keys)


def test_ties_have_no_gaps() -> None:
    tie = {"slave": {"body": "a", "surface": "z0"}, "master": {"body": "a", "surface": "z1"}, "gap": 0.1}
    with pytest.raises(SceneFileError, match=r"ties\.0\.gap"):
        file_of(ties=[tie])


def test_laws_of_surfaces_are_those_of_the_package() -> None:
    laws: dict[Any, dict[str, Any]] = {
        surface_laws.LinearClosure(5.0): {"law": "linear", "stiffness": 5},
        surface_laws.ExponentialClosure(5.0, 0.1): {
            "law": "exponential", "pressure": 5.0, "clearance": 0.1
        },
        surface_laws.ClosureTable((0.0, 0.1), (0.0, 3.0)): {
            "law": "table", "closures": [0, 0.1], "pressures": [0, 3]
        },
    }  # fmt: skip
    table = {"pressure": [1, 5], "coefficient": [0.3, 0.2]}
    friction = {"law": "coulomb", "coefficient": table, "shear_limit": 2}
    slave = {"body": "a", "surface": "z0"}
    for law, given in laws.items():
        pair = {"slave": slave, "master": FLOOR, "friction": friction, "closure": given}
        (found,) = file_of(contacts=[pair]).scene.contacts
        assert found.closure == law
        assert found.friction == pairs.Coulomb(surface_laws.FrictionTable((1.0, 5.0), (0.3, 0.2)), 2.0)
    by_slip = {"law": "coulomb", "coefficient": {"slip": [0, 0.1], "coefficient": [0.3, 0.2]}}
    (rubbed,) = file_of(contacts=[{"slave": slave, "master": FLOOR, "friction": by_slip}]).scene.contacts
    assert rubbed.friction == pairs.Coulomb(surface_laws.SlipTable((0.0, 0.1), (0.3, 0.2)))
    fluid = {"pressure": 2, "enters": "x0", "critical": 1}
    (wet,) = file_of(contacts=[{"slave": slave, "master": FLOOR, "fluid": fluid}]).scene.contacts
    assert wet.fluid == FluidPressure(2.0, "x0", 1.0)
    named = {"pressure": 2, "enters": "x0", "critical": "pressure", "name": "oil"}
    ramp = {"name": "leak", "count": 4, "fluids": {"oil": 3}}
    file = file_of(contacts=[{"slave": slave, "master": FLOOR, "fluid": named}], steps=[ramp, ramp])
    assert [step.fluids["oil"] for step in file.steps] == [2.25, 2.5, 2.75, 3.0, *[3.0] * 4]  # type: ignore[index]
    water = {**ramp, "fluids": {"water": 3}}
    with pytest.raises(SceneFileError, match=r"steps\.0\.fluids\.water must be the name of a fluid, .*oil"):
        _ = file_of(contacts=[{"slave": slave, "master": FLOOR, "fluid": named}], steps=[water])
    falling = {"law": "table", "closures": [0, 0.1, 0.2], "pressures": [0, 3, 2]}
    with pytest.raises(SceneFileError, match=r"contacts\.0: .* must rise for a unique answer"):
        _ = file_of(contacts=[{"slave": slave, "master": FLOOR, "closure": falling}]).scene


def test_obstacles_and_laws_of_friction_are_those_of_the_package() -> None:
    masters = [
        FLOOR,
        {"obstacle": "sphere", "centre": [0, 0, -9], "radius": 9, "hollow": False},
        {"obstacle": "cylinder", "point": [0, 0, -9], "axis": [1, 0, 0], "radius": 9},
        {"obstacle": "distance", "formula": "z"},
        {"obstacle": "cone", "tip": [0, 0, -1], "axis": [0, 0, -1], "half_angle": 1.2, "radius": 0.5},
        {"obstacle": "box", "centre": [0, 0, -2], "size": [3, 3, 2], "radius": 0.5, "rotation": [0, 0, 0.1]},
    ]
    laws: list[dict[str, Any]] = [
        {"law": "none"}, {"law": "coulomb", "coefficient": 0.2}, {"law": "tresca", "traction": 3},
        {"law": "none"}, {"law": "none"}, {"law": "none"},
    ]  # fmt: skip
    contacts = [
        {"slave": {"body": "a", "surface": "z0"}, "master": master, "friction": law}
        for master, law in zip(masters, laws, strict=True)
    ]
    found = file_of(contacts=contacts).scene.contacts
    assert [pair.friction for pair in found] == [None, pairs.Coulomb(0.2), pairs.Tresca(3.0), *[None] * 3]
    assert [pair.master for pair in found] == [
        obstacles.RigidPlane((0, 0, 0), (0, 0, 1)),
        obstacles.RigidSphere((0, 0, -9), 9.0),
        obstacles.RigidCylinder((0, 0, -9), (1, 0, 0), 9.0),
        obstacles.DistanceObstacle(Expression("z")),
        Cone((0, 0, -1), (0, 0, -1), 1.2, 0.5),
        Box((0, 0, -2), (3, 3, 2), 0.5, (0, 0, 0.1)),
    ]


@pytest.mark.parametrize("geometry", ["best", "reconstructed", "faceted"])
def test_a_contact_says_what_gaps_are_measured_between(geometry: str) -> None:
    contact = {"slave": {"body": "a", "surface": "z0"}, "master": FLOOR}
    (pair,) = file_of(contacts=[{**contact, "geometry": geometry}]).scene.contacts
    assert pair.geometry == geometry
    assert file_of(contacts=[contact]).scene.contacts[0].geometry == "best"
    with pytest.raises(SceneFileError, match=r"contacts\.0\.geometry must be .*'best', 'reconstructed'"):
        file_of(contacts=[{**contact, "geometry": "flat"}])


def test_a_formula_in_z_is_refused_for_plane_bodies() -> None:
    file = file_of(
        mesh={"shape": "rectangle", "lower": [0, 0], "upper": [1, 1], "counts": [1, 1]},
        material={**STEEL, "model": "plane_stress"},
        loads=[{"kind": "pressure", "body": "a", "surface": "y1", "value": "z"}],
    )
    with pytest.raises(
        SceneFileError, match=r"loads\.0\.value: the formula 'z' depends on z, but the bodies lie in"
    ):
        _ = file.scene


def test_subdomains_are_boxes_or_a_number_of_parts() -> None:
    cut = file_of(solver={"subdomains": [2, 1, 1]}).partitions["a"]
    assert (cut.max() + 1, np.bincount(cut).tolist()) == (2, [8, 8])
    assert file_of(solver={"subdomains": {"a": 3}}).partitions["a"].max() + 1 == 3
    with pytest.raises(SceneFileError, match=r"solver.subdomains: boxes\[0\] must be at most the 4 layers"):
        _ = file_of(solver={"subdomains": [9, 1, 1]}).partitions


def test_steps_go_from_value_to_value() -> None:
    supports = [
        {"name": "top", "body": "a", "surface": "z1", "value": [0, "free", -1]},
        {"body": "a", "surface": "z0"},
    ]
    loads = [{"name": "push", "kind": "pressure", "body": "a", "surface": "x1", "value": "x"}]
    steps: list[dict[str, Any]] = [
        {"name": "press"},
        {"name": "shift", "count": 2, "supports": {"top": [3, "free", -1]}},
        {"name": "push", "count": 2, "loads": {"push": "3 * x"}},
    ]
    found = file_of(supports=supports, loads=loads, steps=steps).steps
    assert [step.name for step in found] == ["press", "shift 1/2", "shift 2/2", "push 1/2", "push 2/2"]
    assert [step.supports[0].value for step in found if step.supports] == [
        (0.0, None, -1.0), (1.5, None, -1.0), (3.0, None, -1.0), (3.0, None, -1.0), (3.0, None, -1.0),
    ]  # fmt: skip
    assert all(step.supports and step.supports[1].value == (0.0, 0.0, 0.0) for step in found)
    pushed = [step.loads[0].value(np.array([[2.0, 0, 0]])) for step in found if step.loads]  # type: ignore[operator,union-attr]
    np.testing.assert_allclose([float(np.squeeze(push)) for push in pushed], [2, 2, 2, 4, 6])


def test_steps_follow_formulas_in_time() -> None:
    loads = [
        {"name": "push", "kind": "pressure", "body": "a", "surface": "x1", "value": 2.0},
        {"kind": "traction", "body": "a", "surface": "z1", "value": ["sin(t) * x", 0.0, "t"]},
    ]
    steps: list[dict[str, Any]] = [
        {"count": 2, "duration": 0.5},
        {"count": 2, "loads": {"push": "10 * t"}},
        {"count": 2, "duration": 4.0, "loads": {"push": 0.0}},
    ]
    found = file_of(loads=loads, steps=steps)
    times = [0.25, 0.5, 1.5, 2.5, 4.5, 6.5]
    assert [step.time for step in found.steps] == times
    at = np.array([[2.0, 0.0, 0.0]])
    pushed, pulled = zip(*(_values(step.loads, at) for step in found.steps), strict=True)
    # While t rules, nothing is interpolated; on the way from it, from its value at the begin of the step.
    pushed = tuple(float(np.squeeze(push)) for push in pushed)
    assert pushed == pytest.approx((2.0, 2.0, 15.0, 25.0, 12.5, 0.0))
    np.testing.assert_allclose(np.squeeze(pulled), [[2.0 * np.sin(t), 0.0, t] for t in times])
    assert _values(found.scene.loads, at)[1] == pytest.approx(np.array([[0.0, 0.0, 0.0]]))


def _values(loads: Any, at: np.ndarray) -> list[Any]:
    return [load.value(at) if callable(load.value) else load.value for load in loads]


def test_there_is_no_time_without_steps() -> None:
    loads = [{"kind": "pressure", "body": "a", "surface": "x1", "value": "t"}]
    with pytest.raises(SceneFileError, match=r"loads\.0\.value: .* depends on the time t, which only loads"):
        _ = file_of(loads=loads).scene


def test_fields_come_from_files(tmp_path: Path) -> None:
    (tmp_path / "wind.csv").write_text("x, y, z, p, q\n0, 0, 0, 1, 0.1\n1, 1, 1, 3, 0.3\n")
    interference = 'interference = { file = "wind.csv", field = "q" }'
    (tmp_path / "scene.toml").write_text(
        changed(
            ('kind = "traction"', 'kind = "pressure"'),
            ("value = [10.0, 0.0, -100.0]", 'value = { file = "wind.csv", field = "p" }'),
            ("coefficient = 0.3 }", 'coefficient = { file = "wind.csv", field = "q" } }\n' + interference),
        )
    )
    scene = read_scene_file(tmp_path / "scene.toml", MPI.COMM_SELF).scene
    ends = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
    assert scene.loads[0].value(ends).tolist() == pytest.approx([1.0, 3.0])  # type: ignore[operator]
    assert scene.contacts[0].friction_at(ends).tolist() == pytest.approx([0.1, 0.3])
    assert scene.contacts[0].gap_at(ends) == pytest.approx([-0.1, -0.3])
    (tmp_path / "wind.csv").unlink()
    with pytest.raises(SceneFileError, match=r"loads\.0\.value: .*wind\.csv"):
        _ = read_scene_file(tmp_path / "scene.toml", MPI.COMM_SELF).scene


def test_a_negative_coefficient_is_found_before_it_is_used(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(changed(("coefficient = 0.3", 'coefficient = "1 - x"')))
    with pytest.raises(SceneFileError, match=r"contacts\.0\.friction: .* zero or positive everywhere"):
        _ = read_scene_file(tmp_path / "scene.toml", MPI.COMM_SELF).scene


def test_steps_turn_a_moment_up() -> None:
    moment = {"name": "turn", "kind": "total_moment", "body": "a", "surface": "z1", "value": [0, 0, 1]}
    steps = [{"loads": {"turn": [0, 4, 3]}, "count": 2}]
    found = file_of(loads=[moment], steps=steps, supports=[{"body": "a", "surface": "z0"}]).steps
    moments = [load.moment for step in found for load in step.loads]
    assert moments == [(0.0, 2.0, 2.0), (0.0, 4.0, 3.0)]


def test_steps_must_keep_what_is_free() -> None:
    supports = [{"name": "top", "body": "a", "surface": "z1", "value": [0, "free", -1]}]
    with pytest.raises(
        SceneFileError, match=r"steps.0.supports.top must have the form of 'top' itself, \[0.0, "
    ):
        file_of(supports=supports, steps=[{"supports": {"top": [0, 0, 0]}}])


def test_two_supports_cannot_have_one_name() -> None:
    twice = [{"name": "top", "body": "a", "surface": surface} for surface in ("z0", "z1")]
    with pytest.raises(SceneFileError, match=r'supports\.1\.name must be a name of its own, got "top" twice'):
        file_of(supports=twice)


# Scene files whose contact pairs the scene finds.
PAIR = re.compile(r"\[\[contacts\]\].*?\n\n", re.DOTALL)
FOUND = (
    '[automatic_contact]\nfriction = { law = "coulomb", coefficient = 0.2 }\n'
    'closure = { law = "linear", stiffness = 1e5 }\n\n'
)


def read(text: str, folder: Path) -> SceneFile:
    path = folder / "scene.toml"
    path.write_text(text)
    return read_scene_file(path, SELF)


def test_pairs_are_found_in_place_of_those_of_the_file(tmp_path: Path) -> None:
    file = read(PAIR.sub(FOUND, GOOD), tmp_path)
    (pair,) = file.scene.contacts
    assert pair.place == "upper near lower on lower near upper"
    assert pair.friction == Coulomb(0.2)
    assert pair.closure == surface_laws.LinearClosure(1e5)
    assert file.partitions.keys() == {"lower", "upper"}


def test_files_name_bodies_that_may_meet_themselves(tmp_path: Path) -> None:
    contact = '[automatic_contact]\nself_contact = ["lower"]\n\n'
    with pytest.raises(SceneFileError, match="of body 'lower' with itself needs a material for large"):
        _ = read(PAIR.sub(contact, GOOD), tmp_path).scene


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD + "\n" + FOUND, r"automatic_contact: .*got both: leave one of them out"),
        (
            PAIR.sub("[automatic_contact]\ndistance = 0.1\n\n", GOOD).replace(
                "0.5, 0.5, 1.0]", "0.5, 0.5, 1.9]"
            ),
            r"automatic_contact: Automatic contact needs bodies that face each other .* finds none",
        ),
        (PAIR.sub("[automatic_contact]\ndistance = -1.0\n\n", GOOD), r"automatic_contact\.distance .*-1\.0"),
    ],
)
def test_what_finds_no_pair_is_refused(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(SceneFileError, match=message):
        _ = read(text, tmp_path).scene


# Rigid surfaces of scene files.
RIGID_SURFACES_STEEL = {"young_modulus": 2.1e5, "poisson_ratio": 0.3}


def file_with_rigid_surface(**parts: Any) -> SceneFile:
    """A scene of one block "a"."""
    return read_scene_file(
        {
            "meshes": {"m": {"shape": "block", "lower": [0, 0, 0], "upper": [2, 1, 1], "counts": [4, 2, 2]}},
            "materials": {"s": RIGID_SURFACES_STEEL},
            "bodies": {"a": {"mesh": "m", "material": "s"}},
            **parts,
        },
        SELF,
    )


RIGID = {"kind": "rigid", "body": "a", "surface": "z1", "at": [1, 0.5, 3]}


def test_a_rigid_surface_is_that_of_the_package() -> None:
    moved = {**RIGID, "value": [0, "free", -1, "free", 0, 0.02], "moment": [3, 0, 0]}
    loaded = {**RIGID, "force": [0, 0, -5]}
    for given, expected in (
        (
            moved,
            supports_module.RigidSurface(
                "a", "z1", (1, 0.5, 3), (0, None, -1), (None, 0, 0.02), moment=(3, 0, 0)
            ),
        ),
        (loaded, supports_module.RigidSurface("a", "z1", (1, 0.5, 3), (None,) * 3, (None,) * 3, (0, 0, -5))),
    ):
        assert list(file_with_rigid_surface(supports=[given]).scene.supports) == [expected]
    plane = {
        "meshes": {"m": {"shape": "rectangle", "lower": [0, 0], "upper": [2, 1], "counts": [4, 2]}},
        "materials": {"s": {**RIGID_SURFACES_STEEL, "model": "plane_strain"}},
        "bodies": {"a": {"mesh": "m", "material": "s"}},
        "supports": [{**RIGID, "surface": "x1", "at": [2, 0.5], "value": [0, "free", 0.1]}],
    }
    (found,) = read_scene_file(plane, SELF).scene.supports
    assert found == supports_module.RigidSurface("a", "x1", (2, 0.5), (0, None), 0.1)


def test_steps_turn_a_rigid_surface() -> None:
    supports = [{**RIGID, "name": "top", "value": [0, 0, "free", 0, 0, 0]}, {"body": "a", "surface": "z0"}]
    steps: list[dict[str, Any]] = [
        {"count": 2, "supports": {"top": [0.1, 0, "free", 0, 0, 0.04]}},
        {"supports": {"top": [0.1, 0, "free", 0, 0, "0.01 * t"]}},
    ]
    found = [step.supports[0] for step in file_with_rigid_surface(supports=supports, steps=steps).steps]
    assert [each.displacement for each in found] == [(0.05, 0.0, None), (0.1, 0.0, None), (0.1, 0.0, None)]
    np.testing.assert_allclose([each.rotation for each in found], [(0, 0, 0.02), (0, 0, 0.04), (0, 0, 0.03)])


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            {"value": [0, 0]},
            "supports.0.value must be six numbers, formulas in t or 'free' in brackets: displac",
        ),
        ({"value": [0, 0, 0]}, "RigidSurface.rotation of surface 'z1' of body 'a' must be 3 finite numbers"),
        ({"at": [0, 0]}, "RigidSurface"),
        ({"kind": "stiff"}, "supports.0.kind must be one of "),
        ({"force": [0, 0]}, "RigidSurface.force of surface 'z1' of body 'a' must be 3 finite numbers"),
        ({"surface": "top"}, "supports.0.surface must be a surface of the body 'a'"),
    ],
)
def test_a_rigid_surface_that_is_none_is_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneFileError, match=words):
        _ = file_with_rigid_surface(supports=[{**RIGID, **given}]).scene


# Parameters of a dual solver.
SMALSE = {"balance": 0.5, "loosest": 0.2, "balance_reduction": 0.5, "expansion": 1.0, "proportioning": 2.0}


def test_smalse_has_the_parameters_of_its_table() -> None:
    pressed = {
        "supports": [{"body": "a", "surface": "z1"}],
        "contacts": [{"slave": {"body": "a", "surface": "z0"}, "master": FLOOR}],
        "loads": [{"kind": "traction", "body": "a", "surface": "x1", "value": [5, 0, -5]}],
    }
    given = {"method": "smalse", "tolerance": 1e-8, "subdomains": [2, 1, 1]}
    found = file_of(**pressed, solver={**given, "smalse": SMALSE})
    wanted = Smalse(balance=0.5, loosest=0.2, balance_reduction=0.5, mpgp=Mpgp(1.0, 2.0))
    assert found.problem.solver == wanted
    plain = file_of(**pressed, solver=given)
    assert plain.problem.solver == Smalse()
    one, other = found.problem.solve().energies.strain, plain.problem.solve().energies.strain
    assert one == pytest.approx(other, rel=1e-7)
    assert one > 0.0


@pytest.mark.parametrize(
    ("solver", "message"),
    [
        ({"smalse": {"balance": 0.5}}, "smalse has parameters of method = \"smalse\", got method 'auto'"),
        ({"method": "smalse", "smalse": {"expansion": 2.0}}, "expansion must be a number .* 2, got 2"),
        ({"method": "smalse", "smalse": {"balance_reduction": 1}}, "balance_reduction must be a number .* 1"),
        ({"method": "smalse", "smalse": {"gamma": 1}}, "solver.smalse.gamma is not known"),
    ],
)
def test_parameters_of_smalse_that_it_does_not_take(solver: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneFileError, match=message):
        _ = file_of(supports=[{"body": "a", "surface": "z1"}], solver=solver).problem
