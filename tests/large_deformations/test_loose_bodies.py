"""Bodies that come loose where others yield: nothing holds them, and they stay until they are met again."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    DeformedState,
    LoadStep,
    Preload,
    RigidPlane,
    Scene,
    Section,
    State,
    Support,
    Surface,
    TotalForce,
    solve_scene,
    solve_steps,
)
from fenics_contact._equilibrium.static_admissibility import unresisted_motions
from fenics_contact._large_deformations import newton
from fenics_contact._large_deformations.equations import Linearisation
from fenics_contact.errors import ConvergenceError
from fenics_contact.gallery import block, bolt, drilled_plate
from fenics_contact.materials import IsotropicElasticity, J2Plasticity
from fenics_contact.mesh import merge_duplicate_nodes

STEEL = J2Plasticity(2.1e5, 0.3, 640.0, isotropic_hardening=2e3)
RUBS = Coulomb(0.15)


def jaws(way: float) -> Scene:
    """A block between jaws, one of which moves, and another one that is pressed and sheared all the time."""

    def box(low: tuple[float, float, float], cells: int) -> Body:
        x, y, z = low
        return Body(block(low, (x + 1, y + 1, z + 1), (cells, cells, cells)), STEEL)

    bodies = {"left": box((0, 0, 0), 2), "held": box((1, 0, 0), 3), "right": box((2, 0, 0), 2)}
    bodies |= {"under": box((0, 2, 0), 2), "over": box((0, 2, 1), 3)}
    supports = [Support("left", "x0"), Support("right", "x1", (way, 0.0, 0.0)), Support("under", "z0")]
    contacts = [
        ContactPair(Surface("held", "x0"), Surface("left", "x1"), RUBS),
        ContactPair(Surface("held", "x1"), Surface("right", "x0"), RUBS),
        ContactPair(Surface("over", "z0"), Surface("under", "z1"), RUBS),
    ]
    return Scene(bodies, supports, [TotalForce("over", "z1", (10.0, 0.0, -100.0))], contacts)


def test_a_block_comes_loose_and_is_gripped_again_in_whole_steps() -> None:
    """What is left of contact, solved as a whole, must be as accurate as the residuals of the others."""
    steps = [LoadStep(f"{way}", supports=jaws(way).supports) for way in (-1e-3, 1e-3, -1e-3)]
    states = solve_steps(ContactProblem(jaws(-1e-3), MPI.COMM_SELF), steps)
    gripped = [float(state.contact.normal_force[state.contact.on_pair(0)].sum()) for state in states]
    assert gripped[0] > 50.0
    assert gripped == pytest.approx([gripped[0], 0.0, gripped[0]], rel=1e-6, abs=1e-6)
    for state in states:
        assert isinstance(state, DeformedState)
        assert state.fractions == (1.0,)
        assert len(state.solution.history) < 7


def test_friction_holds_both_parts_of_a_bar_that_is_drawn_at_a_section() -> None:
    """Each of its ends rubs on a wall, and the section lets one part move along the other."""
    bar = Body(block((0, 0, 0), (1, 1, 4), (1, 1, 4)), STEEL)
    walls = [RigidPlane((0, 0, 0), (0, 0, 1)), RigidPlane((0, 0, 4), (0, 0, -1))]
    contacts = [ContactPair(Surface("bar", f"z{end}"), wall, RUBS) for end, wall in enumerate(walls)]
    pushed = Preload("bar", Section((0.5, 0.5, 2), (0, 0, 1)), force=-50.0)
    scene = Scene({"bar": bar}, [Support("bar", "x0", (0.0, None, None))], [], contacts, preloads=[pushed])
    state = solve_scene(scene, MPI.COMM_SELF)
    assert unresisted_motions(state.torn, ()) == ()
    assert state.contact.normal_force.sum() == pytest.approx(100.0)


def plate(low: float, high: float, layers: int) -> BodyMesh:
    """Return two squares with a hole each, side by side."""
    one = drilled_plate(5.5, 20.0, (-20.0, 20.0), np.linspace(low, high, layers + 1), 2)
    points = np.concatenate([one.points, one.points + np.array([40.0, 0.0, 0.0])])
    cells = np.concatenate([one.cells, one.cells + one.n_nodes])
    points, cells, number = merge_duplicate_nodes(points, cells)
    sides = {name: one.surfaces[name] for name in ("top", "bottom", "y0")}
    both = {name: number[np.concatenate([own, own + one.n_nodes])] for name, own in sides.items()}
    return BodyMesh(points, cells, {**both, "x0": number[one.surfaces["x0"]]})


def two_bolts() -> Scene:
    """Return two plates on a gasket with two bolts, of which one is drawn."""
    meshes = {"upper": plate(1.0, 15.0, 2), "lower": plate(-15.0, -1.0, 2)}
    bodies = {name: Body(mesh, STEEL) for name, mesh in meshes.items()}
    bodies["gasket"] = Body(plate(-1.0, 1.0, 1), IsotropicElasticity(700.0, 0.3))
    met = [("gasket", "top", "upper", "bottom"), ("gasket", "bottom", "lower", "top")]
    screw, preloads = bolt(5.0, 8.0, (-15.0, 15.0), 6.0, n=2, n_radial=1, layers=(4, 2)), []
    for name, x, force in (("drawn", 0.0, 18e3), ("not yet", 40.0, None)):
        bodies[name] = Body(screw.placed(np.eye(3), np.array([x, 0.0, 0.0])), STEEL)
        met += [(name, "head", "upper", "top"), (name, "nut", "lower", "bottom")]
        preloads.append(Preload(name, Section((x, 0, 0), (0, 0, 1)), force))
    contacts = [ContactPair(Surface(*pair[:2]), Surface(*pair[2:]), RUBS) for pair in met]
    supports = [Support("lower", "x0"), *(Support(name, "y0", (None, 0.0, None)) for name in bodies)]
    return Scene(bodies, supports, [], contacts, preloads=preloads)


def whole_steps(state: State) -> int:
    """Return how many steps but the first have solved contact as a whole."""
    return sum(newton.WHOLE in line.note for line in state.solution.history[1:])


def test_a_bolt_that_nothing_draws_yet_costs_few_products(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first step starts from the shortest forces in equilibrium; from none it took 1050 products.

    Faces after it are wrong twice, and contact is solved as a whole; where that is in vain, the next face is
    solved, and what was spent is counted.
    """
    state = solve_scene(two_bolts(), MPI.COMM_SELF)
    assert state.preloads()["drawn"].force == pytest.approx(18e3)
    assert isinstance(state, DeformedState)
    assert state.fractions == (1.0,)
    assert state.solution.products < 250
    assert whole_steps(state) > 0

    tried, solved_instead = [0], newton._Run._solved_instead

    def in_vain(run: newton._Run, at: newton._State, near: Linearisation) -> newton._Solved:
        found = solved_instead(run, at, near)
        tried[0] += found.taken.products
        raise ConvergenceError("no", ())

    monkeypatch.setattr(newton._Run, "_solved_instead", in_vain)
    other = solve_scene(two_bolts(), MPI.COMM_SELF)
    assert tried[0] > 0
    assert whole_steps(other) == 0
    forces = other.contact.normal_force
    assert forces == pytest.approx(state.contact.normal_force, abs=1e-6 * forces.sum())
    monkeypatch.setattr(newton._WrongFaces, "are_many", lambda self, method: False)
    plain = solve_scene(two_bolts(), MPI.COMM_SELF)
    assert other.solution.products == plain.solution.products + tried[0]
