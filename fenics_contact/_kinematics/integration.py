"""Quadrature of cells: full, or reduced to the points of linear ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

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

    At sections of bodies that are one cell across, reduced integration leaves motions without energy, which
    no other cells resist: they get some by a share of full integration. `share`: of full integration;
    stresses change by about as much.
    """

    share: float = 1e-6
    name = "reduced, stabilised"

    def stiffness(self, form: ufl.Form, in_full: Callable[[ufl.Form], ufl.Form]) -> ufl.Form:
        """Return the stiffness with its share of full integration."""
        return (1.0 - self.share) * form + self.share * in_full(form)


FULL = Integration()


def integration_of(name: str, cuts: object) -> Integration:
    """Return the integration called "full" or "reduced"; `cuts`: where a section may be one cell across."""
    if name == "full":
        return FULL
    return Stabilised() if cuts else Reduced()
