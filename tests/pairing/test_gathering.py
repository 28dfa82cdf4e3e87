"""Slave nodes beyond the rim of a master: pressures stay bounded, and what is exact stays exact."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    Scene,
    State,
    Support,
    Surface,
    Tie,
    Traction,
    solve_scene,
)
from fenics_contact._pairing.mortar.gathering import CondensedDualBasis, OwnDualBasis
from fenics_contact._pairing.mortar.points import MortarPoints
from fenics_contact._pairing.points import ContactPoints
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.qp import FaceNewton
from tests.pairing.mortar_surfaces import CURVED, KINDS, plate

MEAN = 0.0125
WIDTH = 0.5


def met_by(slave: FacetedSurface, master: FacetedSurface) -> MortarPoints:
    return MortarPoints.of(slave, master, np.ones(len(slave.nodes), dtype=bool), 0.5)


def gathers(points: ContactPoints, slave: Body) -> bool:
    """Whether points have several nodes of the slave, the scene's first body."""
    return bool(np.diff(points.jump[:, : len(slave.mesh.points)].indptr).max() > 1)


def punch(covered: float) -> State:
    """Half of a flat punch on a wider bed, the slave; the punch covers a fraction of the facet at its rim."""
    half = 2.0 + covered * WIDTH
    bodies = {
        "bed": Body(rectangle((0.0, -4.0), (8.0, 0.0), (16, 8)), PlaneStrain(1.0, 0.3)),
        "punch": Body(rectangle((0.0, 0.0), (half, 2.0), (7, 5)), PlaneStrain(1.0, 0.3)),
    }
    supports = [Support("bed", "y0"), *(Support(name, "x0", (0, None)) for name in bodies)]
    pair = ContactPair(Surface("bed", "y1"), Surface("punch", "y0"))
    return solve_scene(Scene(bodies, supports, [Traction("punch", "y1", (0, -MEAN))], [pair]), MPI.COMM_SELF)


@pytest.mark.parametrize("covered", [0.2, 0.04, 0.004])
def test_the_pressure_of_a_node_that_hardly_faces_a_punch_is_bounded(covered: float) -> None:
    state, without = punch(covered), punch(0.0)
    assert state.scene.contacts[0].by_mortar
    assert state.contact.normal_force.sum() == pytest.approx(MEAN * (2.0 + covered * WIDTH), rel=1e-9)
    # Nothing jumps as the facet begins to be covered; the wider punch alone has less pressure at its rim.
    assert without.contact.pressure.max() == pytest.approx(1.46 * MEAN, rel=0.01)
    assert state.contact.pressure.max() == pytest.approx(without.contact.pressure.max(), rel=0.6 * covered)
    assert state.contact.points.area.sum() == pytest.approx(2.0 + covered * WIDTH, rel=1e-12)


@pytest.mark.parametrize("kinds", KINDS, ids="-".join)
def test_constant_tractions_and_linear_fields_stay_exact(kinds: tuple[str, str]) -> None:
    slave = plate(kinds[0], 9, up=False, low=-0.3, high=1.2, height=0.2)
    low = slave.points[2, 0] - 0.03 if kinds[0] == "edges" else 0.0
    master = plate(kinds[1], 7, low=low, turn=0.25)
    met = met_by(slave, master)
    gathering, area = met.gathering, met.coupling.area
    assert isinstance(gathering, CondensedDualBasis)
    assert 0 < np.count_nonzero(gathering.gathers) < len(area)
    assert len(area) < len(gathering.whole.node)
    np.testing.assert_allclose(gathering.part.sum(axis=0), 1.0, atol=1e-14)
    np.testing.assert_allclose(area @ gathering.own, gathering.whole.area, rtol=1e-12)
    np.testing.assert_allclose(area @ met.coupling.weight, master.areas, atol=1e-12)
    np.testing.assert_allclose(met.weight.sum(axis=1), 1.0, atol=1e-12)
    below = slave.points - [*np.zeros(slave.dim - 1), 0.2]
    np.testing.assert_allclose(
        below[met.coupling.node], met.weight @ np.concatenate([below, master.points]), atol=1e-12
    )
    np.testing.assert_allclose(met.gap, 0.2, atol=1e-13)


@pytest.mark.parametrize("kinds", KINDS, ids="-".join)
def test_a_master_no_wider_than_two_facets_still_bears_a_body_that_tips(kinds: tuple[str, str]) -> None:
    slave = plate(kinds[0], 4, up=False, low=-0.5, high=0.5, height=0.1, uneven=0.0)
    master = plate(kinds[1], 2, low=-0.05, high=0.05)
    met = met_by(slave, master)
    assert isinstance(met.gathering, OwnDualBasis)
    assert met.coupling.node.size >= slave.dim


def test_a_tie_near_the_rim_transfers_forces_and_moments() -> None:
    bodies = {
        "bed": Body(block((-1.0, -1.0, -1.0), (2.0, 2.0, 0.0), (6, 6, 2)), IsotropicElasticity(1e3, 0.3)),
        "post": Body(block((0.0, 0.0, 0.0), (1.05, 1.05, 1.0), (3, 3, 3)), IsotropicElasticity(1e3, 0.3)),
    }
    scene = Scene(
        bodies, [Support("bed", "z0")], [Traction("post", "x1", (1.0, 0.3, 2.0))],
        ties=[Tie(Surface("bed", "z1"), Surface("post", "z0"))],
    )  # fmt: skip
    state = solve_scene(scene, MPI.COMM_SELF)
    assert gathers(state.dual.torn.ties, bodies["bed"])
    assert state.balance().imbalance < 1e-10


def test_planes_of_symmetry_through_the_rim_halve_the_scene() -> None:
    def solved(low: float) -> State:
        bodies = {
            "bed": Body(
                block((0.0, 2 * low, -1.0), (3.0, 2.0, 0.0), (6, 4 if low == 0.0 else 8, 2)),
                IsotropicElasticity(1.0, 0.3),
            ),
            "punch": Body(
                block((0.0, 1.55 * low, 0.0), (2.05, 1.55, 0.8), (3, 3 if low == 0.0 else 6, 2)),
                IsotropicElasticity(3.0, 0.2),
            ),
        }
        supports = [Support("bed", "z0"), *(Support(name, "x0", (0, None, None)) for name in bodies)]
        if low == 0.0:
            supports += [Support(name, "y0", (None, 0, None)) for name in bodies]
        pair = ContactPair(Surface("bed", "z1"), Surface("punch", "z0"), Coulomb(0.3))
        loads = [Traction("punch", "z1", (0.0, 0.0, -0.01))]
        scene = Scene(bodies, supports, loads, [pair])
        return solve_scene(scene, MPI.COMM_SELF, solver=FaceNewton(tolerance=1e-10))

    half, whole = solved(0.0), solved(-1.0)
    found = []
    for state in (half, whole):
        places = state.scene.points[state.contact.points.slave]
        kept = places[:, 1] > -1e-9
        order = np.lexsort(np.round(places[kept].T, 9))
        found.append(np.column_stack([places, state.contact.pressure])[kept][order])
    assert gathers(half.contact.points, half.scene.bodies["bed"])
    np.testing.assert_allclose(found[0], found[1], rtol=1e-6, atol=1e-7)


def spectrum(points: MortarPoints) -> np.ndarray:
    """Of the symmetric part of the slave's means, in terms of areas, where gathered nodes follow points."""
    coupling, gathering = points.coupling, points.gathering
    assert coupling.own is not None
    own = coupling.own.toarray()
    if isinstance(gathering, CondensedDualBasis):
        own = own[:, gathering.whole.node] @ gathering.part.toarray().T
    else:
        own = own[:, coupling.node]
    root = np.sqrt(coupling.area)
    matrix = root[:, None] * own / root
    return np.linalg.eigvalsh((matrix + matrix.T) / 2)


QUADRATIC = [each for each in CURVED if each[0] not in ("edges", "quads")]


@pytest.mark.parametrize("kinds", QUADRATIC, ids="-".join)
def test_pressures_of_quadratic_slaves_are_determined_wherever_the_rim_of_the_master_lies(
    kinds: tuple[str, str],
) -> None:
    """Covered in part, facets have means far from their nodes, which gathering keeps positive."""
    slave, values, plain = plate(kinds[0], 4, up=False, uneven=0.0), list[np.ndarray](), list[np.ndarray]()
    for end in 0.75 + 0.25 * np.array([0.003, 0.03, 0.1, 0.3, 0.45, 0.55, 0.7, 0.97]):
        points = met_by(slave, plate(kinds[1], 3, low=-0.2, high=float(end)))
        values.append(spectrum(points))
        whole = points.gathering.whole
        alone = OwnDualBasis(whole, len(whole.node))
        plain.append(spectrum(MortarPoints(slave, points.master, whole, alone, None)))
    assert np.concatenate(plain).min() < 0.6, "covered facets alone are close to their nodes"
    assert 0.3 < np.concatenate(values).min() < np.concatenate(values).max() < 2.2
