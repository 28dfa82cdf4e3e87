"""The same scene on refined meshes, and the cells that are marked."""

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactPair, Preload, Scene, Section, Support, Surface, Traction, solve_scene
from fenics_contact._adaptive.marking import bulk
from fenics_contact._adaptive.refined_scene import refine_scene
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain

STEEL = PlaneStrain(2.1e5, 0.3)


def two_blocks() -> Scene:
    lower = rectangle((0.0, 0.0), (3.0, 1.0), (3, 2), cell="triangle")
    upper = rectangle((0.0, 1.0), (3.0, 2.0), (3, 2), cell="triangle")
    return Scene(
        bodies={"lower": Body(lower, STEEL), "upper": Body(upper, STEEL)},
        supports=[Support("lower", "y0"), Support("upper", "x0", (0.0, None))],
        loads=[Traction("upper", "y1", (0.0, -100.0))],
        contacts=[ContactPair(Surface("upper", "y0"), Surface("lower", "y1"))],
    )


def test_a_refined_scene_has_the_same_parts_and_force():
    scene = two_blocks()
    assert scene.contacts[0].discretisation == "node"
    found = refine_scene(scene, {"upper": [0, 1]})
    fine = found.scene
    assert fine.bodies["lower"].mesh is scene.bodies["lower"].mesh
    assert list(found.refinements) == ["upper"]
    assert fine.bodies["upper"].mesh is found.refinements["upper"].mesh
    assert fine.bodies["upper"].mesh.n_cells > scene.bodies["upper"].mesh.n_cells
    # The surfaces no longer match, and the scene says so.
    assert fine.contacts[0].discretisation == "mortar"
    state = solve_scene(fine, MPI.COMM_SELF, tolerance=1e-10)
    assert state.resultants().contacts[0].force == pytest.approx([0.0, 300.0], abs=1e-7)


def test_a_bolt_is_cut_again_on_its_refined_mesh():
    body = rectangle((0.0, 0.0), (1.0, 4.0), (2, 6), cell="triangle")
    section = Section((0.0, 2.0), (0.0, 1.0))
    scene = Scene(
        bodies={"bolt": Body(body, STEEL)},
        supports=[Support("bolt", "y0"), Support("bolt", "y1")],
        preloads=[Preload("bolt", section, force=50.0)],
    )
    found = refine_scene(scene, {"bolt": np.arange(6)})
    cut, whole = found.scene.bodies["bolt"].mesh, found.refinements["bolt"].mesh
    assert len(cut.cuts) == 1
    assert not whole.cuts
    assert cut.n_nodes - whole.n_nodes == len(cut.cuts[section].pairs) >= 3
    (of_bolt,) = solve_scene(found.scene, MPI.COMM_SELF, tolerance=1e-10).preloads().values()
    assert of_bolt.force == pytest.approx(50.0)


def test_unknown_bodies_are_refused():
    with pytest.raises(InvalidInputError, match=r"got 'lwoer': take one of \['lower', 'upper'\]"):
        refine_scene(two_blocks(), {"lwoer": [0]})


def test_the_fewest_cells_with_a_fraction_of_the_error_are_marked():
    shares = {"a": np.array([5.0, 1.0, 0.0]), "b": np.array([2.0, 2.0])}
    assert {name: list(cells) for name, cells in bulk(shares, 0.5).items()} == {"a": [0]}
    # Of two equal shares both or none.
    assert {name: list(cells) for name, cells in bulk(shares, 0.6).items()} == {"a": [0], "b": [0, 1]}
    assert {name: list(cells) for name, cells in bulk(shares, 1.0).items()} == {"a": [0, 1], "b": [0, 1]}
    # At most two of five cells, and with them those with equal shares.
    assert {name: list(cells) for name, cells in bulk(shares, 1.0, 0.4).items()} == {"a": [0], "b": [0, 1]}
    assert {name: list(cells) for name, cells in bulk(shares, 1.0, 0.1).items()} == {"a": [0]}
