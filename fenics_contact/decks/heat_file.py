"""A deck that conducts heat where the command line expects a scene file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from fenics_contact._scene_file.heat import HeatFile
from fenics_contact.decks.course import of_heat
from fenics_contact.decks.heat import HeatDeck
from fenics_contact.errors import together
from fenics_contact.heat.fields import BothOnBodies
from fenics_contact.heat.scene import HeatScene
from fenics_contact.heat.state import HeatState
from fenics_contact.output.files import write_text
from fenics_contact.results.deformed_state import AnyState

#: A scene file of heat with whatever a deck does not have; times are there because decks have steps.
NOTHING: dict[str, Any] = {
    "meshes": {"deck": {"file": "deck.inp"}},
    "bodies": {"deck": {"mesh": "deck", "heat": {"material": "deck"}}},
    "heat": {"materials": {"deck": {"conductivity": 1.0}}, "time": {"duration": 1.0, "initial": 0.0}},
}


@dataclass(frozen=True, eq=False)
class Warm(BothOnBodies):
    """Bodies that have moved at temperatures."""

    heat: HeatState
    mechanics: AnyState


@dataclass(frozen=True, eq=False)
class HeatDeckFile(HeatFile):
    """A deck that conducts heat with what scene files say of subdomains and output."""

    deck: HeatDeck
    steps_in_words = "steps of heat"

    @property
    def notes(self) -> Sequence[str]:
        """What is done otherwise than the deck says, and known cards without effect."""
        return self.deck.notes

    @cached_property
    def scene(self) -> HeatScene:  # type: ignore[override]
        """What conducts at the end of its first step."""
        return self.deck.scene()

    @property
    def plans(self) -> tuple[object, ...]:
        """What will be built, as text. Collective on first use."""
        return *super().plans, *(each.scene.plan(self.partitions) for each in self.deck.mechanics)

    @property
    def steps(self) -> tuple[float, ...]:  # type: ignore[override]
        """The ends of its steps that conduct heat."""
        return tuple(cards.start + cards.period for cards, _ in self.deck.steps)

    def followed(self, show: Callable[[str], None]) -> Iterator[tuple[float, Any, list[HeatState]]]:
        """Yield times with their states, once the tables of the deck are written. Collective."""
        printed = dict[int, str]()
        for step, time, found in of_heat(self.deck, self.comm, {"partitions": self.partitions}):
            text = "".join(of.printout(state, number, time) for of, state, number in found)
            printed[step] = printed.get(step, "") + text
            with together(self.comm):
                if self.comm.rank == 0 and printed[step]:
                    write_text(self.folder / "prints" / f"step_{step + 1}.dat", printed[step])
            states = [each.state for each in found]
            heat = [each.state for each in found if each.of.deck is self.deck.frame]
            ranges = [
                f", {name} {min(T):.6g} to {max(T):.6g}"
                for own in heat
                for name, T in own.temperature.items()
            ]
            show(f"step {step + 1}, time {time:g}{''.join(ranges)}")
            yield time, Warm(*states) if len(states) > 1 else states[0], heat
