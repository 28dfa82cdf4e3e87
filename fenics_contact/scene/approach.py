"""How far the bodies of a contact pair may come closer, estimated before anything is computed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.mesh import vector_areas
from fenics_contact.scene.loads import BodyForce, Load, Pressure, ThermalStrain, TotalForce
from fenics_contact.scene.materials import PlaneStress
from fenics_contact.scene.pairs import ContactPair, Surface, Tie
from fenics_contact.scene.rigid_surfaces import RigidSurface
from fenics_contact.surface_shapes import tangent_bases
from fenics_contact.surfaces import quadrature_areas
from fenics_contact.theory import contact_modulus, hertz_line, hertz_point

if TYPE_CHECKING:
    from fenics_contact.scene.body import Body
    from fenics_contact.scene.parts import SceneParts

#: Nodes around the smallest gap to which the gap is fitted.
AROUND = 30
#: Contact is taken as line contact if one relative curvature is below this fraction of the other.
LINE = 1e-2
#: A gap counts as flat if its curvature times the size of the surface is below this.
FLAT = 1e-6


def displacement_along(scene: SceneParts, normal: np.ndarray) -> float:
    """Return the largest displacement along a direction that a support prescribes as a number, [length]."""
    sizes = [0.0]
    for support in scene.supports:
        given = support.motion[: scene.dim] if isinstance(support, RigidSurface) else support.value
        value = [0.0 if number is None or callable(number) else number for number in given]
        sizes.append(abs(float(np.array(value) @ normal)))
    return max(sizes)


def force_along(scene: SceneParts, normal: np.ndarray) -> float | None:
    """Return the largest resultant, over the bodies, of the loads along a direction, [force].

    None if a load is given as a function or in UFL.
    """
    total = {name: np.zeros(scene.dim) for name in scene.body_names}
    for load in scene.loads:
        resultant = _resultant(scene, load)
        if resultant is None:
            return None
        total[load.body] += resultant
    return max(abs(float(force @ normal)) for force in total.values())


def _resultant(scene: SceneParts, load: Load) -> np.ndarray | None:
    """Return the resultant of a load that is given by numbers, shape (dim,), [force]."""
    if isinstance(load, ThermalStrain):
        return np.zeros(scene.dim)
    if callable(load.value) or not isinstance(load.value, float | tuple):
        return None
    mesh, value = scene.bodies[load.body].mesh, np.array(load.value)
    if isinstance(load, TotalForce):
        return value
    if isinstance(load, BodyForce):
        return value * mesh.volume
    facets = mesh.surfaces[load.surface]
    if isinstance(load, Pressure):
        return np.asarray(-value * vector_areas(mesh.points, facets).sum(axis=0))
    return value * float(quadrature_areas(mesh.points, facets).sum())


def modulus_of(scene: SceneParts, pair: ContactPair) -> float | None:
    """Return the contact modulus E* of a pair, of the softest materials of its bodies; None if not isotropic.

    Rigid obstacles count as infinitely stiff.
    """
    sides = [_constants(scene.bodies[pair.slave.body]), (np.inf, 0.0)]
    if isinstance(pair.master, Surface):
        sides[1] = _constants(scene.bodies[pair.master.body])
    if None in sides:
        return None
    (young_1, poisson_1), (young_2, poisson_2) = sides  # type: ignore[misc]
    return contact_modulus(young_1, poisson_1, young_2, poisson_2)


def master_share(scene: SceneParts, pair: ContactPair | Tie) -> float:
    """Return the master's share of the compliance 1/E* of two bodies; a half where one is not isotropic."""
    assert isinstance(pair.master, Surface)
    own, other = (_constants(scene.bodies[surface.body]) for surface in (pair.slave, pair.master))
    if own is None or other is None:
        return 0.5
    moduli = [contact_modulus(*constants, np.inf, 0.0) for constants in (own, other)]
    return moduli[0] / sum(moduli)


def _constants(body: Body) -> tuple[float, float] | None:
    """Return Young's modulus and Poisson's ratio, the latter 0 where a thin slice strains freely."""
    constants = []
    for material in body.materials:
        if not (hasattr(material, "young_modulus") and hasattr(material, "poisson_ratio")):
            return None
        ratio = 0.0 if isinstance(material, PlaneStress) else float(material.poisson_ratio)
        constants.append((float(material.young_modulus), ratio))
    return min(constants)


def hertz_approach(
    force: float, modulus: float, place: np.ndarray, normal: np.ndarray, gap: np.ndarray
) -> float | None:
    """Return how far two bodies come closer by Hertz's theory; None where it does not hold, [length].

    The relative curvatures are those of a quadratic polynomial through the gaps around the smallest one; the
    theory holds if they are positive and the contact is smaller than the surfaces. Along a line, where the
    approach depends on the whole bodies, it is the depth κ a²/2 by which they would overlap undeformed.

    Args:
        force: Force that presses the bodies together, [force], in the plane [force / length].
        modulus: E*, [force / length²].
        place: Coordinates of the nodes of one surface that face the other, shape (n, dim), [length].
        normal: Normals of the gaps there, shape (n, dim).
        gap: Gaps, shape (n,), [length].
    """
    curvatures, reach = _relative_curvatures(place, normal[np.argmin(gap)], gap)
    if force <= 0.0 or len(curvatures) == 0:
        return None
    low, high, size = curvatures[0], curvatures[-1], reach.max()
    if high * size <= FLAT or low < -LINE * high:
        return None
    if len(curvatures) == 1 or low <= LINE * high:
        line = hertz_line(force / (1.0 if len(curvatures) == 1 else reach[0]), high, modulus)
        return float(high * line.half_width**2 / 2) if line.half_width < size else None
    point = hertz_point(force, (low, high), modulus)
    return point.approach if max(point.semi_axes) < size else None


def _relative_curvatures(
    place: np.ndarray, normal: np.ndarray, gap: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Fit a quadratic polynomial to the gap around its minimum.

    Returns:
        The relative curvatures, ascending, shape (dim − 1,), [1 / length], and how far the nodes reach along
        their directions, shape (dim − 1,), [length]; nothing if there are too few nodes.
    """
    dim = place.shape[1]
    axes = tangent_bases(normal[None])[0]
    along = (place - place[np.argmin(gap)]) @ axes.T
    near = np.argsort((along**2).sum(axis=1))[:AROUND]
    if len(near) < dim * (dim + 1) // 2:
        return np.zeros(0), np.zeros(0)
    size = float(np.abs(along[near]).max())
    x = along[near] / size
    one, other = np.triu_indices(dim - 1)
    terms = np.column_stack([np.ones(len(x)), x, x[:, one] * x[:, other]])
    bend = np.zeros((dim - 1, dim - 1))
    bend[one, other] = np.linalg.lstsq(terms, gap[near], rcond=1e-10)[0][dim:] / size**2
    values, directions = np.linalg.eigh(bend + bend.T)
    return values, np.ptp(along @ directions, axis=0)
