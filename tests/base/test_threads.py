"""Scenes are solved with one thread of BLAS, unless the environment gives a number."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from threadpoolctl import ThreadpoolController

from fenics_contact import ContactProblem, ShapeProblem, SurfaceDesign
from fenics_contact._base import threads
from fenics_contact._base.threads import SETTINGS, libraries, one_thread
from fenics_contact._cli.info import _advice
from fenics_contact.design import StrainEnergy
from tests.design.bridges import bridge


def numbers() -> list[int]:
    """Return the number of threads of each library of BLAS in this process."""
    return [library["num_threads"] for library in libraries().info() if library["user_api"] == "blas"]


@pytest.fixture(autouse=True)
def two_threads(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """Let BLAS have two threads, but for old libraries that began with one, and no settings."""
    for name in SETTINGS:
        monkeypatch.delenv(name, raising=False)
    with libraries().limit(limits=2):
        many = numbers()
        assert 2 in many
        yield many
        assert numbers() == many, "what was there is there again"


def test_states_their_errors_and_derivatives_take_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    found: dict[str, list[int]] = {}

    def watch(module: str, name: str) -> None:
        whole: Any = getattr(__import__(module, fromlist=[name]), name)

        def watched(*given: Any, **more: Any) -> Any:
            found[name] = numbers()
            return whole(*given, **more)

        monkeypatch.setattr(f"{module}.{name}", watched)

    watch("fenics_contact._equilibrium.problem", "check_same_input")
    watch("fenics_contact.design.problem", "adjoint_of")
    watch("fenics_contact.design.problem", "by_nodes")
    watch("fenics_contact._accuracy.state_errors", "solver_errors")
    contact = ContactProblem(bridge("hexahedron"), MPI.COMM_SELF, tolerance=1e-4)
    problem = ShapeProblem(contact, SurfaceDesign("beam", "z1", net=(2, 1), transition=0.15), StrainEnergy())
    problem.evaluate(np.zeros(problem.size)).state.estimate_errors(geometry=False)
    assert list(found) == ["check_same_input", "adjoint_of", "by_nodes", "solver_errors"]
    assert all(set(each) == {1} for each in found.values())


@pytest.mark.parametrize("name", SETTINGS)
def test_a_number_in_the_environment_is_kept(
    name: str, two_threads: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(name, "2")
    with one_thread(MPI.COMM_SELF):
        assert numbers() == two_threads
    monkeypatch.setattr(threads, "libraries", lambda: ThreadpoolController().select(prefix="none"))
    assert threads.unlimited(4) == "", "whoever has chosen is not warned"


@pytest.mark.parametrize("ranks", [1, 2])
def test_ranks_are_warned_once_of_threads_that_cannot_be_limited(
    ranks: int, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    comm: Any = SimpleNamespace(rank=0, size=ranks)
    threads._warn.cache_clear()
    with monkeypatch.context() as patch, caplog.at_level(logging.WARNING):
        patch.setattr(threads, "libraries", lambda: ThreadpoolController().select(prefix="none"))
        for _ in range(2):
            with one_thread(comm):
                pass
        said = [record.getMessage() for record in caplog.records]
        assert list(_advice(comm, [])) == said
        patch.setenv("OMP_NUM_THREADS", "1")
        assert list(_advice(comm, [])) == []
    assert len(said) == ranks - 1
    assert all(each.startswith("2 ranks share the cores") for each in said)
    assert all("export OPENBLAS_NUM_THREADS=1" in each for each in said)
