"""Small-strain elasticity with constants that depend on the temperature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.elastic import check_isotropic
from fenics_contact.materials.plastic import HistoryMaterial, MaterialResponse

#: A constant: a number, or pairs of a temperature and the value there.
ByTemperature: TypeAlias = float | tuple[tuple[float, float], ...]
_ONE = np.eye(3)
#: I ⊗ I and the identity of symmetric tensors: isotropic stiffness is λ times one plus 2 G times the other.
_VOLUME = np.einsum("ij,kl->ijkl", _ONE, _ONE)
_SYMMETRIC = 0.5 * (np.einsum("ik,jl->ijkl", _ONE, _ONE) + np.einsum("il,jk->ijkl", _ONE, _ONE))


@dataclass(frozen=True)
@checked("young_modulus", "poisson_ratio", "mean_expansion")
class TemperatureDependentElasticity(HistoryMaterial):
    """Isotropic elasticity with constants that follow the temperature, σ = C(T) : (ε(u) − ε_th(T) I).

    T is the initial temperature and what `ThermalStrain` adds to it at each point. Constants are numbers, or
    pairs of a temperature and the value there: straight between them, constant beyond. Stress depends on
    temperature and strain alone, not on the way there. Bodies are in space, of revolution or in plane strain;
    load steps are solved as those of nonlinear materials are, without contact in one Newton step.

    Attributes:
        young_modulus: Young's modulus E > 0, [force / length²].
        poisson_ratio: Poisson's ratio ν in (−1, 0.5), dimensionless.
        mean_expansion: Mean thermal expansion α(T) from the temperature `expansion_from` on, strain per
            degree: ε_th = α(T) (T − T_z) − α(T₀) (T₀ − T_z), as in data sheets and codes. None for a
            body without thermal strain.
        initial_temperature: T₀, at which the body is free of stress, in degrees.
        expansion_from: T_z, to which the table of expansions refers, in degrees.

    Example:
        Steel at 20 °C, as EN 1993-1-2 softens it:

        >>> steel = TemperatureDependentElasticity(
        ...     ((20.0, 2.1e5), (100.0, 2.1e5), (500.0, 1.26e5)), 0.3,
        ...     ((20.0, 1.22e-5), (500.0, 1.42e-5)), initial_temperature=20.0, expansion_from=20.0,
        ... )
        >>> float(steel.free_strain(np.array([480.0]))[0].round(6))
        0.006816
    """

    young_modulus: ByTemperature
    poisson_ratio: ByTemperature
    mean_expansion: ByTemperature | None = None
    initial_temperature: float = 0.0
    expansion_from: float = 0.0

    history_size = 0

    def __post_init__(self) -> None:
        """Reject tables out of order, and constants for which the strain energy is not positive."""
        for name in ("young_modulus", "poisson_ratio", "mean_expansion"):
            given = getattr(self, name)
            if given is not None:
                object.__setattr__(self, name, _table(name, given))
        for young in _values(self.young_modulus):
            for poisson in _values(self.poisson_ratio):
                check_isotropic(young, poisson, None)
        for name in ("initial_temperature", "expansion_from"):
            if not np.isfinite(getattr(self, name)):
                raise InvalidInputError(f"{name} must be finite, got {getattr(self, name)!r}: give degrees")

    @property
    def at_rest(self) -> tuple[float, float]:
        """E and ν at the initial temperature."""
        start = np.array(self.initial_temperature)
        return float(_at(self.young_modulus, start)), float(_at(self.poisson_ratio, start))

    @property
    def expands(self) -> bool:
        """Yes: temperatures strain it."""
        return True

    def free_strain(self, change: np.ndarray) -> np.ndarray:
        """Return ε_th at changes of temperature, of the same shape."""
        if self.mean_expansion is None:
            return np.zeros_like(change)
        start, zero = self.initial_temperature, self.expansion_from
        now = start + change
        before = float(_at(self.mean_expansion, np.array(start))) * (start - zero)
        return np.asarray(_at(self.mean_expansion, now) * (now - zero) - before)

    def respond(self, gradient: np.ndarray, history: np.ndarray, duration: float) -> MaterialResponse:
        """Return the stress at the initial temperature; see `HistoryMaterial.respond`."""
        return self.respond_at(gradient, history, duration, np.zeros(len(gradient)))

    def respond_at(
        self, gradient: np.ndarray, history: np.ndarray, duration: float, change: np.ndarray
    ) -> MaterialResponse:
        """Return stress and stiffness at changes of temperature; see `HistoryMaterial.respond_at`."""
        now = self.initial_temperature + change
        young, poisson = _at(self.young_modulus, now), _at(self.poisson_ratio, now)
        shear = (young / (2 * (1 + poisson)))[:, None, None]
        lame = (young * poisson / ((1 + poisson) * (1 - 2 * poisson)))[:, None, None]
        strain = 0.5 * (gradient + gradient.swapaxes(1, 2)) - self.free_strain(change)[:, None, None] * _ONE
        stress = lame * np.trace(strain, axis1=1, axis2=2)[:, None, None] * _ONE + 2 * shear * strain
        tangent = lame[..., None, None] * _VOLUME + 2 * shear[..., None, None] * _SYMMETRIC
        return MaterialResponse(stress, tangent, history)


def _table(name: str, given: ByTemperature) -> ByTemperature:
    """Return a number, or pairs with ascending temperatures."""
    if isinstance(given, int | float | np.number) and not isinstance(given, bool) and np.isfinite(given):
        return float(given)
    try:
        pairs = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        pairs = np.zeros(0)
    good = pairs.ndim == 2 and pairs.shape[1:] == (2,) and len(pairs) and np.isfinite(pairs).all()
    if not good or (np.diff(pairs[:, 0]) <= 0).any():
        raise InvalidInputError(
            f"{name} must be a finite number, or pairs with ascending temperatures, got {given!r}: correct it"
        )
    return tuple((float(temperature), float(value)) for temperature, value in pairs)


def _values(given: ByTemperature) -> Sequence[float]:
    return [given] if isinstance(given, float) else [value for _, value in given]


def _at(given: ByTemperature, temperature: np.ndarray) -> np.ndarray:
    """Return a constant at temperatures."""
    if isinstance(given, float):
        return np.full(temperature.shape, given)
    table = np.array(given)
    return np.interp(temperature, table[:, 0], table[:, 1])
