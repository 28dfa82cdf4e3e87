"""When one rank meets an error, all ranks stop with the same one, and the next scene can be tried."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.conftest import run_on_ranks

SCRIPT = Path(__file__).with_name("bad_input_on_ranks.py")
RANKS = 3
EXPECTED = {
    "too_few_subdomains": (
        "InvalidInputError",
        "3 ranks share 2 subdomains: partition with scene.partition(3), cut the bodies finer",
    ),
    "infinite_load_on_the_last_rank": (
        "InvalidInputError",
        "stiffness and load of subdomain 5 of body 'bar' must be finite, got NaN or infinity: check",
    ),
    "infinite_stiffness": (
        "InvalidInputError",
        "infinity in the stiffness of IsotropicElasticity: check",
    ),
    "nothing_holds_it": ("InfeasibleError", "body 'bar' can move away under the load: translation (1, "),
    "pulled_off_the_floor": ("InfeasibleError", "body 'bar' can move away under the load"),
    "overlap": ("InvalidInputError", "bodies must not overlap at the start: 9 nodes of 'bar'"),
    "a_partition_of_another_mesh": ("InvalidInputError", "partition of body 'bar' must have shape (24,)"),
    "a_subdomain_in_two_pieces": (
        "InvalidInputError",
        "every subdomain must be connected through cell faces",
    ),
    "clashing_supports": ("InvalidInputError", "supports must agree where they meet"),
}


@pytest.fixture(scope="module")
def raised() -> dict[str, list[list[str]]]:
    answer: dict[str, list[list[str]]] = json.loads(run_on_ranks(SCRIPT, RANKS, timeout=60).splitlines()[-1])
    assert set(answer) == set(EXPECTED)
    return answer


@pytest.mark.parametrize("case", EXPECTED)
def test_all_ranks_stop_with_the_same_error(raised: dict[str, list[list[str]]], case: str) -> None:
    kind, message = EXPECTED[case]
    assert [name for name, _ in raised[case]] == [kind] * RANKS
    assert all(message in text for _, text in raised[case]), raised[case]


def test_ranks_without_an_error_of_their_own_say_whose_it_was(raised: dict[str, list[list[str]]]) -> None:
    texts = [text for _, text in raised["infinite_load_on_the_last_rank"]]
    assert [text.endswith("(met on rank 2)") for text in texts] == [True, True, False]
