"""One to 512 subdomains, ragged ones, redundant supports, nodes that several supports or pairs share."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    Scene,
    State,
    Status,
    Support,
    Surface,
    TotalForce,
    Traction,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.mesh.partition import merge_pieces
from tests.scenes import (
    FLOOR,
    SOFT,
    STIFF,
    block_on_plane,
    crowned,
    partitions,
    pressed_block,
    two_blocks,
)
from tools.hard_cases.trial import Trial, boxes, cut_trial, trial

GROUP = "partition"


def long_block(friction: float = 0.5) -> Scene:
    """A crowned block of 16 x 8 x 8 cells, pressed and pushed, that friction alone holds."""
    mesh = crowned(block((0.0, 0.0, 0.0), (4.0, 2.0, 1.0), (16, 8, 8)), 0.02)
    pair = ContactPair(Surface("block", "z0"), FLOOR, Coulomb(friction))
    load = Traction("block", "z1", (0.3, 0.1, -1.0))
    return Scene({"block": Body(mesh, SOFT)}, loads=[load], contacts=[pair])


def cut_in(counts: tuple[int, int, int]) -> Trial:
    """The long block in so many boxes; the answer must be that of 16 boxes."""
    scene = long_block()
    many = np.prod(counts) > 100
    return Trial(
        scene,
        cut=boxes(scene, counts),
        other=boxes(scene, (4, 2, 2)),
        units=not many,
        ranks=(2,) if not many else (),
    )


for _counts in ((1, 1, 1), (2, 1, 1), (8, 4, 2), (16, 8, 4)):
    _number = int(np.prod(_counts))
    trial(GROUP, f"a block of 1024 cells in {_number} subdomain{'' if _number == 1 else 's'}")(
        partial(cut_in, _counts)
    )


def random_cut(mesh: BodyMesh, parts: int, seed: int) -> np.ndarray:
    """Grow subdomains from random cells: jagged, of all sizes, some next to nothing."""
    random = np.random.default_rng(seed)
    centres = mesh.points[mesh.cells].mean(axis=1)
    seeds = centres[random.choice(mesh.n_cells, parts, replace=False)]
    weight = random.uniform(0.5, 2.0, parts)
    distance = np.linalg.norm(centres[:, None] - seeds, axis=2) * weight + 0.2 * random.random(
        (mesh.n_cells, parts)
    )
    return merge_pieces(mesh, np.unique(distance.argmin(axis=1), return_inverse=True)[1].ravel())


@trial(GROUP)
def two_blocks_in_ragged_subdomains_of_all_sizes() -> Trial:
    scene = two_blocks(Coulomb(0.38))
    cut = {name: random_cut(body.mesh, 7, 3) for name, body in scene.bodies.items()}
    sizes = np.bincount(cut["upper"])
    assert sizes.max() > 4 * sizes.min()
    return Trial(scene, cut=cut, other=partitions(scene), ranks=(2, 4))


@trial(GROUP)
def every_cell_a_subdomain_of_its_own() -> Trial:
    scene = block_on_plane(Coulomb(0.6))
    mesh = scene.bodies["block"].mesh
    return Trial(scene, cut={"block": np.arange(mesh.n_cells)}, other=partitions(scene))


@trial(GROUP)
def subdomains_of_which_only_one_touches_the_floor() -> Trial:
    """Flat layers: all contact rows are on one subdomain, the others have gluing rows alone."""
    scene = block_on_plane(Coulomb(0.6))
    return Trial(scene, cut=boxes(scene, (1, 1, 3)), other=boxes(scene, (3, 1, 1)))


@trial(GROUP)
def a_subdomain_that_touches_the_floor_at_one_node() -> Trial:
    scene = block_on_plane(Coulomb(0.6))
    mesh = scene.bodies["block"].mesh
    corner = np.flatnonzero((mesh.cells == int(np.unique(mesh.surfaces["z0"])[0])).any(axis=1))
    lone = np.zeros(mesh.n_cells, dtype=np.int64)
    above = (
        np.flatnonzero((mesh.grid == mesh.grid[corner[0]] + [0, 0, 1]).all(axis=1))
        if mesh.grid is not None
        else []
    )
    lone[corner] = 1
    lone[above] = 1
    return Trial(scene, cut={"block": lone}, other=partitions(scene))


@trial(GROUP)
def a_support_given_twice_and_by_two_surfaces_that_share_an_edge() -> Trial:
    """The same values once more change nothing; edges are held twice by the two surfaces."""
    scene = pressed_block(Coulomb(0.4))
    top = scene.supports[0]
    side = Support("block", "y1", (None, 0.0, None))
    return cut_trial(replace(scene, supports=[top, top, side, side]))


@trial(GROUP)
def two_supports_that_disagree_on_an_edge() -> Trial:
    scene = pressed_block(Coulomb(0.4))
    other = Support("block", "x1", (0.02, None, None))
    return cut_trial(
        replace(scene, supports=[*scene.supports, other]),
        error=InvalidInputError,
        match="supports must agree where they meet",
    )


@trial(GROUP)
def contact_nodes_whose_motion_a_support_prescribes_in_part() -> Trial:
    """A side of the block, and with it an edge of its contact surface, may not move along x."""
    scene = block_on_plane(Coulomb(0.3))
    return cut_trial(replace(scene, supports=[Support("block", "x0", (0.0, None, None))]))


@trial(GROUP)
def contact_nodes_that_a_support_holds_in_all_directions() -> Trial:
    scene = block_on_plane(Coulomb(0.3))
    return cut_trial(replace(scene, supports=[Support("block", "y0")]))


@trial(GROUP)
def master_nodes_that_a_support_holds() -> Trial:
    scene = two_blocks(Coulomb(0.38))
    return cut_trial(replace(scene, supports=[Support("lower", "z0"), Support("lower", "z1")]))


@trial(GROUP)
def a_node_that_is_slave_of_two_pairs_and_master_of_a_third() -> Trial:
    """A block between a floor and a second one, its side at a third one: shared edges have two roles."""
    base = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3))
    top = block((0.1, 0.1, 1.0), (1.9, 0.9, 1.8), (5, 3, 2))
    side = block((2.0, 0.0, 0.0), (2.8, 1.0, 1.0), (2, 4, 4))
    law = Coulomb(0.5)
    scene = Scene(
        {"base": Body(base, SOFT), "top": Body(top, STIFF), "side": Body(side, STIFF)},
        [Support("side", "x1")],
        [TotalForce("top", "z1", (0.2, 0.05, -2.0)), TotalForce("base", "x0", (0.8, 0.0, 0.0))],
        [
            ContactPair(Surface("base", "z0"), FLOOR, law),
            ContactPair(Surface("base", "x1"), Surface("side", "x0"), Coulomb(0.2), discretisation="node"),
            ContactPair(Surface("top", "z0"), Surface("base", "z1"), law, discretisation="node"),
        ],
    )

    def shared(state: State) -> None:
        points = state.torn.points
        counts = np.unique(points.slave, return_counts=True)[1]
        assert (counts == 2).any()
        masters = np.unique(points.jump[points.pair == 2].nonzero()[1])
        assert np.isin(points.slave[points.pair < 2], masters).any()

    # Edges that lie on floor and side have more multipliers than displacements.
    return cut_trial(scene, forces=False, checks=shared, ranks=(2, 4))


@trial(GROUP)
def two_pairs_with_the_same_slave_surface_and_floors_one_below_the_other() -> Trial:
    scene = block_on_plane(Coulomb(0.6))
    lower = ContactPair(Surface("block", "z0"), replace(FLOOR, point=(0.0, 0.0, -0.1)), Coulomb(0.3))

    def one_presses(state: State) -> None:
        contact = state.contact
        assert contact.normal_force[contact.on_pair(1)].max() == 0.0
        assert contact.count(Status.STICK) > 0

    return cut_trial(replace(scene, contacts=[*scene.contacts, lower]), checks=one_presses)


@trial(GROUP)
def the_same_pair_given_twice() -> Trial:
    """Every node has two equal rows: forces are shared between them in any way, their sum is unique.

    Under one name it is refused: its facets have a second one.
    """
    scene = block_on_plane(Coulomb(0.6))
    body, (pair,) = scene.bodies["block"], scene.contacts
    mesh = replace(body.mesh, surfaces={**body.mesh.surfaces, "again": body.mesh.surfaces["z0"]})
    again = replace(pair, slave=Surface("block", "again"))
    bodies = {"block": Body(mesh, body.material)}
    return cut_trial(replace(scene, bodies=bodies, contacts=[pair, again]), forces=False)
