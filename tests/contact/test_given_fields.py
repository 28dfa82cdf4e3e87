"""Loads and friction given as fields."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Coulomb, Pressure, SampledField, Support, Tresca, solve_scene, write_result
from fenics_contact.errors import InvalidInputError
from fenics_contact.output import read_result
from tests.contact.given_fields import MESH, NODES, forces, rising, shifted


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
