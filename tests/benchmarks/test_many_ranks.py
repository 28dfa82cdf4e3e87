"""The model of time on many ranks: its counts are those of runs, and seconds follow from counts."""

from __future__ import annotations

import json
from collections.abc import Callable

import pytest

from benchmarks.many_ranks import Lattice, Machine, counted_products, extrapolated, main
from fenics_contact.qp.coarse import DENSE_LIMIT
from fenics_contact.results import PhaseCosts

CHECKED = """
    import json
    from mpi4py import MPI
    from benchmarks.many_ranks import checked
    run = checked(MPI.COMM_WORLD, side=4, edge=2)
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(run))
"""


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_the_model_counts_what_a_run_counts(mpirun: Callable[..., str], ranks: int) -> None:
    run = json.loads(mpirun(CHECKED, ranks))
    counted, model = run["counted"], run["model"]
    assert counted["flops"] > 0
    assert (counted["reductions"] > 0) == (ranks > 1)
    for name, number in counted.items():
        # Ranks of equal costs are not exactly slabs.
        margin = 0.4 if name.startswith("message") and ranks > 2 else 0.15
        assert model[name] == pytest.approx(number, rel=margin), name


def test_seconds_are_latencies_bytes_and_operations() -> None:
    machine = Machine(latency=1.0, bandwidth=10.0, flops=100.0)
    alone = machine.seconds(PhaseCosts(flops=50), 1)
    assert alone == {"messages": 0.0, "global": 0.0, "operations": 0.5}
    assert machine.seconds(PhaseCosts(messages=3, message_bytes=20), 8)["messages"] == 5.0
    assert machine.seconds(PhaseCosts(reductions=2, reduction_bytes=5), 8)["global"] == 2 * 2 * 3 + 1.0
    assert machine.seconds(PhaseCosts(copies=2, copy_bytes=5), 9)["global"] == 2 * 4 + 0.5
    assert machine.seconds(PhaseCosts(transfers=2, transfer_bytes=5), 9)["global"] == 2 * 8 + 0.5
    assert machine.seconds(PhaseCosts(meetings=1), 16)["global"] == 4 + 8 * 16 / 10
    assert machine.overhead(Lattice(4, products=10), 2) == pytest.approx(10 * (1e-3 + 32e-5))


def test_lattices_have_the_sizes_of_their_subdomains() -> None:
    one, more = Lattice(4, 6), Lattice(8, 6)
    assert one.unknowns == 64 * 3 * 7**3
    assert (one.motions, one.contact_rows) == (384, 3 * 25**2)
    # Nearly eight times the operations; fewer of the subdomains have sides that are free.
    assert 8 < more.local / one.local < 10
    assert one.local < 64 * 4 * 654**2, "an inner one has 654 interface dofs"
    assert one.motions <= DENSE_LIMIT < more.motions
    alone, many = one.solve(1), one.solve(64)
    assert (alone.messages, alone.reductions, alone.copies) == (0, 0, 0)
    assert many.flops > alone.flops / 64
    assert many.largest_reduction == 8 * 25 * 10**3
    assert more.solve(64).largest_copy == 8 * 6 * 512
    # Once the motions without contact, and in each of 8 steps those with contact, alone.
    assert (Lattice(16).reduced, Lattice(40).reduced, one.reduced) == (True, True, False)
    assert (Lattice(16).holders(1000), Lattice(40).holders(1000)) == (1, 20)
    assert Lattice(16).coarse_factors(1000) == pytest.approx(3.8 + 8 * 0.24)
    assert Lattice(40).coarse_factors(1000) == pytest.approx(
        (15.0 * (384000 / 24576) ** 2 + 3.5 * 8 * (2.5e-7 * 9600**2 + 1.8e-11 * 9600**3)) / 20, rel=1e-12
    )


def test_the_table_says_what_outgrows_the_subdomains(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--latency", "1e-6"])
    printed = capsys.readouterr().out
    assert printed.startswith("Machine(latency=1e-06")
    assert extrapolated(Machine(latency=1e-6)) in printed
    rows = [[float(cell) for cell in line.split("|")[1:-1]] for line in printed.splitlines()[4:]]
    assert [row[0] for row in rows] == [1, 8, 64, 512, 4096, 10_000]
    assert rows[-1][1] > 6e8
    assert rows[0][4] + rows[0][5] < rows[0][3], "on one rank the subdomains take the time"
    assert rows[-1][4] > 5 * rows[-1][3]
    assert 5000 > rows[-1][5] > 1000 * rows[-1][3]
    assert rows[2][5] < 0.1 * 3.5 * 8 * 2.3 * (rows[2][2] / 24576) ** 2, "faces factor contact alone"
    assert rows[-1][3] == pytest.approx(rows[2][3], rel=0.15)


def test_products_are_tabled_by_subdomains(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("benchmarks.many_ranks.LATTICES", ((2, 2),))
    closed, opened = counted_products()
    assert closed.startswith("all nodes closed\n")
    assert opened.startswith("some open\n")
    head, _, row = (line.split("|")[1:-1] for line in closed.splitlines()[2:5])
    assert len(head) == len(row) == 7
    assert [int(row[0]), int(row[1])] == [8, 2]
    assert 15.0 < float(row[2]) < 25.0
    products = [[int(each.split("(")[0]) for each in column.split(",")] for column in row[3:]]
    assert [len(each) for each in products] == [2, 2, 2, 3]
    assert all(10 < each[0] < each[-1] < 300 for each in products)
