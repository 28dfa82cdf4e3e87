"""An interrupted minimisation goes on from its checkpoint as if nothing had happened."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Checkpoint, CheckpointError, minimize
from fenics_contact._optimize.result import Reason, Record, StepKind
from fenics_contact.design import BundleTrust, LinearConstraints, NotConvergedError, Result
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import InvalidDesignError
from tests.optimize.cases import BY_NAME, Case
from tests.optimize.functions import Array, Fun, mifflin1

FINE = BundleTrust(tolerance=1e-6)


class Interrupted(Exception):
    """The process ends here."""


def lasting(fun: Fun, evaluations: int) -> Fun:
    """Return a function that can be evaluated so many times only."""
    left = [evaluations]

    def run(x: Array) -> tuple[float, Array]:
        if left[0] == 0:
            raise Interrupted
        left[0] -= 1
        return fun(x)

    return run


def minimised(case: Case, fun: Fun, checkpoint: Checkpoint | None, method: BundleTrust = FINE) -> Result:
    return minimize(
        fun, case.start, method, bounds=case.bounds, constraints=case.constraints, checkpoint=checkpoint
    )


def in_pieces(case: Case, fun: Fun, checkpoint: Checkpoint, piece: int) -> tuple[Result, int]:
    """Minimise in runs of so many evaluations each; return the result and how many were interrupted."""
    for interrupted in range(200):
        try:
            return minimised(case, lasting(fun, piece), checkpoint), interrupted
        except Interrupted:
            continue
    raise AssertionError("the run does not come on")


def stopped(case: Case, checkpoint: Checkpoint, evaluations: int) -> None:
    """Leave a checkpoint of a run that ended too early."""
    with pytest.raises(Interrupted):
        minimised(case, lasting(case.fun, evaluations), checkpoint)


@pytest.mark.parametrize(("name", "piece"), [("Maxquad", 7), ("Shor", 1), ("HS86", 3), ("Crescent", 2)])
def test_a_run_in_pieces_takes_the_same_bits_as_one_without_interruption(
    name: str, piece: int, tmp_path: Path
) -> None:
    case = BY_NAME[name]
    whole = minimised(case, case.fun, None)
    result, interrupted = in_pieces(case, case.fun, Checkpoint(tmp_path / "run.npz"), piece)
    assert interrupted > 3
    assert result.x.tobytes() == whole.x.tobytes()
    assert result.subgradient.tobytes() == whole.subgradient.tobytes()
    assert result.history == whole.history
    assert result.reason is whole.reason


def test_rejected_designs_and_a_small_bundle_are_kept_too(tmp_path: Path) -> None:
    def fun(x: Array) -> tuple[float, Array]:
        if x[0] > 1.3:
            raise InvalidDesignError("a cell is inverted")
        return mifflin1(x - [0.25, 0.0])

    small, start = replace(FINE, max_bundle=4, first_step=2.0), np.zeros(2)
    whole = minimize(fun, start, small)
    kinds = {record.kind for record in whole.history}
    assert kinds == {StepKind.START, StepKind.SERIOUS, StepKind.NULL, StepKind.REJECTED}
    checkpoint = Checkpoint(tmp_path / "run.npz")
    for _ in range(3):
        with pytest.raises(Interrupted):
            minimize(lasting(fun, 4), start, small, checkpoint=checkpoint)
    result = minimize(fun, start, small, checkpoint=checkpoint)
    assert result.x.tobytes() == whole.x.tobytes()
    assert [str(record) for record in result.history] == [str(record) for record in whole.history]


class Following:
    """A noisy function whose noise depends on the point before, as a warm start does."""

    def __init__(self, case: Case, name: str = "one") -> None:
        self.case, self.name, self.last = case, name, np.zeros(case.start.size)
        self.comm = MPI.COMM_SELF

    def __call__(self, x: Array) -> tuple[float, Array]:
        noise = 1e-6 * np.sin(1e5 * (x @ self.last))
        self.last = x.copy()
        value, gradient = self.case.fun(x)
        return float(value + noise), gradient

    def fingerprint(self) -> Mapping[str, str]:
        return {"function": self.name}

    def memory(self) -> Mapping[str, np.ndarray]:
        return {"last": self.last}

    def recall(self, memory: Mapping[str, np.ndarray]) -> None:
        self.last = memory["last"]


def test_what_a_function_remembers_is_given_back_to_it(tmp_path: Path) -> None:
    case, rough = BY_NAME["Rosen-Suzuki"], BundleTrust(tolerance=1e-4)
    whole = minimize(Following(case), case.start, rough)
    checkpoint = Checkpoint(tmp_path / "run.npz")
    short = replace(rough, max_evaluations=5)
    with pytest.raises(NotConvergedError, match="max_evaluations"):
        minimize(Following(case), case.start, short, checkpoint=checkpoint)
    result = minimize(Following(case), case.start, rough, checkpoint=checkpoint)
    assert result.history == whole.history
    with pytest.raises(InvalidInputError, match=r"differs .* in function \(one, two\): give"):
        minimize(Following(case, "two"), case.start, rough, checkpoint=checkpoint)


def test_limits_and_tolerance_may_be_changed_to_go_on(tmp_path: Path) -> None:
    case, checkpoint = BY_NAME["Maxquad"], Checkpoint(tmp_path / "run.npz")
    whole = minimised(case, case.fun, None)
    first = replace(FINE, tolerance=1e-2, raise_on_failure=False)
    rough = minimised(case, case.fun, checkpoint, first)
    assert rough.reason.success
    again = minimised(case, lasting(case.fun, 0), checkpoint, first)
    assert again.history == rough.history, "a finished run needs no evaluation to know its result"
    limited = replace(FINE, max_evaluations=rough.evaluations + 3, raise_on_failure=False)
    assert minimised(case, case.fun, checkpoint, limited).reason is Reason.EVALUATION_LIMIT
    assert minimised(case, case.fun, checkpoint).history == whole.history


CHANGES: dict[str, tuple[dict[str, Any], str]] = {
    "start": ({"x0": np.full(2, 0.5)}, r"in x0 \(float64 array"),
    "size": ({"x0": np.zeros(3), "bounds": (-1.0, 1.0), "constraints": None}, r"in variables \(2, 3\)"),
    "bounds": ({"bounds": (-1.0, 2.0)}, r"in constraints.upper .*; scale"),
    "constraints": ({"constraints": LinearConstraints([[1.0, 0.0]], [0.7])}, r"in constraints.limit"),
    "options": ({"method": BundleTrust(locality=0.0)}, r"in method\['locality'\] \(0.1, 0.0\)"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_another_problem_is_refused_and_what_differs_is_named(name: str, tmp_path: Path) -> None:
    def fun(x: Array) -> tuple[float, Array]:
        k = int(np.argmax(np.abs(x)))
        return abs(x[k]), np.sign(x[k]) * np.eye(x.size)[k]

    rows = LinearConstraints([[1.0, 0.0]], [0.9])
    problem = {"x0": np.array([0.5, 0.2]), "bounds": (-1.0, 1.0), "constraints": rows}
    checkpoint = Checkpoint(tmp_path / "run.npz")
    minimize(fun, checkpoint=checkpoint, **problem)  # type: ignore[arg-type]
    before = (tmp_path / "run.npz").read_bytes()
    changed, message = CHANGES[name]
    with pytest.raises(InvalidInputError, match=message):
        minimize(fun, checkpoint=checkpoint, **{**problem, **changed})
    assert (tmp_path / "run.npz").read_bytes() == before
    fresh = replace(checkpoint, resume=False)
    assert minimize(fun, checkpoint=fresh, **{**problem, **changed}).history[0].kind is StepKind.START


def test_a_run_that_writes_less_often_loses_less_than_an_interval_and_writes_its_end(tmp_path: Path) -> None:
    case, path = BY_NAME["Maxquad"], tmp_path / "run.npz"
    stopped(case, Checkpoint(path, every=5), 13)
    with np.load(path) as stored:
        assert stored["history.evaluations"].tolist() == list(range(1, 12))
    whole = minimised(case, case.fun, None)
    result = minimised(case, case.fun, Checkpoint(path, every=1000))
    assert result.history == whole.history
    with np.load(path) as stored:
        assert len(stored["history.evaluations"]) == whole.evaluations


def test_the_callback_sees_each_record_once(tmp_path: Path) -> None:
    case, seen = BY_NAME["CB2"], []

    def watch(record: Record, x: Array) -> None:
        seen.append(record)

    checkpoint = Checkpoint(tmp_path / "run.npz")
    with pytest.raises(Interrupted):
        minimize(lasting(case.fun, 4), case.start, FINE, callback=watch, checkpoint=checkpoint)
    result = minimize(case.fun, case.start, FINE, callback=watch, checkpoint=checkpoint)
    assert tuple(seen) == result.history


def test_a_record_whose_callback_was_cut_short_is_told_again(tmp_path: Path) -> None:
    case, seen = BY_NAME["CB2"], []

    def watch(record: Record, x: Array) -> None:
        seen.append(record)
        if len(seen) == 4:
            raise Interrupted

    checkpoint = Checkpoint(tmp_path / "run.npz")
    with pytest.raises(Interrupted):
        minimize(case.fun, case.start, FINE, callback=watch, checkpoint=checkpoint)
    result = minimize(case.fun, case.start, FINE, callback=watch, checkpoint=checkpoint)
    assert seen[3] == seen[4]
    assert tuple(seen[:3] + seen[4:]) == result.history


def test_an_unreadable_checkpoint_is_never_replaced_by_a_new_run(tmp_path: Path) -> None:
    case, path = BY_NAME["CB2"], tmp_path / "run.npz"
    stopped(case, Checkpoint(path), 4)
    path.write_bytes(path.read_bytes()[:-100])
    half = path.read_bytes()
    with pytest.raises(InvalidInputError, match=r"is not a complete checkpoint .*: restore or remove it"):
        minimised(case, case.fun, Checkpoint(path))
    assert path.read_bytes() == half


def test_a_checkpoint_that_cannot_be_written_ends_the_run_with_the_words_what_to_do(tmp_path: Path) -> None:
    case = BY_NAME["CB2"]
    (tmp_path / "runs").write_text("no folder")
    with pytest.raises(CheckpointError, match="free space, let one run write"):
        minimised(case, case.fun, Checkpoint(tmp_path / "runs" / "run.npz"))
