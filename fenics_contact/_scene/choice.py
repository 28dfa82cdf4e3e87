"""What a scene chose for a pair that asks for the best, and why."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Choice:
    """The discretisation that a scene chose.

    Attributes:
        found: It, empty where none was chosen.
        why: In words.
        exchanged: Whether slave and master were exchanged.
        stays: Whether other meshes do not change it.
    """

    found: str = ""
    why: str = ""
    exchanged: bool = False
    stays: bool = False


#: What is added where slave and master were exchanged.
EXCHANGED = "; slave and master are exchanged, as a corner or an edge of this slave touches first"
#: Of pairs whose discretisation is given.
NO_CHOICE = Choice()


class Chosen:
    """A pair whose discretisation is given, or was chosen by its scene.

    Attributes:
        discretisation: What it is.
        choice: What the scene chose; another discretisation was given in its place where they differ.
    """

    discretisation: str
    choice: Choice

    @property
    def reason(self) -> str:
        """Why the scene chose the discretisation that it has, and whether it exchanged slave and master.

        In words; empty where it was given.
        """
        if self.choice.found != self.discretisation:
            return ""
        return f"{self.choice.found}, {self.choice.why}{EXCHANGED if self.choice.exchanged else ''}"

    @property
    def explained_discretisation(self) -> str:
        """The discretisation and, where the scene chose it, why."""
        return self.reason or self.discretisation
