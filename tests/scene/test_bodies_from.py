"""Meshes of a file become bodies by the names of their materials."""

from __future__ import annotations

import pytest

from fenics_contact import Body, Scene, Support
from fenics_contact._scene.scene import bodies_from
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.readers import read_msh
from tests.conftest import ROOT

STEEL, RUBBER = IsotropicElasticity(2.1e5, 0.3), IsotropicElasticity(10.0, 0.45)
MESHES = {name: block((0, 0, 0), (1, 1, 1), (1, 1, 1)) for name in ("link 1", "link 2", "pad")}


def materials(bodies: dict[str, Body]) -> list[object]:
    return [body.material for body in bodies.values()]


def test_one_material_is_that_of_all_bodies() -> None:
    bodies = bodies_from(MESHES, STEEL)
    assert list(bodies) == list(MESHES)
    assert materials(bodies) == [STEEL, STEEL, STEEL]


def test_a_pattern_stands_for_many_names_and_a_name_goes_first() -> None:
    assert materials(bodies_from(MESHES, {"link *": STEEL, "pad": RUBBER})) == [STEEL, STEEL, RUBBER]
    assert materials(bodies_from(MESHES, {"*": STEEL, "link 2": RUBBER})) == [STEEL, RUBBER, STEEL]


def test_regions_of_a_file_get_their_own_materials() -> None:
    file = ROOT / "tests" / "data" / "two_squares_22.msh"
    hard, soft = PlaneStrain(2e5, 0.3), PlaneStrain(1e5, 0.35)
    plates = read_msh(file, {"plate": ["steel", "copper"]})
    bodies = bodies_from(plates, {"plate": {"steel": hard, "copper": soft}})
    scene = Scene(bodies, [Support("plate", "bottom", (0.0, 0.0))])
    assert scene.bodies["plate"].materials == (hard, soft)


def test_a_body_without_material_and_a_material_without_body_are_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"'pad' has none of \['link \*'\]: name it, or give"):
        bodies_from(MESHES, {"link *": STEEL})
    with pytest.raises(InvalidInputError, match=r"'lnk' matches none of \['link 1', 'link 2', 'pad'\]"):
        bodies_from(MESHES, {"*": STEEL, "lnk": RUBBER})
