"""Decks of CalculiX and Abaqus, read as scenes with their load steps."""

from typing import TYPE_CHECKING

from fenics_contact._base.late_names import late_names

if TYPE_CHECKING:
    from fenics_contact.decks.convert import write_scene_file
    from fenics_contact.decks.deck import Deck, read_deck
    from fenics_contact.decks.heat import HeatDeck, read_heat_deck
    from fenics_contact.decks.job import Increment, run_job
    from fenics_contact.decks.tables import Print, PrintTable
    from fenics_contact.readers.deck_cards import DeckError, Origin

__all__ = [
    "Deck",
    "DeckError",
    "HeatDeck",
    "Increment",
    "Origin",
    "Print",
    "PrintTable",
    "read_deck",
    "read_heat_deck",
    "run_job",
    "write_scene_file",
]

__getattr__, __dir__ = late_names(__name__)
