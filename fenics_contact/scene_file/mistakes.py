"""Mistakes in scene files: where they are, what is allowed, what was given."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches

from fenics_contact.errors import InvalidInputError
from fenics_contact.scene_file.places import Path

#: Largest number of mistakes in a message.
MOST_LISTED = 50


@dataclass(frozen=True)
class Mistake:
    """One mistake.

    Attributes:
        path: Path of keys.
        line: Line of the file, from 1; 0 where there is none.
        place: Name of the place in messages: "line 12", "--set solver.tolerance", "" for a dictionary.
        words: What is needed, what was given, what to do.
    """

    path: Path
    line: int
    place: str
    words: str

    def __str__(self) -> str:
        """Return place and words."""
        return f"{self.place}: {self.words}" if self.place else self.words


class SceneFileError(InvalidInputError):
    """A scene file cannot be used; all mistakes are listed, the first fifty in the message.

    Attributes:
        mistakes: The mistakes in the order of their lines.
    """

    def __init__(self, name: str, mistakes: Iterable[Mistake] | str = ()) -> None:
        """Build the message from the mistakes.

        Args:
            name: Name of the file; or the whole message if there are no mistakes.
            mistakes: The mistakes.
        """
        ordered = (
            () if isinstance(mistakes, str) else tuple(sorted(mistakes, key=lambda mistake: mistake.line))
        )
        self.mistakes: tuple[Mistake, ...] = ordered
        if not ordered:
            super().__init__(name)
        elif len(ordered) == 1:
            super().__init__(f"{name}, {ordered[0]}" if ordered[0].place else f"{name}: {ordered[0]}")
        else:
            lines = "".join(f"\n  {mistake}" for mistake in ordered[:MOST_LISTED])
            more = f"\n  and {len(ordered) - MOST_LISTED} more" if len(ordered) > MOST_LISTED else ""
            super().__init__(f"{name} has {len(ordered)} mistakes:{lines}{more}")


def suggestion(given: str, allowed: Iterable[str]) -> str:
    """Return "did you mean ...? " if an allowed name is close to the one given, else ""."""
    close = get_close_matches(given, list(allowed), n=1, cutoff=0.6)
    return f"did you mean {close[0]!r}? " if close else ""


def listed(names: Iterable[str]) -> str:
    """Return a list of names in quotes; "none" for no name."""
    return ", ".join(repr(name) for name in names) or "none"
