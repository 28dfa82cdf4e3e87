"""A bolt that yields under an overload loses preload, by the joint diagram of springs."""

from __future__ import annotations

from dataclasses import replace

import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ConstraintTerm,
    ContactProblem,
    LinearConstraint,
    LoadStep,
    Preload,
    Support,
    solve_steps,
)
from fenics_contact.materials import J2Plasticity
from tests.feti.bolts import LENGTH, MIDDLE, bar, joint, pulled

TIGHT, YIELDS, HARDENING, YOUNG = 50.0, 70.0, 250.0, 1000.0
#: Stiffness of the bolt, also where it yields, and of the sleeve.
BOLT, FLOWS, SLEEVE = (modulus / LENGTH for modulus in (YOUNG, 200.0, 1.5 * YOUNG))


def by_diagram(pull: float) -> tuple[float, float]:
    """Return the force of the bolt under a pull that makes it yield, and after it."""
    begins = (YIELDS - TIGHT) * (BOLT + SLEEVE) / BOLT
    force = YIELDS + (pull - begins) * FLOWS / (FLOWS + SLEEVE)
    force = max(force, pull)  # the sleeve is let go
    longer = (force - YIELDS) / HARDENING * LENGTH
    return force, max(TIGHT - longer * BOLT * SLEEVE / (BOLT + SLEEVE), 0.0)


def test_a_bolt_beyond_yield_keeps_the_preload_of_the_joint_diagram() -> None:
    """It yields with the sleeve clamped, beyond that, and by so much that nothing is left."""
    scene = joint(Preload("bolt", MIDDLE, force=TIGHT))
    free_to_narrow = [Support("bolt", "z0", (None, None, 0.0)), Support("bolt", "x0", (0.0, None, None))]
    metal = J2Plasticity(YOUNG, 0.0, YIELDS, isotropic_hardening=HARDENING)
    follows = [ConstraintTerm("bolt", "z1", "z"), ConstraintTerm("head", [0], "z", -1.0)]
    scene = replace(
        scene,
        bodies={**scene.bodies, "bolt": Body(bar(), metal)},
        supports=[*scene.supports[1:], *free_to_narrow],
        ties=[],
        constraints=[LinearConstraint(follows)],
    )
    pulls = (65.0, 80.0, 90.0, 100.0)
    steps = [LoadStep("tighten"), *(pulled(load) for pull in pulls for load in (pull, 0.0))]
    states = solve_steps(ContactProblem(scene, MPI.COMM_SELF), steps)[1:]
    found = [state.preloads()["bolt"].force for state in states]
    expected = [force for pull in pulls for force in by_diagram(pull)]
    assert found == pytest.approx(expected, abs=1e-5 * TIGHT)
    assert expected[::2] == pytest.approx([71.7647, 80.0, 90.0, 100.0], abs=1e-4)
    assert expected[1::2] == pytest.approx([45.7647, 26.0, 2.0, 0.0], abs=1e-4)
