"""Pressures that follow a surface, and tractions with a given resultant."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy.sparse as sp
import ufl
from ufl.core.expr import Expr

from fenics_contact import _dolfinx
from fenics_contact._base.checks import GivenVector, floats
from fenics_contact._base.sparse import ROUNDING
from fenics_contact._fem.load_forms import Symbol, load_fields, load_key, load_name, numbers_of
from fenics_contact._fem.templates import Templates, Written, surface_measure
from fenics_contact._kinematics.element import Element
from fenics_contact._scene.loads import Load, Pressure, TotalForce, Traction
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.thickness import by_thickness, thickness_on
from fenics_contact._surfaces.facets import SurfaceMoments, surface_moments
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.hyperelastic import cofactor, deformation_gradient

#: The forms, by number of arguments less one.
FORMS = ("growth", "softening")


def prepare_following(templates: Templates, scene: Scene) -> None:
    """Compile the missing forms of a scene's following pressures. Collective."""
    for load in scene.following_pressures:
        element = scene.bodies[load.body].element
        for kind in FORMS:
            name = (f"{kind} of", *load_name(load, element))
            templates.get(_key(kind, load, element), name, partial(_written, kind, load, element))


def _key(kind: str, load: Pressure, element: Element) -> tuple[object, ...]:
    return (kind, *load_key(load, (), element))


def _written(kind: str, load: Pressure, element: Element) -> Written:
    (u,) = element.fields(1)
    space, symbol = u.ufl_function_space(), Symbol(load, element)
    moved, v, du = element.in_space(u, ufl.TestFunction(space), ufl.TrialFunction(space))
    normal = ufl.FacetNormal(element.template)
    if len(moved) > len(normal):
        normal = ufl.as_vector([normal[0], normal[1], 0])

    def growth(along: Expr) -> Expr:
        change = cofactor(deformation_gradient(moved)) - ufl.Identity(len(moved))
        return -symbol.expression * ufl.dot(change * normal, along)

    density = growth(v)
    if kind == "softening":
        density = -ufl.derivative(growth(v), moved, du)
    density = element.integrand(element.on_cells(density))
    return density * surface_measure(element), symbol.constants, (u, *symbol.coefficients)


class FollowingPressure:
    """A pressure on the surface of one mesh: how it changes as the surface moves.

    Of an even pressure the unsymmetric part of the stiffness is an integral along the edge of the surface: it
    cancels between neighbours, and does no work on edges that are held or slide in planes of symmetry.

    References:
        K. Schweizerhof, E. Ramm, Displacement dependent pressure loads in nonlinear finite element analyses,
        Comput. Struct. 18 (1984) 1099-1114.
    """

    def __init__(
        self,
        templates: Templates,
        load: Pressure,
        element: Element,
        space: _dolfinx.fem.FunctionSpace,
        points: np.ndarray,
        facets: tuple[np.ndarray, np.ndarray],
        acted: np.ndarray,
    ) -> None:
        """Bind the forms; arguments as in `FormLibrary.load`, of which the forms are prepared."""
        self._mesh = space.mesh
        absolute = load.is_ufl or not element.kinematics.is_homogeneous
        self._points = points if absolute else points - points[0]
        self._displacement = _dolfinx.fem.Function(space)
        fields = (self._displacement, *load_fields(load, space, points, acted))
        self._growth, self._softening = (
            templates[_key(kind, load, element)].bind([space] * number, numbers_of(load), fields, facets)
            for number, kind in enumerate(FORMS, start=1)
        )

    def at(self, displacement: np.ndarray) -> tuple[np.ndarray, sp.csr_matrix]:
        """Return what the force is more than on the undeformed surface, and its stiffness.

        Returns force, shape (dim n,), [force]; less its growth with the displacement, shape (dim n, dim n),
        [force / length].
        """
        from fenics_contact._fem.kinematics import assembled

        _dolfinx.update_coordinates(self._mesh, self._points)
        self._displacement.x.array[:] = displacement
        return (
            _dolfinx.assemble_vector(self._growth),
            assembled(self._softening, (displacement.size,) * 2),
        )


@dataclass(frozen=True)
class LinearTraction:
    """A traction a + b × (x − c) that grows linearly with the distance from a point; a function of position.

    `even`: a; `turning`: b, in the plane (1,); `centre`: c.
    """

    even: GivenVector
    turning: GivenVector
    centre: GivenVector

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Return the traction at points, both of shape (n, dim)."""
        arm = points - self.centre
        around: np.ndarray
        if len(self.centre) == 2:
            around = self.turning[0] * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
        else:
            around = np.cross(self.turning, arm)
        return np.asarray(self.even + around)


@dataclass(frozen=True)
class TwistingTraction:
    """A traction on a body of revolution that grows around the axis with the radius, a + b r e_θ."""

    even: GivenVector
    turning: float

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Return the traction at points, (n, 2) to (n, 3)."""
        return np.asarray(self.even + self.turning * points[:, :1] * [0.0, 0.0, 1.0])


def as_tractions(scene: Scene) -> tuple[Load, ...]:
    """Return the scene's loads with every resultant spread over the present shape of its surface."""
    return tuple(
        spread_traction(scene, load) if isinstance(load, TotalForce) else load
        for load in by_thickness(scene.loads, scene.bodies)
    )


def spread_traction(scene: Scene, load: TotalForce) -> Traction:
    """Return the traction a + b × (x − c), c the centroid, that has the resultant of a load.

    With the area A and J b = ∫ (x − c) × (b × (x − c)): a = F / A and J b = M + (p − c) × F. On bodies of
    revolution with torsion it is a + b r e_θ with b ∫ r² = M.
    """
    mesh = scene.bodies[load.body].mesh
    surface = surface_moments(mesh.points, mesh.surfaces[load.surface], scene.kinematics.measure)
    thickness = thickness_on(scene.bodies[load.body], load.surface, "the surface of a TotalForce")
    if thickness != 1.0:
        given = None if load.moment is None else float(np.asarray(load.moment)) / thickness
        load = replace(load, value=tuple(each / thickness for each in load.value), moment=given)
    even = tuple(component / surface.area for component in load.value)
    if scene.torsion:
        around = surface.area * surface.centroid[0] ** 2 + surface.second_moment[0, 0]  # ∫ r²
        twisting = float(np.asarray(load.moment or 0.0) / around)
        value = TwistingTraction((*even, 0.0), twisting) if twisting else (*even, 0.0)
        return Traction(load.body, load.surface, value)
    if load.moment is None and load.at is None:
        return Traction(load.body, load.surface, even)
    force = np.array(load.value)
    arm = np.zeros(mesh.dim) if load.at is None else load.at - surface.centroid
    lever = np.cross(arm, force) if mesh.dim == 3 else arm[:1] * force[1] - arm[1:] * force[0]
    moment = lever + (0.0 if load.moment is None else load.moment)
    turning = floats(_turning(load, surface, moment))
    return Traction(load.body, load.surface, LinearTraction(even, turning, floats(surface.centroid)))


def _turning(load: TotalForce, surface: SurfaceMoments, moment: np.ndarray) -> np.ndarray:
    """Return b = J⁻¹ M, shape (3,), in the plane (1,)."""
    second = surface.second_moment
    if len(second) == 2:
        return moment / np.trace(second)
    size, axes = np.linalg.eigh(np.trace(second) * np.eye(3) - second)
    along = axes.T @ moment
    if size[0] <= ROUNDING * size[-1]:
        raise InvalidInputError(
            f"surface {load.surface!r} of {load.body!r} must not be a line for a moment: choose a wider one"
        )
    return np.asarray(axes @ (along / size))
