"""What a deck that conducts heat goes through: its temperatures, and bodies that move at them, by times."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

from fenics_contact._equilibrium.steps import LoadSequence
from fenics_contact.decks.heat import HeatDeck
from fenics_contact.decks.heat_results import HeatResults
from fenics_contact.decks.results import Computed, DeckResults
from fenics_contact.heat.state import HeatState

if TYPE_CHECKING:
    from mpi4py import MPI

#: Step of the deck from 0, time since the first one, and what is known: temperatures, if any, moved bodies.
Moment: TypeAlias = tuple[int, float, list[Computed]]


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
    state: Any
    for place, at, state in deck.increments(comm, partitions=settings.get("partitions")):
        cards = deck.steps[place][0]
        number, time = cards.number, cards.start + at
        if deck.acts_back:
            both = (results, state.heat), (moving[0], state.mechanics)
            yield number, time, [Computed(*each, number) for each in both]
            continue
        ends[number] = state
        if number not in deck.moving or at < cards.period:  # else bodies are still to be moved
            waiting.append((number, time, [Computed(results, state, number)]))
        if not moving:
            yield waiting.pop()
    for moved in () if deck.acts_back else moving:
        statics = deck.statics(list(ends.values()))
        sequence = LoadSequence(statics.problem(comm, **settings), count=len(statics.steps))
        for place, load in zip(statics.step_of, statics.steps, strict=True):
            number = deck.moving[place]
            alone = [cards for cards, _ in deck.steps if cards.number not in deck.moving]
            time = float(load.time or 0.0) + sum(cards.period for cards in alone if cards.number < number)
            while waiting and waiting[0][1] < time:
                yield waiting.pop(0)
            state = sequence.advance(load)
            warm = [Computed(results, own, number) for k, own in ends.items() if k <= number]
            yield number, time, [*warm[-1:], Computed(moved, state, place)]
        sequence.finish()
    yield from waiting
