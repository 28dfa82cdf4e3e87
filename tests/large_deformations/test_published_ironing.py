"""Published contacts of large deformation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI
from scipy.sparse.linalg import splu

from benchmarks.large_deformations.ball_on_metal import pressed
from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    DeformedState,
    LoadSequence,
    LoadStep,
    RigidPlane,
    Scene,
    Status,
    Support,
    Surface,
    box_partition,
    solve_scene,
)
from fenics_contact._large_deformations.equations import Equations
from fenics_contact._large_deformations.loading import Loading
from fenics_contact.feti import TornSystem, build_torn_system, decompose
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import NeoHooke
from fenics_contact.qp.layout import ContactLayout
from tests.conftest import run_on_ranks
from tests.hard.deformed.slender import slot_closes
from tests.large_deformations.ironing import die
from tests.large_deformations.mortar_scenes import followed
from tests.large_deformations.scenes import RUBBER, cut, rounded
from tests.large_deformations.scenes import pressed as pressed_block

#: Lowest and highest published force [N/mm] at the end of the press and after 2.5 mm of the way: vertical,
#: horizontal.
PUBLISHED = {1.0: ((267.9, 332.0), (55.3, 71.0)), 1.25: ((334.9, 419.7), (100.2, 190.4))}
MODULUS = 689.6  # N/mm²


def ironed(way: str, time: float) -> Scene:
    """A stiff die 0.2 above a block, pressed by 1 mm until time 1 and then drawn, 10 mm in a unit of time."""
    bodies = {
        "block": Body(rectangle((0.0, 0.0), (12.0, 4.0), (48, 16)), NeoHooke(MODULUS, 0.32)),
        "die": Body(die(12), NeoHooke(10.0 * MODULUS, 0.32)),
    }
    moved = (10.0 * max(time - 1.0, 0.0), -min(time, 1.0))
    pair = ContactPair(Surface("die", "y0"), Surface("block", "y1"), Coulomb(0.3), way)  # type: ignore[arg-type]
    return Scene(bodies, [Support("block", "y0"), Support("die", "y1", moved)], contacts=[pair])


@pytest.mark.slow
@pytest.mark.parametrize("way", ["node", pytest.param("mortar", marks=pytest.mark.claim)])
def test_shallow_ironing_lies_within_the_published_spread(way: str) -> None:
    times = [0.25, 0.5, 0.75, 1.0, 1.05, 1.1, 1.15, 1.2, 1.25]
    states = followed([ironed(way, time) for time in times], MPI.COMM_SELF, 1e-8)
    for time, published in PUBLISHED.items():
        horizontal, vertical = states[times.index(time)].reactions()[1].force
        for found, (low, high) in zip((-vertical, horizontal), published, strict=True):
            assert low < found < high, (time, found)
    assert states[-1].contact.count(Status.SLIP) > 5
    assert max(state.balance().imbalance for state in states) < 1e-7
    assert np.ptp([-state.reactions()[1].force[1] for state in states[-2:]]) < 0.05 * PUBLISHED[1.25][0][0]


# A cube of metal under a rigid ball, with a published force on the same mesh.

#: Force on 512 hexahedra, and its last digit.
BALL, DIGIT = 37.3058, 1e-4


def test_a_ball_on_yielding_metal_has_the_published_force() -> None:
    mesh = block((0, 0, 0), (0.5, 0.5, 1), (4, 4, 8))
    state = solve_scene(pressed(mesh), MPI.COMM_SELF, partitions={"cube": box_partition(mesh, (2, 2, 2))})
    assert abs(-4.0 * state.contact.force[:, 2].sum() - BALL) < DIGIT


# Equal cylinders pressed far on one another, which symmetry compares with one cylinder on a plane.
APPROACHES = (0.1, 0.2, 0.3, 0.4)


def cylinder(cells: int, up: bool) -> BodyMesh:
    """Right half of a piece of a cylinder of radius one, above the origin or below it."""
    mesh = rectangle((0.0, 0.0 if up else -1.0), (0.9, 1.0 if up else 0.0), (cells, cells))
    x, y = mesh.points.T
    height = 1.0 - np.sqrt(1.0 - x**2)
    return replace(mesh, points=np.column_stack([x, (height if up else -height) + (1.0 - height) * y]))


def on_plane(approach: float, cells: int) -> Scene:
    supports = [Support("upper", "x0", (0.0, None)), Support("upper", "y1", (0.0, -approach))]
    pair = ContactPair(Surface("upper", "y0"), RigidPlane((0, 0), (0, 1)))
    return Scene({"upper": Body(cylinder(cells, True), RUBBER)}, supports, contacts=[pair])


def on_another(approach: float, cells: tuple[int, int], way: str) -> Scene:
    bodies = {name: Body(cylinder(n, name == "upper"), RUBBER) for name, n in zip(("upper", "lower"), cells)}
    supports = [Support(name, "x0", (0.0, None)) for name in bodies]
    supports += [Support("upper", "y1", (0.0, -2.0 * approach)), Support("lower", "y0")]
    pair = ContactPair(Surface("upper", "y0"), Surface("lower", "y1"), None, way)  # type: ignore[arg-type]
    return Scene(bodies, supports, contacts=[pair])


@cache
def forces_on_plane(cells: int) -> np.ndarray:
    return forces([on_plane(approach, cells) for approach in APPROACHES])


def forces(scenes: list[Scene]) -> np.ndarray:
    states = followed(scenes, MPI.COMM_SELF, 1e-8)
    return np.array([state.contact.force[:, 1].sum() for state in states])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("way", "limit"), [("node", 0.015), pytest.param("mortar", 0.0005, marks=pytest.mark.claim)]
)
def test_two_cylinders_press_as_one_on_a_plane(way: str, limit: float) -> None:
    """Approaches of up to 0.4 radii each; meshes that do not match."""
    plane = forces_on_plane(20)
    assert plane[-1] > 9.0 * plane[0]
    both = forces([on_another(approach, (20, 28), way) for approach in APPROACHES])
    assert np.abs(both / plane - 1.0).max() < limit


@pytest.mark.parametrize("way", [pytest.param("node", marks=pytest.mark.claim), "mortar"])
def test_two_cylinders_with_the_same_mesh_press_as_one_on_a_plane(way: str) -> None:
    plane = forces_on_plane(10)[1::2]
    both = forces([on_another(approach, (10, 10), way) for approach in APPROACHES[1::2]])
    assert np.abs(both / plane - 1.0).max() < 0.002


# Torn bodies under large deformation deform as whole ones do.
def histories(scenes: Sequence[Scene], pieces: int) -> tuple[list[DeformedState], Monolithic]:
    """Follow the scenes in both ways."""
    mesh = scenes[0].bodies["block"].mesh
    problem = ContactProblem(scenes[-1], MPI.COMM_SELF, partitions=cut(mesh, pieces), tolerance=1e-10)
    sequence, reference = LoadSequence(problem), Monolithic(scenes[0])
    states: list[DeformedState] = []
    for number, scene in enumerate(scenes):
        state = sequence.advance(LoadStep(str(number), supports=scene.supports))
        assert isinstance(state, DeformedState)
        states.append(state)
        reference.advance(scene)
    return states, reference


def error(state: DeformedState, reference: Monolithic) -> float:
    moved = reference.displacement
    return float(np.abs(state.gather_displacement("block") - moved).max() / np.abs(moved).max())


def test_a_compressed_cube() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (6, 6, 6))
    scenes = [
        Scene({"block": Body(mesh, RUBBER)}, [Support("block", "z0"), Support("block", "z1", (0, 0, -depth))])
        for depth in (0.1, 0.2, 0.3, 0.4)
    ]
    states, reference = histories(scenes, 2)
    assert error(states[-1], reference) < 1e-8
    assert [len(state.solution.history) for state in states] <= [5, 5, 5, 5]
    assert states[-1].equilibrium.linearisation.system.softened > 0, "subdomains buckle at 40 %"
    worst = [line.residuals.worst for line in states[-1].solution.history]
    assert worst[2] < 10 * worst[1] ** 2 / worst[0], "quadratic"


def test_a_pressed_and_dragged_block() -> None:
    mesh = rounded(6)
    scenes = [pressed_block(mesh, 0.1), *(pressed_block(mesh, 0.1, 0.08 * k) for k in range(1, 8))]
    states, reference = histories(scenes, 2)
    assert error(states[-1], reference) < 1e-8
    last = states[-1]
    n = last.contact.points.count
    contact = reference.multiplier[-3 * n :]
    assert np.abs(last.contact.normal_force - contact[:n]).max() < 1e-8 * contact.max()
    assert np.abs(last.contact.friction_force.ravel() - contact[n:]).max() < 1e-8 * contact.max()
    assert max(len(state.solution.history) for state in states) <= 7
    assert any(state.contact.count(1) and state.contact.count(2) for state in states), "stick and slip"


# One Newton system for all unknowns of a body in one piece: another way to the same discrete equilibrium.
class Monolithic:
    """Displacements and multipliers of all rows at once, by sparse LU; frictional rows in three dimensions.

    Attributes:
        displacement: By node, shape (n_nodes, dim).
        multiplier: Of supports and contacts, in the order of the rows of the torn system.
        steps: Newton steps of every load step.
    """

    def __init__(self, scene: Scene) -> None:
        pieces = {name: np.zeros(body.mesh.n_cells, dtype=int) for name, body in scene.bodies.items()}
        self._decomposition = decompose(scene, pieces, MPI.COMM_SELF)
        self._equations = Equations(scene, self._decomposition)
        self._last: TornSystem | None = None
        self._u = np.zeros(self._decomposition.torn_size)
        self.multiplier = np.zeros(0)
        self.steps: list[int] = []

    @property
    def displacement(self) -> np.ndarray:
        (mesh,) = self._decomposition.meshes
        by_node = np.empty((len(mesh.nodes), mesh.components))
        by_node[mesh.nodes] = self._u.reshape(-1, mesh.components)
        return by_node

    def advance(self, scene: Scene, tolerance: float = 1e-11) -> None:
        """Find the equilibrium of the next load."""
        torn = build_torn_system(scene, self._decomposition, previous=self._last)
        earlier = self._last or Loading(torn, np.zeros(0), 1.0).removed().torn
        self._last = torn
        torn = torn.with_slip_from(earlier.relative(self._u), earlier.sliding(self._u))
        if self.multiplier.size == 0:
            self.multiplier = np.zeros(len(torn.right))
        (mechanics,) = self._equations._mechanics
        layout, u, lam = torn.layout, self._u, self.multiplier
        mu = torn.groups.slips.coefficient
        B, n, m = torn.B, len(u), len(torn.right)
        for number in range(40):
            response = mechanics.at(u)
            lacking = torn.right - B @ u
            rho = 0.1 * response.stiffness.diagonal().max()
            force = torn.load - response.force - B.T @ lam
            rows, A, D = self._rows(layout, lacking, lam, rho, mu)
            size = max(np.abs(lam).max(), np.abs(response.force).max(), 1e-30)
            wrong = max(np.abs(force).max() / size, np.abs(rows).max() / max(np.abs(u).max(), 1e-3))
            if number and wrong < tolerance:
                self._u, self.multiplier = u, lam
                self.steps.append(number)
                return
            matrix = sp.bmat([[response.stiffness, B.T], [A @ B, D]]).tocsc()
            change = splu(matrix).solve(np.concatenate([force, rows]))
            u, lam = u + change[:n], lam + change[n:]
        assert m, "the reference must converge"
        raise AssertionError(f"the reference does not converge, its residual is {wrong}")

    @staticmethod
    def _rows(
        layout: ContactLayout, lacking: np.ndarray, lam: np.ndarray, rho: float, mu: np.ndarray
    ) -> tuple[np.ndarray, sp.csr_matrix, sp.csr_matrix]:
        """Return −(residual) of all rows, in lengths, and its derivatives A by B u and D by λ."""
        m = len(lam)
        A, D, right = sp.lil_matrix((m, m)), sp.lil_matrix((m, m)), lacking.copy()
        for row in layout.equality:
            A[row, row] = 1.0
        closed = lam[layout.normal] - rho * lacking[layout.normal] > 0.0
        for row, on in zip(layout.normal, closed, strict=True):
            A[row, row], D[row, row] = (1.0, 0.0) if on else (0.0, 1.0 / rho)
            right[row] = lacking[row] if on else -lam[row] / rho
        for disc, rows in enumerate(layout.tangential):
            normal = layout.normal[layout.friction_of[disc]]
            bound = mu[disc] * max(lam[normal], 0.0)
            w = lam[rows] - rho * lacking[rows]
            length = np.linalg.norm(w)
            if closed[layout.friction_of[disc]] and length < bound:
                A[rows, rows] = 1.0
                continue
            e = w / length if length > 0 else np.zeros(len(rows))
            turn = (
                bound / length * (np.eye(len(rows)) - np.outer(e, e)) if length > 0 else 0 * np.eye(len(rows))
            )
            # λ_T − μ λ_N e = 0, divided by ρ
            A[np.ix_(rows, rows)] = -turn
            D[np.ix_(rows, rows)] = (np.eye(len(rows)) - turn) / rho
            D[rows, normal] = -mu[disc] * e / rho if lam[normal] > 0.0 else 0.0
            right[rows] = -(lam[rows] - bound * e) / rho
        return right, A.tocsr(), D.tocsr()


# A body that folds: its surface is slave and master at once.
@pytest.mark.parametrize("ranks", [1, *(pytest.param(n, marks=pytest.mark.claim) for n in (2, 4))])
def test_a_slot_closes_alike_as_one_surface_and_as_two(ranks: int, tmp_path: Path) -> None:
    run_on_ranks(Path(__file__).with_name("folding_on_ranks.py"), ranks, tmp_path / "state.npz")
    found, sides = np.load(tmp_path / "state.npz"), slot_closes("left", "right").solve()[-1]
    pressed = sides.contact.normal_force > 0.0
    assert np.count_nonzero(pressed) > 3
    assert found["displacement"] == pytest.approx(sides.gather_displacement("block"), abs=1e-7)
    assert found["force"].sum(axis=0) == pytest.approx(sides.contact.force.sum(axis=0), abs=1e-7)
