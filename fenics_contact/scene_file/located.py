"""Errors of values of a scene file, referred to their keys."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from fenics_contact.errors import InvalidInputError
from fenics_contact.scene_file.mistakes import Mistake, SceneFileError
from fenics_contact.scene_file.places import Path, written
from fenics_contact.scene_file.source import Source


@contextmanager
def located(source: Source, path: Path, mistakes: list[Mistake] | None = None) -> Iterator[None]:
    """Make an error of the block a mistake at a key.

    Args:
        source: Source of the key.
        path: The key.
        mistakes: Collects the mistake, which is raised unless given.
    """
    try:
        yield
    except SceneFileError as error:
        if mistakes is None:
            raise
        mistakes.extend(error.mistakes)
    except InvalidInputError as error:
        mistake = source.mistake(path, f"{written(path)}: {error}")
        if mistakes is None:
            raise SceneFileError(source.name, [mistake]) from error
        mistakes.append(mistake)
