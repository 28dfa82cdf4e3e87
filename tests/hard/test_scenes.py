"""Every hard scene: solved with all that must hold, the same however given, or refused with the reason."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from mpi4py import MPI

from fenics_contact import State
from fenics_contact.errors import ConvergenceError
from tests.conftest import run_on_ranks
from tests.hard.conftest import Record
from tests.hard.scenes import TRIALS
from tools.hard_cases.invariants import assert_holds, violations
from tools.hard_cases.trial import OTHER_UNITS, Answer, Trial, fallbacks, scene_size, statuses

#: The largest number of ranks of any case, and the seconds that all of them may take there.
TIMEOUT = 3000.0
OnRanks = Callable[[str, int], dict[str, Any]]


@pytest.fixture(scope="module")
def on_ranks(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> OnRanks:
    """Return ``on_ranks(sentence, n)``; one mpirun for all sentences that are tested."""
    selected = [
        item.callspec.params.get("sentence") for item in request.session.items if hasattr(item, "callspec")
    ]
    found: dict[int, dict[str, Any]] = {}

    def answer(sentence: str, ranks: int) -> dict[str, Any]:
        if ranks not in found:
            wanted = [name for name in TRIALS if name in selected and ranks in TRIALS[name].build().ranks]
            names = tmp_path_factory.mktemp("ranks") / f"{ranks}.json"
            names.write_text(json.dumps(wanted))
            script = Path(__file__).with_name("on_ranks.py")
            found[ranks] = json.loads(run_on_ranks(script, ranks, names, timeout=TIMEOUT))
        return found[ranks][sentence]

    return answer


def other_answers(case: Trial, sentence: str, on_ranks: OnRanks) -> dict[str, Answer]:
    """Return the answers that should be the same one, each in the units of the trial."""
    answers = {}
    if case.units:
        length, force = OTHER_UNITS
        answers["units"] = Answer.of(case.in_units(length, force).solve()).in_units(1 / length, 1 / force)
    if case.other is not None:
        answers["partition"] = Answer.of(case.solve(cut=case.other))
    answers |= {name: twin() for name, twin in case.twins.items()}
    for ranks in case.ranks:
        found = on_ranks(sentence, ranks)
        assert "answer" in found, found
        answers[f"{ranks} ranks"] = Answer.read(found["answer"])
    return answers


@pytest.mark.parametrize("sentence", TRIALS)
def test_hard_scene(sentence: str, record: Record, on_ranks: OnRanks) -> None:
    entry = TRIALS[sentence]
    case = entry.build()
    if case.cause:
        figures = solved_or_told(case, sentence, on_ranks)
    elif case.error is not None:
        figures = refused(case, sentence, on_ranks)
    else:
        figures = solved(case, sentence, on_ranks)
    record(entry.group, sentence, tolerance=case.solver.tolerance, **figures)


def solved(case: Trial, sentence: str, on_ranks: OnRanks) -> dict[str, Any]:
    """Solve a trial, require all that must hold of it, and return its columns of the table."""
    state = case.solve()
    found = violations(state, case.force_scale)
    assert_holds(found, case.solver.tolerance, case.amplification)
    if case.checks is not None:
        case.checks(state)
    answer = Answer.of(state)
    others = other_answers(case, sentence, on_ranks)
    differences = {name: answer.difference(other, case) for name, other in others.items()}
    assert max(differences.values(), default=0.0) <= case.agreement, differences
    return {
        "natural": found.natural,
        "balance": max(found.balance, found.nodal),
        "cone": found.cone,
        "law": found.law,
        "same": max(differences.values(), default=None),
        "outcome": f"solved; {case.remark(state)}" if case.remark else "solved",
        **work(state),
    }


def solved_or_told(case: Trial, sentence: str, on_ranks: OnRanks) -> dict[str, Any]:
    """Do the same with a trial that is known to fail: where it does, it must say so."""
    try:
        return solved(case, sentence, on_ranks)
    except ConvergenceError as caught:
        failure = caught
    assert re.search(case.match, str(failure)), failure
    assert failure.history
    return told(failure, f"fails: {case.cause}")


def refused(case: Trial, sentence: str, on_ranks: OnRanks) -> dict[str, Any]:
    """Require the expected error on every number of ranks."""
    assert case.error is not None
    with pytest.raises(case.error, match=case.match) as caught:
        case.solve(MPI.COMM_SELF)
    for ranks in case.ranks:
        answer = on_ranks(sentence, ranks)
        assert answer.get("alike"), answer
        assert answer["error"].startswith(caught.type.__name__), answer
    return told(caught.value, f"refused: {caught.value}")


def told(error: Exception, outcome: str) -> dict[str, Any]:
    """Return the columns of the table of an error."""
    history = error.history if isinstance(error, ConvergenceError) else ()
    if not history:
        return {"outcome": outcome}
    return {
        "products": history[-1].products,
        "steps": len(history),
        "fallbacks": fallbacks(history),
        "outcome": outcome,
    }


def work(state: State) -> dict[str, Any]:
    """Return the columns of the table that tell what a state cost."""
    return {
        "scene": scene_size(state),
        "products": state.counts["f_products"],
        "steps": state.counts["solver_steps"],
        "status": statuses(state),
        "fallbacks": fallbacks(getattr(state.solution, "history", ())),
    }
