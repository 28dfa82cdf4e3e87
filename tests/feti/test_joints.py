"""Every kind of joint: its rows, its forces and its place among all rows of a system."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ConstraintTerm,
    LinearConstraint,
    Preload,
    Scene,
    Section,
    Spring,
    Support,
    Surface,
    Tie,
)
from fenics_contact.feti import TornSystem, build_torn_system, decompose
from fenics_contact.feti.joints import JOINTS
from fenics_contact.feti.row_groups import Joint
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh.cuts import parts_of

STEEL = IsotropicElasticity(1000.0, 0.3)


@pytest.fixture(scope="module")
def torn() -> TornSystem:
    """Blocks on each other, the second one glued, the third one free to slide, with all other joints."""
    heights = {"low": (0, 2), "middle": (2, 3), "high": (3, 4)}
    meshes = {
        name: block((0, 0, first), (1, 1, last), (2, 2, last - first))
        for name, (first, last) in heights.items()
    }
    along = ConstraintTerm("high", "x1", (1.0, 2.0, 0.0), equation=0)
    slope = [along, ConstraintTerm("low", "x1", "x", -1.0, 0)]
    scene = Scene(
        {name: Body(mesh, STEEL) for name, mesh in meshes.items()},
        [Support("low", "z0"), Support("high", "y0", (None, 0.1, None))],
        ties=[
            Tie(Surface("high", "z0"), Surface("middle", "z1"), sliding=True),
            Tie(Surface("middle", "z0"), Surface("low", "z1")),
        ],
        preloads=[Preload("low", Section((0.5, 0.5, 1.0), (0, 0, 1)), force=3.0)],
        springs=[Spring(Surface("low", "y1"), Surface("high", "y1"), (1.0, 0.0, 4.0), name="rod")],
        constraints=[LinearConstraint(slope, 0.2, "slope")],
    )
    parts = {}
    for name, mesh in meshes.items():
        centres = mesh.points[mesh.cells].mean(axis=1)
        parts[name] = (centres[:, 0 if name == "low" else 1] > 0.5).astype(int)
    return build_torn_system(scene, decompose(scene, parts, MPI.COMM_SELF), overlap=True)


@pytest.fixture(params=JOINTS, ids=lambda kind: kind.__name__)
def joint(request: pytest.FixtureRequest, torn: TornSystem) -> Joint:
    """The joint of a kind; the scene has one of each."""
    (found,) = (each for each in torn.groups.joints if type(each) is request.param)
    assert found.count
    return found


def field(torn: TornSystem, *, free: bool) -> np.ndarray:
    """Return a displacement of all nodes, zero where supports hold them if it is that of free components."""
    fixed = torn.decomposition.fixed
    values = np.random.default_rng(3).normal(size=fixed.shape)
    return np.where(fixed & free, 0.0, values)


def test_rows_are_numbered_kind_by_kind(torn: TornSystem) -> None:
    kinds = [type(each) for each in torn.groups.joints]
    assert kinds == list(JOINTS)
    rows = np.concatenate([torn.groups.rows_of(each) for each in torn.groups])
    np.testing.assert_array_equal(rows, np.arange(torn.numbering.total))
    assert torn.n_equality == torn.n_gluing + sum(each.count for each in torn.groups.joints)


def test_rows_of_b_measure_what_the_joint_says(torn: TornSystem, joint: Joint) -> None:
    moved, decomposition = field(torn, free=True), torn.decomposition
    copies = np.empty((decomposition.torn_size // 3, 3))
    copies[decomposition.held[1]] = moved[decomposition.tearing.copy_node]
    measured = torn.gathered(torn.jump(copies.ravel()), joint)
    acting = ~joint.held(decomposition.fixed)
    assert acting.any()
    np.testing.assert_allclose(measured[acting], joint.measured(moved)[acting], atol=1e-12)
    np.testing.assert_allclose(measured[~acting], 0.0, atol=1e-12)


def test_forces_do_the_work_of_multipliers(torn: TornSystem, joint: Joint) -> None:
    moved, multiplier = field(torn, free=False), np.random.default_rng(5).normal(size=joint.count)
    fixed = torn.decomposition.fixed
    acting = np.where(joint.held(fixed), 0.0, multiplier)
    on_nodes = joint.on_nodes(joint.forces(multiplier, fixed))
    assert np.abs(on_nodes).max() > 0.1
    assert (on_nodes * moved).sum() == pytest.approx(-float(acting @ joint.measured(moved)), rel=1e-10)


def test_what_supports_move_is_measured_or_changes_the_right_side(torn: TornSystem, joint: Joint) -> None:
    prescribed = np.where(torn.decomposition.fixed, field(torn, free=False), np.nan)
    np.testing.assert_allclose(joint.of_supports(prescribed), joint.measured(np.nan_to_num(prescribed)))
    np.testing.assert_array_equal(joint.driven(prescribed), -joint.of_supports(prescribed))


def test_unit_forces_of_a_joint_have_wrenches_that_its_rows_lie_in(torn: TornSystem, joint: Joint) -> None:
    tearing = torn.decomposition.tearing
    wrenches, rows = [], []
    for index, name in enumerate(tearing.body_names):
        body, part = torn.scene.bodies[name], parts_of(torn.scene.bodies[name].mesh)
        modes = np.concatenate(
            [body.rigid_modes() * (part == number)[:, None, None] for number in np.unique(part)], axis=2
        )
        nodes = slice(int(tearing.node_offset[index]), int(tearing.node_offset[index + 1]))
        wrenches.append(joint.wrenches(modes, nodes))
        moved = np.zeros((*torn.decomposition.fixed.shape, modes.shape[2]))
        moved[nodes] = modes
        rows.append(np.array([joint.measured(mode) for mode in np.moveaxis(moved, 2, 0)]))
    every, own = np.vstack(wrenches), np.vstack(rows)
    fitted, *_ = np.linalg.lstsq(every, own, rcond=None)
    assert np.abs(own).max() > 0.1
    np.testing.assert_allclose(every @ fitted, own, atol=1e-9)


def test_compliance_is_that_of_springs(torn: TornSystem) -> None:
    multiplier = np.random.default_rng(7).normal(size=torn.numbering.total)
    soft, compliance = torn.compliance.soft, np.array([1.0, 0.25])
    np.testing.assert_array_equal(torn.compliance.constant, compliance)
    added = torn.compliance.added(np.zeros(torn.numbering.total), multiplier)
    np.testing.assert_array_equal(np.flatnonzero(added), soft)
    work, kept = torn.compliance.energies(multiplier)
    assert work == pytest.approx(float(added @ multiplier))
    assert kept == pytest.approx(0.5 * work)
