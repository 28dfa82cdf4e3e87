"""The reverse mode through points of mortar contact between true surfaces, with planes of symmetry."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact._pairing.coupling_derivatives import CouplingDerivatives
from fenics_contact._pairing.search import MortarPoints
from fenics_contact._surfaces.facets import FacetedSurface, faceted_surface
from fenics_contact._surfaces.true_surface import reconstructed
from fenics_contact.design.contact_derivatives import mortar_points_pulled_back
from tests.pairing.mortar_surfaces import SOLID, shell

STEP, SHARE = 1e-6, 0.3


def in_touch(kind: str, cells: int, radius: float, *, convex: bool) -> FacetedSurface:
    """A warped piece of a cylinder that ends on a plane of symmetry at z = 0."""
    plain = shell(kind, cells, radius, convex=convex, span=(0.3, 1.5) if convex else (0.5, 2.0))
    warp = 0.004 * np.random.default_rng(cells).standard_normal(plain.points.shape)
    mirrored = np.zeros(warp.shape, dtype=bool)
    mirrored[plain.points[:, 2] == 0.0, 2] = True
    return reconstructed(
        faceted_surface(plain.points + np.where(mirrored, 0.0, warp), plain.facets, mirrored)
    )


def moved(surface: FacetedSurface, by: np.ndarray) -> FacetedSurface:
    """The surface with other nodes, those on the plane of symmetry within it."""
    plain = faceted_surface(
        surface.points + np.where(surface.mirrored, 0.0, by), surface.facets, surface.mirrored
    )
    return replace(plain, relief=surface.relief)


def couple(slave: FacetedSurface, master: FacetedSurface) -> MortarPoints:
    return MortarPoints.of(slave, master, np.ones(len(slave.nodes), dtype=bool), SHARE)


@dataclass(frozen=True)
class Setting:
    """Two surfaces, the nodes with multipliers, and random derivatives by the points there."""

    slave: FacetedSurface
    master: FacetedSurface
    chosen: np.ndarray
    by: CouplingDerivatives

    def scalar(self, slave: FacetedSurface, master: FacetedSurface) -> float:
        met, by = couple(slave, master), self.by
        found = met.coupling
        assert np.array_equal(found.node, self.chosen)
        weights = np.einsum("nr,nr->", by.left, met.weight @ np.concatenate([by.own, by.right]))
        return float(by.area @ found.area + weights + np.sum(by.normal * found.normal) + by.gap @ met.gap)


@cache
def setting(kinds: tuple[str, str]) -> Setting:
    slave, master = in_touch(kinds[0], 6, 1.0, convex=True), in_touch(kinds[1], 8, 1.05, convex=False)
    chosen, rng = couple(slave, master).coupling.node, np.random.default_rng(3)
    by = CouplingDerivatives(
        rng.standard_normal(len(chosen)), rng.standard_normal((len(chosen), 2)),
        rng.standard_normal((len(master.nodes), 2)), rng.standard_normal((len(chosen), 3)),
        rng.standard_normal(len(chosen)), rng.standard_normal((len(slave.nodes), 2)),
    )  # fmt: skip
    return Setting(slave, master, chosen, by)


@pytest.mark.parametrize("kinds", SOLID, ids="-".join)
def test_gaps_are_closable_from_both_sides_and_at_the_rim_means(kinds: tuple[str, str]) -> None:
    here = setting(kinds)
    gaps = couple(here.slave, here.master).closable
    assert gaps is not None
    assert gaps.kept.any()
    assert {0.0, SHARE} == set(gaps.share)
    alone = (gaps.share == 0.0) & ~gaps.kept
    assert alone.any(), "what faces them has nodes that face nothing"
    own = dict(zip(gaps.here.point, gaps.here.gap, strict=True))
    assert gaps.value[alone] == pytest.approx([own[node] for node in np.flatnonzero(alone)], abs=1e-15)
    met = couple(here.slave, here.master)
    assert met.gathering is not None
    assert gaps.kept[met.gathering.gathers].all()
    assert here.slave.mirrored.any()
    assert here.master.mirrored.any()


@pytest.mark.parametrize("which", ["slave", "master"])
@pytest.mark.parametrize("kinds", SOLID, ids="-".join)
def test_the_derivative_by_nodes_agrees_with_central_differences(kinds: tuple[str, str], which: str) -> None:
    here, rng = setting(kinds), np.random.default_rng(11)
    ways = [rng.standard_normal(each.points.shape) for each in (here.slave, here.master)]
    ways[which == "slave"] *= 0.0
    by = mortar_points_pulled_back(couple(here.slave, here.master), here.by, MPI.COMM_SELF)
    terms = [
        np.where(surface.mirrored, 0.0, part * way)
        for surface, part, way in zip((here.slave, here.master), by, ways, strict=True)
    ]
    ahead, behind = (
        here.scalar(moved(here.slave, s * ways[0]), moved(here.master, s * ways[1])) for s in (STEP, -STEP)
    )
    found, size = sum(map(np.sum, terms)), sum(np.abs(term).sum() for term in terms)
    assert size > 1.0
    assert abs(found - (ahead - behind) / (2 * STEP)) < 1e-6 * size
