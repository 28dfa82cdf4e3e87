"""The same scenes by this package and by other programs, as far as these are installed."""
