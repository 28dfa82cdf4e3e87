"""What a deck that conducts heat goes through: its temperatures, and bodies that move at them, by times."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from fenics_contact._equilibrium.steps import LoadSequence
from fenics_contact.decks.heat import HeatDeck
from fenics_contact.decks.heat_results import HeatResults
from fenics_contact.decks.results import Computed, DeckResults
from fenics_contact.heat.state import HeatState

if TYPE_CHECKING:
    from mpi4py import MPI


class Moment(NamedTuple):
    """What is found at a time since the first step, in a step of the deck from 0.

    `heat`: the temperatures, none before the first step that conducts heat; `new`: them, and moved bodies.
    """

    step: int
    time: float
    heat: Sequence[HeatState]
    new: Sequence[Computed]


def results_of(deck: HeatDeck) -> list[DeckResults]:
    """Return the results of what a deck conducts, and of its bodies that move, if they do."""
    kinds = (HeatResults, DeckResults)
    warm, moved = ([name for names in kind.printed.values() for name in names] for kind in kinds)
    moving = [DeckResults(each, warm) for each in deck.mechanics]
    return [HeatResults(deck.frame, moved * len(moving)), *moving]


def course(deck: HeatDeck, comm: MPI.Comm, settings: Mapping[str, Any]) -> Iterator[Moment]:
    """Yield what a deck goes through, in the order of time. Collective.

    `settings`: those of `ContactProblem` for steps in which bodies move.
    """
    results, *moving = results_of(deck)
    ends, waiting = dict[int, HeatState](), list[Moment]()
    for number, time, state in deck.increments(comm, partitions=settings.get("partitions")):
        cards = deck.steps[number][0]
        ends[cards.number], new = state, [Computed(results, state, cards.number)]
        if cards.number not in deck.moving or time < cards.period:  # else bodies are still to be moved
            waiting.append(Moment(cards.number, cards.start + time, [state], new))
        if not moving:
            yield waiting.pop()
    for moved in moving:
        statics = deck.statics(list(ends.values()))
        sequence = LoadSequence(statics.problem(comm, **settings), count=len(statics.steps))
        for place, load in zip(statics.step_of, statics.steps, strict=True):
            number = deck.moving[place]
            alone = [cards for cards, _ in deck.steps if cards.number not in deck.moving]
            time = float(load.time or 0.0) + sum(cards.period for cards in alone if cards.number < number)
            while waiting and waiting[0].time < time:
                yield waiting.pop(0)
            step: Any = sequence.advance(load)
            heat = [own for k, own in ends.items() if k <= number][-1:]
            new = [*(Computed(results, own, number) for own in heat), Computed(moved, step, place)]
            yield Moment(number, time, heat, new)
        sequence.finish()
    yield from waiting
