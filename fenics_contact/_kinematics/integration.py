"""Quadrature of cells: full, or reduced to the points of linear ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import ufl


@dataclass(frozen=True)
class Integration:
    """Full integration: quadratic cells get twice the degree of linear ones."""

    name = ""
    #: Whether single cells deform without energy in more ways than their material does.
    has_hourglasses = False

    def degree(self, linear: int, order: int) -> int:
        """Return the degree of the quadrature by that of linear cells and the order of the cells."""
        return linear * order

    def metadata(
        self, degree: int, order: int, intervals: tuple[tuple[float, float], ...] = ()
    ) -> dict[str, Any]:
        """Return where a stiffness is evaluated, for UFL.

        Args:
            degree: Of other integrals on the cells.
            order: Of the cells.
            intervals: Parts of the third direction, from 0 to 1, in each of which two points lie; whole cells
                where there are none.
        """
        if not intervals:
            return {"quadrature_degree": degree}
        line = _gauss(degree // 2 + 1)
        flat = tuple((x, y, a * b) for x, a in line for y, b in line)
        return _custom(degree, flat, _within(intervals, _gauss(2)), intervals)

    def stiffness(self, form: ufl.Form, in_full: Callable[[ufl.Form], ufl.Form]) -> ufl.Form:
        """Return a stiffness (UFL) by this integration, of one that has its degree.

        `in_full`: returns a form in full integration.
        """
        return form


@dataclass(frozen=True)
class Reduced(Integration):
    """Quadratic cells by the points of linear ones."""

    name = "reduced"
    has_hourglasses = True

    def degree(self, linear: int, order: int) -> int:
        """Return the degree of linear cells."""
        return linear


@dataclass(frozen=True)
class Stabilised(Reduced):
    """Reduced integration with a small share of full integration.

    Where bodies are one cell across, reduced integration leaves motions without energy, which no other cells
    resist: they get some by a share of full integration. `share`: of full integration; where the motions are
    those of a section alone, `AT_SECTIONS`, much less is enough.

    A plate under another one needs 188 products with 1e-3, 516 with 1e-4 and 3861 with 1e-6, for the same
    deflection to four digits; with 1e-2 a cylinder pinched on 16 x 16 cells is 0.5 % stiffer.
    """

    share: float = 1e-3
    name = "reduced, stabilised"

    def stiffness(self, form: ufl.Form, in_full: Callable[[ufl.Form], ufl.Form]) -> ufl.Form:
        """Return the stiffness with its share of full integration."""
        return (1.0 - self.share) * form + self.share * in_full(form)


@dataclass(frozen=True)
class OfPrisms(Integration):
    """Prisms by 9 points, linear ones by 2, as in CalculiX: of the least degree that holds all their motions.

    A prism is a hexahedron with an edge at y = 1 of no length, see `mesh.collapsed`: positions are those in
    the cube, weights those in the prism over 1 − y, the Jacobian of that map.
    """

    name = "reduced prisms"
    has_hourglasses = True  # of hexahedra

    def metadata(
        self, degree: int, order: int, intervals: tuple[tuple[float, float], ...] = ()
    ) -> dict[str, Any]:
        """Return where a stiffness is evaluated; see `Integration.metadata`."""
        at = ((1 / 6, 1 / 6), (2 / 3, 1 / 6), (1 / 6, 2 / 3)) if order == 2 else ((1 / 3, 1 / 3),)
        flat = tuple((x / (1 - y), y, 0.5 / len(at) / (1 - y)) for x, y in at)
        line = _within(intervals or ((0.0, 1.0),), _gauss(2 if intervals else order + 1))
        return _custom(degree, flat, line, intervals)


@dataclass(frozen=True)
class AlongRows(Reduced):
    """Two points along the first direction of cells, and five in the others, for rows of single cells.

    Rows do not lock as they bend along the first direction, and their sections do not deform without energy.
    Loads and stresses are by the points of reduced integration. The five are Kronrod's extension of Gauss's
    two, as in CalculiX: in round sections three bend 0.7 % too much.
    """

    name = "reduced along rows"
    has_hourglasses = False

    def metadata(
        self, degree: int, order: int, intervals: tuple[tuple[float, float], ...] = ()
    ) -> dict[str, Any]:
        """Return where a stiffness is evaluated; see `Integration.metadata`."""
        places = 0.0, 3.0**-0.5, -(3.0**-0.5), (6 / 7) ** 0.5, -((6 / 7) ** 0.5)
        weights = 28 / 45, 27 / 55, 27 / 55, 98 / 495, 98 / 495
        across = tuple((0.5 + 0.5 * y, 0.5 * b) for y, b in zip(places, weights, strict=True))
        return _custom(degree, tuple((x, y, a * b) for x, a in _gauss(2) for y, b in across), across)


def _gauss(count: int) -> tuple[tuple[float, float], ...]:
    """Return Gauss points on [0, 1] and their weights."""
    places, weights = np.polynomial.legendre.leggauss(count)
    return tuple(zip((0.5 + 0.5 * places).tolist(), (0.5 * weights).tolist(), strict=True))


def _within(
    intervals: tuple[tuple[float, float], ...], line: tuple[tuple[float, float], ...]
) -> tuple[tuple[float, float], ...]:
    """Return points and weights in each of some intervals by those on [0, 1]."""
    return tuple((low + (high - low) * z, (high - low) * w) for low, high in intervals for z, w in line)


@cache
def _custom(
    degree: int,
    flat: tuple[tuple[float, float, float], ...],
    line: tuple[tuple[float, float], ...],
    intervals: tuple[tuple[float, float], ...] = (),
) -> dict[str, Any]:
    """Return points and weights in the first two directions times those in the third one.

    Tuples are those of all their digits in UFL's signatures, arrays are not.
    """
    return {
        "quadrature_rule": "custom",
        "quadrature_degree": degree,
        "intervals": intervals,
        "quadrature_points": tuple((x, y, z) for x, y, _ in flat for z, _ in line),
        "quadrature_weights": tuple(a * b for *_, a in flat for _, b in line),
    }


FULL = Integration()
REDUCED = Reduced()
STABILISED = Stabilised()
OF_PRISMS = OfPrisms()
AT_SECTIONS = Stabilised(1e-6)
ALONG_ROWS = AlongRows()
