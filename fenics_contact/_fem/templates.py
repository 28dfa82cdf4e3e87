"""Compiled forms with their constants and coefficients, and the integration measures."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Hashable, Mapping, Sequence
from copy import copy
from dataclasses import replace

import numpy as np
import ufl
from ufl.algorithms.analysis import extract_type
from ufl.constantvalue import FloatValue
from ufl.core.expr import Expr

from fenics_contact import _dolfinx
from fenics_contact._base.fingerprint import require_alike
from fenics_contact._base.libraries import MPI
from fenics_contact._base.requirements import check_compiler
from fenics_contact._kinematics.element import Element
from fenics_contact._kinematics.integration import FULL
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.errors.ranks import on_root_then_bcast
from fenics_contact.materials.laminate import Intervals
from fenics_contact.mesh.cell_types import quadrature, shape_values
from fenics_contact.mesh.quality import jacobians

#: Gauss rule of the volume by shape: two points per direction on tensor-product cells, one on simplices suit
#: linear elasticity; quadratic cells get twice the degree.
QUADRATURE_DEGREE = {"hexahedron": 2, "tetrahedron": 1, "quadrilateral": 2, "triangle": 1}
#: Tag of every loaded surface inside a load form.
LOADED = 1

#: UFL constants on a template; numbers are given for them later.
Constants = tuple[ufl.Constant, ...]
#: A form, its constants and its coefficients.
Written = tuple[ufl.Form, Sequence[ufl.Constant], Sequence[ufl.Coefficient]]


class Template:
    """A compiled form, its constants and its coefficients."""

    def __init__(
        self,
        comm: MPI.Comm,
        form: ufl.Form,
        constants: Sequence[ufl.Constant],
        coefficients: Sequence[ufl.Coefficient] = (),
    ) -> None:
        """Compile ``form``. Collective on ``comm``."""
        self._form = _dolfinx.CompiledForm(comm, form)
        self._written = form
        self._constants, self._coefficients = tuple(constants), tuple(coefficients)

    @property
    def signature(self) -> str:
        """What forms have in common that differ in their symbols alone."""
        return str(self._written.signature())

    def mentions(self, kind: type) -> bool:
        """Return whether the form contains a UFL symbol of a given type."""
        return bool(extract_type(self._written, kind))

    def bind(
        self,
        spaces: Sequence[_dolfinx.fem.FunctionSpace],
        values: Sequence[float],
        functions: Sequence[_dolfinx.fem.Function] = (),
        facets: tuple[np.ndarray, np.ndarray] | None = None,
        mesh: _dolfinx.mesh.Mesh | None = None,
        cells: Mapping[int, np.ndarray] | None = None,
    ) -> _dolfinx.fem.Form:
        """Return the form on one mesh, with values for its constants and Functions for its coefficients."""
        mesh = spaces[0].mesh if mesh is None else mesh
        constants = {
            symbol: _dolfinx.fem.Constant(mesh, np.float64(value))
            for symbol, value in zip(self._constants, values, strict=True)
        }
        coefficients = dict(zip(self._coefficients, functions, strict=True))
        tagged = None if facets is None else {LOADED: facets}
        return self._form.bind(mesh, spaces, coefficients, constants, tagged, cells=cells)


class Templates:
    """Compiled forms by key; identical forms of different keys are compiled once.

    A key contains everything on which a form depends. Keys of two materials of one class differ, but mostly
    not their forms: only values of constants do, which are bound later.
    """

    def __init__(self, comm: MPI.Comm) -> None:
        """Start empty."""
        self._comm = comm
        self._by_key: dict[Hashable, Template] = {}
        self._by_text: dict[Hashable, Template] = {}
        self._names: list[tuple[object, ...]] = []

    @property
    def names(self) -> tuple[tuple[object, ...], ...]:
        """Names of the compiled forms, in order."""
        return tuple(self._names)

    def __getitem__(self, key: Hashable) -> Template:
        """Return the template prepared under ``key``."""
        return self._by_key[key]

    def __contains__(self, key: Hashable) -> bool:
        return key in self._by_key

    def get(self, key: Hashable, name: tuple[object, ...], write: Callable[[], Written]) -> Template:
        """Return the template under ``key``. Collective when it is new, on all ranks or on none."""
        if key not in self._by_key:
            what = f"the form of {', '.join(map(_called, name))}"
            with together(self._comm):
                form, constants, coefficients = write()
                _check_numbers(form, what)
                text = _text(form, constants, coefficients)
            require_alike(self._comm, {what: hashlib.sha256(repr(text).encode()).hexdigest()[:16]})
            if text not in self._by_text:
                self._by_text[text] = self._compiled(what, form, constants, coefficients)
                self._names.append(name)
            self._by_key[key] = self._by_text[text]
        return self._by_key[key]

    def _compiled(
        self,
        what: str,
        form: ufl.Form,
        constants: Sequence[ufl.Constant],
        coefficients: Sequence[ufl.Coefficient],
    ) -> Template:
        try:
            return Template(self._comm, form, constants, coefficients)
        except Exception as error:  # on all ranks
            on_root_then_bcast(self._comm, check_compiler)
            raise InvalidInputError(
                f"{what} must be UFL that compiles, got {type(error).__name__}: {error}: check quotients, "
                "roots and logarithms at F = I, and that ~/.cache/fenics or $XDG_CACHE_HOME can be written"
            ) from error


def _check_numbers(form: ufl.Form, what: str) -> None:
    """Reject non-finite numbers in a form."""
    bad = [number for number in extract_type(form, FloatValue) if not np.isfinite(float(number))]
    if bad:
        raise InvalidInputError(
            f"numbers in UFL must be finite, got {float(bad[0])} in {what}: check its constants"
        )


def _called(part: object) -> str:
    return part.__name__ if isinstance(part, type) else str(part)


def _text(
    form: ufl.Form, constants: Sequence[ufl.Constant], coefficients: Sequence[ufl.Coefficient]
) -> Hashable:
    """Return the key that two forms share if one can replace the other."""
    used = form.constants(), form.coefficients()
    places = tuple(
        tuple(symbol in mine for symbol in symbols)
        for symbols, mine in zip((constants, coefficients), used, strict=True)
    )
    return form.signature(), places


def scalar_constants(element: Element, count: int) -> Constants:
    """Return ``count`` UFL constants on the template."""
    return tuple(element.constant() for _ in range(count))


def volume_measure(element: Element, degree: int | None = None) -> ufl.Measure:
    """Return dx on the template with the package's quadrature degree, or the given one.

    The given one is for linear cells; it is doubled on quadratic ones that are not reduced.
    """
    metadata = {"quadrature_degree": quadrature_degree(element, degree)}
    return ufl.dx(domain=element.template, metadata=metadata)


def stiffness_measure(element: Element, intervals: Intervals = ()) -> ufl.Measure:
    """Return dx on the template with the points at which stiffnesses are evaluated, of plies by intervals."""
    degree, order = quadrature_degree(element), element.cell.order
    return ufl.dx(domain=element.template, metadata=element.integration.metadata(degree, order, intervals))


def stiffness_form(form: ufl.Form, element: Element) -> ufl.Form:
    """Return a stiffness by the integration of an element."""
    degree = quadrature_degree(replace(element, integration=FULL))

    def in_full(form: ufl.Form) -> ufl.Form:
        of_plies = [integral.metadata().get("intervals", ()) for integral in form.integrals()]
        whole = [FULL.metadata(degree, element.cell.order, where) for where in of_plies]
        parts = zip(form.integrals(), whole, strict=True)
        return ufl.Form([integral.reconstruct(metadata=metadata) for integral, metadata in parts])

    return element.integration.stiffness(form, in_full)


def quadrature_degree(element: Element, degree: int | None = None) -> int:
    """Return the degree of the package's quadrature on cells, or of that given for linear ones."""
    if degree is None:
        degree = max(QUADRATURE_DEGREE[element.cell.shape_name], element.kinematics.least_degree)
    return element.integration.degree(degree, element.cell.order)


def surface_measure(element: Element) -> ufl.Measure:
    """Return ds of the loaded surface on the template."""
    degree = 2 * element.cell.order
    return ufl.ds(domain=element.template, metadata={"quadrature_degree": degree})(LOADED)


#: Cells with a dilatation that is linear in each; it is constant in all others. Hexahedra and quadrilaterals
#: of 27 and 9 nodes are stable with it, and as accurate as they can be (Q2/P1 discontinuous). Quadratic
#: simplices are not: at their Gauss points it would be the dilatation itself.
LINEAR = ("quadrilateral9", "hexahedron27")
#: Cells in which deformations without change of shape have a dilatation of mean zero, which is not projected
#: away: u = 2 (b·x) x − |x|² b.
UNSEEN = ("tetrahedron10",)


def polynomial_size(element: Element) -> int:
    """Return the number of coefficients of a polynomial: one, or one more than the dimension."""
    return 1 + element.dim if element.cells in LINEAR else 1


class CellPolynomials:
    """The polynomials 1, or 1 and X − X_c, in cells c with centres X_c, and projections by the Gauss rule.

    References:
        D. Boffi, L. Gastaldi, On the quadrilateral Q2-P1 element for the Stokes problem, Int. J. Numer.
        Methods Fluids 39 (2002) 1001-1011: polynomials of the coordinates in space keep the order on
        distorted cells, those of reference coordinates do not.
    """

    def __init__(self, points: np.ndarray, cells: np.ndarray, element: Element) -> None:
        """Evaluate them at the Gauss points."""
        cell = element.cell
        positions, weights = quadrature(cell, quadrature_degree(element))
        jacobian = jacobians(points, cells, positions)
        self.weights = np.broadcast_to(jacobian, (len(cells), len(weights))) * weights
        places = shape_values(cell, positions) @ points[cells]
        self.weights = element.kinematics.measure.around(places[..., 0]) * self.weights
        self.centres = np.einsum("cq,cqd->cd", self.weights, places) / self.weights.sum(axis=1)[:, None]
        linear = (places - self.centres[:, None])[..., : polynomial_size(element) - 1]
        self.values = np.concatenate([np.ones((*self.weights.shape, 1)), linear], axis=2)
        #: Inverse of ∫ ψ_i ψ_j, shape (n_cells, n, n).
        self.inverse = np.linalg.inv(self.values.swapaxes(1, 2) @ (self.weights[..., None] * self.values))

    def of(self, cells: np.ndarray) -> CellPolynomials:
        """Return those of some cells."""
        part = copy(self)
        for name, array in vars(self).items():
            setattr(part, name, array[cells])
        return part

    def coefficients(self, given: np.ndarray) -> np.ndarray:
        """Return the coefficients of the projections of values at Gauss points."""
        return np.asarray(self.inverse @ (self.values.swapaxes(1, 2) @ (self.weights[..., None] * given)))

    def projected(self, given: np.ndarray) -> np.ndarray:
        """Return the projections of values at Gauss points, shape (n_cells, n_gauss, k)."""
        return np.asarray(self.values @ self.coefficients(given))

    def at(self, coefficients: np.ndarray) -> np.ndarray:
        """Return the values at Gauss points by coefficients (n_cells, n), shape (n_cells, n_gauss)."""
        return np.asarray((self.values @ coefficients[..., None])[..., 0])


def polynomial(coefficients: Expr, centre: Expr, element: Element) -> Expr:
    """Return a polynomial on the template."""
    if element.cells not in LINEAR:
        return coefficients
    x = element.x
    slopes = (coefficients[1 + i] * (x[i] - centre[i]) for i in range(len(x)))
    return coefficients[0] + sum(slopes)


def coefficient_shape(element: Element) -> tuple[int, ...]:
    """Return the shape of a polynomial's coefficients in one cell."""
    return (polynomial_size(element),) if element.cells in LINEAR else ()
