"""One held body in one piece is factored, and what comes out is judged."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, RigidSurface, Scene, Support, Traction, solve_scene
from fenics_contact.errors import ConvergenceError
from fenics_contact.feti.direct import DirectSystem
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain


def cantilever(length: float, cells: int) -> Scene:
    mesh = block((0.0, 0.0, 0.0), (length, 1.0, 1.0), (cells, 2, 2))
    body = Body(mesh, IsotropicElasticity(100.0, 0.3))
    return Scene({"beam": body}, [Support("beam", "x0")], [Traction("beam", "x1", (0.0, 0.0, 1e-6))])


def test_a_slender_beam_is_solved_to_what_double_precision_allows() -> None:
    state = solve_scene(cantilever(100.0, 40), MPI.COMM_SELF)

    assert isinstance(state.system, DirectSystem)
    (part,) = state.torn.subdomains
    free = np.setdiff1d(np.arange(part.mesh.size), state.torn.B.indices)
    dense = np.linalg.solve(part.stiffness[free][:, free].toarray(), part.load[free])
    np.testing.assert_allclose(state.torn_displacement[free], dense, atol=1e-6 * np.abs(dense).max())
    assert state.estimate_errors().algebraic < 1e-7


def test_an_answer_that_is_rounding_is_refused() -> None:
    with pytest.raises(ConvergenceError, match=r"error below 0.0001 in energy norm.*too slender"):
        solve_scene(cantilever(1e5, 40), MPI.COMM_SELF)


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.3, 0.1), (1e3, 2.0)])
@pytest.mark.parametrize("angle", [0.1, 0.2, 0.3])
def test_a_body_that_is_only_moved_has_no_energy_but_rounding(
    angle: float, shift: tuple[float, float]
) -> None:
    """Which may be negative, and says nothing of how slender it is."""
    plate = rectangle((0.0, 0.0), (1.0, 1.0), (7, 7))
    turned = RigidSurface("plate", "y0", (0.0, 0.0), shift, angle)
    state = solve_scene(Scene({"plate": Body(plate, PlaneStrain(1.0, 0.3))}, [turned]), MPI.COMM_SELF)
    exact = np.array(shift) + angle * plate.points[:, ::-1] * (-1.0, 1.0)
    found = state.gather_displacement("plate")
    assert np.abs(found - exact).max() < 1e-13 * np.abs(exact).max()


def test_a_damaged_factor_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = DirectSystem.__init__

    def damaged(self: DirectSystem, *args: object, **kwargs: object) -> None:
        whole(self, *args, **kwargs)
        solve = self._factor.solve

        def wrong(right: np.ndarray, out: np.ndarray) -> None:
            solve(right, out)
            out *= 0.7

        self._factor.solve = wrong

    monkeypatch.setattr(DirectSystem, "__init__", damaged)
    with pytest.raises(ConvergenceError, match="needs an error below"):
        solve_scene(cantilever(3.0, 5), MPI.COMM_SELF)


def test_a_body_of_which_every_node_is_prescribed_has_reactions() -> None:
    plate = Body(rectangle((0.0, 0.0), (1.0, 1.0), (1, 1)), PlaneStrain(1000.0, 0.0))
    stretched = (lambda x: 0.01 * x[:, 0], 0.0)
    scene = Scene({"plate": plate}, [Support("plate", side, stretched) for side in ("y0", "y1")])
    state = solve_scene(scene, MPI.COMM_SELF)
    assert isinstance(state.system, DirectSystem)
    assert state.energies.strain == pytest.approx(0.5 * 1000.0 * 0.01**2)
    np.testing.assert_allclose(state.gather_stress("plate")[:, 0, 0], 10.0)
    assert state.estimate_errors().algebraic == 0.0
    assert state.balance().imbalance < 1e-12
