"""Integrals over a body as objectives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.fem import material_sets, temperature_of
from fenics_contact.feti import Subdomain
from fenics_contact.shape.forms import (
    Density,
    Integrand,
    ShapeForms,
    subdomain_fields,
    sum_over_subdomains,
)
from fenics_contact.shape.nodal_fields import field_by_places
from fenics_contact.shape.objective import Partials, require_linear
from fenics_contact.shape.sums import Weighable

Functions = Sequence["_dolfinx.fem.Function"]
Spaces = Sequence["_dolfinx.fem.FunctionSpace"]
#: Binds a functional to a subdomain, with Functions for its fields and spaces for its arguments.
Bind = Callable[[Subdomain, Functions, Spaces], "_dolfinx.fem.Form"]


@dataclass(frozen=True, eq=False)
class BodyIntegral:
    """∫ of a density over one body of a state.

    Attributes:
        state: The state.
        forms: Compiled functionals.
        density: What is integrated.
        body: Name of the body.
    """

    state: State
    forms: ShapeForms
    density: Density
    body: str

    def __call__(self, *numbers: float) -> float:
        """Integrate with values of the density's constants. Collective."""
        bind, state = self._prepare("value", numbers), self.state
        total = 0.0
        for subdomain, functions in subdomain_fields(state.torn, [state.torn_displacement]):
            if subdomain.mesh.body == self.body:
                total += _dolfinx.assemble_scalar(bind(subdomain, functions, []))
        return float(state.torn.decomposition.comm.allreduce(total))

    def derivatives(self, *numbers: float) -> dict[str, np.ndarray]:
        """Return the derivatives by displacements and shape, by UFL. Collective."""
        torn, u = self.state.torn, self.state.torn_displacement
        by_shape, by_displacement = (self._prepare(by, numbers) for by in ("shape", "displacement"))

        def assemble(bind: Bind, subdomain: Subdomain, functions: Functions) -> np.ndarray:
            if subdomain.mesh.body != self.body:
                return np.zeros(subdomain.mesh.size)
            return _dolfinx.assemble_vector(bind(subdomain, functions, [subdomain.mesh.space]))

        gradient = [assemble(by_displacement, *each) for each in subdomain_fields(torn, [u])]
        moving = sum_over_subdomains(torn, [u], partial(assemble, by_shape), self.forms.moving)
        return {"by_displacement": np.concatenate(gradient), "by_shape": moving + self._by_heat(numbers)}

    def _by_heat(self, numbers: tuple[float, ...]) -> np.ndarray | float:
        """Return the derivative by the places at which temperatures are evaluated. Collective."""
        torn, heated = self.state.torn, temperature_of(self.state.scene.loads, self.body).of_position
        if not heated:
            return 0.0
        by_temperature, moving = self._prepare("temperature", numbers), self.forms.moving

        def assemble(subdomain: Subdomain, functions: Functions) -> np.ndarray:
            if subdomain.mesh.body != self.body:
                return np.zeros(subdomain.mesh.size)
            space = _dolfinx.scalar_space(subdomain.mesh.space.mesh, 1)
            by_values = _dolfinx.assemble_vector(by_temperature(subdomain, functions, [space]))
            parts = [field_by_places(torn, subdomain, load, space, by_values, moving) for load in heated]
            return np.sum(parts, axis=0)

        with together(torn.decomposition.comm):
            return sum_over_subdomains(torn, [self.state.torn_displacement], assemble, moving)

    def _prepare(self, by: str, numbers: tuple[float, ...]) -> Bind:
        """Compile the integral or a derivative, return a function that binds it to subdomains. Collective."""
        body = self.state.scene.bodies[self.body]
        cell_type, temperature = body.mesh.cell_type, temperature_of(self.state.scene.loads, self.body)
        for materials in material_sets(body):
            self.forms.functional(self.density, materials, cell_type, by, temperature)

        def bind(subdomain: Subdomain, functions: Functions, spaces: Spaces) -> _dolfinx.fem.Form:
            parts, mesh = subdomain.material, subdomain.mesh.space.mesh
            template = self.forms.functional(self.density, parts.materials, cell_type, by, temperature)
            points = body.mesh.points[np.sort(subdomain.mesh.nodes)]
            fields = [*functions, *temperature.fields(mesh, points)]
            values = (*numbers, *temperature.numbers, *parts.parameters)
            return template.bind(spaces, values, fields, mesh=mesh, cells=parts.cells)

        return bind


def require_body(state: State, what: str, body: str) -> None:
    """Check the name of a body."""
    bodies = state.scene.bodies
    if body not in bodies:
        raise InvalidInputError(
            f"{what}.body must name a body of the scene, got {body!r}, there are {sorted(bodies)}"
        )


@dataclass(frozen=True)
class VolumeIntegral(Weighable):
    """J = ∫ integrand(u, x, σ) dx over one body.

    Attributes:
        name: Its name among compiled forms.
        integrand: Takes displacement, coordinates and stress (UFL; without thermal stress), returns a UFL
            scalar.
        body: Name of the body.

    Example:
        >>> import ufl
        >>> VolumeIntegral("motion", lambda u, x, stress: ufl.inner(u, u), "link2").body
        'link2'
    """

    name: str
    integrand: Integrand
    body: str

    def value(self, state: State, forms: ShapeForms) -> float:
        """Integrate. Collective."""
        return self._on(state, forms)()

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Differentiate the integral by UFL."""
        integral = self._on(state, forms)
        return Partials.of(state, integral(), **integral.derivatives())

    def _on(self, state: State, forms: ShapeForms) -> BodyIntegral:
        require_linear(state, self)
        require_body(state, "VolumeIntegral", self.body)
        return BodyIntegral(state, forms, Density(self.name, self.integrand), self.body)
