"""PETSc is started on the ranks that work; a fork of a process that computed says so instead of hanging."""

from __future__ import annotations

import sys
from collections.abc import Callable

import pytest

from fenics_contact._base.launching import finished

#: The child of every fork is ended by the kernel after so many seconds, as is what it waits for.
FORK = """
    import multiprocessing, signal, sys

    def in_fork(function, *arguments):
        def child(answers):
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.alarm(60)
            try:
                answers.put(("returned", function(*arguments)))
            except Exception as error:
                answers.put((type(error).__name__, str(error)))
        context = multiprocessing.get_context("fork")
        answers = context.SimpleQueue()
        process = context.Process(target=child, args=(answers,))
        process.start()
        process.join()
        return ("ended with", process.exitcode) if answers.empty() else answers.get()
"""


def test_ranks_of_which_some_work_do_not_wait_for_others(mpirun: Callable[..., str]) -> None:
    script = """
        import sys
        from mpi4py import MPI
        from tests.house.pressed_block import ENERGY, solve

        world = MPI.COMM_WORLD
        part = world.Split(int(world.rank == 2), world.rank)
        if world.rank < 2:
            found = solve(part).energies.strain
        world.Barrier()
        if world.rank == 2:
            found = solve(part).energies.strain
        world.Barrier()
        sys.stdout.write(f"{found / ENERGY} {solve(world).energies.strain / ENERGY}\\n")
    """
    ratios = [float(ratio) for ratio in mpirun(script, 3, timeout=60.0, fresh=True).split()]
    assert ratios == pytest.approx(6 * [1.0], rel=1e-5)


def test_a_rank_that_worked_alone_works_with_others(mpirun: Callable[..., str]) -> None:
    script = """
        import sys
        from mpi4py import MPI
        from tests.house.pressed_block import ENERGY, solve

        if MPI.COMM_WORLD.rank == 1:
            sys.stdout.write(f"{solve(MPI.COMM_SELF).energies.strain / ENERGY}\\n")
        sys.stdout.write(f"{solve(MPI.COMM_WORLD).energies.strain / ENERGY}\\n")
    """
    ratios = [float(ratio) for ratio in mpirun(script, 2, timeout=60.0, fresh=True).split()]
    assert ratios == pytest.approx(3 * [1.0], rel=1e-5)


def test_nothing_that_ranks_share_is_left_at_the_end(mpirun: Callable[..., str]) -> None:
    """PETSc could not free it after its own end, and MPICH's launcher would kill ranks that came later."""
    script = """
        import atexit, sys
        from mpi4py import MPI
        from fenics_contact._base import sparse
        from tests.house.pressed_block import solve

        atexit.register(lambda: sys.stdout.write(f"{len(sparse._owned)} {len(sparse._waiting)}\\n"))
        half = MPI.COMM_WORLD.Split(MPI.COMM_WORLD.rank // 2, -MPI.COMM_WORLD.rank)
        kept = [solve(half), solve(MPI.COMM_WORLD)]
        if MPI.COMM_WORLD.rank == 2:
            kept.pop()
        sys.stdout.write(f"{len(sparse._owned) > 0}\\n")
    """
    lines = mpirun(script, 3, timeout=60.0, fresh=True).splitlines()
    assert sorted(lines) == 3 * ["0 0"] + 3 * ["True"]


def test_signals_keep_the_handlers_that_they_have_when_petsc_starts(mpirun: Callable[..., str]) -> None:
    """As those of an interruptible run. PETSc takes SIGHUP from all, SIGTERM under MPICH."""
    script = """
        import os, signal, sys
        heard = []
        for number in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, lambda number, frame: heard.append(number))
        from mpi4py import MPI
        from tests.house.pressed_block import solve
        solve(MPI.COMM_SELF)
        os.kill(os.getpid(), signal.SIGHUP)
        os.kill(os.getpid(), signal.SIGTERM)
        sys.stdout.write(str(heard == [signal.SIGHUP, signal.SIGTERM]))
    """
    assert mpirun(script, 1, fresh=True) == "True"


@pytest.mark.parametrize("loaded", ["sys", "dolfinx"])
def test_processes_forked_before_anything_is_computed_compute(
    loaded: str, mpirun: Callable[..., str]
) -> None:
    if finished([sys.executable, "-c", f"import {loaded}"], 60.0).status != 0:
        pytest.skip("a script loads this dolfinx after MPI alone")
    script = f"""{FORK}
    import {loaded}
    from tests.house.pressed_block import ENERGY, solve

    def energy():
        from mpi4py import MPI
        return solve(MPI.COMM_SELF).energies.strain / ENERGY

    for _ in range(2):
        sys.stdout.write("%s %s\\n" % in_fork(energy))
    """
    lines = [line.split() for line in mpirun(script, 1, fresh=True).splitlines()]
    assert [words[0] for words in lines] == ["returned"] * 2, lines
    assert [float(words[1]) for words in lines] == pytest.approx(2 * [1.0], rel=1e-5)


def test_processes_forked_after_a_solve_refuse_to_compute(mpirun: Callable[..., str]) -> None:
    script = f"""{FORK}
    import numpy as np
    from mpi4py import MPI
    from fenics_contact._accuracy.discretisation import discretisation_error
    from fenics_contact import ContactProblem
    from fenics_contact import Tresca
    from tests.house.pressed_block import solve
    from tests.design.blocks import block_on_block, problem

    state = solve(MPI.COMM_SELF)
    design = problem(block_on_block(Tresca(0.8), load=(0.6, 0.12, -2.0)))
    alpha = np.zeros(design.size)
    design(alpha)
    for task in (
        lambda: solve(MPI.COMM_SELF),
        lambda: ContactProblem.following(state).solve(),
        lambda: design(alpha + 1e-3),
        lambda: state.von_mises,
        lambda: discretisation_error(state.torn, state.torn_displacement),
    ):
        sys.stdout.write("%s: %s\\n" % in_fork(task))
    """
    lines = mpirun(script, 1, fresh=True).splitlines()
    assert len(lines) == 5
    for line in lines:
        assert line.startswith("ForkedProcessError: computing needs a process that starts"), lines
        assert "multiprocessing.get_context('spawn')" in line
