"""Answers depend on neither the ranks nor the partition, and are printed once."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.graph_partition import graph_partition
from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    ContactPair,
    Coulomb,
    Pressure,
    SampledField,
    Scene,
    State,
    Status,
    Support,
    Surface,
    Traction,
    Tresca,
    solve_scene,
    write_result,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.averages import nodal_mean
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.output import read_result
from fenics_contact.qp import FaceNewton
from fenics_contact.readers import from_gmsh_model
from tests.conftest import run_on_ranks
from tests.equilibrium.checks import assert_solved
from tests.equilibrium.effect_cases import CASES, figures, solved
from tests.equilibrium.effect_cases import collect as collect_effects
from tests.equilibrium.fields_on_ranks import SCENES, cut
from tests.equilibrium.given_fields import MESH, NODES, forces, rising, shifted
from tests.equilibrium.own_forms import PRESSURE, integrals
from tests.equilibrium.printed_on_ranks import main
from tests.equilibrium.rank_cases import PARTITIONS, TENSION, collect
from tests.readers.msh_files import name as name_of_group
from tests.readers.msh_files import own_gmsh, within
from tests.scenes import SOFT

RANKS = [1, 2, 4]


@cache
def answer(ranks: int) -> dict[str, Any]:
    if ranks == 1:
        return collect(MPI.COMM_SELF)
    found = json.loads(run_on_ranks(Path(__file__).with_name("rank_cases.py"), ranks))
    assert found["ranks"] == ranks
    return found


@pytest.mark.parametrize("cut", PARTITIONS)
@pytest.mark.parametrize("ranks", RANKS)
def test_objective_and_contact_forces_depend_on_neither_ranks_nor_partition(ranks: int, cut: str) -> None:
    expected, found = answer(1)["contact"]["boxes"], answer(ranks)["contact"][cut]
    assert abs(expected["objective"]) > 0.01
    assert found["objective"] == pytest.approx(expected["objective"], rel=1e-8)
    force, known = np.array(found["force"]), np.array(expected["force"])
    assert np.abs(force - known).max() < 1e-6 * np.abs(known).max()
    assert found["status"] == expected["status"]
    assert set(found["status"]) == {int(status) for status in Status}
    assert found["subdomains"] == {"boxes": 4, "bisection": 6}[cut]


@pytest.mark.parametrize("ranks", RANKS)
def test_displacement_functions_hold_the_nodal_values(ranks: int) -> None:
    for found in answer(ranks)["contact"].values():
        assert found["field error"] < 1e-9
        assert found["position error"] < 1e-14
        assert found["field nodes"] == [72, 105]


@pytest.mark.parametrize("ranks", RANKS)
def test_stress_does_not_depend_on_ranks(ranks: int) -> None:
    for found in answer(ranks)["contact"].values():
        assert min(found["stress"]) > 1.0
        assert found["stress"] == pytest.approx(answer(1)["contact"]["boxes"]["stress"], rel=1e-6)


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
@pytest.mark.parametrize("ranks", RANKS)
def test_a_bar_under_tension_has_its_analytic_stress_and_length(ranks: int, cell: str) -> None:
    found = answer(ranks)["uniaxial"][cell]
    elongation = 2.0 * TENSION / SOFT.young_modulus
    assert found["cells"] == {"hexahedron": 16, "tetrahedron": 96}[cell]
    assert found["contact points"] == 0
    assert found["stress error"] < 1e-7 * TENSION
    assert found["elongation"] == pytest.approx(elongation, rel=1e-8)
    assert found["primal"] == pytest.approx(-0.5 * TENSION * elongation, rel=1e-8)
    assert found["dual"] == pytest.approx(found["primal"], rel=1e-8)


@pytest.mark.parametrize("ranks", RANKS)
def test_every_rank_is_told_why_there_is_no_answer(ranks: int) -> None:
    words = answer(ranks)["refusals"]
    assert len(words) == 3 * ranks
    for start in range(0, len(words), 3):
        sliding, lifted, stopped = words[start : start + 3]
        assert "InfeasibleError: every body must be held" in sliding
        assert "body 'block' can move away under the load: translation (" in sliding
        assert "'block' can move away under the load: translation (0, 0, 1) meets no resistance" in lifted
        assert "StoppedError: " in stopped


# What users see of a state is the same on any number of ranks, at the tolerance that they get.
SCRIPT = Path(__file__).with_name("fields_on_ranks.py")
Mpirun = Callable[..., str]
Fields = dict[str, dict[str, list[float]]]


@pytest.fixture(scope="module")
def alone() -> Fields:
    from tests.conftest import run_on_ranks

    return dict(json.loads(run_on_ranks(SCRIPT, 1)))


@pytest.mark.parametrize("ranks", [2, 4])
def test_displacement_and_stress_are_the_same_on_any_number_of_ranks(
    ranks: int, alone: Fields, mpirun: Mpirun
) -> None:
    found = json.loads(mpirun(SCRIPT, ranks))
    assert set(alone) == set(SCENES)
    for name, fields in alone.items():
        for what, values in fields.items():
            size = np.abs(values).max()
            assert size > 0.0
            np.testing.assert_allclose(found[name][what], values, rtol=0, atol=1e-9 * size)


@pytest.mark.parametrize("name", SCENES)
def test_the_displacement_of_a_state_is_one_of_whole_bodies(name: str) -> None:
    """Copies of nodes agree, supports hold, and contact points are where the solver has them."""
    scene = SCENES[name]()
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene))
    torn, system = state.torn, state.dual
    size = np.abs(state.torn_displacement).max()
    equality = system.problem.layout.equality
    before, after = (
        torn.right - torn.jump(u) for u in (state.torn_displacement, state.conforming_displacement)
    )
    assert np.abs(before[equality]).max() > 1e-6 * size, "the solver left nothing to sew"
    assert np.abs(after[equality]).max() < 1e-14 * size
    contact = system.problem.layout.contact
    np.testing.assert_allclose(after[contact], before[contact], rtol=0, atol=1e-14 * size)
    mean = nodal_mean(torn.decomposition, state.torn_displacement)
    free = ~torn.decomposition.fixed
    shown = np.concatenate([state.gather_displacement(body) for body in scene.bodies])
    copies = torn.decomposition.tearing.multiplicity > 1
    shares = torn.decomposition.tearing.copy_share
    assert name != "patched" or shares.max() > 0.9, "copies of a node should differ in stiffness"
    np.testing.assert_allclose(
        shown[copies[:, None] & free], mean[copies[:, None] & free], rtol=0, atol=1e-14 * size
    )


def test_only_what_is_next_to_seams_and_supports_moves_and_forces_inside_stay() -> None:
    scene = SCENES["patched"]()
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene))
    moved = state.conforming_displacement - state.torn_displacement
    interface = state.dual.inverse.interface
    start = 0
    for subdomain in state.torn.subdomains:
        part = slice(start, start + subdomain.mesh.size)
        force = np.abs(subdomain.stiffness @ moved[part])
        own = interface[(interface >= part.start) & (interface < part.stop)] - start
        inside = np.setdiff1d(np.arange(subdomain.mesh.size), own)
        assert force[own].max() > 0.0
        assert force[inside].max(initial=0.0) < 1e-9 * force[own].max()
        start = part.stop


# Mortar, ties, regions, heat, load steps and plane scenes: one answer on 1, 2 and 4 ranks, however cut.
@cache
def effects_on(ranks: int) -> dict[str, Any]:
    if ranks == 1:
        return collect_effects(MPI.COMM_SELF)
    return json.loads(run_on_ranks(Path(__file__).with_name("effect_cases.py"), ranks))


def assert_alike(found: dict[str, Any], expected: dict[str, Any]) -> None:
    assert found["energy"] == pytest.approx(expected["energy"], rel=1e-8)
    assert found["friction"] == pytest.approx(expected["friction"], rel=1e-6, abs=1e-12)
    for name in ("force", "displacement", "stress"):
        values, known = np.array(found[name]), np.array(expected[name])
        assert np.abs(values - known).max(initial=0.0) <= 1e-6 * np.abs(known).max(initial=0.0), name


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("ranks", [2, 4])
def test_the_number_of_ranks_does_not_matter(ranks: int, name: str) -> None:
    assert_alike(effects_on(ranks)[name], effects_on(1)[name])


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("parts", [1, 9])
def test_the_partition_does_not_matter(parts: int, name: str) -> None:
    assert_alike(figures(solved(MPI.COMM_SELF, name, parts)), effects_on(1)[name])


def test_the_cases_stick_slip_and_open() -> None:
    counts = {status: 0 for status in Status}
    for name in ("mortar", "stiff on soft", "load steps in the plane"):
        state = solved(MPI.COMM_SELF, name, 4)
        for status in Status:
            counts[status] += state.contact.count(status)
        assert state.energies.friction > 0.0
    assert min(counts.values()) >= 3


# An irregular mesh gives one answer, however it is cut into subdomains.
TOLERANCE = 1e-9
COUNTS = (1, 4, 17, 64)


@cache
def holed_block() -> BodyMesh:
    """A block of 2 x 1 x 1 on the plane z = 0 with a bore through its middle, in tetrahedra of all sizes."""
    with own_gmsh() as gmsh:
        model = gmsh.model
        whole = model.occ.addBox(0, 0, 0, 2, 1, 1)
        bore = model.occ.addCylinder(0.8, -0.1, 0.55, 0, 1.2, 0, 0.25)
        model.occ.cut([(3, whole)], [(3, bore)])
        model.occ.synchronize()
        name_of_group(gmsh, 3, [whole], "holed")
        name_of_group(gmsh, 2, within(gmsh, 2, (0, 0, 0), (2, 1, 0)), "bottom")
        name_of_group(gmsh, 2, within(gmsh, 2, (0, 0, 1), (2, 1, 1)), "top")
        gmsh.option.setNumber("Mesh.MeshSizeMin", 0.12)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.25)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 12)
        model.mesh.generate(3)
        return from_gmsh_model()["holed"]


def scene() -> Scene:
    """The holed block pressed and pushed on a softer one that bulges, and held by friction alone."""
    base = block((-0.2, -0.1, -1.0), (2.2, 1.1, 0.0), (7, 5, 4))
    points = base.points.copy()
    points[:, 2] -= 0.02 * (points[:, 0] - 1.0) ** 2 * (points[:, 2] + 1.0)
    bodies = {
        "base": Body(base.moved(points), IsotropicElasticity(100.0, 0.3)),
        "holed": Body(holed_block(), IsotropicElasticity(300.0, 0.2)),
    }
    loads = [Traction("holed", "top", (0.45, 0.1, -2.0)), BodyForce("holed", (0.0, 0.0, -0.2))]
    pair = ContactPair(Surface("holed", "bottom"), Surface("base", "z1"), Coulomb(0.3))
    return Scene(bodies, [Support("base", "z0")], loads, [pair])


@cache
def solved_partitions(count: int) -> State:
    cut = {body: graph_partition(each.mesh, count, body) for body, each in scene().bodies.items()}
    return solve_scene(scene(), MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=TOLERANCE))


def test_the_mesh_is_irregular_and_the_contact_mixed() -> None:
    mesh, state = holed_block(), solved_partitions(1)
    assert mesh.cell_type == "tetrahedron"
    assert mesh.n_cells > 1000
    assert mesh.grid is None
    assert mesh.volume == pytest.approx(2.0 - np.pi * 0.25**2, rel=0.01)
    assert all(state.contact.count(status) > 3 for status in Status)
    total = state.contact.force.sum(axis=0)
    np.testing.assert_allclose(total[:2], (-0.9, -0.2), rtol=1e-6)
    assert total[2] == pytest.approx(4.0 + 0.2 * mesh.volume, rel=1e-6)


@pytest.mark.parametrize("count", COUNTS)
def test_every_partition_is_solved_to_its_tolerance(count: int) -> None:
    state = solved_partitions(count)
    assert state.counts["subdomains"] == 2 * count
    assert_solved(state, TOLERANCE)


@pytest.mark.parametrize("count", COUNTS[1:])
def test_energy_forces_and_displacements_do_not_depend_on_the_partition(count: int) -> None:
    whole, torn = solved_partitions(1), solved_partitions(count)
    assert torn.energies.total_potential == pytest.approx(whole.energies.total_potential, rel=1e-6)
    assert torn.energies.friction == pytest.approx(whole.energies.friction, rel=1e-6)
    np.testing.assert_array_equal(torn.contact.status, whole.contact.status)
    size = np.abs(whole.contact.force).max()
    np.testing.assert_allclose(torn.contact.force, whole.contact.force, rtol=0, atol=1e-6 * size)
    np.testing.assert_allclose(
        torn.contact.gap, whole.contact.gap, rtol=0, atol=1e-6 * np.abs(whole.contact.gap).max()
    )
    for body in whole.scene.bodies:
        expected = whole.gather_displacement(body)
        np.testing.assert_allclose(
            torn.gather_displacement(body), expected, rtol=0, atol=1e-6 * np.abs(expected).max()
        )


# One rank may print what all ranks hold: it says the same on any number of ranks.
PRINTED_SCRIPT = Path(__file__).with_name("printed_on_ranks.py")


def replicated(printed: str) -> list[str]:
    """Return the lines that do not depend on the number of ranks: no times, work, rounding."""
    names = ("unknowns", "contact ", "largest force", "strain energy", "total potential", "bodies", "points")
    return [line for line in printed.splitlines() if line.strip().startswith(names)]


def test_one_rank_alone_prints_the_same_on_any_number_of_ranks(
    mpirun: Callable[..., str], capsys: pytest.CaptureFixture[str]
) -> None:
    main(MPI.COMM_SELF)
    alone, both = capsys.readouterr().out, mpirun(PRINTED_SCRIPT, 2)
    assert len(replicated(alone)) > 8
    assert replicated(both) == replicated(alone)
    assert "ranks      2" in both


# Results are dolfinx Functions that forms of the user's own can be written with, on any number of ranks.
def check(found: dict[str, float], order: int) -> None:
    """∫ σ_zz dx is the load times the height; the rest is known to the state."""
    assert found["vertical stress"] == pytest.approx(-2.0 * PRESSURE, rel=1e-6)
    assert found["elastic energy"] == pytest.approx(found["energy of the state"], rel=1e-7)
    assert found["von Mises"] == pytest.approx(found["own von Mises"], rel=2e-2)
    # A nodal pressure is a force by a nodal area, which is the integral of a linear shape function.
    assert found["contact force"] == pytest.approx(2.0 * PRESSURE, rel=1e-6)


@pytest.mark.parametrize("order", [1, 2])
def test_results_are_integrated_by_the_users_own_forms(order: int) -> None:
    check(integrals(MPI.COMM_SELF, order), order)


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [2, 4])
def test_own_forms_give_the_same_on_more_ranks(mpirun: Callable[..., str], ranks: int) -> None:
    lines = mpirun(Path(__file__).parent / "own_forms.py", ranks).splitlines()
    assert len(lines) == 2
    for order, line in enumerate(lines, 1):
        found, alone = json.loads(line), integrals(MPI.COMM_SELF, order)
        check(found, order)
        assert found == pytest.approx(alone, rel=1e-6)


# Loads and friction given as fields.
@pytest.mark.parametrize(
    "coefficient", [rising, SampledField(NODES, rising(NODES))], ids=["function", "sampled"]
)
def test_every_point_slips_with_its_own_coefficient(coefficient: object) -> None:
    state = solve_scene(shifted(Coulomb(coefficient)), MPI.COMM_SELF, tolerance=1e-9)  # type: ignore[arg-type]
    points = state.torn.points
    mu = rising(MESH.points[points.slave])
    size = np.linalg.norm(state.contact.friction_force, axis=1)
    np.testing.assert_allclose(size, mu * state.contact.normal_force, rtol=1e-7)
    assert np.ptp(mu) == pytest.approx(0.2)


def test_a_constant_field_is_the_number() -> None:
    one, other = (
        solve_scene(shifted(law), MPI.COMM_SELF, tolerance=1e-9).contact.force
        for law in (Coulomb(0.3), Coulomb(lambda x: np.full(len(x), 0.3)))
    )
    np.testing.assert_allclose(one, other, rtol=1e-12)


def test_the_bound_of_given_friction_varies() -> None:
    law = Tresca(lambda x: 0.001 * (1.0 + x[:, 0]))
    state = solve_scene(shifted(law), MPI.COMM_SELF, tolerance=1e-9)
    points = state.torn.points
    bound = 0.001 * (1.0 + MESH.points[points.slave, 0]) * points.area
    np.testing.assert_allclose(np.linalg.norm(state.contact.friction_force, axis=1), bound, rtol=1e-7)


def test_friction_must_not_be_negative_anywhere() -> None:
    with pytest.raises(InvalidInputError, match=r"zero or positive everywhere, got -3 at \(4, "):
        solve_scene(shifted(Coulomb(lambda x: 1.0 - x[:, 0])), MPI.COMM_SELF)


def test_a_pressure_known_only_on_its_surface_is_enough() -> None:
    top = MESH.points[np.unique(MESH.surfaces["z1"])]
    scene = replace(
        shifted(None),
        supports=[Support("block", "x0", (0.0, None, None)), Support("block", "y0", (None, 0.0, None))],
        loads=[Pressure("block", "z1", SampledField(top, 0.01 * top[:, 0], reach=0.1))],
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-9)
    assert state.balance().loads.force[2] == pytest.approx(-0.01 * 4.0**2 / 2.0)


def test_a_result_names_a_field_shortly(tmp_path: Path) -> None:
    state = solve_scene(shifted(Coulomb(SampledField(NODES, rising(NODES)))), MPI.COMM_SELF, tolerance=1e-6)
    write_result(state, tmp_path)
    friction = read_result(tmp_path)["scene"]["contacts"][0]["friction"]
    assert friction["friction_coefficient"]["type"] == "SampledField"
    assert len(str(friction)) < 300


@pytest.mark.parametrize("ranks", [2, 4])
def test_a_field_does_not_depend_on_ranks(ranks: int, mpirun: Callable[..., str]) -> None:
    found = json.loads(mpirun(Path(__file__).with_name("given_fields.py"), ranks))
    np.testing.assert_allclose(found, forces(MPI.COMM_SELF), atol=1e-9)
