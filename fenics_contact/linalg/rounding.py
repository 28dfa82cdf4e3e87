"""How far sums of floating-point numbers that cancel can be trusted."""

from __future__ import annotations

#: What is left of terms that cancel counts as rounding below this part of them: sums over a body leave some
#: hundred units in the last place.
ROUNDING = 1e-13
#: The same where few operations lie between: numbers that differ by less, relatively, are the same.
LAST_PLACES = 1e-14
