"""A hundred random scenes: every one solved and verified on whole bodies, or refused for a reason that holds.

`python -m tests.random_scenes --count 1000` judges as many as wanted.
"""

from __future__ import annotations

import pytest

from tests.random_scenes.judge import GOOD, judge

#: Scenes of many seconds, which claims rest on.
LONG = {20_037, 20_076}
CLAIM = [pytest.mark.slow, pytest.mark.claim]


@pytest.mark.parametrize(
    "seed", [pytest.param(seed, marks=CLAIM if seed in LONG else []) for seed in range(20_000, 20_100)]
)
def test_a_random_scene_is_solved_and_verified_or_refused_for_a_reason(seed: int) -> None:
    verdict = judge(seed)
    assert verdict.outcome in GOOD, f"{verdict.detail}\n{verdict.words}"
