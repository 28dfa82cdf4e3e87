"""Mortar where meshes of deformable bodies do not match, nodes elsewhere, with a reason."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fenics_contact import Body, BodyMesh, ContactPair, RigidPlane, Scene, Surface, Tie
from fenics_contact._scene.parts import keeping_discretisation
from fenics_contact.gallery import block, half_disc, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import quadratic

STEEL, PLATE = IsotropicElasticity(2.1e5, 0.3), PlaneStrain(2.1e5, 0.3)


def blocks(above: int, below: int, *, shift: float = 0.0, gap: float = 0.0, dim: int = 3) -> list[BodyMesh]:
    if dim == 2:
        upper = rectangle((shift, 1.0 + gap), (1.0 + shift, 2.0 + gap), (above, above))
        return [upper, rectangle((0.0, 0.0), (2.0, 1.0), (2 * below, below))]
    upper = block((shift, 0.0, 1.0 + gap), (1.0 + shift, 1.0, 2.0 + gap), (above,) * 3)
    return [upper, block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (2 * below, below, below))]


def scene_of(meshes: list[BodyMesh], **given: Any) -> Scene:
    dim = meshes[0].dim
    low, high = ("y0", "y1") if dim == 2 else ("z0", "z1")
    bodies = {name: Body(mesh, PLATE if dim == 2 else STEEL) for name, mesh in zip("ab", meshes, strict=True)}
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


def test_what_was_given_stays_and_rigid_masters_and_quadratic_cells_have_nodes() -> None:
    for given in ("node", "mortar"):
        assert chosen(scene_of(blocks(3, 4), discretisation=given)) == (given, "")
    curved = [quadratic(mesh) for mesh in blocks(2, 3)]
    assert chosen(scene_of(curved))[1] == "node, as there is no mortar for quadratic cells"
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
    bent = replace(scene, bodies={**scene.bodies, "a": Body(reshaped, STEEL)})
    assert chosen(bent) == chosen(scene) == ("node", "node, as the meshes match")
    finer = {**scene.bodies, "a": Body(blocks(5, 3)[0], STEEL)}
    assert chosen(replace(keeping_discretisation(scene), bodies=finer))[0] == "node"
    assert chosen(replace(scene, bodies=finer))[0] == "mortar"


def test_round_bodies_that_touch_at_a_node_do_not_match() -> None:
    disc = half_disc(1.0, 4)
    scene = Scene(
        {"a": Body(disc, PLATE), "b": Body(rectangle((-1.0, -1.0), (1.0, 0.0), (7, 3)), PLATE)},
        contacts=[ContactPair(Surface("a", "contact"), Surface("b", "y1"), discretisation="best")],
    )
    assert chosen(scene) == ("mortar", "mortar, as the meshes do not match")
