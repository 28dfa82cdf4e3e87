"""Small scenes that together go most of the library's ways, in tenths of a second each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.graph_partition import graph_partition
from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    DistanceObstacle,
    FixedPoint,
    LoadStep,
    RigidPlane,
    RigidSphere,
    Scene,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
    ThermalStrain,
    Tie,
    TotalForce,
    Traction,
    Tresca,
    contact_area,
    minimize,
    solve_scene,
    solve_steps,
)
from fenics_contact._scene.obstacles import RigidObstacle
from fenics_contact._scene.pairs import Friction
from fenics_contact.design import (
    AdaptiveTolerance,
    BundleTrust,
    ContactForces,
    ForScipy,
    LinearConstraints,
    TotalPotential,
)
from fenics_contact.gallery import DesignSurface, block, box_lattice, hemisphere, rectangle
from fenics_contact.materials import IsotropicElasticity, NeoHooke, OrthotropicElasticity, PlaneStrain
from fenics_contact.mesh import bisection_partition, quadratic
from fenics_contact.qp import DualSolver, FaceNewton, Smalse
from fenics_contact.results import BalancedTolerance, ContactResult
from fenics_contact.results.deformed_state import AnyState
from fenics_contact.results.linear_state import as_linear
from fenics_contact.shapes import Parametric, Profile
from fenics_contact.study.scenes.chain_links import chain, graded_links

#: Tolerance of states where it is not balanced: the solvers' own.
TOLERANCE = 1e-6
#: What a scene's answer consists of: arrays by what they are, "tolerance" and "products".
Figures = dict[str, Any]

COMM = MPI.COMM_SELF
SOFT, STIFF = IsotropicElasticity(100.0, 0.3), IsotropicElasticity(300.0, 0.2)
FLOOR = RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))


def _figures(*states: AnyState, **more: Any) -> Figures:
    """Return potential energy and contact forces of some states, and what they cost."""
    return {
        "energy": [state.energies.total_potential for state in states],
        "force": np.concatenate([state.contact.force.ravel() for state in states]),
        "products": sum(state.solution.products for state in states),
        "tolerance": TOLERANCE,
        **more,
    }


def _discretisation(state: AnyState) -> float:
    return as_linear(state, "errors").estimate_errors(geometry=False).discretisation


def _balanced_figures(state: AnyState) -> Figures:
    """Return the figures of a balanced state, which is as good as its mesh deserves, and its errors."""
    errors, wanted = as_linear(state, "errors").estimate_errors(), state.tolerance
    solver = [errors.algebraic, errors.friction]
    found = _figures(state, estimate=[errors.discretisation, errors.geometry], certificate=solver)
    assert isinstance(wanted, BalancedTolerance)
    return found | {"tolerance": wanted.share * errors.discretisation}


def _crowned(mesh: BodyMesh, rise: float) -> BodyMesh:
    """Bend the lower face of a block upwards towards its ends in x."""
    x, y, z = mesh.points.T
    along, below = 2 * (x - x.min()) / np.ptp(x) - 1, (z.max() - z) / np.ptp(z)
    return mesh.moved(np.column_stack([x, y, z + rise * along**2 * below]))


def _on_floor(friction: Friction, load: tuple[float, float, float], cells: tuple[int, int, int]) -> Scene:
    """A crowned block that only a rigid floor holds."""
    mesh = _crowned(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), cells), 0.02)
    pair = ContactPair(Surface("block", "z0"), FLOOR, friction)
    return Scene({"block": Body(mesh, SOFT)}, loads=[Traction("block", "z1", load)], contacts=[pair])


def _two_blocks(friction: Friction, cell: str, pair: dict[str, Any]) -> Scene:
    """A crowned block pressed on another one whose mesh does not match; nothing else holds it."""
    lower = block((0.0, 0.0, -1.0), (2.0, 1.0, 0.0), (5, 3, 2), cell)
    upper = _crowned(block((0.1, 0.05, 0.0), (1.9, 0.95, 0.8), (6, 4, 2), cell), 0.04)
    return Scene(
        {"lower": Body(lower, STIFF), "upper": Body(upper, SOFT)},
        [Support("lower", "z0")],
        [Traction("upper", "z1", (0.6, 0.12, -2.0))],
        [
            ContactPair(
                Surface("upper", "z0"), Surface("lower", "z1"), friction, **{"discretisation": "node", **pair}
            )
        ],
    )


def _cut(scene: Scene, parts: int) -> dict[str, np.ndarray]:
    return {name: graph_partition(body.mesh, parts) for name, body in scene.bodies.items()}


def floating_block() -> Figures:
    """Sticks and slips on a rigid floor, in the default partition, with its errors."""
    return _balanced_figures(solve_scene(_on_floor(Coulomb(0.7), (1.0, 0.3, -2.0), (14, 7, 7)), COMM))


def hardly_held_block() -> Figures:
    """All but slides: friction of 0.53 where 0.52 is needed; Newton's method is rescued."""
    hasty = FaceNewton(tolerance=TOLERANCE, patience=1, forcing=0.9, loosest=0.5)
    scene = _on_floor(Coulomb(0.53), (1.0, 0.3, -2.0), (6, 3, 3))
    return _figures(solve_scene(scene, COMM, partitions=_cut(scene, 3), solver=hasty))


def cornered_block() -> Figures:
    """Floor and wall at once, so that forces on the edge between them are not unique."""
    scene = _on_floor(Coulomb(0.4), (1.0, 0.3, -2.0), (6, 3, 3))
    wall = ContactPair(Surface("block", "x1"), RigidPlane((2.0, 0.0, 0.0), (-1.0, 0.0, 0.0)), Coulomb(0.4))
    scene = replace(scene, contacts=[*scene.contacts, wall])
    state = solve_scene(scene, COMM, partitions=_cut(scene, 3), tolerance=TOLERANCE)
    return _figures(state) | {"force": state.contact.force.sum(axis=0)}


def pressed_ball() -> Figures:
    """A quarter of a ball on a block, across planes of symmetry, between reconstructed surfaces."""
    ticks = np.expm1(3 * np.linspace(0, 1, 6)) / np.expm1(3)
    meshes = {
        "ball": hemisphere(1.0, 4, grading=3.0),
        "block": box_lattice([1.05 * ticks, ticks, -ticks[::-1]]),
    }
    symmetric = {"x0": (0.0, None, None), "y0": (None, 0.0, None)}
    scene = Scene(
        {name: Body(mesh, SOFT) for name, mesh in meshes.items()},
        [Support("block", "z0"), *(Support(name, *side) for name in meshes for side in symmetric.items())],
        [TotalForce("ball", "top", (0.0, 0.0, -0.1))],
        [ContactPair(Surface("block", "z1"), Surface("ball", "contact"), None, "node", "reconstructed")],
    )
    state = solve_scene(scene, COMM, tolerance=BalancedTolerance(share=1e-5))
    found = _balanced_figures(state)
    return found | {"estimate": [*found["estimate"], contact_area(state)]}


def mortar_blocks() -> Figures:
    """Tetrahedra on tetrahedra that do not match, by mortar and reconstructed surfaces, with errors."""
    by_mortar = {"discretisation": "mortar", "geometry": "reconstructed"}
    return _balanced_figures(solve_scene(_two_blocks(Coulomb(0.38), "tetrahedron", by_mortar), COMM))


def tresca_far_away() -> Figures:
    """Given friction between turned blocks of metres, a thousand kilometres from the origin."""
    scene = _two_blocks(Tresca(0.8), "hexahedron", {})
    turn = np.linalg.qr(np.array([[1.0, 0.3, -0.2], [0.1, 1.0, 0.5], [0.4, -0.3, 1.0]]))[0]
    turn *= np.sign(np.linalg.det(turn))
    points = {name: body.mesh.points @ turn.T + 1e6 for name, body in scene.bodies.items()}
    loads = [Traction("upper", "z1", tuple(turn @ [0.6, 0.12, -2.0]))]
    scene = replace(scene.moved(points), loads=loads)
    return _figures(solve_scene(scene, COMM, partitions=_cut(scene, 3), tolerance=TOLERANCE))


def _solved_otherwise(friction: Friction, solver: DualSolver) -> Figures:
    scene = _two_blocks(friction, "hexahedron", {})
    guides = [Support("upper", "x0", (0.0, None, None)), Support("upper", "y0", (None, 0.0, None))]
    scene = replace(scene, supports=[*scene.supports, *guides])
    return _figures(solve_scene(scene, COMM, partitions=_cut(scene, 2), solver=solver))


def by_smalse() -> Figures:
    """Guided blocks without friction, by augmented Lagrangians and MPGP."""
    return _solved_otherwise(None, Smalse(TOLERANCE))


def by_fixed_point() -> Figures:
    """Coulomb friction of guided blocks by a sequence of given slip bounds."""
    return _solved_otherwise(Coulomb(0.3), FixedPoint(FaceNewton(TOLERANCE)))


def there_and_back() -> Figures:
    """A plate of triangles dragged over a rigid disc in three steps, friction remembering."""
    mesh = rectangle((-1, 0), (1, 1), (16, 8), "triangle")
    pair = ContactPair(Surface("plate", "y0"), RigidSphere((0.0, -3.0), 3.0), Coulomb(0.4))
    scene = Scene({"plate": Body(mesh, PlaneStrain(100.0, 0.3))}, contacts=[pair])
    steps = [LoadStep(f"{s}", supports=[Support("plate", "y1", (s, -0.05))]) for s in (0.02, 0.0, -0.02)]
    problem = ContactProblem(scene, COMM, partitions=_cut(scene, 4), tolerance=TOLERANCE)
    return _figures(*solve_steps(problem, steps))


def shaped_obstacles() -> Figures:
    """Plates pressed on a curve with parameters, a profile, and a distance without derivatives."""
    obstacles: dict[str, RigidObstacle] = {
        "wave": Parametric(lambda u: np.column_stack([-u, 0.2 * np.cos(u) - 0.2]), (-4.0,), (4.0,)),
        "arch": Profile([(2.0, -0.5), (0.0, 0.0), (-2.0, -0.5)]),
        "round": DistanceObstacle(lambda x: np.hypot(x[:, 0], x[:, 1] + 3.0) - 3.0),
    }
    plate = Body(rectangle((-0.5, 0.0), (0.5, 0.5), (6, 4)), PlaneStrain(100.0, 0.3))
    scene = Scene(
        dict.fromkeys(obstacles, plate),
        [Support(name, "y1", (0.01, -0.02)) for name in obstacles],
        contacts=[ContactPair(Surface(name, "y0"), each, Coulomb(0.2)) for name, each in obstacles.items()],
    )
    return _figures(solve_scene(scene, COMM, tolerance=TOLERANCE))


def without_contact() -> Figures:
    """Tied blocks under a load that varies, cut by bisection, and one of them alone."""
    lower = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3))
    upper = block((0.0, 0.0, 1.0), (2.0, 1.0, 2.0), (5, 4, 3), "tetrahedron")
    parts = {"lower": Body(lower, STIFF), "upper": Body(upper, SOFT)}
    held, load = Support("lower", "z0"), lambda points: np.outer(points[:, 0], [0.1, 0.0, -0.5])
    tied = Scene(
        parts, [held], [Traction("upper", "z1", load)],
        ties=[Tie(Surface("upper", "z0"), Surface("lower", "z1"))],
    )  # fmt: skip
    cut = {name: bisection_partition(body.mesh, 3) for name, body in parts.items()}
    alone = Scene({"lower": parts["lower"]}, [held], [Traction("lower", "z1", load)])
    states = solve_scene(tied, COMM, partitions=cut, tolerance=TOLERANCE), solve_scene(alone, COMM)
    return _figures(*states, estimate=[_discretisation(state) for state in states])


def heated_stack() -> Figures:
    """Wood and nearly incompressible rubber tied together, one of quadratic cells, heated, on the floor."""
    lower = quadratic(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (3, 2, 2)))
    upper = block((0.0, 0.0, 1.0), (2.0, 1.0, 2.0), (5, 4, 3), "tetrahedron")
    wood = OrthotropicElasticity((12e3, 800.0, 800.0), (0.4, 0.4, 0.3), (700.0, 700.0, 300.0))
    warm = replace(wood, thermal_expansion=(1e-4, 1e-3, 1e-3))
    scene = Scene(
        {"lower": Body(lower, warm), "upper": Body(upper, IsotropicElasticity(10.0, 0.499))},
        loads=[
            ThermalStrain("lower", lambda points: points[:, 2]),
            Traction("upper", "z1", (0.1, 0.0, -1.0)),
        ],
        contacts=[ContactPair(Surface("lower", "z0"), FLOOR, Coulomb(0.5))],
        ties=[Tie(Surface("upper", "z0"), Surface("lower", "z1"), discretisation="node")],
    )
    return _balanced_figures(solve_scene(scene, COMM))


def _largest(contact: ContactResult) -> tuple[float, np.ndarray, np.ndarray]:
    force = contact.normal_force
    k = int(np.flatnonzero(force >= (1.0 - 1e-9) * force.max())[0])  # of mirrored points the first
    return float(force[k]), np.eye(len(force))[k], np.zeros((len(force), 2))


def chain_gradient() -> Figures:
    """Two graded links under 80 kN, with the gradients of their energy and of their largest force."""
    links = graded_links((18, 3, 6))
    state = ContactProblem(chain(links), COMM).solve(design=True)
    design, contact = SurfaceDesign("link 1", links.first.crown), ContactProblem.following(state)
    points = [
        ShapeProblem(contact, design, objective).differentiate(state)
        for objective in (TotalPotential(), ContactForces(_largest))
    ]
    return _figures(state, gradient=np.concatenate([each.gradient / abs(each.value) for each in points]))


def small_design() -> Figures:
    """The underside of a block is shaped for little energy: eight evaluations, as accurate as is asked."""
    scene = _on_floor(Coulomb(0.3), (0.3, 0.1, -2.0), (6, 3, 3))
    mesh = scene.bodies["block"].mesh
    nodes = np.unique(mesh.surfaces["z0"])
    nodes = nodes[np.lexsort(mesh.points[nodes, 1::-1].T.round(9))]
    parameters = mesh.points[nodes, :2] / [2.0, 1.0]
    surface = DesignSurface(nodes, parameters, np.tile([0.0, 0.0, -1.0], (len(nodes), 1)), (7, 4))
    contact = ContactProblem(scene, COMM, partitions=_cut(scene, 2))
    design = SurfaceDesign("block", surface, (3, 2))
    problem = ShapeProblem(contact, design, TotalPotential(), tolerance=AdaptiveTolerance())
    method = BundleTrust(max_evaluations=8, raise_on_failure=False)
    found = minimize(problem, np.zeros(6), method, bounds=(-0.02, 0.02))
    return {
        "energy": [found.value], "gradient": problem(found.x)[1], "products": problem.products,
        "tolerance": method.tolerance,
    }  # fmt: skip


def nonsmooth_minimum() -> Figures:
    """The least of the largest of three quadratic functions, which a constraint cuts off."""
    curvature, places = (
        np.array([1.0, 4.0, 9.0]),
        np.array([[1.0, 0.0, 2.0], [-1.0, 1.0, 0.0], [0.0, -2.0, 1.0]]),
    )

    def largest(x: np.ndarray) -> tuple[float, np.ndarray]:
        values = 0.5 * curvature @ ((x[:, None] - places.T) ** 2)
        k = int(np.argmax(values))
        return float(values[k]), curvature * (x - places[k])

    method = BundleTrust(tolerance=1e-5)
    rows = LinearConstraints([[1.0, 1.0, 1.0]], [-0.5])
    start, box = [-2.0, 0.0, 0.0], (-3.0, 3.0)
    found = minimize(largest, start, method, bounds=box, constraints=rows)
    task = ForScipy(largest, start, bounds=box, constraints=rows)
    task(task.arguments("SLSQP")["x0"])  # SciPy's own iterates differ between its versions
    return {
        "energy": [found.value, task.best.value], "products": found.evaluations,
        "tolerance": method.tolerance,
    }  # fmt: skip


def rubber_drawn_over_a_disc() -> Figures:
    """A block of rubber in four pieces, pressed deep on a rigid disc and drawn over it."""
    mesh = rectangle((0.0, 0.0), (2.0, 1.0), (12, 6))
    pair = ContactPair(Surface("block", "y0"), RigidSphere((0.8, -0.5), 0.5), Coulomb(0.3))
    scene = Scene({"block": Body(mesh, NeoHooke(1.0, 0.3))}, [Support("block", "y1")], contacts=[pair])
    problem = ContactProblem(scene, COMM, partitions=_cut(scene, 4))
    way = [(0.0, -0.15), (0.0, -0.35), (0.1, -0.35)]
    steps = [LoadStep(f"{x}, {y}", supports=[Support("block", "y1", (x, y))]) for x, y in way]
    states = solve_steps(problem, steps)
    return _figures(*states, tolerance=1e-8)


SCENES: dict[str, Callable[[], Figures]] = {
    scene.__name__.replace("_", " "): scene
    for scene in (
        floating_block, hardly_held_block, cornered_block, pressed_ball, mortar_blocks, tresca_far_away,
        by_smalse, by_fixed_point, there_and_back, shaped_obstacles, without_contact, heated_stack,
        chain_gradient, small_design, nonsmooth_minimum, rubber_drawn_over_a_disc,
    )
}  # fmt: skip
