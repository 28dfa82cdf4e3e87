"""Every hard case of large deformations: solved with all that must hold, however cut, or refused."""

from __future__ import annotations

import pytest

from fenics_contact import DeformedState
from tests.hard.conftest import Record
from tests.hard.deformed import CASES
from tests.hard.deformed.case import TOLERANCE, Case, difference, displacement, violations
from tools.hard_cases.trial import scene_size, statuses

GROUP = "deformed"


@pytest.mark.parametrize("sentence", CASES)
def test_deformed_case(sentence: str, record: Record) -> None:
    case = CASES[sentence]()
    if case.error is not None:
        with pytest.raises(case.error, match=case.match) as caught:
            case.solve()
        record(GROUP, sentence, tolerance=TOLERANCE, outcome=f"refused: {caught.value}")
        return
    record(GROUP, sentence, tolerance=TOLERANCE, **solved(case))


def solved(case: Case) -> dict[str, object]:
    """Solve a case, require all that must hold of it, and return its columns of the table."""
    states = case.solve()
    if case.checks is not None:
        case.checks(states)
    last: DeformedState = states[-1]
    found = violations(states, case.remembers)
    assert found.nodal < 1e4 * TOLERANCE, found
    assert found.cone < 1e2 * TOLERANCE, found
    assert found.law < 1e2 * TOLERANCE, found
    u = displacement(last)
    others = {"cut otherwise": displacement(case.solve(pieces=case.other)[-1])}
    others |= {name: twin() for name, twin in case.twins.items()}
    apart = {name: difference(u, other) for name, other in others.items()}
    assert max(apart.values()) < case.agreement, apart
    return {
        "scene": scene_size(last),
        "products": sum(state.solution.products for state in states),
        "steps": sum(state.factorisations for state in states),
        "balance": found.nodal,
        "cone": found.cone,
        "law": found.law,
        "same": max(apart.values()),
        "status": statuses(last),
        "outcome": "solved",
    }
