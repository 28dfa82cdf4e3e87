"""What plastic bodies do and remember is the same on one rank and on several."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.conftest import run_on_ranks

pytestmark = [pytest.mark.slow, pytest.mark.claim]


@cache
def found(ranks: int) -> dict[str, Any]:
    text = run_on_ranks(Path(__file__).with_name("plastic_on_ranks.py"), ranks, timeout=120)
    answer: dict[str, Any] = json.loads(text)
    return answer


@pytest.mark.parametrize("ranks", [2, 4])
def test_a_plastic_bar_does_not_depend_on_the_ranks(ranks: int) -> None:
    assert (np.array(found(1)["history"])[..., 6] > 0).sum() > 100
    for name, alone in found(1).items():
        size = np.abs(alone).max()
        np.testing.assert_allclose(found(ranks)[name], alone, atol=1e-6 * size, err_msg=name)
