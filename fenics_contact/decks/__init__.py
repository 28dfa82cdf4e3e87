"""Decks of CalculiX and Abaqus, read as scenes with their load steps."""

from fenics_contact.decks.cards import DeckError, Origin
from fenics_contact.decks.deck import Deck, Print, read_deck

__all__ = ["Deck", "DeckError", "Origin", "Print", "read_deck"]
