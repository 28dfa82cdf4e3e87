"""The demos of large deformations go their whole way and find their numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

#: Largest forces of a hook on the way in and out, and the force of its snap; N/mm.
SNAP = (0.61451, 0.86331, -0.49173)
#: Forces of a closed seal on floor, lid, wall and itself, N/mm.
SEAL = [8.6536, 10.7938, 11.9279, 3.8672]

#: Force of a ball on metal, N, depth of its imprint, mm, its work and what flow takes of that, N mm.
BALL = (3495.76, 0.0903567, 150.0533, 132.3761)

#: Vertical and horizontal force on a die when it is pressed, half way, and at the bed's end, N/mm.
IRONING = ((320.1, 66.34), (408.08, 131.24), (339.6, 82.8))

#: Takes long; claims rest on one rank or on two.
pytestmark = pytest.mark.slow


def on_ranks(claimed: int) -> pytest.MarkDecorator:
    marks = {claimed: [pytest.mark.claim]}
    return pytest.mark.parametrize("ranks", [pytest.param(n, marks=marks.get(n, [])) for n in (1, 2)])


def run(
    demo: Callable[..., Any], name: str, ranks: int, pictures: set[str], steps: int = 20
) -> dict[str, Any]:
    """Run a demo of more than some load steps; return what its result holds, after a look at its files."""
    result, output, printed = demo(name, ranks=ranks, timeout=300.0)
    assert result["ranks"] == ranks
    assert printed.count("pictures and files in") == 1, "one rank prints"
    assert {path.stem for path in output.glob("*.png")} == pictures
    assert min(path.stat().st_size for path in output.glob("*.png")) > 10_000
    more: dict[str, Any] = result["more"]
    left = np.asarray(more["reduction"])
    assert len(left) > steps
    assert np.median(left) < 1e-3, "superlinear"
    assert np.quantile(left, 0.9) < 0.01, "nearly everywhere"
    return more


@on_ranks(2)
def test_a_hook_snaps_in_and_holds_better_than_it_goes_in(demo: Callable[..., Any], ranks: int) -> None:
    more = run(demo, "snap_fit", ranks, {"force", "stress", "stress_on_top"})
    assert (more["inward"], more["outward"], more["snap"]) == pytest.approx(SNAP, rel=1e-3)
    assert abs(more["push"][35]) < 1e-6, "it is home"
    assert more["inward"] == pytest.approx(more["formula"]["in"][1], rel=0.2)
    assert more["outward"] == pytest.approx(more["formula"]["out"][1], rel=0.2)


@on_ranks(1)
def test_a_seal_fills_its_groove_until_it_meets_itself(demo: Callable[..., Any], ranks: int) -> None:
    more = run(demo, "rubber_seal", ranks, {"force", "pressure", "free", "stress"})
    forces = {name: np.asarray(values) for name, values in more["forces"].items()}
    assert [float(values[-1]) for values in forces.values()] == pytest.approx(SEAL, rel=1e-3)
    assert np.all(np.diff(forces["lid"]) > 0)
    assert np.all(forces["floor"] <= forces["lid"] + 1e-6), "friction on the wall takes the rest"
    assert forces["bore"][-4] == 0 < forces["bore"][-1]


@on_ranks(1)
def test_a_ball_leaves_an_imprint_in_metal_and_stress_around_it(demo: Callable[..., Any], ranks: int) -> None:
    pictures = {"force", "profile", "stress", "stress_under_load"}
    more = run(demo, "ball_imprint", ranks, pictures, steps=12)
    found = (max(more["force"]), more["imprint"], more["work"], more["flow"])
    assert found == pytest.approx(BALL, rel=1e-3)
    assert (more["turned_force"], more["turned_tabor"]) == pytest.approx((3289.27, 2.86109), rel=1e-3)
    assert more["springback"] == pytest.approx(more["hertz"], rel=0.2)
    assert abs(more["force"][-1]) < 1e-6, "the ball is away"
    assert more["flow"] + more["stored"] == pytest.approx(more["work"], rel=0.07)
    assert more["residual"] > 300.0


@on_ranks(1)
def test_a_bed_is_ironed_from_end_to_end(demo: Callable[..., Any], ranks: int) -> None:
    more = run(demo, "shallow_ironing", ranks, {"forces", "stress", "stress_at_the_end"})
    found = [(more["vertical"][step], more["horizontal"][step]) for step in (3, 23, 43)]
    np.testing.assert_allclose(found, IRONING, rtol=1e-3)
    assert np.ptp(more["horizontal"][13:24]) < 5.0, "steady"


@on_ranks(1)
def test_a_lip_seal_drags_least_and_is_as_tight(demo: Callable[..., Any], ranks: int) -> None:
    result, output, printed = demo("lip_seal", ranks=ranks, timeout=300.0)
    assert result["ranks"] == ranks
    assert printed.count("pictures and files in") == 1, "one rank prints"
    assert {path.stem for path in output.glob("*.png")} == {"profile", "front", "pressure", "stress"}
    assert list(output.rglob("*.vtm"))
    more = result["more"]
    assert more["start"] == pytest.approx(0.854633, rel=1e-4)
    assert more["least"] == pytest.approx(0.316785, rel=1e-3)
    assert more["round"] == pytest.approx([0.562851, 0.409598], rel=2e-3)
    assert more["tight_at"] == [20.0, 15.0, 15.0]
    slope, quotient = more["gradient"]
    assert slope == pytest.approx(quotient, rel=1e-5)
    assert more["dragged"]["ours"] < 0.9 * more["dragged"]["round"]
