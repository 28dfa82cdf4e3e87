"""Bodies that nothing holds are refused where the load would move them, and only there."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, Scene, State, Support, Traction, box_partition, solve_scene
from fenics_contact._scene.loads import Load
from fenics_contact.errors import InfeasibleError
from fenics_contact.gallery import block
from tests.feti.scenes import STEEL


def bars(*loads: Load, supports: tuple[Support, ...] = ()) -> State:
    """Two bars of two subdomains each, side by side; the left one is clamped unless supports are given."""
    meshes = {name: block((x, 0, 0), (x + 1, 1, 4), (2, 2, 4)) for name, x in (("left", 0), ("right", 3))}
    scene = Scene(
        {name: Body(mesh, STEEL) for name, mesh in meshes.items()},
        supports or (Support("left", "z0"),),
        loads,
    )
    cuts = {name: box_partition(mesh, (1, 1, 2)) for name, mesh in meshes.items()}
    return solve_scene(scene, MPI.COMM_SELF, partitions=cuts, tolerance=1e-10)


def test_a_loaded_body_without_support_is_refused_by_name() -> None:
    message = (
        r"every body must be held by supports, contact or friction, but body 'right' can move away under the "
        r"load: translation \(.*, 1\) .*meets no resistance. Support it, or let it touch something"
    )
    with pytest.raises(InfeasibleError, match=message):
        bars(Traction("left", "z1", (1.0, 0.0, 0.0)), Traction("right", "z1", (0.0, 0.0, 1.0)))


def test_a_support_that_leaves_the_loaded_direction_free_is_not_enough() -> None:
    supports = (Support("left", "z0"), Support("right", "z0", (None, None, 0.0)))
    with pytest.raises(
        InfeasibleError, match=r"body 'right' can move away under the load: translation \((-?0|1)"
    ):
        bars(Traction("right", "x1", (1.0, 0.0, 0.0)), supports=supports)


def test_a_body_without_support_and_load_stays_free_of_stress() -> None:
    state = bars(Traction("left", "z1", (1.0, 0.0, 0.5)))
    assert state.von_mises["left"].x.array.max() > 0.1
    assert np.abs(state.von_mises["right"].x.array).max() < 1e-8


def test_a_scene_without_a_single_multiplier_is_solved() -> None:
    mesh = block((0, 0, 0), (1, 1, 4), (2, 2, 4), "tetrahedron")
    loads = [Traction("bar", "z1", (0.0, 0.0, 1.3)), Traction("bar", "z0", (0.0, 0.0, -1.3))]
    scene = Scene({"bar": Body(mesh, STEEL)}, loads=loads)
    state = solve_scene(
        scene, MPI.COMM_SELF, partitions={"bar": np.zeros(mesh.n_cells, dtype=int)}, tolerance=1e-10
    )
    assert state.counts["equality_multipliers"] == 0
    np.testing.assert_allclose(state.von_mises["bar"].x.array, 1.3, rtol=1e-9)


def test_loads_in_balance_need_no_support() -> None:
    pull = 7.0
    state = bars(Traction("right", "z1", (0.0, 0.0, pull)), Traction("right", "z0", (0.0, 0.0, -pull)))
    np.testing.assert_allclose(state.von_mises["right"].x.array, pull, rtol=1e-7)
    assert state.energies.strain == pytest.approx(0.5 * pull**2 / STEEL.young_modulus * 4.0, rel=1e-8)
