"""Scenes are cut as their partitions say; partitions that do not fit are refused."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, Scene, TotalForce, Traction, _dolfinx, solve_scene
from fenics_contact._base import libraries
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti import build_torn_system, decompose, decomposition
from fenics_contact.feti.subdomain import assemble, cut_out
from fenics_contact.gallery import block
from tests.feti.scenes import CELLS, STEEL, clamped_block, lone_block, touching_blocks


def test_a_body_without_partition_is_refused() -> None:
    scene, partitions = touching_blocks()
    del partitions["upper"]
    message = r"every body needs a partition, 'upper' has none: pass"
    with pytest.raises(InvalidInputError, match=message):
        decompose(scene, partitions, MPI.COMM_SELF)


@pytest.mark.parametrize(
    ("partitions", "message"),
    [
        (
            {"block": 4},
            r"partitions\['block'\] needs shape \(64,\), got 4",
        ),
        (4, "partitions must be by names of bodies, got 4: leave it out"),
    ],
)
def test_a_number_of_subdomains_is_no_partition(partitions: Any, message: str) -> None:
    scene, _ = lone_block("hexahedron")
    with pytest.raises(InvalidInputError, match=message):
        solve_scene(scene, MPI.COMM_SELF, partitions=partitions)
    with pytest.raises(InvalidInputError, match=message):
        scene.plan(partitions)


def test_a_partition_of_another_mesh_is_refused() -> None:
    scene, partitions = lone_block("hexahedron")
    message = r"partitions\['block'\] needs shape \(64,\), got \(63,\)"
    with pytest.raises(InvalidInputError, match=message):
        decompose(scene, {"block": partitions["block"][1:]}, MPI.COMM_SELF)


def test_a_subdomain_that_does_not_hang_together_is_refused() -> None:
    scene, partitions = lone_block("hexahedron")
    torn = partitions["block"].copy()
    torn[-1] = 0  # a cell in the corner opposite to subdomain 0
    with pytest.raises(InvalidInputError, match="must be connected through cell faces, 1 of 8 are not"):
        decompose(scene, {"block": torn}, MPI.COMM_SELF)


@pytest.mark.parametrize(
    ("change", "message"),
    [(lambda p: p + 1, "0 of 9 is empty: renumber"), (lambda p: 0.5 * p, "integers")],
)
def test_a_partition_that_does_not_count_from_zero_is_refused(change: object, message: str) -> None:
    scene, partitions = lone_block("hexahedron")
    with pytest.raises(InvalidInputError, match=message):
        decompose(scene, {"block": change(partitions["block"])}, MPI.COMM_SELF)  # type: ignore[operator]


def test_subdomains_for_which_mpich_has_no_communicators_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond its last one MPICH ends all ranks."""
    freed: list[int] = []

    class Few:
        left = 35

        def Dup(self) -> SimpleNamespace:
            self.left -= 1
            if self.left < 0:
                raise MPI.Exception(MPI.ERR_OTHER)
            return SimpleNamespace(Free=lambda: freed.append(1))

    mpich = SimpleNamespace(Get_library_version=lambda: "MPICH Version: 5.0", COMM_SELF=Few())
    mpich.Exception = MPI.Exception
    monkeypatch.setattr(libraries, "MPI", mpich)
    decomposition._check_communicators(3, each=10)
    with pytest.raises(InvalidInputError, match="about 40 communicators of MPI, MPICH has 5 left"):
        decomposition._check_communicators(4, each=10)
    assert len(freed) == 35


def test_every_form_is_compiled_once_for_all_subdomains_and_bodies(monkeypatch: pytest.MonkeyPatch) -> None:
    made = []
    compile_form = _dolfinx.CompiledForm.__init__

    def counted(self: _dolfinx.CompiledForm, comm: MPI.Comm, form: object) -> None:
        made.append(form)
        compile_form(self, comm, form)

    monkeypatch.setattr(_dolfinx.CompiledForm, "__init__", counted)
    scene, partitions = touching_blocks()
    decomposition = decompose(scene, partitions, MPI.COMM_SELF)
    build_torn_system(scene, decomposition)
    build_torn_system(scene, decomposition)
    # Stiffness of hexahedra and of tetrahedra, a surface load on tetrahedra, a body force on hexahedra.
    assert len(made) == len(decomposition.forms.compiled) == 4


@pytest.mark.parametrize("cell", CELLS)
def test_subdomains_hold_their_cells_and_know_their_nodes(cell: str) -> None:
    scene, partitions = lone_block(cell)
    decomposition = decompose(scene, partitions, MPI.COMM_SELF)
    mesh = scene.bodies["block"].mesh
    assert len(decomposition.meshes) == 8
    for part in decomposition.meshes:
        np.testing.assert_array_equal(np.flatnonzero(partitions["block"] == part.number), np.sort(part.cells))
        np.testing.assert_array_equal(np.sort(part.nodes), np.unique(mesh.cells[part.cells]))
        _dolfinx.update_coordinates(part.space.mesh, mesh.points[np.sort(part.nodes)])
        coordinates = part.space.tabulate_dof_coordinates()
        np.testing.assert_allclose(coordinates, mesh.points[part.nodes], atol=1e-14)
    assert (
        decomposition.torn_unknowns
        == decomposition.torn_size
        == 3 * sum(len(m.nodes) for m in decomposition.meshes)
    )


def test_subdomains_whose_cells_are_connected_alike_share_a_mesh() -> None:
    scene, partitions = clamped_block("hexahedron", layers=3)  # bent: no two have the same shape
    torn = build_torn_system(scene, decompose(scene, partitions, MPI.COMM_SELF))
    assert len({id(part.mesh.space) for part in torn.subdomains}) == 1
    stiffnesses = [part.stiffness.toarray() for part in torn.subdomains]
    assert np.abs(stiffnesses[0] - stiffnesses[-1]).max() > 1e-3 * np.abs(stiffnesses[0]).max()
    for part, stiffness in zip(torn.subdomains, stiffnesses, strict=True):
        alone = assemble(
            cut_out(part.mesh.number, "block", scene.bodies["block"], np.sort(part.mesh.cells), {}),
            scene.bodies["block"], scene.loads, torn.decomposition.forms,
        )  # fmt: skip
        assert alone.mesh.space is not part.mesh.space
        assert np.array_equal(alone.mesh.nodes, part.mesh.nodes)
        assert np.array_equal(alone.mesh.cells, part.mesh.cells)
        np.testing.assert_array_equal(alone.stiffness.toarray(), stiffness)
        np.testing.assert_array_equal(alone.load, part.load)


def test_subdomains_of_other_cells_or_components_have_meshes_of_their_own() -> None:
    scene, partitions = touching_blocks()
    meshes = decompose(scene, partitions, MPI.COMM_SELF).meshes
    of_body = {name: {id(m.space) for m in meshes if m.body == name} for name in ("lower", "upper")}
    assert not of_body["lower"] & of_body["upper"]


@pytest.mark.parametrize("cell", CELLS)
def test_loads_add_up_to_their_resultants(cell: str) -> None:
    scene, partitions = clamped_block(cell)
    total = build_torn_system(scene, decompose(scene, partitions, MPI.COMM_SELF)).load
    mesh = scene.bodies["block"].mesh
    straight, given = block((0, 0, 0), (1, 1, 1), (1, 1, 1), cell), (4.0, -5.0, 6.0)
    expected = mesh.volume * np.array([0.0, 0.5, -2.0])
    weight_only = total.reshape(-1, 3).sum(axis=0) - expected
    np.testing.assert_allclose(np.cross(weight_only, [0.3, 0.1, 1.0]), 0.0, atol=1e-12)
    assert np.linalg.norm(weight_only) > 1.0
    for load, resultant in (
        (TotalForce("cube", "x1", given), given),
        (Traction("cube", "x1", given), given),  # on an area of one
    ):
        cube = Scene({"cube": Body(straight, STEEL)}, loads=[load])
        one = build_torn_system(
            cube, decompose(cube, {"cube": np.zeros(straight.n_cells, int)}, MPI.COMM_SELF)
        )
        np.testing.assert_allclose(one.load.reshape(-1, 3).sum(axis=0), resultant, rtol=1e-13)
    bent = Scene(scene.bodies, loads=[TotalForce("block", "z1", given)])
    forces = build_torn_system(bent, decompose(bent, partitions, MPI.COMM_SELF)).load
    np.testing.assert_allclose(forces.reshape(-1, 3).sum(axis=0), given, rtol=1e-12)


def test_the_same_decomposition_serves_moved_coordinates() -> None:
    scene, partitions = clamped_block("hexahedron")
    decomposition = decompose(scene, partitions, MPI.COMM_SELF)
    before = build_torn_system(scene, decomposition)
    larger = scene.moved({"block": 2 * scene.bodies["block"].mesh.points})
    after = build_torn_system(larger, decomposition)
    fresh = build_torn_system(larger, decompose(larger, partitions, MPI.COMM_SELF))
    for old, new, again in zip(before.subdomains, after.subdomains, fresh.subdomains, strict=True):
        np.testing.assert_allclose(new.stiffness.data, 2 * old.stiffness.data, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(new.stiffness.data, again.stiffness.data, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(new.points, 2 * old.points)
