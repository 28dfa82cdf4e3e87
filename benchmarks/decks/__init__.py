"""CalculiX's own test decks, solved here and by CalculiX."""
