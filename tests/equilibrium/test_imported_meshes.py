"""Meshes from files written by gmsh's own program, solved from the file to the contact forces."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    Scene,
    Status,
    Support,
    Surface,
    Tie,
    Traction,
    read_mesh,
    solve_scene,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import boundary_faces
from fenics_contact.mesh.near_surfaces import near_surfaces
from fenics_contact.readers import read_msh
from tests.readers.mesh_files import joined

DATA = Path(__file__).parents[1] / "data"
STEEL = IsotropicElasticity(1000.0, 0.3)


def test_bodies_of_a_msh_file_press_on_each_other() -> None:
    """A unit cube of tetrahedra on a table, pressed and pushed on top; all parts go by their names."""
    meshes = read_msh(DATA / "two_boxes_41.msh")
    scene = Scene(
        {name: Body(mesh, STEEL) for name, mesh in meshes.items()},
        [Support("table", "bottom")],
        [Traction("tool", "top", (0.2, 0.0, -1.0))],
        [ContactPair(Surface("tool", "interface"), Surface("table", "interface"), Coulomb(0.5), "mortar")],
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)
    np.testing.assert_allclose(state.contact.force.sum(axis=0), [-0.2, 0.0, 1.0], atol=1e-5)
    assert state.contact.count(Status.STICK) > 0
    assert state.contact.count(Status.OPEN) < state.contact.points.count
    table, tool = (state.gather_displacement(name) for name in ("table", "tool"))
    assert np.abs(table[np.unique(meshes["table"].surfaces["bottom"])]).max() < 1e-9
    sunk = -tool[np.unique(meshes["tool"].surfaces["top"]), 2].mean()
    assert 1e-3 < sunk < 2e-3, "the tool gives way by a thousandth, the wider table by less"


def test_regions_of_a_plane_msh_file_are_two_materials_or_two_tied_bodies() -> None:
    """One body of two regions that share nodes, or two bodies tied along their matching nodes: one answer."""
    file = DATA / "two_squares_22.msh"
    whole = read_msh(file, bodies={"plate": ["steel", "copper"]})["plate"]
    laws = {"steel": PlaneStrain(2000.0, 0.3), "copper": PlaneStrain(1000.0, 0.35)}
    pull = (1.0, -0.3)
    one = Scene({"plate": Body(whole, laws)}, [Support("plate", "bottom", (0.0, 0.0))], [
        Traction("plate", "right", pull)
    ])  # fmt: skip
    parts = read_msh(file)
    right, left = parts["copper"].points[:, 0].min(), parts["steel"].points[:, 0].max()
    assert right == pytest.approx(left)
    parts = {name: with_side(mesh, left) for name, mesh in parts.items()}
    two = Scene(
        {name: Body(mesh, laws[name]) for name, mesh in parts.items()},
        [Support(name, "bottom", (0.0, 0.0)) for name in parts],
        [Traction("copper", "right", pull)],
        ties=[Tie(Surface("copper", "side"), Surface("steel", "side"), discretisation="node")],
    )
    expected = solve_scene(one, MPI.COMM_SELF, tolerance=1e-10)
    found = solve_scene(two, MPI.COMM_SELF, tolerance=1e-10)
    assert found.energies.total_potential == pytest.approx(expected.energies.total_potential, rel=1e-8)
    assert expected.energies.total_potential < -1e-5


def test_bodies_of_an_abaqus_file_press_on_each_other_where_they_are_near(tmp_path: Path) -> None:
    """From the file to the forces in four calls; the file names bodies and loads, but no contact surface."""
    table = block((0, 0, 0), (2, 1, 1), (4, 2, 2))
    joined([table, block((0.5, 0, 1), (1.5, 1, 2), (3, 2, 2))]).write(tmp_path / "press.inp")
    meshes, pairs = near_surfaces(read_mesh(tmp_path / "press.inp"), 0.01)
    contacts = [ContactPair(Surface(b, f"near {a}"), Surface(a, f"near {b}"), Coulomb(0.5)) for a, b in pairs]
    loads = [Traction("tool", "pushed", (0.2, 0.0, -1.0))]
    scene = Scene(
        {name: Body(mesh, STEEL) for name, mesh in meshes.items()},
        [Support("table", "held")],
        loads,
        contacts,
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)
    np.testing.assert_allclose(state.contact.force.sum(axis=0), [-0.2, 0.0, 1.0], atol=1e-5)


def with_side(mesh: BodyMesh, x: float) -> BodyMesh:
    """Name the edges at ``x``."""
    edges, _ = boundary_faces(mesh.cells, dim=2)
    at = np.abs(mesh.points[edges][:, :, 0] - x).max(axis=1) < 1e-9
    return replace(mesh, surfaces={**mesh.surfaces, "side": edges[at]})


def test_a_name_that_the_file_lacks_is_refused_with_those_that_it_has() -> None:
    meshes = read_msh(DATA / "two_boxes_41.msh")
    with pytest.raises(InvalidInputError, match=r"names surface 'lid' of body 'tool', which has .*'top'"):
        Scene({"tool": Body(meshes["tool"], STEEL)}, [Support("tool", "lid")])
    with pytest.raises(InvalidInputError, match="hammer"):
        read_msh(DATA / "two_boxes_41.msh", bodies=["hammer"])
