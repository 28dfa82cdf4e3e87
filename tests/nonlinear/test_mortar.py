"""Rubber that meets rubber by mortar where both lie now."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Status
from fenics_contact.errors.kinds import FoldedFacetsError
from tests.conftest import run_on_ranks
from tests.nonlinear.ironing import WAY, ironing
from tests.nonlinear.mortar_scenes import by_mortar, followed, pressed_and_pushed, stacked
from tests.nonlinear.scenes import tilted


@pytest.mark.parametrize(
    ("cells", "held", "friction"),
    [
        ("quadrilateral", True, 0.0),
        ("triangle", False, 0.0),
        ("hexahedron", False, 0.3),
        ("tetrahedron", True, 0.0),
    ],
)
def test_patch_of_half_the_height(cells: str, held: bool, friction: float) -> None:
    """At 50 % the state is homogeneous, however the meshes meet."""
    scene = stacked(cells, 1.0, held=held, friction=friction)
    (state,) = followed([scene], MPI.COMM_SELF)
    stress = np.concatenate([state.gather_stress(body) for body in scene.bodies])
    assert np.abs(stress[0]).max() > 0.5
    assert np.abs(stress - stress[0]).max() < 1e-8 * np.abs(stress).max()
    contact, across = state.contact, scene.dim - 1
    grown = (1.0 + state.gather_displacement("high").max()) ** across
    assert held or grown > 1.2
    np.testing.assert_allclose(contact.pressure, -stress[0, across, across], rtol=1e-7)
    np.testing.assert_allclose(contact.nominal_pressure, contact.pressure * grown, rtol=1e-7)
    assert contact.area.sum() == pytest.approx(grown, rel=1e-7)


def test_ironing_converges_quadratically() -> None:
    states = followed([by_mortar(ironing(0.3, way)) for way in WAY[:3]], MPI.COMM_SELF)
    assert states[1].contact.count(Status.STICK) > 3
    assert states[-1].contact.count(Status.SLIP) > 3
    for state in states:
        worst = [line.residuals.worst for line in state.solution.history]
        assert worst[-1] < max(10 * worst[-2] ** 1.8, 1e-10), "quadratic down to rounding"
        assert any(new < 10 * old**1.8 < 1e-5 for old, new in pairwise(worst))


def test_a_newton_step_that_folds_facets_cuts_the_load_step(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = 0

    def folded_once(*_: object) -> None:
        nonlocal calls
        calls += 1
        if calls == 3:
            raise FoldedFacetsError("1 are folded")

    monkeypatch.setattr("fenics_contact._pairing.mortar.coupling.check_convex", folded_once)
    (state,) = followed([stacked("hexahedron", 0.3, held=True, friction=0.0)], MPI.COMM_SELF)
    assert calls > 3
    assert state.fractions == (0.5, 1.0)


def test_two_blocks_turned_in_space_give_the_turned_answer() -> None:
    rotation = tilted(1.1)
    upright, turned = (
        followed(pressed_and_pushed(each), MPI.COMM_SELF, 1e-11)[-1] for each in (np.eye(3), rotation)
    )
    assert turned.contact.count(Status.SLIP) > 3
    forces = upright.contact.force @ rotation.T
    assert np.abs(turned.contact.force - forces).max() < 1e-9 * np.abs(forces).max()
    for name in ("low", "high"):
        moved = upright.gather_displacement(name) @ rotation.T
        assert np.abs(turned.gather_displacement(name) - moved).max() < 1e-9 * np.abs(moved).max()


@pytest.mark.parametrize("ranks", [2, pytest.param(4, marks=pytest.mark.claim)])
def test_ranks_find_the_same(ranks: int, tmp_path: Path) -> None:
    script = Path(__file__).with_name("mortar_on_ranks.py")
    run_on_ranks(script, ranks, tmp_path / "state.npz")
    (serial,) = followed(pressed_and_pushed(np.eye(3))[1:], MPI.COMM_SELF)
    with np.load(tmp_path / "state.npz") as found:
        for name, values in found.items():
            inside = name in ("low", "high")
            expected = serial.gather_displacement(name) if inside else getattr(serial.contact, name)
            assert np.abs(values - expected).max() < 1e-7 * np.abs(expected).max(), name
