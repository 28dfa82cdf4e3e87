"""Ranks that call something else than the others, or not at all: they are told, or ended."""

from __future__ import annotations

import re
import time

from tests.conftest import launch

#: A solved state on every rank.
SOLVED = """
import sys, time
from mpi4py import MPI
from fenics_contact.errors import ranks
from tests.ranks.given import scene, solve
from tests.ranks.run_cases import response
world = MPI.COMM_WORLD
"""


def test_ranks_that_do_not_meet_are_told_so() -> None:
    """One comes late, ranks call different things, and the program of one ends while another calls."""
    end = launch(
        2,
        "-c",
        SOLVED
        + """
ranks.PATIENCE = 0.2
state = solve(world, scene())
if world.rank == 1:
    time.sleep(1.5)
state.displacement

def told(name):
    try:
        getattr(state, name)() if name == "estimate_errors" else getattr(state, name)
    except ValueError as error:
        sys.stdout.write(f"{error}\\n")

told("estimate_errors" if world.rank == 0 else "von_mises")
if world.rank == 0:
    for name in ("estimate_errors", "contact_pressure"):
        told(name)
""",
    )
    assert end.returncode == 0, end.stderr
    waits = "waits since 0 s for the others in State.displacement, which is collective: if they are not just"
    assert f"rank 0 {waits}" in end.stderr
    assert f"rank 1 {waits}" not in end.stderr
    order = "all ranks must make the same collective calls in the same order, but rank 0 calls "
    calls = f"{order}LinearState.estimate_errors and rank 1 State.von_mises: take them out"
    assert end.stdout.count(calls) == 2
    for name in ("LinearState.estimate_errors", "State.contact_pressure"):
        gone = f"{order}{name} and rank 1 nothing any more, for its program has ended: take them out"
        assert end.stdout.count(gone) == 1, end.stdout


def test_where_the_program_of_one_rank_fails_the_others_end() -> None:
    end = launch(
        2,
        "-c",
        SOLVED
        + """
solve(world, scene())
if world.rank == 1:
    raise ZeroDivisionError
solve(world, scene())
""",
        timeout=60.0,
    )
    assert end.returncode != 0
    assert "rank 0 calls solve_scene and rank 1 nothing any more, for its program has ended" in end.stderr


def test_a_rank_that_fails_before_all_have_met_is_waited_for_with_a_word() -> None:
    end = launch(
        2,
        "-c",
        SOLVED
        + """
ranks.PATIENCE = 0.5
if world.rank == 1:
    import time
    time.sleep(2.0)
solve(world, scene())
""",
        timeout=60.0,
    )
    assert end.returncode == 0, end.stderr
    assert re.search(r"rank 0 waits since \d s for the others in the first call of this package", end.stderr)


def test_where_the_others_cannot_be_told_the_program_ends_and_says_why() -> None:
    """The others wait inside MPI for a rank that has failed: nobody can call them back."""
    begun = time.perf_counter()
    end = launch(
        2,
        "-c",
        SOLVED
        + """
ranks.SHORTEST_WAIT = ranks.LONGEST_WAIT = 0.5

def largest(state):
    if world.rank == 1:
        raise RuntimeError("a bug on one rank")
    return world.allreduce(1.0)

response(world, largest)
""",
        timeout=60.0,
    )
    assert end.returncode != 0
    assert "rank 1 failed in quantity 'force' of a response, and the other ranks wait for it" in end.stderr
    assert "RuntimeError: a bug on one rank" in end.stderr
    assert time.perf_counter() - begun < 30.0
