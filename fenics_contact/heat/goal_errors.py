"""The error of a quantity of steady temperatures: by mesh, geometry and solver, with the adjoint's weights.

With the adjoint w of the quantity J, less the functions of nodes at which J is a heat that enters there,

    J(T) − J_h(T_h) ≈ ∫ k (G T_h − ∇T_h)·(G w_h − ∇w_h) + Σ A q w − ∫ q w + ...,

with gradients G recovered from both fields and k at T_h. The second part is of heat q that passes through
contacts at points, which is a sum with areas A in place of an integral. What facets of linear cells miss of
curved bodies is the derivative of J − wᵀ R along a motion of their nodes that makes the volume the true one.

References:
    R. Becker, R. Rannacher, An optimal control approach to a posteriori error estimation in finite element
    methods, Acta Numer. 10 (2001) 1-102.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact._accuracy.discretisation import OfCells, Parts
from fenics_contact._accuracy.recovery import find_sites, recovered_gradients
from fenics_contact._adaptive.boundary_errors import towards_shapes
from fenics_contact._adaptive.estimates import ErrorEstimate
from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.feti.subdomain import SubdomainMesh
from fenics_contact.heat.adjoint import HeatAdjoint, heat_adjoint
from fenics_contact.heat.contact_residuals import between_points
from fenics_contact.heat.objectives import AtTemperatures, HeatObjective
from fenics_contact.heat.parts import HeatLoad, OnSurface
from fenics_contact.heat.points_of_cells import PointsOfCells
from fenics_contact.heat.scene import HeatScene
from fenics_contact.heat.state import HeatState
from fenics_contact.mesh.cell_types import quadrature


@collectively("heat_goal_error", lambda state, *_, **__: state.comm)
def heat_goal_error(state: HeatState, objective: HeatObjective, *, tolerance: float = 1e-9) -> ErrorEstimate:
    """Estimate the error of a quantity of steady temperatures by its adjoint. Collective.

    Costs one adjoint and the recovery of two gradients. Errors of loads and films between nodes, and of ties
    between meshes that do not match, are not included.

    Args:
        state: A steady state, see `heat_adjoint`.
        objective: The quantity.
        tolerance: Relative residual of the adjoint.

    Raises:
        InvalidInputError: As `heat_adjoint`.
        ConvergenceError: As `heat_adjoint`.

    Example:
        >>> error = heat_goal_error(state, TemperatureMean("chip"))  # doctest: +SKIP
        >>> print(error)  # doctest: +SKIP
        >>> cells = error.by_cell("chip")  # doctest: +SKIP
    """
    if len(state.adjoining()) > 1:
        raise InvalidInputError(
            "errors are estimated of temperatures alone, got a state with mechanics, whose own error is not "
            "known here: give the state of solve_heat"
        )
    adjoint = heat_adjoint(state, objective, tolerance=tolerance)
    comm, at, value = state.comm, adjoint.at, adjoint.value
    weight, balanced = adjoint.values - objective.partials(at)[2], adjoint.lagrangian(at)
    (found, own), between_nodes = _between_gradients(state, weight), objective.missing(at)
    between, apart = between_points(state, weight)
    geometry, curved = _by_geometry(adjoint, balanced, weight)
    own = {n: (cells, shares + (curved[n] + apart[n])[cells]) for n, (cells, shares) in own.items()}
    sums = np.array([found, *(float(shares.sum()) for _, shares in own.values())])
    sums = np.asarray(comm.allreduce(sums))
    sizes = {name: body.mesh.n_cells for name, body in state.scene.bodies.items()}
    mesh, uncancelled = sums[0] + between + between_nodes, sums[1:].sum() + abs(between_nodes)
    return ErrorEstimate(
        value, float(mesh), float(uncancelled), geometry, balanced - value, "", comm, sizes, own
    )


def _between_gradients(state: HeatState, weight: np.ndarray) -> tuple[float, OfCells]:
    """Return ∫ k e·f over this rank's cells, and √(∫ k e·e ∫ k f·f) of each. Collective."""
    total, parts, torn = 0.0, Parts(state.scene.bodies), state.torn
    for order in sorted({body.mesh.order for body in state.scene.bodies.values()}):
        sites = find_sites(torn, order)
        fields = np.column_stack([state.values, weight])[sites.node]
        gradients = recovered_gradients(sites, fields)
        for number, mesh in enumerate(torn.decomposition.meshes):
            if mesh.number in sites.of_cells:
                nodes = sites.of_cells[mesh.number]
                both = _products(state, mesh, fields[nodes], gradients[nodes])
                total += float(both[:, 0, 1].sum())
                parts.add(torn.subdomains[number], np.sqrt(both[:, 0, 0] * both[:, 1, 1]))
    return total, parts.joined()


def _products(state: HeatState, mesh: SubdomainMesh, fields: np.ndarray, gradients: np.ndarray) -> np.ndarray:
    """Return ∫ k (g − ∇u)·(h − ∇v) of two fields and their gradients over cells, (n_cells, 2, 2).

    `fields`: the temperature and another, (n_cells, m, 2); `gradients`: (n_cells, m, 2, dim).
    """
    body, element = state.scene.bodies[mesh.body], state.torn.scene.bodies[mesh.body].element
    positions, weights = quadrature(element.cell, 2 * element.cell.order)
    at = PointsOfCells.of(body.mesh, mesh.cells, element.cell, positions)
    values, slopes = at.of_nodes(fields), at.of_nodes(gradients)
    missed = np.einsum("qa,cafi->fcqi", at.shape, slopes) - np.einsum("cqai,caf->fcqi", at.slopes, values)
    temperature = values[..., 0] @ at.shape.T
    flux = [body.conducted(mesh.cells, at.places, temperature, each) for each in missed]
    volume = body.thickness * at.sizes(weights, element.kinematics.measure)
    return np.einsum("cq,fcqi,gcqi->cfg", volume, missed, np.stack(flux))


def _by_geometry(
    adjoint: HeatAdjoint, balanced: float, weight: np.ndarray, step: float = 1e-3
) -> tuple[float, dict[str, np.ndarray]]:
    """Return the derivative of J − wᵀ R along the way of curved boundaries to their true shapes. Collective.

    And of each body the shares of its cells, (n_cells,), by how far their nodes go. Arcs are longer than
    their chords by half of what chords grow by when moved to enclose as much: surfaces go half of the way.
    Gaps are those between true surfaces and do not change. `balanced`: J − wᵀ R on the facets; `weight`: w
    less what is part of J; `step`: part of the way by which the difference is taken.
    """
    here = adjoint.at
    scene, decomposition = here.scene, here.decomposition
    shares = {name: np.zeros(body.mesh.n_cells) for name, body in scene.bodies.items()}
    with together(decomposition.comm):
        meshes = towards_shapes(scene.geometry, 0.5 * step)
    if not meshes:
        return 0.0, shares
    bodies = {name: replace(scene.bodies[name], mesh=mesh) for name, mesh in meshes.items()}
    moved = replace(scene, bodies={**scene.bodies, **bodies})
    there = AtTemperatures.of(moved, decomposition, here.values)
    there = replace(there, joints=replace(here.joints, area=there.joints.area), given=here.given)
    inside = (replace(each, contacts=(), loads=_in_volumes(each)) for each in (scene, moved))
    before, after = (AtTemperatures.of(each, decomposition, here.values).residual for each in inside)
    change = adjoint.lagrangian(there) - balanced - weight @ (after - before)
    for name, mesh in meshes.items():
        length = np.linalg.norm(mesh.points - scene.bodies[name].mesh.points, axis=1)
        shares[name] = length[mesh.cells].sum(axis=1)
    whole = sum(float(each.sum()) for each in shares.values())
    found = float(change / step)
    return found, {name: abs(found) / whole * each for name, each in shares.items()}


def _in_volumes(scene: HeatScene) -> list[HeatLoad]:
    return [load for load in scene.loads if not isinstance(load, OnSurface)]
