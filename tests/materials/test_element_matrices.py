"""Element matrices, regions and forms, on any number of ranks."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ufl
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
from fenics_contact._fem.composition import integrate
from fenics_contact._fem.forms import FormLibrary
from fenics_contact._fem.templates import Constants, volume_measure
from fenics_contact._kinematics.element import plain_element
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti import build_torn_system, decompose
from fenics_contact.materials import (
    AnisotropicElasticity,
    IsotropicElasticity,
    J2Plasticity,
    Material,
    MooneyRivlin,
    NeoHooke,
    OrthotropicElasticity,
    OrthotropicPlaneStress,
    PlaneStrain,
    PlaneStress,
    material_axes,
)
from tests.conftest import run_on_ranks
from tests.materials.bodies import bent, box, in_halves, steel
from tests.materials.elements import (
    CELLS,
    PLANE,
    SPACE,
    by_node,
    element_stiffness,
    isotropic_matrix,
    one_cell,
    skewed_cell,
    whole,
)
from tests.materials.materials import LAME, POISSON, YOUNG, EnergyByEntries, FromEnergy, FromStress

WOOD = ((11.0, 0.9, 0.5), (0.37, 0.42, 0.6), (0.7, 0.6, 0.05))


def difference(material: Material, cell: str, C: np.ndarray) -> float:
    """Largest difference to the element matrix of C, relative to its largest entry."""
    vertices = skewed_cell(cell)
    expected = element_stiffness(vertices, cell, C)
    assert np.abs(expected).max() > 0.01
    return float(
        np.abs(by_node(one_cell(material, cell, vertices)) - expected).max() / np.abs(expected).max()
    )


def plane_stress_matrix(young: float, poisson: float) -> np.ndarray:
    C = np.array([[1, poisson, 0], [poisson, 1, 0], [0, 0, (1 - poisson) / 2]])
    return young / (1 - poisson**2) * C


def compliance_of_wood() -> np.ndarray:
    (E1, E2, E3), (n12, n13, n23), (G12, G13, G23) = WOOD
    S = np.diag([1 / E1, 1 / E2, 1 / E3, 1 / G23, 1 / G13, 1 / G12])
    S[0, 1] = S[1, 0] = -n12 / E1
    S[0, 2] = S[2, 0] = -n13 / E1
    S[1, 2] = S[2, 1] = -n23 / E2
    return S


@pytest.mark.parametrize("cell", SPACE)
def test_an_isotropic_body_in_space(cell: str) -> None:
    material = IsotropicElasticity(YOUNG, POISSON)
    assert difference(material, cell, isotropic_matrix(YOUNG, POISSON, 3)) < 1e-13


@pytest.mark.parametrize("cell", PLANE)
def test_plane_strain_and_plane_stress(cell: str) -> None:
    strained, stressed = isotropic_matrix(YOUNG, POISSON, 2), plane_stress_matrix(YOUNG, POISSON)
    assert difference(PlaneStrain(YOUNG, POISSON), cell, strained) < 1e-13
    assert difference(PlaneStress(YOUNG, POISSON), cell, stressed) < 1e-13
    assert difference(PlaneStress(YOUNG, POISSON), cell, strained) > 0.01


def test_a_constant_strain_triangle_by_hand() -> None:
    """E = 1, ν = 0, right triangle with legs of length one: K = ½ Bᵀ diag(1, 1, ½) B."""
    B = np.array([[-1, 0, 1, 0, 0, 0], [0, -1, 0, 0, 0, 1], [-1, -1, 0, 1, 1, 0.0]])
    expected = 0.5 * B.T @ np.diag([1, 1, 0.5]) @ B
    found = by_node(one_cell(PlaneStrain(1.0, 0.0), "triangle", np.array([[0, 0], [1, 0], [0, 1.0]])))
    np.testing.assert_allclose(found, expected, atol=1e-15)


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("model", [FromEnergy, FromStress])
def test_a_model_of_the_user_gives_the_same_from_energy_and_from_stress(model: Any, cell: str) -> None:
    dim = 2 if cell in PLANE else 3
    assert difference(model(*LAME), cell, isotropic_matrix(YOUNG, POISSON, dim)) < 1e-13


@pytest.mark.parametrize("cell", PLANE)
def test_an_energy_may_be_written_with_single_entries(cell: str) -> None:
    assert difference(EnergyByEntries(*LAME), cell, isotropic_matrix(YOUNG, POISSON, 2)) < 1e-13


@pytest.mark.parametrize("cell", SPACE)
def test_an_orthotropic_body_along_the_axes(cell: str) -> None:
    assert difference(OrthotropicElasticity(*WOOD), cell, np.linalg.inv(compliance_of_wood())) < 1e-12


@pytest.mark.parametrize("cell", SPACE)
def test_equal_constants_make_an_isotropic_body_in_any_orientation(cell: str) -> None:
    shear = YOUNG / (2 * (1 + POISSON))
    axes = material_axes((1, 2, 0.5), (0, 1, 3))
    material = OrthotropicElasticity((YOUNG,) * 3, (POISSON,) * 3, (shear,) * 3, axes)
    assert difference(material, cell, isotropic_matrix(YOUNG, POISSON, 3)) < 1e-12


@pytest.mark.parametrize("cell", SPACE)
def test_turning_body_and_material_together_turns_the_matrix(cell: str) -> None:
    axes = np.array(material_axes((1, 2, 0.5), (0, 1, 3)))
    vertices = skewed_cell(cell)
    straight = by_node(one_cell(OrthotropicElasticity(*WOOD), cell, vertices))
    turned_material = OrthotropicElasticity(*WOOD, tuple(tuple(axis) for axis in axes))
    turned = by_node(one_cell(turned_material, cell, vertices @ axes))
    Q = np.kron(np.eye(len(vertices)), axes)
    np.testing.assert_allclose(Q @ turned @ Q.T, straight, atol=1e-12 * np.abs(straight).max())
    unturned = by_node(one_cell(OrthotropicElasticity(*WOOD), cell, vertices @ axes))
    assert np.abs(unturned - turned).max() > 0.01 * np.abs(turned).max()


def any_moduli() -> np.ndarray:
    """A stiffness matrix without a zero and without any symmetry of a crystal."""
    roots = np.random.default_rng(3).uniform(-1.0, 1.0, (6, 6)) + 3.0 * np.eye(6)
    return np.asarray(roots @ roots.T)


@pytest.mark.parametrize("cell", SPACE)
def test_an_anisotropic_body_has_the_matrix_it_is_given(cell: str) -> None:
    C = any_moduli()
    assert np.abs(C).min() > 0.01
    material = AnisotropicElasticity(C)  # type: ignore[arg-type]
    assert difference(material, cell, C) < 1e-12


def test_an_orthotropic_body_is_an_anisotropic_one_in_the_same_axes() -> None:
    axes = material_axes((1, 2, 0.5), (0, 1, 3))
    straight, turned = OrthotropicElasticity(*WOOD), OrthotropicElasticity(*WOOD, axes)
    found = AnisotropicElasticity(straight.stiffness_matrix, axes)  # type: ignore[arg-type]
    np.testing.assert_allclose(found.stiffness_matrix, turned.stiffness_matrix, rtol=1e-12, atol=1e-12)
    assert np.abs(turned.stiffness_matrix - straight.stiffness_matrix).max() > 0.1


@pytest.mark.parametrize("cell", PLANE)
def test_an_orthotropic_plate_along_and_across_the_axes(cell: str) -> None:
    (E1, E2, _), (n12, *_), (G12, *_) = WOOD
    S = np.array([[1 / E1, -n12 / E1, 0], [-n12 / E1, 1 / E2, 0], [0, 0, 1 / G12]])
    assert difference(OrthotropicPlaneStress((E1, E2), n12, G12), cell, np.linalg.inv(S)) < 1e-12
    across = np.linalg.inv(S)[np.ix_([1, 0, 2], [1, 0, 2])]
    assert difference(OrthotropicPlaneStress((E1, E2), n12, G12, np.pi / 2), cell, across) < 1e-12


def test_an_orthotropic_plate_is_an_orthotropic_body_without_stress_normal_to_it() -> None:
    angle = 0.4
    c, s = np.cos(angle), np.sin(angle)
    body = OrthotropicElasticity(*WOOD, ((c, s, 0), (-s, c, 0), (0, 0, 1)))
    plate = OrthotropicPlaneStress(WOOD[0][:2], WOOD[1][0], WOOD[2][0], angle)
    in_plane = np.linalg.inv(body.stiffness_matrix)[np.ix_([0, 1, 5], [0, 1, 5])]
    np.testing.assert_allclose(plate.stiffness_matrix, np.linalg.inv(in_plane), rtol=1e-10, atol=1e-12)


# Bodies of several materials: each where it is, and forms for no more than is there.
REGIONS_WOOD = OrthotropicElasticity((110.0, 9.0, 5.0), (0.37, 0.42, 0.6), (7.0, 6.0, 0.5))


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
    both = by_node(whole(Body(mesh, {"left": REGIONS_WOOD, "right": steel(3)})))
    swapped = by_node(whole(Body(mesh, {"left": steel(3), "right": REGIONS_WOOD})))
    one, other = by_node(whole(Body(mesh, REGIONS_WOOD))), by_node(whole(Body(mesh, steel(3))))
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


# Forms are the same however many UFL constants were made before, as on ranks with more subdomains.
MATERIALS = [NeoHooke(1.0, 0.3), MooneyRivlin(1.0, 0.5, 10.0), J2Plasticity(1.0, 0.3, 0.01)]

#: Rank 1 makes the constants numbered 9 and 10, whose names sort the other way round.
APART = """
import ufl
from mpi4py import MPI
from fenics_contact import solve_scene
from fenics_contact.gallery import block
from fenics_contact import Body, Scene, Support
from fenics_contact.materials import NeoHooke

comm = MPI.COMM_WORLD
ufl.Constant._globalcount = 8 + comm.rank
mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (2, 1, 1))
supports = [Support("pad", "x0"), Support("pad", "x1", (0.01, 0.0, 0.0))]
state = solve_scene(Scene({"pad": Body(mesh, NeoHooke(1.0, 0.3))}, supports), comm)
energies = comm.gather(state.energies.strain)
if comm.rank == 0:
    print(*energies)
"""


def signature(material: Material) -> str:
    element = plain_element("hexahedron")
    space = element.displacements
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)

    def work(m: Material, constants: Constants) -> ufl.core.expr.Expr:
        return m.stiffness(u, v, constants)

    form, _ = integrate((material,), element, work, volume_measure(element))
    return str(form.signature())


@pytest.mark.parametrize("material", MATERIALS, ids=lambda each: type(each).__name__)
def test_forms_do_not_depend_on_the_number_of_constants_made_before(
    material: Material, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = set()
    for before in range(6, 12):
        monkeypatch.setattr(ufl.Constant, "_globalcount", before, raising=False)
        found.add(signature(material))
    assert len(found) == 1


def test_ranks_that_made_different_numbers_of_constants_write_the_same_forms(mpirun) -> None:
    one, two = mpirun(APART, 2, fresh=True).split()
    assert float(one) == float(two) > 0.0


# Materials, temperatures and stresses are the same on one rank and on several, some without a cell.
RANKS = (2, 4)


@cache
def found(ranks: int) -> dict[str, Any]:
    answer: dict[str, Any] = json.loads(
        run_on_ranks(Path(__file__).with_name("on_ranks.py"), ranks, timeout=120)
    )
    return answer


@pytest.mark.parametrize("ranks", RANKS)
@pytest.mark.parametrize(
    "body", ["triangle heated", "triangle plain", "hexahedron heated", "hexahedron plain"]
)
def test_displacement_and_stress_do_not_depend_on_the_ranks(body: str, ranks: int) -> None:
    for here, alone in zip(found(ranks)[body], found(1)[body], strict=True):
        size = np.abs(alone).max()
        assert size > 1e-3
        np.testing.assert_allclose(here, alone, atol=1e-7 * size)


@pytest.mark.parametrize("ranks", RANKS[1:])
def test_some_ranks_had_no_cell_of_the_heated_body(ranks: int) -> None:
    assert 0 in found(ranks)["hexahedron cells"]


@pytest.mark.parametrize("ranks", RANKS)
def test_all_ranks_refuse_a_wrong_material(ranks: int) -> None:
    assert len(found(ranks)["refused"]) == ranks
    assert all("complete kernel(points)" in text for text in found(ranks)["refused"])
