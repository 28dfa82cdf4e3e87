"""What a deck goes through: temperatures, and bodies that move, at the ends of increments."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
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


def of_statics(results: DeckResults, comm: MPI.Comm, settings: Mapping[str, Any]) -> Iterator[Moment]:
    """Yield what a deck of statics goes through; settings are those of `ContactProblem`. Collective."""
    deck = results.deck
    sequence = LoadSequence(deck.problem(comm, **settings), count=len(deck.steps))
    for number, (step, load) in enumerate(zip(deck.step_of, deck.steps, strict=True), start=1):
        time = float(number if load.time is None else load.time)
        yield step, time, [Computed(results, sequence.advance(load), step)]
    sequence.finish()


def results_of(deck: HeatDeck) -> list[DeckResults]:
    """Return the results of what a deck conducts, and of its bodies that move, if they do."""
    kinds = (HeatResults, DeckResults)
    warm, moved = ([name for names in kind.printed.values() for name in names] for kind in kinds)
    moving = [DeckResults(each, warm) for each in deck.mechanics]
    return [HeatResults(deck.frame, moved * len(moving)), *moving]


def of_heat(deck: HeatDeck, comm: MPI.Comm, settings: Mapping[str, Any]) -> Iterator[Moment]:
    """Yield what a deck that conducts heat goes through, in the order of time. Collective."""
    results, *moving = results_of(deck)
    ends, waiting = dict[int, HeatState](), list[Moment]()
    for place, at, state in deck.increments(comm, partitions=settings.get("partitions")):
        cards = deck.steps[place][0]
        number, time = cards.number, cards.start + at
        if deck.acts_back:
            warm = Computed(results, state.heat, number)
            yield number, time, [warm, Computed(moving[0], state.mechanics, number)]
            continue
        ends[number] = state
        if number not in deck.moving or at < cards.period:  # else bodies are still to be moved
            waiting.append((number, time, [Computed(results, state, number)]))
        if not moving:
            yield waiting.pop()
    alone = [cards for cards, _ in deck.steps if cards.number not in deck.moving]
    for each in () if deck.acts_back else moving:
        moved = replace(each, deck=deck.statics(list(ends.values())))
        for place, at, found in of_statics(moved, comm, settings):
            number = deck.moving[place]
            time = at + sum(cards.period for cards in alone if cards.number < number)
            while waiting and waiting[0][1] < time:
                yield waiting.pop(0)
            known = [Computed(results, own, number) for k, own in ends.items() if k <= number]
            yield number, time, [*known[-1:], *found]
    yield from waiting
