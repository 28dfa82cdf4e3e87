"""Tied bodies behave as one, and where a tie may slide only the normal direction is held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Tie,
    Traction,
    box_partition,
    solve_scene,
)
from fenics_contact._pairing.search import find_tied_points
from fenics_contact._scene.pairs import Discretisation
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity

STEEL = IsotropicElasticity(1000.0, 0.3)
FACES = Surface("upper", "z0"), Surface("lower", "z1")
PUSH = (0.3, 0.1, -1.0)


def tower(counts: tuple[int, int, int] = (4, 3, 2), **parts: object) -> Scene:
    """Two blocks upon each other, the lower one clamped, the upper one pushed."""
    lower, upper = block((0, 0, 0), (2, 1, 1), (4, 3, 2)), block((0, 0, 1), (2, 1, 2), counts)
    scene = Scene(
        {"lower": Body(lower, STEEL), "upper": Body(upper, STEEL)},
        [Support("lower", "z0")],
        [Traction("upper", "z1", PUSH)],
    )
    return replace(scene, **parts)


def cuts(scene: Scene) -> dict[str, np.ndarray]:
    return {name: box_partition(body.mesh, (2, 1, 1)) for name, body in scene.bodies.items()}


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_tied_matching_meshes_are_one_mesh(discretisation: Discretisation) -> None:
    scene = tower(ties=[Tie(*FACES, discretisation=discretisation)])
    tied = solve_scene(scene, MPI.COMM_SELF, partitions=cuts(scene), tolerance=1e-10)
    whole = block((0, 0, 0), (2, 1, 2), (4, 3, 4))
    one = Scene({"all": Body(whole, STEEL)}, [Support("all", "z0")], [Traction("all", "z1", PUSH)])
    state = solve_scene(
        one, MPI.COMM_SELF, partitions={"all": box_partition(whole, (2, 1, 1))}, tolerance=1e-10
    )
    expected = state.gather_displacement("all")
    for name, body in scene.bodies.items():
        found = tied.gather_displacement(name)
        place = [int(np.argmin(np.linalg.norm(whole.points - point, axis=1))) for point in body.mesh.points]
        np.testing.assert_allclose(found, expected[place], atol=1e-8 * np.abs(expected).max())


def test_a_tied_body_needs_no_other_hold_and_an_untied_one_is_refused() -> None:
    scene = tower((5, 4, 2), ties=[Tie(*FACES)])
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cuts(scene), tolerance=1e-10)
    base = np.unique(scene.bodies["lower"].mesh.surfaces["z0"])
    assert state.counts["equality_multipliers"] > 0
    assert np.abs(state.gather_displacement("lower")[base]).max() < 1e-12
    with pytest.raises(InfeasibleError, match="body 'upper' can move away under the load"):
        solve_scene(replace(scene, ties=[]), MPI.COMM_SELF, partitions=cuts(scene), tolerance=1e-10)


def test_a_sliding_tie_holds_the_normal_direction_alone() -> None:
    glides = tower((5, 4, 2), ties=[Tie(*FACES, sliding=True)])
    with pytest.raises(InfeasibleError, match=r"body 'upper' can move away .* translation"):
        solve_scene(glides, MPI.COMM_SELF, partitions=cuts(glides), tolerance=1e-10)
    # Pulled apart, which contact would let go.
    guides = [Support("upper", "x0", (0.0, None, None)), Support("upper", "y0", (None, 0.0, None))]
    pulled = replace(
        glides, supports=[*glides.supports, *guides], loads=[Traction("upper", "z1", (0.0, 0.0, 1.0))]
    )
    state = solve_scene(pulled, MPI.COMM_SELF, partitions=cuts(pulled), tolerance=1e-10)
    low = np.unique(pulled.bodies["upper"].mesh.surfaces["z0"])
    high = np.unique(pulled.bodies["lower"].mesh.surfaces["z1"])
    above, below = state.gather_displacement("upper")[low], state.gather_displacement("lower")[high]
    assert above[:, 2].mean() == pytest.approx(below[:, 2].mean(), rel=1e-2)
    widths = [np.ptp(field[:, 0]) for field in (above, below)]
    assert min(widths) > 0.0


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
@pytest.mark.parametrize("sliding", [True, False])
def test_only_a_tie_that_does_not_slide_drags_what_it_is_tied_to(
    sliding: bool, discretisation: Discretisation
) -> None:
    """The upper block is moved along x as a whole; what it does to the lower one is all that deforms."""
    moved = [Support("lower", "z0"), Support("upper", "z1", (0.1, 0.0, 0.0))]
    ties = [Tie(*FACES, sliding=sliding, discretisation=discretisation)]
    scene = tower((5, 3, 3), supports=moved, loads=[], ties=ties)
    strain = solve_scene(scene, MPI.COMM_SELF, partitions=cuts(scene), tolerance=1e-10).energies.strain
    assert strain < 1e-12 if sliding else strain > 1e-2


def test_a_tie_beside_contact_leaves_the_contact_law_alone() -> None:
    """A tied tower that stands on a floor with friction bears the whole push there."""
    floor = ContactPair(Surface("lower", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)), Coulomb(0.5))
    scene = tower((5, 4, 2), supports=[], ties=[Tie(*FACES)], contacts=[floor])
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cuts(scene), tolerance=1e-10)
    np.testing.assert_allclose(state.contact.force.sum(axis=0), -2.0 * np.array(PUSH), rtol=1e-6)
    assert state.torn.ties.count == 30
    assert state.torn.n_equality == state.torn.n_gluing + 90


def test_supported_components_of_tied_nodes_are_left_to_the_support() -> None:
    roller = [Support("lower", "z0"), Support("upper", "x0", (0.0, None, None))]
    scene = tower((5, 4, 2), ties=[Tie(*FACES)], supports=roller)
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cuts(scene), tolerance=1e-10)
    held = np.unique(scene.bodies["upper"].mesh.surfaces["x0"])
    assert np.abs(state.gather_displacement("upper")[held, 0]).max() < 1e-12
    assert state.torn.n_equality == state.torn.n_gluing + 90 - 5


def test_a_body_cannot_be_tied_to_itself() -> None:
    with pytest.raises(
        InvalidInputError, match="body 'ring' cannot be tied to itself: a tie joins two bodies"
    ):
        Tie(Surface("ring", "a"), Surface("ring", "b"))


def test_an_unknown_discretisation_is_refused() -> None:
    with pytest.raises(
        InvalidInputError, match=r"Tie.discretisation must be 'best' or 'node' or 'mortar', got 'x'"
    ):
        Tie(Surface("a", "s"), Surface("b", "s"), discretisation="x")  # type: ignore[arg-type]


def test_tied_surfaces_that_do_not_meet_are_refused() -> None:
    scene = tower()
    away = scene.moved({"upper": scene.bodies["upper"].mesh.points + np.array([5.0, 0.0, 0.0])})
    message = (
        "Tie 0 needs slave nodes that face the master, but none of the 20 movable nodes of 'z0' meets it"
    )
    with pytest.raises(InvalidInputError, match=message):
        solve_scene(replace(away, ties=[Tie(*FACES)]), MPI.COMM_SELF, partitions=cuts(away), tolerance=1e-10)


@pytest.mark.parametrize("edge", [1.5, 1.1])
def test_ties_by_nodes_beyond_the_masters_edge_are_told(
    edge: float, caplog: pytest.LogCaptureFixture
) -> None:
    """The last facet of the slave hangs over the edge: what the master transmits there is lost."""
    wide, narrow = block((0, 0, 1), (3, 1, 2), (6, 1, 1)), block((0, 0, 0), (edge, 1, 1), (4, 1, 2))
    bodies = {"wide": Body(wide, STEEL), "narrow": Body(narrow, STEEL)}
    over, under = Surface("wide", "z0"), Surface("narrow", "z1")

    def told(tie: Tie) -> list[str]:
        caplog.clear()
        find_tied_points(Scene(bodies, ties=[tie]), np.zeros((wide.n_nodes + narrow.n_nodes, 3), dtype=bool))
        return [record.getMessage() for record in caplog.records]

    words = told(Tie(over, under, discretisation="node"))
    if edge == 1.5:  # edges of facets lie upon each other
        assert words == []
    else:
        (warning,) = words
        assert warning.startswith("the tie of wide z0 on narrow z1 is by nodes, and the master ends within")
        assert "only some of their nodes are tied, 12 % of the master's surface lies under them" in warning
    assert told(Tie(under, over, discretisation="node")) == []
    assert told(Tie(over, under)) == []
