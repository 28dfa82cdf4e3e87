"""`.frd` files of scenes, read back by their columns."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    ThermalStrain,
    Traction,
    solve_scene,
)
from fenics_contact._scene.loads import Load
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, StVenantKirchhoff
from fenics_contact.mesh import quadratic
from fenics_contact.output import write_frd
from fenics_contact.output.frd import FrdField, contact_axes, table
from tests.fem.mixed_cells import ORDERS, mixed_bar
from tests.frd_files import read_frd

STEEL = IsotropicElasticity(210000.0, 0.3, 1.2e-5)


def solved(kind: str = "hexahedron", load: Load | None = None) -> State:
    """A block 2 high that stands on a plane and is pressed by 42 from above."""
    linear: Any = kind.rstrip("0123456789")
    mesh = block((0, 0, 0), (1, 1, 2), (2, 2, 2), linear)
    mesh = mesh if kind == linear else quadratic(mesh)
    guides = [Support("block", "x0", (0.0, None, None)), Support("block", "y0", (None, 0.0, None))]
    pair = ContactPair(Surface("block", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)))
    loads = [load or Traction("block", "z1", (0.0, 0.0, -42.0))]
    return solve_scene(Scene({"block": Body(mesh, STEEL)}, guides, loads, [pair]), MPI.COMM_SELF)


@pytest.mark.parametrize(
    ("kind", "code", "cells"),
    [("hexahedron", 1, 8), ("hexahedron27", 4, 8), ("tetrahedron", 3, 48), ("tetrahedron10", 6, 48)],
)
def test_uniform_pressure_is_exact_in_all_fields(kind: str, code: int, cells: int, tmp_path: Path) -> None:
    found = read_frd(write_frd(tmp_path / "block.frd", solved(kind)))
    assert [block.kind for block in found.blocks] == ["DISP", "STRESS", "TOSTRAIN", "FORC", "CONTACT"]
    assert len(found.cells) == cells
    assert {each for each, _ in found.cells.values()} == {code}
    assert sorted({node for _, nodes in found.cells.values() for node in nodes}) == list(found.nodes)
    nodes = list(found.nodes)
    places, at_rest = np.array(list(found.nodes.values())), 42.0 / 210000.0
    moved = found.block("DISP").at(nodes)
    assert np.allclose(moved, places * [0.3 * at_rest, 0.3 * at_rest, -at_rest], atol=1e-9)
    assert np.allclose(found.block("STRESS").at(nodes), [0, 0, -42, 0, 0, 0], atol=1e-3)
    strain = [0.3 * at_rest, 0.3 * at_rest, -at_rest, 0, 0, 0]
    assert np.allclose(found.block("TOSTRAIN").at(nodes), strain, atol=1e-9)
    forces, low, top = found.block("FORC").at(nodes), places[:, 2] == 0.0, places[:, 2] == 2.0
    centres = 4 * 42.0 / 9.0 if kind == "hexahedron27" else 0.0  # of faces, which are not written
    assert forces[top, 2].sum() == pytest.approx(-42.0 + centres)
    assert np.abs(forces[~top]).max() < 1e-2  # contact with the plane is no part of them
    contact = found.block("CONTACT").at(nodes)
    assert contact[low, 3].max() == pytest.approx(42.0, rel=1e-3)
    assert not contact[~low].any()


@pytest.mark.parametrize("order", ["linear", "quadratic", "serendipity"])
def test_stresses_that_vary_are_exact_in_all_shapes(order: str, tmp_path: Path) -> None:
    """Quadratic cells bend exactly: σ_xx is linear across the bar, which linear cells only follow."""
    mesh = ORDERS[order](mixed_bar())
    bent = (lambda x: -x[:, 0] * (x[:, 2] - 0.5), 0.0, lambda x: x[:, 0] ** 2 / 2)
    supports = [Support("bar", side, bent) for side in ("x0", "x1", "y0", "y1", "z0", "z1")]
    scene = Scene({"bar": Body(mesh, IsotropicElasticity(1.0, 0.0))}, supports)
    found = read_frd(write_frd(tmp_path / "bar.frd", solve_scene(scene, MPI.COMM_SELF)))
    assert {kind for kind, _ in found.cells.values()} == ({1, 2, 3} if order == "linear" else {1, 4, 5, 6})
    heights = np.array([place[2] for place in found.nodes.values()])
    ours = found.block("STRESS").at(list(found.nodes))[:, 0]
    assert np.abs(ours - (0.5 - heights)).max() < (0.3 if order == "linear" else 1e-4)


def test_forces_leave_out_what_heat_would_take_to_be_held_back(tmp_path: Path) -> None:
    for kind in ("hexahedron", "hexahedron27"):
        state = solved(kind, ThermalStrain("block", 100.0))
        found = read_frd(write_frd(tmp_path / "hot.frd", state))
        assert np.abs(state._nodal_forces.load).max() > 10.0  # what heat counts for in the equations
        assert np.abs(found.block("FORC").at(list(found.nodes))).max() < 1e-3
        rise = {node: u[2] / 1.2e-3 for node, u in found.block("DISP").values.items()}
        assert rise == pytest.approx({node: place[2] for node, place in found.nodes.items()}, abs=1e-5)


def test_strains_of_large_deformations_are_greens(tmp_path: Path) -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (1, 1, 1))
    supports = [Support("block", "z0"), Support("block", "z1", (0.5, 0.0, 0.0))]
    scene = Scene({"block": Body(mesh, StVenantKirchhoff(1.0, 0.0))}, supports)
    found = read_frd(write_frd(tmp_path / "sheared.frd", solve_scene(scene, MPI.COMM_SELF), [0.25]))
    assert np.allclose(found.block("TOSTRAIN", 0.25).at([1, 8]), [0, 0, 0.125, 0, 0, 0.25], atol=1e-6)
    green = np.array([[0, 0, 0.25], [0, 0, 0], [0.25, 0, 0.125]])
    slope = np.array([[1, 0, 0.5], [0, 1, 0], [0, 0, 1]])
    cauchy = slope @ green @ slope.T  # S = E ε with E = 1, ν = 0, and no change of volume
    stress = [cauchy[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))]
    assert np.allclose(found.block("STRESS", 0.25).at([1, 8]), stress, atol=1e-6)


def test_several_states_have_their_times(tmp_path: Path) -> None:
    state = solved()
    path = write_frd(tmp_path / "steps.frd", [state, state], times=[0.5, 12.0])
    heads = [line[7:24] for line in path.read_text().splitlines() if line.startswith("  100CL")]
    assert (heads[0], heads[-1]) == ("  101 5.00000E-01", "  102 12.00000000")  # as CalculiX has them
    found = read_frd(path)
    assert [(each.time, each.step) for each in found.blocks[::5]] == [(0.5, 1), (12.0, 2)]
    with pytest.raises(InvalidInputError, match="times must have one for each of 2 states, got 1"):
        write_frd(tmp_path / "steps.frd", [state, state], times=[0.5])
    with pytest.raises(InvalidInputError, match="needs at least one state"):
        write_frd(tmp_path / "steps.frd", [])


def test_numbers_without_room_in_their_columns_are_zero() -> None:
    line = table(np.array([7]), np.array([[1e-120, -1.5e-7]]))
    assert line == " -1         7 0.00000E+00-1.50000E-07\n"


def test_tangents_of_contact_are_projections_of_the_axes() -> None:
    first, second = contact_axes(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.6, 0.8, 0.0]]))
    assert np.allclose(first, [[1, 0, 0], [0, 0, 1], [0.8, -0.6, 0]])
    assert np.allclose(second, [[0, 1, 0], [0, -1, 0], [0, 0, -1]])


def test_a_field_of_tensors_names_its_components() -> None:
    text = FrdField("STRESS", np.array([1]), np.zeros((1, 6))).text.splitlines()
    assert text[0] == " -4  STRESS      6    1"
    assert text[5] == " -5  SYZ         1    4    2    3"
