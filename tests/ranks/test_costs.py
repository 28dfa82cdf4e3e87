"""What a rank sends and computes is counted, wherever it happens."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact import PhaseTimer, solve_scene
from fenics_contact._base.costs import costs_of, count_flops, size_of, with_ledger
from fenics_contact.feti.factor import Factor
from fenics_contact.feti.inverse import FactoredOperator
from fenics_contact.results import Costs, PhaseCosts
from tests.ranks.counted import bar

CALLS = """
    import json
    import numpy as np
    from mpi4py import MPI
    from fenics_contact._base.costs import costs_of, count_messages, count_of_exchange, with_ledger
    from fenics_contact._base.progress import PhaseTimer
    from fenics_contact.errors.ranks import own_of, together
    from dataclasses import asdict

    plain = MPI.COMM_WORLD
    comm, timer = with_ledger(plain), PhaseTimer()
    assert with_ledger(comm) is comm
    assert own_of(comm) is own_of(plain), "ranks would wait for each other at two places"
    numbers = np.arange(10.0)
    with timer.phase("solve"):
        for _ in range(3):
            assert comm.allreduce(numbers)[9] == 9.0 * comm.size
        comm.Allreduce(numbers, np.empty(10))
        comm.allreduce(1.0, op=MPI.MAX)
        with timer.phase("factor"):
            parts = comm.allgather((numbers, numbers[: 5 * comm.rank]))
            assert [len(part) for _, part in parts] == [5 * rank for rank in range(comm.size)]
    assert comm.bcast(numbers if comm.rank == 0 else None)[9] == 9.0
    comm.Bcast(np.zeros(1000))
    given = [np.full(1 + rank, comm.rank) for rank in range(comm.size)]
    assert [len(part) for part in comm.alltoall(given)] == comm.size * [1 + comm.rank]
    with together(comm):
        pass
    # Ranks share two numbers with the next one each.
    exchange = count_of_exchange(comm, np.full(2, (comm.rank + 1) % comm.size))
    count_messages(comm, exchange)
    count_messages(comm, exchange)
    plain.allreduce(1.0)
    phases = {name: asdict(part) for name, part in costs_of(comm).phases.items()}
    every = plain.gather(phases)
    if comm.rank == 0:
        print(json.dumps(every))
"""


def test_every_call_is_counted_with_its_bytes_in_its_phase(mpirun: Callable[..., str]) -> None:
    first, second = json.loads(mpirun(CALLS, 2))
    solve, factor, other = (PhaseCosts(**first[name]) for name in ("solve", "factor", "other"))
    assert (solve.reductions, solve.reduction_bytes, solve.largest_reduction) == (5, 4 * 80 + 8, 80)
    assert (solve.copies, factor.copies, other.copies) == (0, 1, 2)
    assert 2 * 80 + 40 < factor.copy_bytes < 2 * 80 + 40 + 700, "arrays, and some words of pickle's"
    assert (other.copy_bytes, other.largest_copy) == (8080, 8000)
    assert (other.transfers, other.transfer_bytes) == (1, 8)
    assert second["other"]["transfer_bytes"] == 16
    assert other.meetings == second["other"]["meetings"] == 1
    assert (other.messages, other.message_bytes) == (2 * 2, 2 * 2 * 16), "two are sent, two received"
    assert second["factor"] == first["factor"]


def test_one_rank_counts_operations_alone() -> None:
    comm = with_ledger(MPI.COMM_SELF)
    assert type(comm).allreduce is MPI.Intracomm.allreduce, "nothing is paid"
    with PhaseTimer().phase("solve"):
        comm.allreduce(1.0)
        count_flops(comm, 5)
        count_flops(MPI.COMM_SELF, 7)  # has no ledger
    assert costs_of(comm) == Costs(1, {"solve": PhaseCosts(flops=5)})
    assert costs_of(MPI.COMM_SELF) == Costs(1, {})


def test_bytes_are_those_of_entries_and_of_what_pickle_makes() -> None:
    assert [size_of(each) for each in (np.zeros((3, 2), np.float32), 1.0, True, np.int64(3))] == [24, 8, 8, 8]
    assert 8000 < size_of({"a": [np.zeros(1000)]}) < 8300
    assert 1000 < size_of("x" * 1000) < 1050


def test_phases_add_up_to_parts() -> None:
    phases = {
        "factor": PhaseCosts(copies=1, copy_bytes=10, largest_copy=10),
        "assemble": PhaseCosts(copies=2, copy_bytes=9, largest_copy=7),
        "adjoint": PhaseCosts(reductions=1, reduction_bytes=3_000_000, largest_reduction=3_000_000),
        "other": PhaseCosts(messages=1, message_bytes=16, meetings=1),
    }
    costs = Costs(2, phases)
    assert costs.set_up == PhaseCosts(copies=3, copy_bytes=19, largest_copy=10)
    assert (costs.solve, costs.recovery) == (phases["adjoint"], phases["other"])
    assert costs.total == costs.set_up + costs.solve + costs.recovery
    assert str(costs.recovery) == "1 message 16 B, 1 meeting"
    lines = repr(costs).splitlines()
    assert lines[0] == "Costs"
    assert lines[-1].split(maxsplit=1) == ["largest", "reduction 3 MB, copy 10 B"]


PULLED = """
    import json
    from mpi4py import MPI
    from fenics_contact import solve_scene
    from tests.ranks.counted import bar
    comm = MPI.COMM_WORLD
    state = solve_scene(bar(), comm, partitions=bar().partition(4))
    solve, kernel = state.costs.solve, state.system.problem.coarse.m
    copied = state.costs.total.largest_copy
    every = comm.gather((state.solution.products, kernel, solve.flops, solve.messages, copied))
    if comm.rank == 0:
        print(json.dumps(every))
"""


def test_operations_of_ranks_are_those_of_one_and_the_copied_coarse_problem(
    mpirun: Callable[..., str],
) -> None:
    (alone,), ranks = (json.loads(mpirun(PULLED, number)) for number in (1, 2))
    products, kernel, flops, _, copied = alone
    assert (kernel, copied) == (12, 0)
    assert {rank[0] for rank in ranks} == {products}
    assert {rank[3] for rank in ranks} == {4 * (products - 1)}, "two exchanges each, one product outside"
    more = sum(rank[2] for rank in ranks) - flops
    assert more > 0
    assert more % (2 * kernel**2) == 0, "each rank solves the coarse problem, and nothing else twice"


def test_operations_are_those_of_the_matrices_applied() -> None:
    state = solve_scene(bar(), MPI.COMM_SELF, partitions=bar().partition(4))
    system, B = state.system, state.system._B_interface
    rows = np.ones(len(state.torn.numbering.owned))
    counts = [state.costs.solve.flops]
    with PhaseTimer().phase("solve"):
        for call in (system.apply, system.preconditioner, system.problem.coarse.project):
            call(rows)
            counts.append(state.costs.solve.flops)
    dense = sum(2 * len(local) ** 2 for local in system.inverse._local)
    assert np.diff(counts).tolist() == [dense + 4 * B.nnz, dense + 4 * B.nnz, 2 * 12**2]
    assert B.nnz > 0


def test_sparse_factors_take_two_operations_for_each_entry_and_substitution() -> None:
    chain = sp.diags([-np.ones(9), np.full(10, 2.5), -np.ones(9)], [-1, 0, 1], format="csr")
    factor = Factor(chain)
    assert factor.entries == 19, "no fill"
    operator = FactoredOperator(chain, np.array([0, 9]), factor, Factor(chain[1:9][:, 1:9].tocsr()))
    assert operator.flops == (4 * 19, 4 * 15 + 2 * 2 + 4 * 2)


DRAGGED = """
    import json
    from mpi4py import MPI
    from fenics_contact import box_partition, solve_scene
    from tests.ranks.counted import pressed_block
    comm, scene = MPI.COMM_WORLD, pressed_block((6, 4, 4))
    parts = {"block": box_partition(scene.bodies["block"].mesh, (4, 2, 1))}
    state = solve_scene(scene, comm, partitions=parts, tolerance=1e-10)
    block, solve = state.system.preconditioner._contact, state.costs.solve
    contradicted = block.contradiction(state.solution.multiplier)
    owned = len(block._holder.owned)
    mine = (owned, block._gram.nnz, solve.largest_copy, solve.transfer_bytes, contradicted is None)
    force, every = sorted(map(tuple, state.contact.force.round(9).tolist())), comm.gather(mine)
    if comm.rank == 0:
        print(json.dumps([every, force]))
"""


def test_one_rank_holds_the_matrix_of_contact_rows(mpirun: Callable[..., str]) -> None:
    (alone, force), (ranks, same) = (json.loads(mpirun(DRAGGED, number)) for number in (1, 3))
    np.testing.assert_allclose(same, force, atol=2e-9)
    owned, entries, copied, sent, none = zip(*ranks, strict=True)
    assert min(owned) > 0
    assert sum(owned) == alone[0][0]
    assert sorted(entries) == [0, 0, alone[0][1]]
    assert max(copied) <= 8, "no table is copied to all ranks"
    assert np.count_nonzero(sent) == 1
    assert set(none) == {alone[0][4]}


SUMMED = """
    import numpy as np, scipy.sparse as sp
    from mpi4py import MPI
    from fenics_contact._base.costs import costs_of, with_ledger
    from fenics_contact.qp.coarse import DENSE_LIMIT, summed_if_small
    comm = with_ledger(MPI.COMM_WORLD)
    def share(rank, size=40):
        rows, columns = np.arange(size), (np.arange(size) + rank) % size
        return sp.csr_matrix((np.full(size, (-1.0) ** rank), (rows, columns)), shape=(size, size))
    mine = share(comm.rank) + share(7)
    found = summed_if_small(comm, mine)
    known = sum(share(rank).toarray() + share(7).toarray() for rank in range(comm.size))
    assert np.array_equal(found, known)
    assert costs_of(comm).total.reduction_bytes == 8 * 40 * (comm.size + 1) + 40**2 // 8
    large = sp.identity(DENSE_LIMIT + 1, format="csr")
    assert summed_if_small(comm, large) is large
    comm.Barrier()
    if comm.rank == 0:
        print("summed")
"""


@pytest.mark.parametrize("ranks", [2, 3])
def test_ranks_sum_the_entries_that_one_of_them_has(mpirun: Callable[..., str], ranks: int) -> None:
    assert mpirun(SUMMED, ranks).split() == ["summed"]
