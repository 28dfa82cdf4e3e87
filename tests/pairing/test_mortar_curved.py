"""Mortar coupling of concentric cylinders and circles with different meshes tends to the true distance."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact._pairing.mortar.coupling import MortarCoupling, mortar_coupling
from fenics_contact._surfaces.facets import FacetedSurface
from tests.pairing.mortar_surfaces import KINDS, moved, rotation, shell

kinds = pytest.mark.parametrize(("slave_kind", "master_kind"), KINDS)
GAP = 0.05


def pair(slave_kind: str, master_kind: str, n: int, convex: bool) -> tuple[FacetedSurface, FacetedSurface]:
    """A shaft in a hole as slave, or the hole as slave and the shaft as master."""
    slave = shell(slave_kind, n, 1.0 if convex else 1 + GAP, convex=convex, span=(0.3, 1.5))
    master = shell(
        master_kind, 4 * n // 3, 1 + GAP if convex else 1.0, convex=not convex, span=(0.0, 2.0), uneven=-0.2
    )
    return slave, master


@kinds
@pytest.mark.parametrize("convex", [True, False])
def test_gaps_between_concentric_shells_converge_with_second_order(
    slave_kind: str, master_kind: str, convex: bool
) -> None:
    errors = []
    for n in (6, 12, 24, 48):
        slave, master = pair(slave_kind, master_kind, n, convex)
        coupling = mortar_coupling(slave, master)
        assert len(coupling.node) == len(slave.nodes)
        assert coupling.area.sum() == pytest.approx(slave.areas.sum(), rel=1e-12)
        errors.append(np.abs(coupling.gap - GAP).max())
    rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert rates[-1] > 1.8, f"orders of the gap: {rates}"
    assert errors[0] > 1e-4, "the coarse shells are too good: nothing was tested"


@kinds
def test_coarse_shells_give_bounded_weights_and_rows_that_add_up(slave_kind: str, master_kind: str) -> None:
    coupling = mortar_coupling(*pair(slave_kind, master_kind, 3, True))
    assert len(coupling.node) > 0
    np.testing.assert_allclose(coupling.weight.sum(axis=1), 1.0, atol=1e-12)
    assert np.abs(coupling.weight.toarray()).max() < 5


@kinds
def test_rigid_motions_of_shells_change_nothing(slave_kind: str, master_kind: str) -> None:
    slave, master = pair(slave_kind, master_kind, 9, True)
    turn, shift = rotation(slave.dim), np.arange(slave.dim) - 0.4
    before: MortarCoupling = mortar_coupling(slave, master)
    after = mortar_coupling(moved(slave, turn, shift), moved(master, turn, shift))
    np.testing.assert_array_equal(after.node, before.node)
    np.testing.assert_allclose(after.area, before.area, rtol=1e-10)
    np.testing.assert_allclose(after.weight.toarray(), before.weight.toarray(), atol=1e-9)
    np.testing.assert_allclose(after.gap, before.gap, atol=1e-12)


@kinds
def test_the_other_side_of_a_hole_is_not_met(slave_kind: str, master_kind: str) -> None:
    hole = shell(master_kind, 60, 1.02, convex=False, span=(0.0, 6.2), uneven=0.0)
    shaft = shell(slave_kind, 20, 1.0, convex=True, span=(0.2, 2.2))
    coupling = mortar_coupling(shaft, hole)
    assert len(coupling.node) == len(shaft.nodes)
    met = np.unique(coupling.weight.indices)
    assert np.arctan2(hole.points[met, 1], hole.points[met, 0]).min() > 0
    np.testing.assert_allclose(coupling.gap, 0.02, atol=5e-3)
