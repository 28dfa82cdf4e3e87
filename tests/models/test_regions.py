"""Bodies of several materials: each where it is, and forms for no more than is there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyForce,
    Pressure,
    Scene,
    Support,
    ThermalStrain,
    Traction,
    Ufl,
    box_partition,
    solve_scene,
)
from fenics_contact._fem.forms import FormLibrary
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti import build_torn_system, decompose
from fenics_contact.materials import IsotropicElasticity, Material, OrthotropicElasticity
from tests.models.bodies import bent, box, in_halves, steel
from tests.models.elements import CELLS, SPACE, by_node, element_stiffness, isotropic_matrix, whole

WOOD = OrthotropicElasticity((110.0, 9.0, 5.0), (0.37, 0.42, 0.6), (7.0, 6.0, 0.5))


def assembled_by_hand(body: Body, young: dict[str, float]) -> np.ndarray:
    mesh = body.mesh
    dim, K = mesh.dim, np.zeros((mesh.points.size,) * 2)
    for region, cells in mesh.regions.items():
        C = isotropic_matrix(young[region], 0.3, dim)
        for cell in mesh.cells[cells]:
            dofs = (dim * cell[:, None] + np.arange(dim)).ravel()
            K[np.ix_(dofs, dofs)] += element_stiffness(mesh.points[cell], mesh.cell_type, C)
    return K


@pytest.mark.parametrize("cell", CELLS)
def test_every_cell_has_the_stiffness_of_its_region(cell: str) -> None:
    mesh = in_halves(bent(box(cell)), 0.8)
    young = {"left": 100.0, "right": 7.0}
    body = Body(mesh, {region: steel(mesh.dim, value) for region, value in young.items()})
    expected = assembled_by_hand(body, young)
    np.testing.assert_allclose(by_node(whole(body)), expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("cell", SPACE)
def test_regions_may_be_of_different_kinds(cell: str) -> None:
    mesh = in_halves(bent(box(cell)))
    both = by_node(whole(Body(mesh, {"left": WOOD, "right": steel(3)})))
    swapped = by_node(whole(Body(mesh, {"left": steel(3), "right": WOOD})))
    one, other = by_node(whole(Body(mesh, WOOD))), by_node(whole(Body(mesh, steel(3))))
    np.testing.assert_allclose(both + swapped, one + other, atol=1e-12 * np.abs(other).max())
    assert np.abs(both - other).max() > 0.01 * np.abs(other).max()


def test_one_material_in_all_regions_is_one_material() -> None:
    mesh = in_halves(box("hexahedron"))
    body = Body(mesh, {"left": steel(3), "right": steel(3)})
    assert body.materials == (steel(3),)
    assert not body.material_of_cells.any()


@pytest.mark.parametrize("cell", CELLS)
def test_the_cut_into_subdomains_does_not_show(cell: str) -> None:
    """Subdomains of one material, of both, and of either."""
    mesh = in_halves(bent(box(cell)), 1.3)
    left, right = steel(mesh.dim, 100.0), steel(mesh.dim, 7.0)
    value = (0.3, -0.1, 0.2)[: mesh.dim]
    supports = [Support("body", "x0", (0.0,) * mesh.dim)]
    scene = Scene(
        {"body": Body(mesh, {"left": left, "right": right})},
        supports,
        [Traction("body", "x1", value), BodyForce("body", value)],
    )
    found = []
    for boxes in ((1, 1, 1), (2, 1, 1), (4, 2, 1), (1, 2, 1)):
        state = solve_scene(
            scene, MPI.COMM_SELF, partitions={"body": box_partition(mesh, boxes[: mesh.dim])}, tolerance=1e-10
        )
        found.append((state.gather_displacement("body"), state.gather_von_mises("body")))
    for displacement, stress in found[1:]:
        np.testing.assert_allclose(displacement, found[0][0], atol=1e-8 * np.abs(found[0][0]).max())
        np.testing.assert_allclose(stress, found[0][1], rtol=1e-6)
    assert np.abs(found[0][0]).max() > 1e-3


def test_forms_are_shared_by_all_materials_of_one_class() -> None:
    mesh = in_halves(box("hexahedron"))
    forms = FormLibrary(MPI.COMM_SELF)
    first = Body(mesh, {"left": IsotropicElasticity(1.0, 0.3), "right": IsotropicElasticity(2.0, 0.2)})
    second = Body(mesh, {"left": IsotropicElasticity(3.0, 0.3), "right": IsotropicElasticity(4.0, 0.2)})
    forms.prepare(Scene({"first": first, "second": second}))
    kind = IsotropicElasticity
    assert forms.compiled == (("stiffness", kind, "hexahedron"), ("stiffness", kind, kind, "hexahedron"))


def test_a_number_that_is_no_parameter_is_not_shared() -> None:
    """A model may read its own attributes: then its form is another one."""

    class Doubled(IsotropicElasticity):
        def stress(self, u: object, parameters: object) -> object:
            return (2 if self.young_modulus > 1 else 1) * super().stress(u, parameters)

    forms = FormLibrary(MPI.COMM_SELF)
    mesh = box("hexahedron")
    matrices = [by_node(whole(Body(mesh, Doubled(young, 0.3)), forms=forms)) for young in (1.0, 2.0)]
    assert len(forms.compiled) == 2
    np.testing.assert_allclose(matrices[1], 4 * matrices[0], rtol=1e-12, atol=1e-12)


def test_kinds_of_loads_are_compiled_when_a_scene_calls_for_them() -> None:
    mesh = box("hexahedron")
    body = Body(mesh, steel(3, expansion=1e-3))
    forms = FormLibrary(MPI.COMM_SELF)
    loads = {
        ("surface load", "numbers"): Traction("body", "x1", (1, 0, 0)),
        ("surface load", "of position"): Traction("body", "x1", lambda points: points),
        ("pressure", "numbers"): Pressure("body", "x1", 1.0),
        ("body force", "UFL"): BodyForce("body", Ufl(lambda x: x)),
        ("thermal strain", "numbers"): ThermalStrain("body", 1.0),
    }
    expected: list[tuple[object, ...]] = [("stiffness", IsotropicElasticity, "hexahedron")]
    forms.prepare(Scene({"body": body}))
    assert forms.compiled == tuple(expected)
    for name, load in loads.items():
        for _ in range(2):
            forms.prepare(Scene({"body": body}, loads=[load]))
        expected.append((*name, "hexahedron"))
        assert forms.compiled == tuple(expected)


@pytest.mark.parametrize("names", [("left",), ("left", "right", "middle"), ("left", "east")])
def test_materials_must_name_the_regions_of_the_mesh(names: tuple[str, ...]) -> None:
    materials = dict.fromkeys(names, steel(3))
    message = r"must name exactly the regions of the mesh, got .*, the mesh has \['left', 'right'\]: give one"
    with pytest.raises(InvalidInputError, match=message):
        Body(in_halves(box("hexahedron")), materials)


def test_a_mesh_without_regions_has_one_material() -> None:
    with pytest.raises(InvalidInputError, match=r"got \['left'\], the mesh has \[\]: give one material"):
        Body(box("hexahedron"), {"left": steel(3)})


def cube(material: Material, *loads: Traction) -> Scene:
    return Scene({"body": Body(box("hexahedron"), material)}, [Support("body", "x0")], loads)


def test_a_new_load_keeps_matrix_and_kernel() -> None:
    pull, push = Traction("body", "x1", (1, 0, 0)), Traction("body", "y1", (0, -1, 0))
    scene = cube(steel(3), pull)
    cut = {"body": box_partition(scene.bodies["body"].mesh, (2, 1, 1))}
    decomposition = decompose(scene, cut, MPI.COMM_SELF)
    first = build_torn_system(scene, decomposition)
    later = build_torn_system(replace(scene, loads=[push]), decomposition, previous=first)
    fresh = build_torn_system(replace(scene, loads=[push]), decomposition)
    np.testing.assert_array_equal(later.load, fresh.load)
    assert np.abs(later.load - first.load).max() > 0.01
    for old, new in zip(first.subdomains, later.subdomains, strict=True):
        assert new.matrix is old.matrix
        assert new.kernel is old.kernel
    same = build_torn_system(replace(scene, loads=[push]), decomposition, previous=later)
    assert all(a is b for a, b in zip(same.subdomains, later.subdomains, strict=True))


def test_a_load_away_from_a_subdomain_leaves_it_as_it_is() -> None:
    scene = cube(steel(3), Traction("body", "x1", (1, 0, 0)))
    cut = {"body": box_partition(scene.bodies["body"].mesh, (2, 1, 1))}
    decomposition = decompose(scene, cut, MPI.COMM_SELF)
    first = build_torn_system(scene, decomposition)
    more = replace(scene, loads=[Traction("body", "x1", (2, 0, 0))])
    later = build_torn_system(more, decomposition, previous=first)
    assert [new is old for new, old in zip(later.subdomains, first.subdomains, strict=True)] == [True, False]


def test_another_material_makes_another_matrix() -> None:
    scene = cube(steel(3))
    decomposition = decompose(scene, {"body": np.zeros(16, dtype=int)}, MPI.COMM_SELF)
    (old,) = build_torn_system(scene, decomposition).subdomains
    stiffer = cube(steel(3, young=200.0))
    previous = build_torn_system(scene, decomposition)
    (new,) = build_torn_system(stiffer, decomposition, previous=previous).subdomains
    assert new.matrix is not old.matrix
    np.testing.assert_allclose(new.stiffness.toarray(), 2 * old.stiffness.toarray(), atol=1e-12)
