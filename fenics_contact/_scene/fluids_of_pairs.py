"""Fluids that several contact pairs share, and their pressures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import chain

from fenics_contact._scene.checks import check_known
from fenics_contact._scene.pairs import ContactPair
from fenics_contact.errors import InvalidInputError


def pressures_of(pairs: Iterable[ContactPair]) -> dict[str, float]:
    """Return the pressure of each fluid by its name, [force / length²].

    Raises:
        InvalidInputError: If a fluid has two.
    """
    found: dict[str, float] = {}
    for fluid in chain.from_iterable(pair.fluids for pair in pairs):
        if found.setdefault(fluid.name, fluid.pressure) != fluid.pressure:
            raise InvalidInputError(
                f"fluid {fluid.name!r} must have one pressure at all inlets, got {found[fluid.name]:g} "
                f"and {fluid.pressure:g}: give different fluids different names"
            )
    return found


def with_pressures(pairs: Iterable[ContactPair], given: Mapping[str, float]) -> tuple[ContactPair, ...]:
    """Return the pairs with other pressures of some fluids, by name; others keep theirs.

    Raises:
        InvalidInputError: If there is no such fluid, or a pressure is negative.
    """
    pairs = tuple(pairs)
    known = pressures_of(pairs)
    for name in sorted(given):
        words = f"LoadStep.fluids names {name!r}, the contact pairs of the scene have"
        check_known(name, known, words, "use one of them, or give a pair this fluid")
    return tuple(
        replace(pair, fluid=replace(*changed, pressure=given[changed[0].name])) if changed else pair
        for pair in pairs
        for changed in ([fluid for fluid in pair.fluids if fluid.name in given],)
    )
