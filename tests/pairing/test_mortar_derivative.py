"""The reverse mode through the mortar coupling agrees with difference quotients, term by term."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from fenics_contact._pairing.coupling_derivatives import CouplingDerivatives
from fenics_contact._pairing.mortar import derivatives as coupling_derivative
from fenics_contact._pairing.mortar.coupling import (
    MortarCoupling,
    _pseudo_inverse,
    inverted_pulled_back,
    mortar_coupling,
)
from fenics_contact._pairing.mortar.derivatives import (
    SurfaceDerivatives,
    mortar_pulled_back,
    weight_derivatives,
)
from fenics_contact._pairing.mortar.planes import Planes
from fenics_contact._surfaces.facets import FacetedSurface, faceted_surface, slopes
from fenics_contact._surfaces.true_surface import reconstructed
from tests.pairing.mortar_surfaces import CURVED, KINDS, lattice, plate, shell

STEP = 1e-7
TOLERANCE = {
    "plates": 1e-7, "shells": 1e-7, "sharp plates": 1e-6, "sharp shells": 1e-7, "matching": 1e-6,
    "nested": 1e-6,
}  # fmt: skip
TERMS = ("area", "weight", "normal", "gap")


def warped(surface: FacetedSurface, size: float, seed: int) -> FacetedSurface:
    """A surface whose nodes are moved a little, each in its own direction."""
    by = size * np.random.default_rng(seed).standard_normal(surface.points.shape)
    return placed(surface, surface.points + by)


def placed(surface: FacetedSurface, points: np.ndarray) -> FacetedSurface:
    """A surface with its nodes elsewhere, without what lay over it."""
    plain = faceted_surface(points, surface.facets, surface.mirrored)
    plain = replace(plain, cut=surface.cut, sharp=surface.sharp)
    return plain.with_areas_of_pieces()


def plates(kinds: tuple[str, str]) -> tuple[FacetedSurface, FacetedSurface]:
    """Plates that do not match; the slave hangs over the rim of the master."""
    slave = plate(kinds[0], 4, up=False, height=0.1, skew=1.0)
    master = plate(kinds[1], 5, low=0.13, high=1.4, turn=0.3, skew=1.0)
    return warped(slave, 0.01, 1), warped(master, 0.01, 2)


def shells(kinds: tuple[str, str]) -> tuple[FacetedSurface, FacetedSurface]:
    """A shaft in a hole, both with true surfaces over their facets; the shaft is longer."""
    slave = shell(kinds[0], 6, 1.0, convex=True, span=(0.3, 1.5))
    master = shell(kinds[1], 8, 1.05, convex=False, span=(0.6, 2.0), uneven=-0.2)
    return reconstructed(warped(slave, 0.004, 1)), reconstructed(warped(master, 0.004, 2))


def sharp_plates(kinds: tuple[str, str]) -> tuple[FacetedSurface, FacetedSurface]:
    """The plates, with the master's normals at a third of its nodes, and a part of them at another."""
    slave, master = plates(kinds)
    return sharpened(slave), master


def sharp_shells(kinds: tuple[str, str]) -> tuple[FacetedSurface, FacetedSurface]:
    """The shells, likewise."""
    slave, master = shells(kinds)
    return sharpened(slave), master


def sharpened(slave: FacetedSurface) -> FacetedSurface:
    third = np.arange(len(slave.nodes)) % 3
    return replace(slave, sharp=np.choose(third, [0.5 * slave.areas, 2.0 * slave.areas, np.inf]))


def matching(kinds: tuple[str, str]) -> tuple[FacetedSurface, FacetedSurface]:
    """Surfaces of the same mesh, of which the master has more: their edges lie over one another."""
    return regular(kinds[0], 3, up=False, height=0.1), regular(kinds[1], 3, around=1)


def nested(kinds: tuple[str, str]) -> tuple[FacetedSurface, FacetedSurface]:
    """Each master facet lies over four of the slave, and some of the master hangs over."""
    return regular(kinds[0], 8, up=False, height=0.1), regular(kinds[1], 4, around=1)


def regular(
    kind: str, cells: int, *, around: int = 0, up: bool = True, height: float = 0.0
) -> FacetedSurface:
    """The unit square or interval in equal cells, with some more around it."""
    x = np.arange(-around, cells + around + 1) / cells
    if kind == "edges":
        return lattice(np.column_stack([x, np.full(len(x), height)]), kind, not up)
    return lattice(np.stack(np.meshgrid(x, x, [height], indexing="ij"), axis=-1)[:, :, 0], kind, up)


PAIRS: dict[str, Callable[[tuple[str, str]], tuple[FacetedSurface, FacetedSurface]]] = {
    "plates": plates,
    "shells": shells,
    "sharp plates": sharp_plates,
    "sharp shells": sharp_shells,
    "matching": matching,
    "nested": nested,
}


@dataclass(frozen=True)
class Setting:
    """A coupling and random derivatives by it."""

    slave: FacetedSurface
    master: FacetedSurface
    coupling: MortarCoupling
    by: CouplingDerivatives

    def alone(self, term: str) -> CouplingDerivatives:
        """Derivatives by one of the results alone."""
        names = {"weight": "left"}
        zero = {name: np.zeros_like(getattr(self.by, name)) for name in ("area", "left", "normal", "gap")}
        del zero[names.get(term, term)]
        return replace(self.by, **zero)


@cache
def setting(name: str, kinds: tuple[str, str]) -> Setting:
    slave, master = PAIRS[name](kinds)
    coupling, rng = mortar_coupling(slave, master), np.random.default_rng(3)
    count = len(coupling.node)
    by = CouplingDerivatives(
        rng.standard_normal(count),
        rng.standard_normal((count, 3)),
        rng.standard_normal((len(master.nodes), 3)),
        rng.standard_normal(coupling.normal.shape),
        rng.standard_normal(count),
        rng.standard_normal((len(slave.nodes), 3)),
    )
    return Setting(slave, master, coupling, by)


def moved(surface: FacetedSurface, by: np.ndarray) -> FacetedSurface:
    """The surface with other nodes; what lies over the facets goes with them."""
    return replace(placed(surface, surface.points + by), relief=surface.relief)


def scalar(found: MortarCoupling, here: Setting, by: CouplingDerivatives) -> float:
    assert np.array_equal(found.node, here.coupling.node)
    means = found.weight @ by.right
    if here.slave.cut.is_cut:
        means = means - found.of_slave(by.own)
    weights = np.einsum("nr,nr->", by.left, means)
    return float(by.area @ found.area + weights + np.sum(by.normal * found.normal) + by.gap @ found.gap)


@dataclass(frozen=True)
class Moved:
    """Both surfaces a step along their ways, and their coupling there."""

    surfaces: tuple[FacetedSurface, FacetedSurface]
    coupling: MortarCoupling


@cache
def ends(name: str, kinds: tuple[str, str], which: str) -> tuple[Moved, Moved]:
    """Return what lies a step ahead on random ways and a step behind."""
    here, ways = setting(name, kinds), random_ways(setting(name, kinds), which)
    surfaces = [
        (moved(here.slave, step * ways[0]), moved(here.master, step * ways[1])) for step in (STEP, -STEP)
    ]
    ahead, behind = (Moved(pair, mortar_coupling(*pair)) for pair in surfaces)
    return ahead, behind


@cache
def pulled_back(
    name: str, kinds: tuple[str, str], term: str
) -> tuple[CouplingDerivatives, tuple[SurfaceDerivatives, SurfaceDerivatives]]:
    """Return derivatives by one of the results alone, and by the surfaces."""
    here = setting(name, kinds)
    by = here.alone(term)
    return by, mortar_pulled_back(here.slave, here.master, here.coupling, by)


def both_ways(name: str, kinds: tuple[str, str], term: str, which: str) -> tuple[float, float, float]:
    """The derivative along motions of both surfaces, the difference quotient, and the size of summands."""
    here, (by, pulled) = setting(name, kinds), pulled_back(name, kinds, term)
    ways, (ahead, behind) = random_ways(here, which), ends(name, kinds, which)
    found, size = 0.0, 0.0
    for side, (way, part) in enumerate(zip(ways, pulled, strict=True)):
        first, last = ahead.surfaces[side], behind.surfaces[side]
        found += np.sum(part.points * way)
        size += np.abs(part.points * way).sum() + np.abs(part.normals).sum()
        found += np.sum(part.normals * (first.normals - last.normals)) / (2 * STEP)
        if first.relief is not None:
            every = np.arange(len(first.facets))
            found += np.sum(part.slopes * (slopes(first, every) - slopes(last, every))) / (2 * STEP)
    quotient = (scalar(ahead.coupling, here, by) - scalar(behind.coupling, here, by)) / (2 * STEP)
    return float(found), quotient, float(size)


def random_ways(here: Setting, which: str) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(11)
    slave, master = (rng.standard_normal(each.points.shape) for each in (here.slave, here.master))
    return (slave, 0.0 * master) if which == "slave" else (0.0 * slave, master)


@pytest.mark.parametrize("which", ["slave", "master"])
@pytest.mark.parametrize("term", TERMS)
@pytest.mark.parametrize("kinds", KINDS, ids="-".join)
@pytest.mark.parametrize("name", PAIRS)
def test_each_term_agrees_with_central_differences(
    name: str, kinds: tuple[str, str], term: str, which: str
) -> None:
    found, quotient, size = both_ways(name, kinds, term, which)
    # Where edges lie over one another the second derivative jumps, and the quotient is of the first order.
    assert abs(found - quotient) < TOLERANCE[name] * size + 3e-8
    assert size > 1e-3 or (which == "master" and term in ("normal", "area"))


@pytest.mark.parametrize("which", ["slave", "master"])
@pytest.mark.parametrize("term", TERMS)
@pytest.mark.parametrize("kinds", CURVED, ids="-".join)
@pytest.mark.parametrize("name", ["plates", "shells", "sharp plates", "sharp shells"])
def test_each_term_agrees_with_central_differences_on_quadratic_facets(
    name: str, kinds: tuple[str, str], term: str, which: str
) -> None:
    test_each_term_agrees_with_central_differences(name, kinds, term, which)


@pytest.mark.parametrize(
    "kinds", [("quads", "triangles"), ("triangles", "quads"), ("triangles", "triangles")], ids="-".join
)
def test_what_passes_over_the_edges_of_a_matching_master_counts(
    kinds: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the functions of both sides are not the same, so that one side's do not continue the other's."""
    here = setting("matching", kinds)
    ways = random_ways(here, "master")
    _, quotient, size = both_ways("matching", kinds, "weight", "master")
    monkeypatch.setattr(coupling_derivative, "moved_aside", lambda master: master)
    _, exactly = mortar_pulled_back(here.slave, here.master, here.coupling, here.alone("weight"))
    assert abs(np.sum(exactly.points * ways[1]) - quotient) > 1e-3 * size


@pytest.mark.parametrize("kinds", KINDS, ids="-".join)
@pytest.mark.parametrize("name", PAIRS)
def test_moving_everything_together_changes_nothing(name: str, kinds: tuple[str, str]) -> None:
    here = setting(name, kinds)
    for term in TERMS:
        slave, master = mortar_pulled_back(here.slave, here.master, here.coupling, here.alone(term))
        total = slave.points.sum(axis=0) + master.points.sum(axis=0)
        size = np.abs(slave.points).sum() + np.abs(slave.normals).sum()
        assert size > 1e-3
        assert np.abs(total).max() < 1e-9 * size


def test_only_facets_beside_nodes_with_derivatives_are_integrated_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    here, seen = setting("plates", ("quads", "quads")), []
    whole = coupling_derivative.planes_of  # type: ignore[attr-defined]

    def planes_of(surface: FacetedSurface, chosen: np.ndarray) -> Planes:
        seen.append(len(chosen))
        return whole(surface, chosen)

    monkeypatch.setattr(coupling_derivative, "planes_of", planes_of)
    first = np.arange(len(here.coupling.node)) == 0
    by = replace(here.alone("gap"), gap=np.where(first, 1.0, 0.0))
    found = mortar_pulled_back(here.slave, here.master, here.coupling, by)
    assert seen[0] == np.count_nonzero((here.slave.facets == here.coupling.node[0]).any(axis=1))
    assert seen[0] < len(here.slave.facets)
    assert np.abs(found[0].points).max() > 1e-3


@pytest.mark.parametrize("kinds", [*KINDS, *CURVED], ids="-".join)
@pytest.mark.parametrize("past", [0.2, 1e-5], ids=["covered in part", "slivers"])
def test_derivatives_of_all_weights_are_those_of_reverse_mode(past: float, kinds: tuple[str, str]) -> None:
    """Where the rim of the master covers slivers of facets, modes across them are left out."""
    low = 1 - past - 1 / 3
    slave = plate(kinds[0], 3, height=0.01, up=False, low=low, high=low + 1, turn=1e-4, uneven=0.0)
    master, random = plate(kinds[1], 4), np.random.default_rng(3)
    coupling = mortar_coupling(slave, master)
    count, nodes = len(coupling.node), (len(master.nodes), len(slave.nodes))
    left, right = random.standard_normal((count, 2)), random.standard_normal((sum(nodes), 2))
    by = CouplingDerivatives(
        np.zeros(count), left, right[: nodes[0]], np.zeros((count, slave.dim)), np.zeros(count),
        right[nodes[0] :],
    )  # fmt: skip
    expected = np.concatenate([side.points for side in mortar_pulled_back(slave, master, coupling, by)])
    found = weight_derivatives(slave, master, coupling, np.ones(count, dtype=bool))
    by_weight = np.einsum("mr,mr->m", left[found.point], right[found.node])
    by_weight[found.node >= nodes[0]] *= -1.0  # the slave's mean is on the other side
    np.testing.assert_allclose(
        found.rows.T @ by_weight, expected.ravel(), rtol=0, atol=1e-8 * np.abs(expected).max()
    )


def test_the_pseudo_inverse_of_a_sliver_turns_with_it() -> None:
    """The direction that is left out turns as the covariance changes: quotients between it and the other."""
    rng, step = np.random.default_rng(0), 1e-7
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    covariance = (turn * [1.0, 0.5, 1e-12] @ turn.T)[None]
    by_inverse, way = rng.standard_normal((2, 1, 3, 3))
    way, by_inverse = way + way.transpose(0, 2, 1), by_inverse + by_inverse.transpose(0, 2, 1)
    thin = turn[:, 2]
    way -= (thin @ way[0] @ thin) * np.outer(thin, thin)  # it stays a sliver
    ends = [np.sum(by_inverse * _pseudo_inverse(covariance + s * way)) for s in (step, -step)]
    slope = np.sum(inverted_pulled_back(covariance, by_inverse) * way)
    assert slope == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-4)
