"""UFL forms of a scene, each compiled once and bound to every subdomain mesh."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI

from fenics_contact import _dolfinx
from fenics_contact.feti.surface import quadrature_areas
from fenics_contact.scene import BodyForce, Load, Material, Scene, Surface, TotalForce, Traction

#: Gauss rule of the volume: two points a direction on hexahedra, one on tetrahedra suit linear elasticity.
QUADRATURE_DEGREE = {"hexahedron": 2, "tetrahedron": 1}
#: Tag that every loaded surface gets inside a load form.
LOADED = 1


class Template:
    """A compiled form and its constants."""

    def __init__(
        self, comm: MPI.Comm, form: Any, constants: Sequence[Any], coefficients: Sequence[Any] = ()
    ) -> None:
        """Compile ``form``. Collective on ``comm``."""
        self._form = _dolfinx.CompiledForm(comm, form)
        self._constants, self._coefficients = tuple(constants), tuple(coefficients)

    def bind(
        self,
        spaces: Sequence[Any],
        values: Sequence[float],
        functions: Sequence[Any] = (),
        facets: Any = None,
        mesh: Any = None,
    ) -> Any:
        """Return the form on one mesh, with numbers for its constants and Functions for its coefficients."""
        mesh = spaces[0].mesh if mesh is None else mesh
        constants = {
            symbol: _dolfinx.Constant(mesh, np.float64(value))
            for symbol, value in zip(self._constants, values, strict=True)
        }
        coefficients = dict(zip(self._coefficients, functions, strict=True))
        return self._form.bind(
            mesh, spaces, coefficients, constants, None if facets is None else {LOADED: facets}
        )


class FormLibrary:
    """The compiled forms of a scene, by what they express and for which cell type."""

    def __init__(self, comm: MPI.Comm) -> None:
        """Start empty; `prepare` fills it."""
        self._comm = comm
        self._forms: dict[tuple[Any, ...], Template] = {}

    @property
    def compiled(self) -> tuple[tuple[Any, ...], ...]:
        """Names of the forms compiled so far."""
        return tuple(self._forms)

    def prepare(self, scene: Scene) -> None:
        """Compile what the scene calls for and is not there yet. Collective on the library's communicator."""
        for body in scene.bodies.values():
            key = _stiffness_key(body.material, body.mesh.cell_type)
            if key not in self._forms:
                self._forms[key] = self._stiffness_template(body.material, body.mesh.cell_type)
        for load in scene.loads:
            cell_type = scene.bodies[load.body].mesh.cell_type
            key = _load_key(load, cell_type)
            if key not in self._forms:
                self._forms[key] = self._load_template(load, cell_type)

    def stiffness(self, material: Material, cell_type: str, space: Any) -> Any:
        """Return the bilinear form of ``material`` bound to ``space``."""
        return self._forms[_stiffness_key(material, cell_type)].bind([space, space], material.parameters)

    def load(self, load: Load, cell_type: str, space: Any, facets: Any = None) -> Any:
        """Return the linear form of ``load`` bound to ``space``; surface loads need their ``facets``."""
        return self._forms[_load_key(load, cell_type)].bind([space], load.value, facets=facets)

    def _stiffness_template(self, material: Material, cell_type: str) -> Template:
        V = _dolfinx.displacement_space(cell_type)
        constants = scalar_constants(cell_type, len(material.parameters))
        integrand = material.stiffness(ufl.TrialFunction(V), ufl.TestFunction(V), constants)
        return Template(self._comm, integrand * volume_measure(cell_type), constants)

    def _load_template(self, load: Load, cell_type: str) -> Template:
        constants = scalar_constants(cell_type, 3)
        v = ufl.TestFunction(_dolfinx.displacement_space(cell_type))
        return Template(self._comm, load_work(load, cell_type, constants, v), constants)


def load_work(load: Load, cell_type: str, constants: Sequence[Any], v: Any) -> Any:
    """Return the virtual work of a load with components ``constants`` along ``v``, a UFL form."""
    measure = volume_measure(cell_type, 2) if isinstance(load, BodyForce) else surface_measure(cell_type)
    return ufl.dot(ufl.as_vector(list(constants)), v) * measure


def _stiffness_key(material: Material, cell_type: str) -> tuple[Any, ...]:
    return ("stiffness", type(material), cell_type)


def _load_key(load: Load, cell_type: str) -> tuple[Any, ...]:
    return ("body force" if isinstance(load, BodyForce) else "surface load", cell_type)


def scalar_constants(cell_type: str, count: int) -> tuple[Any, ...]:
    """Return ``count`` UFL constants on the template."""
    return tuple(ufl.Constant(_dolfinx.template(cell_type)) for _ in range(count))


def volume_measure(cell_type: str, degree: int | None = None) -> Any:
    """Return dx on the template with the package's quadrature degree, or the given one."""
    degree = QUADRATURE_DEGREE[cell_type] if degree is None else degree
    return ufl.dx(domain=_dolfinx.template(cell_type), metadata={"quadrature_degree": degree})


def surface_measure(cell_type: str) -> Any:
    """Return ds of the loaded surface on the template."""
    return ufl.ds(domain=_dolfinx.template(cell_type), metadata={"quadrature_degree": 2})(LOADED)


def as_tractions(scene: Scene) -> tuple[Load, ...]:
    """Return the scene's loads with every resultant spread over the present area of its surface."""
    return tuple(_spread(scene, load) if isinstance(load, TotalForce) else load for load in scene.loads)


def _spread(scene: Scene, load: TotalForce) -> Traction:
    facets = scene.facets(Surface(load.body, load.surface))
    area = float(quadrature_areas(scene.bodies[load.body].mesh.points, facets).sum())
    x, y, z = (component / area for component in load.value)
    return Traction(load.body, load.surface, (x, y, z))
