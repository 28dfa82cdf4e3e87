"""What can be held by contact and friction, and what cannot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact.errors import InfeasibleError
from fenics_contact.qp import DualProblem, FaceNewton, Smalse, solve
from fenics_contact.qp.coarse import CoarseSpace
from fenics_contact.qp.cones import CoulombLaw, TrescaLaw
from fenics_contact.qp.layout import ContactLayout
from fenics_contact.qp.solve import find_equilibrium
from tests.qp.random_problems import random_problem
from tests.qp.torn_bricks import Bricks, torn_problem


def no_product(x):
    raise AssertionError("the question is about G, e and the cone only")


def test_admissible_multiplier_is_found_without_a_product():
    problem = random_problem(5)
    dual = replace(problem.dual, operator=no_product)
    law = TrescaLaw(problem.layout, problem.slip_bound)
    found = find_equilibrium(dual.with_law(law))
    assert found.motion is None
    assert found.error <= 1e-4
    distance = dual.coarse.norm(dual.coarse.residual(found.multiplier))
    assert distance <= 1.01e-4 * dual.coarse.norm(dual.coarse.load)


@pytest.mark.parametrize(("friction_coefficient", "held"), [(0.195, False), (0.205, True)])
def test_sliding_limit_of_a_pulled_brick_is_found(friction_coefficient, held):
    dual, _ = torn_problem(Bricks(n=3, cubes=(2, 2), press=0.01, shear=0.002))
    mu_f = np.full(dual.layout.n_friction, friction_coefficient)
    found = find_equilibrium(dual.with_law(CoulombLaw(dual.layout, mu_f)))
    assert (found.motion is None) == held


def test_unheld_motion_is_the_sliding_of_the_upper_brick():
    dual, torn = torn_problem(Bricks(n=3, shear=0.003))
    mu_f = np.full(dual.layout.n_friction, 0.2)
    found = find_equilibrium(dual.with_law(CoulombLaw(dual.layout, mu_f)))
    motions = np.einsum("ij,sj->si", torn.kernel, found.motion.reshape(-1, 6))
    translation = motions.reshape(len(torn.places), -1, 3).mean(axis=1)
    upper = np.linalg.norm(translation[torn.body == 1], axis=1).min()
    assert np.abs(translation[torn.body == 0]).max() < 0.05 * upper
    assert np.abs(translation[torn.body == 1][:, 0]).min() > 0.9 * upper


@pytest.mark.parametrize("solver", [FaceNewton(), Smalse()])
def test_brick_pulled_away_from_its_support_is_refused(solver):
    dual, _ = torn_problem(Bricks(friction=False, shear=0.0, press=-0.01))
    with pytest.raises(
        InfeasibleError, match=r"no admissible multiplier comes closer than .* % of it"
    ) as caught:
        solve(dual, None, solver)
    rows = str(caught.value).split("rows [")[1].split("]")[0]
    assert {int(row) // 6 for row in rows.split(",")} <= {2, 3}


def test_brick_pulled_sideways_without_friction_is_refused():
    dual, _ = torn_problem(Bricks(friction=False, shear=0.002))
    with pytest.raises(InfeasibleError, match="no row of B resists: support or glue that body"):
        solve(dual, None, FaceNewton())


def test_brick_pulled_harder_than_its_friction_is_refused():
    dual, _ = torn_problem(Bricks(shear=0.002))
    with pytest.raises(InfeasibleError, match="turn the load into the contact or raise the friction"):
        solve(dual, np.full(dual.layout.n_friction, 1e-5), FaceNewton())


def test_loaded_motion_without_any_row_is_refused():
    layout = ContactLayout.build(2)
    G = sp.csr_matrix([[1.0, 1.0], [0.0, 0.0]])
    problem = DualProblem(
        MPI.COMM_SELF,
        lambda x: x,
        np.zeros(2),
        CoarseSpace(MPI.COMM_SELF, G, np.array([1.0, 2.0])),
        layout,
        np.ones(2),
    )
    with pytest.raises(
        InfeasibleError, match=r"the load works 2.000e\+00 on row 1 of e and no row of B resists"
    ):
        solve(problem, None, FaceNewton())


def test_problem_without_floating_bodies_is_always_held():
    problem = random_problem(5, m=0)
    law = TrescaLaw(problem.layout, problem.slip_bound)
    assert find_equilibrium(problem.dual.with_law(law)).motion is None
