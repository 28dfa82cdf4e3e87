"""Compiled forms with their constants and coefficients, and the integration measures."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Hashable, Mapping, Sequence

import numpy as np
import ufl
from ufl.algorithms.analysis import extract_type
from ufl.constantvalue import FloatValue

from fenics_contact import _dolfinx
from fenics_contact._libraries import MPI
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.fingerprint import require_alike

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
        """Return the form on one mesh, with values for its constants and Functions for its coefficients.

        Args:
            spaces: Spaces of its arguments.
            values: Values of its constants.
            functions: Functions for its coefficients.
            facets: (cells, local facets) of its surface integral.
            mesh: The mesh, where there are no arguments.
            cells: Cells of its tagged volume integrals by tag.
        """
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
        """Return the template under ``key``. Collective when it is new, on all ranks or on none.

        Args:
            key: Everything on which the form depends.
            name: Its name among `names`.
            write: Returns form, constants and coefficients.

        Raises:
            InvalidInputError: If ranks write different forms, a number in it is not finite, or it cannot be
                compiled.
        """
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
            raise InvalidInputError(
                f"{what} must be UFL that compiles, got {type(error).__name__}: {error}: check quotients, "
                "roots and logarithms in it, also at rest (F = I), that the C compiler works, and that the "
                "directory of compiled forms, $XDG_CACHE_HOME/fenics or ~/.cache/fenics, can be written"
            ) from error


def _check_numbers(form: ufl.Form, what: str) -> None:
    """Reject non-finite numbers in a form."""
    bad = [number for number in extract_type(form, FloatValue) if not np.isfinite(float(number))]
    if bad:
        raise InvalidInputError(
            f"numbers in UFL must be finite, got {float(bad[0])} in {what}: check what stresses, energies "
            "and loads in UFL are made of"
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


def scalar_constants(cell_type: str, count: int) -> Constants:
    """Return ``count`` UFL constants on the template."""
    return tuple(_dolfinx.constant_symbol(cell_type) for _ in range(count))


def volume_measure(cell_type: str, degree: int | None = None) -> ufl.Measure:
    """Return dx on the template with the package's quadrature degree, or the given one.

    The given one is for linear cells; it is doubled on quadratic ones.
    """
    metadata = {"quadrature_degree": quadrature_degree(cell_type, degree)}
    return ufl.dx(domain=_dolfinx.template(cell_type), metadata=metadata)


def quadrature_degree(cell_type: str, degree: int | None = None) -> int:
    """Return the degree of the package's quadrature on cells, or of that given for linear ones."""
    linear = QUADRATURE_DEGREE[_dolfinx.shape(cell_type)] if degree is None else degree
    return int(linear * _dolfinx.degree(cell_type))


def surface_measure(cell_type: str) -> ufl.Measure:
    """Return ds of the loaded surface on the template."""
    degree = 2 * _dolfinx.degree(cell_type)
    return ufl.ds(domain=_dolfinx.template(cell_type), metadata={"quadrature_degree": degree})(LOADED)
