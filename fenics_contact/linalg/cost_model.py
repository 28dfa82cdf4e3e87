"""Cost model for sparse factors and dense matrices of a subdomain, from measured rates.

The choice depends only on sizes, not on timings, so that a run is reproducible. `python -m benchmarks.prices`
repeats the measurements and compares them with the predictions.
"""

from __future__ import annotations

from dataclasses import dataclass

#: Products that a factored subdomain is expected to serve: a state with friction, and its adjoint.
PRODUCTS = 100


@dataclass(frozen=True)
class Rates:
    """Rates of one core with OpenBLAS, other cores idle, caches cold.

    Attributes:
        factor: Seconds to factor a sparse matrix of n dofs of a solid, divided by n^1.37.
        substitution: Seconds for forward and backward substitution, divided by n^1.3.
        condensation: Time to form a Schur complement relative to that of factoring the whole matrix.
        dense: Floating point operations per second of a dense factorisation and inversion.
        stream: Bytes per second that the product with a packed triangle reads.
    """

    factor: float = 0.75e-6
    substitution: float = 2.8e-8
    condensation: float = 1.0
    dense: float = 30e9
    stream: float = 15e9


#: Bytes of a sparse factor of n dofs of a solid, divided by n^1.5.
FACTOR_BYTES = 29.0
#: Bytes of the two packed triangles of dense operators, divided by the square of the interface dofs.
TRIANGLE_BYTES = 6.0
#: Rates measured as `Rates` describes.
MEASURED = Rates()


@dataclass(frozen=True)
class LocalCost:
    """Cost of one subdomain.

    Attributes:
        setup: Seconds to factor it.
        product: Seconds to apply K⁺ and S once each on the interface.
    """

    setup: float
    product: float

    def total(self, products: int) -> float:
        """Return the seconds of the set-up and of a number of products."""
        return self.setup + products * self.product


def implicit_cost(size: int, interface: int, rates: Rates = MEASURED) -> LocalCost:
    """Predict the cost of sparse factors of a subdomain with ``size`` dofs, ``interface`` of them shared."""
    blocks = (size, size - interface)
    return LocalCost(
        rates.factor * sum(n**1.37 for n in blocks), rates.substitution * sum(n**1.3 for n in blocks)
    )


def explicit_cost(size: int, interface: int, rates: Rates = MEASURED) -> LocalCost:
    """Predict the cost of dense interface matrices of a subdomain."""
    sparse = rates.condensation * size**1.37 + (size - interface) ** 1.37
    # K⁺ in double precision and S in single, each a triangle.
    triangles = (4 + 2) * interface**2
    return LocalCost(rates.factor * sparse + interface**3 / rates.dense, triangles / rates.stream)


def prefers_explicit(size: int, interface: int, *, products: int = PRODUCTS, rates: Rates = MEASURED) -> bool:
    """Return whether dense interface matrices are expected to be faster than sparse factors.

    Args:
        size: Dofs of the subdomain.
        interface: Dofs that B touches.
        products: Expected number of products with the dual operator, and with the preconditioner.
        rates: Rates of the machine.

    Example:
        >>> prefers_explicit(2079, 729), prefers_explicit(10125, 3534)
        (True, False)
    """
    explicit, implicit = _totals(size, interface, products, rates)
    return explicit < implicit


def expected_seconds(size: int, interface: int) -> float:
    """Return the cost of a subdomain stored in the cheaper way; arguments as for `prefers_explicit`."""
    return min(_totals(size, interface, PRODUCTS, MEASURED))


def expected_bytes(size: int, interface: int) -> float:
    """Return the memory of a factored subdomain stored in the cheaper way; arguments as above."""
    if prefers_explicit(size, interface):
        return TRIANGLE_BYTES * interface**2 + FACTOR_BYTES * (size - interface) ** 1.5
    return FACTOR_BYTES * (size**1.5 + (size - interface) ** 1.5)


def _totals(size: int, interface: int, products: int, rates: Rates) -> tuple[float, float]:
    """Return the seconds of the explicit and of the implicit way."""
    explicit, implicit = (cost(size, interface, rates) for cost in (explicit_cost, implicit_cost))
    return explicit.total(products), implicit.total(products)
