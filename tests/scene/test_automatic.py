"""Contact that is found, and discretisations that are chosen."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AutomaticContact,
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    LinearClosure,
    RigidPlane,
    Roller,
    Scene,
    Support,
    Surface,
    Tie,
    solve_scene,
)
from fenics_contact._scene.discretisation import keeping_discretisation
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, half_disc, rectangle
from fenics_contact.materials import IsotropicElasticity, NeoHooke, PlaneStrain
from fenics_contact.mesh import quadratic
from fenics_contact.mesh.near_surfaces import near_surfaces
from tests.scenes import partitions

STEEL, RUBBER = IsotropicElasticity(2.1e5, 0.3), IsotropicElasticity(10.0, 0.3)
LOW = block((0.0, 0.0, 0.0), (3.0, 3.0, 1.0), (3, 3, 1))


def scene(high: tuple[int, int, int] = (2, 2, 2), *, gap: float = 0.0, material: IsotropicElasticity = STEEL,
          shift: float = 0.0, push: float = 0.0,
          automatic: AutomaticContact = AutomaticContact(Coulomb(0.3))) -> Scene:  # fmt: skip
    """Return a block over a wider plate of three cells a side."""
    low_left = (0.5 + shift, 0.5, 1.0 + gap)
    upper = block(low_left, (2.5 + shift, 2.5, 2.0 + gap), high)
    bodies = {"plate": Body(LOW, STEEL), "punch": Body(upper, material)}
    supports = [Support("plate", "z0"), Support("punch", "z1", (push, 0.0, -0.01))]
    return Scene(bodies, supports, contacts=automatic)


def test_the_surfaces_that_face_each_other_are_found_and_solved() -> None:
    found = scene((4, 4, 2))
    assert [pair.place for pair in found.contacts] == ["punch near plate on plate near punch"]
    assert found.contacts[0].friction == Coulomb(0.3)
    punch, plate = found.bodies["punch"].mesh, found.bodies["plate"].mesh
    assert len(punch.surfaces["near plate"]) == 16
    assert len(plate.surfaces["near punch"]) == 9
    assert "pair 0" in str(found.plan())
    named = Scene(
        {"plate": Body(LOW, STEEL), "punch": found.bodies["punch"]}, found.supports,
        contacts=[ContactPair(Surface("punch", "z0"), Surface("plate", "z1"), Coulomb(0.3))],
    )  # fmt: skip
    forces = []
    for each in (found, named):
        state = solve_scene(each, MPI.COMM_SELF, partitions=partitions(each), tolerance=1e-9)
        forces.append(state.contact.normal_force)
    assert forces[0].sum() > 100.0
    assert forces[0] == pytest.approx(forces[1], rel=1e-6)


def test_a_roller_that_holds_a_node_set_counts_for_the_distance() -> None:
    upper = block((0.5, 0.5, 1.2), (2.5, 2.5, 2.2), (2, 2, 2))
    upper = replace(upper, node_sets={"top": np.flatnonzero(upper.points[:, 2] > 2.1)})
    bodies = {"plate": Body(LOW, STEEL), "punch": Body(upper, STEEL)}
    pushed = Roller("punch", "top", displacement=-0.3, direction=(0.0, 0.0, 1.0))
    found = Scene(bodies, [Support("plate", "z0"), pushed], contacts=AutomaticContact())
    (pair,) = found.contacts
    assert set(pair.bodies) == {"plate", "punch"}


def test_all_pairs_have_the_law_of_closure() -> None:
    law = LinearClosure(1e5)
    contact = solve_scene(scene((4, 4, 2), automatic=AutomaticContact(closure=law)), MPI.COMM_SELF).contact
    pressed = contact.pressure > 1.0
    assert pressed.any()
    np.testing.assert_allclose(contact.gap[pressed], -law.closure(contact.pressure[pressed]), rtol=1e-3)
    rubber = {"seal": Body(LOW, NeoHooke(10.0, 0.3))}
    (folded,) = Scene(rubber, contacts=AutomaticContact(self_contact=("seal",), closure=law)).contacts
    assert folded.closure == law

    class Falling(LinearClosure):
        def closure(self, pressure: np.ndarray) -> np.ndarray:
            return -pressure

    with pytest.raises(InvalidInputError, match="closure of Falling must be zero without pressure"):
        AutomaticContact(closure=Falling(1.0))


def test_the_finer_side_is_the_slave_then_the_softer_one() -> None:
    assert scene((4, 4, 2)).contacts[0].slave.body == "punch"
    assert scene((1, 1, 1)).contacts[0].slave.body == "plate"
    assert scene((2, 2, 2)).contacts[0].slave.body == "plate"  # alike: as named
    assert scene((2, 2, 2), material=RUBBER).contacts[0].slave.body == "punch"


def test_the_finer_side_is_the_slave_where_cells_are_quadratic() -> None:
    for high, slave in (((4, 4, 2), "punch"), ((1, 1, 1), "plate"), ((2, 2, 2), "plate")):
        meshes = {"plate": LOW, "punch": block((0.5, 0.5, 1.0), (2.5, 2.5, 2.0), high)}
        bodies = {name: Body(quadratic(mesh), STEEL) for name, mesh in meshes.items()}
        found = Scene(bodies, [Support("plate", "z0")], contacts=AutomaticContact())
        assert found.contacts[0].slave.body == slave


@pytest.mark.parametrize("curved", ["plate", "punch"])
def test_linear_cells_are_the_slave_of_quadratic_ones(curved: str) -> None:
    meshes = {"plate": LOW, "punch": block((0.5, 0.5, 1.0), (2.5, 2.5, 2.0), (3, 3, 2))}
    bodies = {n: Body(quadratic(mesh) if n == curved else mesh, STEEL) for n, mesh in meshes.items()}
    found = Scene(bodies, [Support("plate", "z0")], contacts=AutomaticContact()).contacts[0]
    assert found.slave.body == ("punch" if curved == "plate" else "plate")


def test_a_side_whose_nodes_are_all_held_is_the_master() -> None:
    fine = block((0.5, 0.5, 1.0), (2.5, 2.5, 2.0), (8, 8, 2))
    bodies = {"plate": Body(LOW, STEEL), "punch": Body(fine, STEEL)}
    supports = [Support("punch", "z0"), Support("plate", "z0", (None, None, 0.1))]
    assert Scene(bodies, supports, contacts=AutomaticContact()).contacts[0].slave.body == "plate"


def test_bodies_that_supports_bring_together_are_near() -> None:
    with pytest.raises(InvalidInputError, match=r"finds none; the nearest nodes of two bodies are 1\.6"):
        scene(gap=1.5)
    assert scene(gap=1.5, push=2.0).contacts
    assert scene(gap=1.5, automatic=AutomaticContact(distance=1.6)).contacts


def test_surfaces_reach_as_far_as_bodies_slide() -> None:
    meshes = {"plate": LOW, "punch": block((0.0, 0.0, 1.0), (1.0, 1.0, 2.0), (1, 1, 1))}
    assert len(near_surfaces(meshes, 0.1)[0]["plate"].surfaces["near punch"]) == 1
    assert len(near_surfaces(meshes, 0.1, along=0.6)[0]["plate"].surfaces["near punch"]) == 3
    # The sides of the plate face another way.
    assert len(near_surfaces(meshes, 0.1, along=9.0)[0]["plate"].surfaces["near punch"]) == 9


def test_three_plane_bodies_meet_in_two_pairs(caplog: pytest.LogCaptureFixture) -> None:
    bodies = {
        name: Body(rectangle((x, 0.0), (x + 1.0, 1.0), (4, 4)), PlaneStrain(1.0, 0.3))
        for name, x in (("a", 0.0), ("b", 1.0), ("c", 2.0))
    }
    with caplog.at_level(logging.INFO, logger="fenics_contact"):
        found = Scene(bodies, contacts=AutomaticContact(distance=0.1))
    assert {frozenset((pair.slave.body, pair.master.body)) for pair in found.contacts} == {  # type: ignore[union-attr]
        frozenset("ab"), frozenset("bc"),
    }  # fmt: skip
    assert "2 contact pairs are found within a distance of 0.1" in caplog.text


def test_bodies_that_may_fold_are_their_own_masters() -> None:
    rubber = {"seal": Body(LOW, NeoHooke(10.0, 0.3))}
    found = Scene(rubber, contacts=AutomaticContact(Coulomb(0.1), self_contact=("seal",)))
    (pair,) = found.contacts
    assert pair.slave == pair.master == Surface("seal", "boundary")
    assert pair.friction == Coulomb(0.1)
    assert len(found.facets(pair.slave)) == 2 * (9 + 3 + 3)
    above = Body(block((0.0, 0.0, 1.1), (3.0, 3.0, 2.1), (3, 3, 1)), STEEL)
    automatic = AutomaticContact(distance=0.2, self_contact=("seal",))
    both = Scene({**rubber, "plate": above}, contacts=automatic)
    assert [each.place for each in both.contacts] == [
        "seal near plate on plate near seal", "seal boundary on seal boundary",
    ]  # fmt: skip
    with pytest.raises(
        InvalidInputError, match=r"self_contact names body 'sael', the scene has \['seal'\]: use"
    ):
        Scene(rubber, contacts=AutomaticContact(self_contact=("sael",)))
    named = {"seal": Body(found.bodies["seal"].mesh, NeoHooke(10.0, 0.3))}
    with pytest.raises(InvalidInputError, match="must have no surface 'boundary' yet"):
        Scene(named, contacts=AutomaticContact(self_contact=("seal",)))
    with pytest.raises(InvalidInputError, match="with itself needs a material for large deformations"):
        Scene({"plate": Body(LOW, STEEL)}, contacts=AutomaticContact(self_contact=("plate",)))


def test_one_body_and_distances_that_are_none_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="needs two bodies"):
        Scene({"plate": Body(LOW, STEEL)}, contacts=AutomaticContact())
    for distance in (0.0, -1.0, np.inf, np.nan):
        with pytest.raises(InvalidInputError, match=r"AutomaticContact\.distance must be positive"):
            AutomaticContact(distance=distance)
    assert list(AutomaticContact()) == []


# Mortar where meshes of deformable bodies do not match, nodes elsewhere, with a reason.
CHOSEN_DISCRETISATION_STEEL, PLATE = IsotropicElasticity(2.1e5, 0.3), PlaneStrain(2.1e5, 0.3)


def blocks(above: int, below: int, *, shift: float = 0.0, gap: float = 0.0, dim: int = 3) -> list[BodyMesh]:
    if dim == 2:
        upper = rectangle((shift, 1.0 + gap), (1.0 + shift, 2.0 + gap), (above, above))
        return [upper, rectangle((0.0, 0.0), (2.0, 1.0), (2 * below, below))]
    upper = block((shift, 0.0, 1.0 + gap), (1.0 + shift, 1.0, 2.0 + gap), (above,) * 3)
    return [upper, block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (2 * below, below, below))]


def scene_of(meshes: list[BodyMesh], **given: Any) -> Scene:
    dim = meshes[0].dim
    low, high = ("y0", "y1") if dim == 2 else ("z0", "z1")
    bodies = {
        name: Body(mesh, PLATE if dim == 2 else CHOSEN_DISCRETISATION_STEEL)
        for name, mesh in zip("ab", meshes, strict=True)
    }
    options = {"discretisation": "best"} | given
    return Scene(bodies, contacts=[ContactPair(Surface("a", low), Surface("b", high), **options)])


def chosen(scene: Scene) -> tuple[str, str]:
    (pair,) = scene.contacts
    return pair.discretisation, pair.reason


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize(
    ("options", "found"),
    [
        ({}, "node, as the meshes match"),
        ({"gap": 0.3}, "node, as the meshes match"),
        ({"shift": 1.0 / 3.0}, "node, as the meshes match"),
        ({"shift": 0.2}, "mortar, as the meshes do not match"),
    ],
)
def test_meshes_match_where_nodes_lie_over_each_other(dim: int, options: dict, found: str) -> None:
    assert chosen(scene_of(blocks(3, 3, dim=dim, **options)))[1] == found
    assert chosen(scene_of(blocks(3, 5, dim=dim, **options)))[1] == "mortar, as the meshes do not match"


def test_the_choice_is_the_same_turned_and_in_other_units() -> None:
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    for cells in (3, 4):
        for unit in (1e-6, 1.0, 1e6):
            moved = [mesh.moved(unit * (mesh.points @ turn.T + 100.0)) for mesh in blocks(3, cells)]
            assert chosen(scene_of(moved)) == chosen(scene_of(blocks(3, cells)))


def test_what_was_given_stays_and_rigid_masters_have_nodes() -> None:
    for given in ("node", "mortar"):
        assert chosen(scene_of(blocks(3, 4), discretisation=given)) == (given, "")
    pair = ContactPair(Surface("a", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)), discretisation="best")
    scene = replace(scene_of(blocks(3, 4)), contacts=[pair])
    assert chosen(scene)[1] == "node, as the master is rigid"
    assert "node, as the master is rigid" in str(scene.plan())


def test_ties_choose_likewise() -> None:
    for cells, found in ((3, "node"), (4, "mortar")):
        tie = Tie(Surface("a", "z0"), Surface("b", "z1"), discretisation="best")
        assert replace(scene_of(blocks(3, cells)), contacts=[], ties=[tie]).ties[0].discretisation == found


def test_designs_and_new_meshes_keep_the_choice() -> None:
    scene = scene_of(blocks(3, 3))
    a = scene.bodies["a"].mesh
    reshaped = a.reshaped(a.points + 0.02 * np.sin(7.0 * a.points[:, [1, 2, 0]]))
    bent = replace(scene, bodies={**scene.bodies, "a": Body(reshaped, CHOSEN_DISCRETISATION_STEEL)})
    assert chosen(bent) == chosen(scene) == ("node", "node, as the meshes match")
    finer = {**scene.bodies, "a": Body(blocks(5, 3)[0], CHOSEN_DISCRETISATION_STEEL)}
    assert chosen(replace(keeping_discretisation(scene), bodies=finer))[0] == "node"
    assert chosen(replace(scene, bodies=finer))[0] == "mortar"


def test_round_bodies_that_touch_at_a_node_do_not_match() -> None:
    disc = half_disc(1.0, 4)
    scene = Scene(
        {"a": Body(disc, PLATE), "b": Body(rectangle((-1.0, -1.0), (1.0, 0.0), (7, 3)), PLATE)},
        contacts=[ContactPair(Surface("a", "contact"), Surface("b", "y1"), discretisation="best")],
    )
    assert chosen(scene) == ("mortar", "mortar, as the meshes do not match")
