"""Settings and numbers as readers like them."""

from __future__ import annotations

from collections.abc import Sequence

from fenics_contact.mesh import CELL_TYPES


def percent(value: float) -> str:
    """Write a relative number in percent, with two digits."""
    return f"{100 * value:.2g} %"


def seconds(value: float) -> str:
    """Write a time with two digits at least."""
    return f"{value:.0f} s" if value >= 100 else f"{value:.2g} s"


def plural(name: str) -> str:
    """Return what cells or a discretisation of contact are called: "hexahedra", "contact by nodes"."""
    if name in CELL_TYPES:
        return CELL_TYPES[name].plural
    return {"node": "contact by nodes", "mortar": "contact by mortar"}.get(name, name)


def joined(words: list[str]) -> str:
    """Return "a, b and c"."""
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]])) if words else ""


def table(head: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [f"| {' | '.join(line)} |" for line in (head, *body)]
    return "\n".join([lines[0], "|" + "---|" * len(head), *lines[1:]])
