"""References of scenes with corners and contrasts, and whether intervals contain them."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact.materials import PlaneStrain
from tools.random_scenes.corner_intervals import judge_corners, judge_nonlinear
from tools.random_scenes.corners import Corners, corners, graded
from tools.random_scenes.judge import GOOD, Outcome


def test_layers_get_wider_towards_the_middle_of_blocks() -> None:
    lines = np.array([0.0, 14.0, 42.0])
    assert graded(3, 2.0)(lines) == pytest.approx([0, 1, 3, 7, 11, 13, 14, 16, 20, 28, 36, 40, 42])
    cut = [0, 1, 3, 5, 7, 9, 11, 13, 14, 16, 20, 24, 28, 32, 36, 40, 42]
    assert graded(3, 2.0, widest=1.0 / 7.0)(lines) == pytest.approx(cut)


def test_a_reference_continues_what_falls_with_every_layer(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tenth of the value falls by a fifth with every layer; layers twice as wide miss a thousandth more."""

    def value(self: Corners, layers: int, widest: float) -> float:
        return 1.0 + 0.1 * 0.8**layers + 0.001 * (widest > 0.05)

    monkeypatch.setattr(Corners, "value", value)
    found, doubt = corners(1).reference()
    assert found == pytest.approx(1.0, abs=1e-12)
    assert doubt == pytest.approx(0.2 * 0.1 * 0.8**18 + 0.001 / 8.0)
    alone, touching = (each for each in map(corners, (1, 0)))
    assert not alone.parts.get("contacts")
    assert touching.parts["contacts"]
    assert touching.reference()[1] == pytest.approx(0.2 * 0.1 * 0.8**18 + 0.001)


def test_every_other_scene_is_singular() -> None:
    made = [corners(seed) for seed in range(20)]
    assert [each.singular for each in made] == [False, True] * 10
    for each in made:
        scene = each.start()
        one = all(isinstance(body.material, PlaneStrain) for body in scene.bodies.values())
        assert one or each.singular
    assert len({each.words for each in made}) > 10


@pytest.mark.claim
def test_intervals_contain_what_graded_meshes_have() -> None:
    found = [judge_corners(seed) for seed in range(12, 18)]
    assert [verdict for verdict in found if verdict.outcome not in GOOD] == []
    assert sum(verdict.outcome is Outcome.SOLVED for verdict in found) >= 3


@pytest.mark.claim
def test_intervals_of_rubber_and_metal_contain_what_graded_meshes_have() -> None:
    found = [judge_nonlinear(seed) for seed in (2, 8, 11, 12)]
    assert [verdict.outcome for verdict in found] == [Outcome.SOLVED] * 4
    assert max(verdict.share for verdict in found) < 1.0
