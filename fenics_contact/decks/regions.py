"""Parts of sections: what a deck loads, or gives a state, on some elements of a section alone."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from fenics_contact.readers.deck_bodies import Component, Section, regions_of
from fenics_contact.readers.deck_mesh import DeckMesh


def split_sections(
    mesh: DeckMesh,
    sections: Sequence[Section],
    of_element: np.ndarray,
    parts: Sequence[Component],
    sets: Iterable[tuple[str, np.ndarray]],
) -> tuple[DeckMesh, list[Section], np.ndarray, list[Component]]:
    """Cut sections of bodies that sets of elements have a part of, so that each is in a set or is not.

    `sets`: names, which parts of sections get behind their own, and elements.

    Returns the mesh with sets of the new sections, the sections, that of each element, and the bodies.
    """
    found, of_element, parts = list(sections), of_element.copy(), list(parts)
    new: dict[str, np.ndarray] = {}
    for label, elements in sets:
        inside = np.zeros(len(of_element), dtype=bool)
        inside[elements] = True
        for place, part in enumerate(parts):
            for number in part.sections:
                mine = part.elements[of_element[part.elements] == number]
                if inside[mine].all() or not inside[mine].any():
                    continue
                name = _free(f"{found[number].name}_{label}", {*mesh.element_sets, *new})
                new[name] = mine[inside[mine]]
                of_element[new[name]] = len(found)
                parts[place] = replace(parts[place], sections=[*parts[place].sections, len(found)])
                found.append(replace(found[number], name=name))
    if new:
        mesh = replace(mesh, element_sets={**mesh.element_sets, **new})
    return mesh, found, of_element, parts


def _free(name: str, taken: set[str]) -> str:
    return next(n for n in (name, *(f"{name}_{k}" for k in range(2, len(taken) + 3))) if n not in taken)


def region_names(sections: Sequence[Section], part: Component) -> dict[int, str | None]:
    """Return the names of a body's regions by the numbers of its sections, None where there is only one."""
    names = regions_of(sections, part)
    if len(names) == 1:
        return {part.sections[0]: None}
    return dict(zip(part.sections, names, strict=True))
