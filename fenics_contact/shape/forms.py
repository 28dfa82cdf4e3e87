"""Derivatives of subdomain integrals by the coordinates of the mesh, from UFL."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import ufl

from fenics_contact import _dolfinx
from fenics_contact.feti import TornSystem
from fenics_contact.feti.forms import Template, as_tractions, load_work, scalar_constants, volume_measure
from fenics_contact.scene import Body, BodyForce, Load, Material

#: Builds an integrand (UFL) from a displacement u, the coordinate x and the stress σ(u).
Integrand = Callable[[Any, Any, Any], Any]


class ShapeForms:
    """Compiled functionals of one or two displacement fields and their derivatives, by what they express.

    A functional is compiled when it is first asked for, by all ranks together.

    Attributes:
        moving: Marks of the nodes of all bodies that a design moves, or None for all; derivatives by other
            nodes are not needed.
    """

    def __init__(self, torn: TornSystem, moving: np.ndarray | None = None) -> None:
        """Start empty."""
        self._comm, self.moving = torn.decomposition.comm, moving
        self._templates: dict[tuple[Any, ...], Template] = {}

    def get(
        self, key: tuple[Any, ...], build: Callable[[], tuple[Any, Sequence[Any], Sequence[Any]]]
    ) -> Template:
        """Return the template under ``key``; ``build`` gives form, constants, coefficients to compile."""
        if key not in self._templates:
            self._templates[key] = Template(self._comm, *build())
        return self._templates[key]

    def virtual_work_by_shape(self, material: Material, cell_type: str) -> Template:
        """∂/∂x of a(u, w) with coefficients (u, w)."""

        def build() -> tuple[Any, Sequence[Any], Sequence[Any]]:
            u, w = _dolfinx.field_symbols(cell_type, 2)
            constants = scalar_constants(cell_type, len(material.parameters))
            form = material.stiffness(u, w, constants) * volume_measure(cell_type)
            return _by_shape(form, cell_type), constants, [u, w]

        return self.get(("work by shape", type(material), cell_type), build)

    def body_force_by_shape(self, load: Load, cell_type: str) -> Template:
        """∂/∂x of the work of a body force along the coefficient w."""

        def build() -> tuple[Any, Sequence[Any], Sequence[Any]]:
            (w,) = _dolfinx.field_symbols(cell_type, 1)
            constants = scalar_constants(cell_type, 3)
            return _by_shape(load_work(load, cell_type, constants, w), cell_type), constants, [w]

        return self.get(("body force by shape", cell_type), build)

    def functional(
        self, name: str, integrand: Integrand, material: Material, cell_type: str, by: str
    ) -> Template:
        """∫ integrand(u, x, σ) dx itself (by="value"), or its derivative by="displacement" or by="shape"."""

        def build() -> tuple[Any, Sequence[Any], Sequence[Any]]:
            (u,) = _dolfinx.field_symbols(cell_type, 1)
            constants = scalar_constants(cell_type, len(material.parameters))
            x = ufl.SpatialCoordinate(_dolfinx.template(cell_type))
            form = integrand(u, x, material.stress(u, constants)) * volume_measure(cell_type, 2)
            if by == "displacement":
                form = ufl.derivative(form, u, ufl.TestFunction(_dolfinx.displacement_space(cell_type)))
            elif by == "shape":
                form = _by_shape(form, cell_type)
            return form, constants, [u]

        return self.get((name, by, type(material), cell_type), build)


def _by_shape(form: Any, cell_type: str) -> Any:
    velocity = ufl.TestFunction(_dolfinx.displacement_space(cell_type))
    return ufl.derivative(form, ufl.SpatialCoordinate(_dolfinx.template(cell_type)), velocity)


def work_by_shape(forms: ShapeForms, torn: TornSystem, u: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return ∂/∂X of a(u, w) − L(w), this rank's share by node of all bodies, shape (n_nodes, 3).

    Tractions are left out: loaded surfaces do not move with a design.

    Args:
        forms: Compiled derivatives.
        torn: The torn system.
        u: Torn displacement of this rank, [length].
        w: Torn field in the place of the test function.
    """
    loads = [load for load in as_tractions(torn.scene) if isinstance(load, BodyForce)]
    for body in torn.scene.bodies.values():  # all ranks compile, also for bodies they hold no part of
        forms.virtual_work_by_shape(body.material, body.mesh.cell_type)
    for load in loads:
        forms.body_force_by_shape(load, torn.scene.bodies[load.body].mesh.cell_type)

    def on_subdomain(body: Body, name: str, space: Any, functions: Sequence[Any]) -> np.ndarray:
        cell_type = body.mesh.cell_type
        template = forms.virtual_work_by_shape(body.material, cell_type)
        result = _dolfinx.assemble_vector(template.bind([space], body.material.parameters, functions))
        for load in loads:
            if load.body == name:
                template = forms.body_force_by_shape(load, cell_type)
                result -= _dolfinx.assemble_vector(template.bind([space], load.value, functions[1:]))
        return result

    return sum_over_subdomains(torn, [u, w], on_subdomain, forms.moving)


def sum_over_subdomains(
    torn: TornSystem,
    fields: Sequence[np.ndarray],
    evaluate: Callable[[Body, str, Any, Sequence[Any]], np.ndarray],
    moving: np.ndarray | None = None,
) -> np.ndarray:
    """Add up vectors of nodal derivatives over this rank's subdomains, shape (n_nodes, 3) for all bodies.

    Args:
        torn: The torn system.
        fields: Torn fields handed to ``evaluate`` as Functions.
        evaluate: Gets body, its name, the subdomain's space and the Functions; returns a vector by dof.
        moving: Marks of nodes of all bodies; subdomains without one of them are left out.
    """
    tearing = torn.decomposition.tearing
    total = np.zeros((int(tearing.node_offset[-1]), 3))
    for name, space, nodes, functions in subdomain_fields(torn, fields, moving):
        vector = evaluate(torn.scene.bodies[name], name, space, functions)
        total[tearing.global_nodes(name, nodes)] += vector.reshape(-1, 3)
    return total


def subdomain_fields(torn: TornSystem, fields: Sequence[np.ndarray], moving: np.ndarray | None = None) -> Any:
    """Yield (body name, space, nodes by block, Functions) of each of this rank's subdomains.

    Args:
        torn: The torn system.
        fields: Torn fields to hand out as Functions.
        moving: Marks of nodes of all bodies; subdomains without one of them are left out.
    """
    tearing = torn.decomposition.tearing
    starts = np.cumsum([0] + [subdomain.mesh.size for subdomain in torn.subdomains])
    for subdomain, start in zip(torn.subdomains, starts[:-1], strict=True):
        mesh = subdomain.mesh
        if moving is not None and not moving[tearing.global_nodes(mesh.body, mesh.nodes)].any():
            continue
        # Systems of several geometries share the meshes: another one may have moved them since.
        points = torn.scene.bodies[mesh.body].mesh.points
        _dolfinx.update_coordinates(mesh.space.mesh, points[np.sort(mesh.nodes)])
        functions = []
        for index, field in enumerate(fields):
            function = _dolfinx.Function(mesh.space, name=f"field{index}")
            function.x.array[:] = field[start : start + mesh.size]
            functions.append(function)
        yield mesh.body, mesh.space, mesh.nodes, functions
