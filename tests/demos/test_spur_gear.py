"""The transmission error of a spur gear over its mesh cycle, evened for a range of torques."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ranks", "size", "rms"), [(2, "small", (2.024, 0.719, 0.619)), (1, "full", (1.890, 0.649, 0.572))]
)
def test_a_relief_evens_the_transmission_error_of_three_torques(
    ranks: int, size: str, rms: tuple[float, ...], demo: Callable[..., Any]
) -> None:
    result, output, printed = demo("spur_gear", "--size", size, ranks=ranks, timeout=500.0)
    assert printed.count("pictures and files in") == 1, "one rank prints"
    pictures = {path.stem: path for path in output.glob("*.png")}
    assert set(pictures) == {"no_relief", "best_linear", "ours", "relief", "stress"}
    assert min(path.stat().st_size for path in pictures.values()) > 10_000
    more = result["more"]
    table = more["table"]
    for (name, row), value in zip(table.items(), rms, strict=True):
        assert row["rms"] == pytest.approx(value, rel=5e-3), name
    assert table["no relief"]["range"][2] == pytest.approx(6.0, rel=0.03)
    if size == "full":
        pressures = [row["pressure"][2] for row in table.values()]
        assert pressures[0] > 2 * pressures[1] > 3.5 * pressures[2]
        assert pressures[2] == pytest.approx(931, rel=0.02), "Hertz's between 927 and 935, of one pair"
    relief = np.array(more["relief"])
    assert (np.diff(relief) >= 0).all(), "it grows towards the tip"
    assert 0.01 < relief[-1] < 0.015
    assert max(more["evaluations"].values()) <= 25
    assert more["gradient"] < 1e-3


def test_an_unknown_size_is_refused(demo: Callable[..., Any]) -> None:
    with pytest.raises(pytest.fail.Exception, match="give --size small or --size full, got --size huge"):
        demo("spur_gear", "--size", "huge")
