"""Every hard scene once: solved with all that must hold, or refused; not in other units, cuts and on ranks.

The whole table, with all twins of every case, is that of `test_scenes`.
"""

from __future__ import annotations

import re

import pytest
from mpi4py import MPI

from fenics_contact.errors import ConvergenceError
from tests.hard.scenes import TRIALS
from tools.hard_cases.invariants import assert_holds, violations
from tools.hard_cases.trial import Trial


@pytest.mark.claim
@pytest.mark.parametrize("sentence", TRIALS)
def test_a_hard_scene_is_solved_once_or_refused(sentence: str) -> None:
    case = TRIALS[sentence].build()
    if case.error is not None and not case.cause:
        with pytest.raises(case.error, match=case.match):
            case.solve(MPI.COMM_SELF)
        return
    try:
        solved_once(case)
    except ConvergenceError as caught:
        failure = caught
    else:
        return
    assert case.cause
    assert re.search(case.match, str(failure)), failure


def solved_once(case: Trial) -> None:
    """Solve a case as it is given and require all that must hold of the answer."""
    state = case.solve()
    assert_holds(violations(state, case.force_scale), case.solver.tolerance, case.amplification)
    if case.checks is not None:
        case.checks(state)
