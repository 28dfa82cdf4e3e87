"""A deck where the command line expects a scene file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact._scene_file.bodies import Shaped
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact._scene_file.source import SceneFileError, Source
from fenics_contact._scene_file.validation import validated, wrong_names
from fenics_contact.decks.deck import Deck, conducts, read_deck
from fenics_contact.decks.tables import write_tables
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.errors.ranks import on_root_then_bcast

if TYPE_CHECKING:
    from mpi4py import MPI

    from fenics_contact.results.state import State

#: Tables of a scene file that a deck does not have; what it has are those of how it is solved and written.
OWN = ("meshes", "materials", "bodies", "supports", "loads", "contacts", "ties", "steps", "design", "heat")
_NOTHING: dict[str, Any] = {
    "meshes": {"deck": {"file": "deck.inp"}},
    "materials": {"deck": {"young_modulus": 1.0, "poisson_ratio": 0.0}},
    "bodies": {"deck": {"mesh": "deck", "material": "deck"}},
}


@dataclass(frozen=True, eq=False)
class DeckFile(SceneFile):
    """A deck with what scene files say of solver, accuracy and output."""

    deck: Deck

    @property
    def notes(self) -> Sequence[str]:
        """What is done otherwise than the deck says, and known cards without effect."""
        return self.deck.notes

    def write_tables(self, state: State, step: int = 0) -> None:
        """Write the tables that the deck prints at the end of one of its steps. Collective."""
        numbers = self.deck.step_of
        if step + 1 < len(numbers) and numbers[step + 1] == numbers[step]:
            return  # a part of a step
        tables = self.deck.tables(state, numbers[step])
        with together(self.comm):
            if self.comm.rank == 0 and tables:
                write_tables(tables, self.folder / "prints" / f"step_{numbers[step] + 1}")

    @cached_property
    def _built(self) -> tuple[Scene, dict[str, Shaped]]:
        scene = self.deck.scene
        if len(self.deck.steps) == 1:
            scene = self.deck.steps[0].applied_to(scene)
        return scene, {name: Shaped(body.mesh) for name, body in scene.bodies.items()}

    @cached_property
    def steps(self) -> tuple[LoadStep, ...]:
        """The load steps if there are several; a single one acts at once."""
        return tuple(self.deck.steps) if len(self.deck.steps) > 1 else ()


def read_deck_file(
    path: Path, comm: MPI.Comm, overrides: Sequence[str], read: Callable[[Path, MPI.Comm], Deck] = read_deck
) -> SceneFile:
    """Read a deck for the command line, of statics or with heat. Collective on ``comm``."""
    for override in overrides:
        key = override.partition("=")[0].strip().partition(".")[0]
        if key in OWN:
            raise InvalidInputError(
                f"--set changes solver, accuracy, output, units and title of a deck, got {override!r}: "
                "make a scene file of it with `fenics-contact convert`"
            )
    made: tuple[Any, ...] = DeckFile, _NOTHING, read
    if read is read_deck and on_root_then_bcast(comm, lambda: conducts(path)):
        from fenics_contact.decks.heat import read_heat_deck
        from fenics_contact.decks.heat_file import NOTHING, HeatDeckFile

        made = HeatDeckFile, NOTHING, read_heat_deck
    kind, data, reader = made
    source = Source(path.name, path.parent, data, "\n").with_overrides(overrides)
    document = validated(source, kind.documents())
    if wrong := wrong_names(source, document):
        raise SceneFileError(source.name, wrong)
    return kind(source, document, comm, reader(path, comm))  # type: ignore[no-any-return]
