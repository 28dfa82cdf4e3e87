"""Reads `.frd` files by their columns, and rejects what CalculiX would not write."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np


@dataclass
class FrdBlock:
    """One field: its kind, the time, the step, the increment, and values by node."""

    kind: str
    time: float
    step: int
    increment: int
    components: list[str]
    values: dict[int, list[float]]

    def at(self, nodes: list[int]) -> np.ndarray:
        """Return the values at some nodes."""
        return np.array([self.values[node] for node in nodes])


@dataclass
class FrdFile:
    """All that is in a file; cells by number: type and nodes."""

    nodes: dict[int, list[float]] = field(default_factory=dict)
    cells: dict[int, tuple[int, list[int]]] = field(default_factory=dict)
    blocks: list[FrdBlock] = field(default_factory=list)

    def block(self, kind: str, time: float = 1.0) -> FrdBlock:
        """Return the field of a kind at a time."""
        (found,) = [each for each in self.blocks if each.kind == kind and abs(each.time - time) < 1e-9]
        return found


COUNTS = {1: 8, 2: 6, 3: 4, 4: 20, 5: 15, 6: 10, 7: 3, 8: 6, 9: 4, 10: 8, 11: 2, 12: 3}


def numbers(line: str) -> list[float]:
    """Return the numbers of twelve columns each behind the first thirteen."""
    assert (len(line) - 13) % 12 == 0, line
    return [float(line[k : k + 12]) for k in range(13, len(line), 12)]


def read_frd(path: Path) -> FrdFile:
    """Read a file, line by line and by columns."""
    lines = iter(path.read_text().splitlines())
    found = FrdFile()
    line = next(lines)
    assert line == "    1C"
    while line[:6] != "    2C":
        assert line[:5] == "    1", line
        line = next(lines)
    assert len(line) == 74
    for _ in range(int(line[24:36])):
        line = next(lines)
        assert line[:3] == " -1"
        found.nodes[int(line[3:13])] = numbers(line)
    assert next(lines) == " -3"
    line = next(lines)
    assert line[:6] == "    3C"
    assert len(line) == 74
    for _ in range(int(line[24:36])):
        line = next(lines)
        assert (line[:3], len(line)) == (" -1", 28)
        kind, nodes = int(line[13:18]), list[int]()
        while len(nodes) < COUNTS[kind]:
            row = next(lines)
            assert row[:3] == " -2"
            nodes += [int(row[k : k + 10]) for k in range(3, len(row), 10)]
        assert len(nodes) == COUNTS[kind]
        found.cells[int(line[3:13])] = kind, nodes
    assert next(lines) == " -3"
    line = next(lines)
    while line != " 9999":
        assert (line[:10], len(line)) == ("    1PSTEP", 70)
        increment, step = int(line[36:48]), int(line[48:60])
        head = next(lines)
        assert (head[:7], len(head)) == ("  100CL", 75)
        line = next(lines)
        assert line[:3] == " -4"
        names = [next(lines)[5:13].strip() for _ in range(int(line[13:18]))]
        components = [name for name in names if name != "ALL"]
        block = FrdBlock(line[5:13].strip(), float(head[12:24]), step, increment, components, {})
        for _ in range(int(head[24:36])):
            row = next(lines)
            if row == " -3":  # CalculiX counts all nodes where it lists those in contact
                break
            assert row[:3] == " -1"
            block.values[int(row[3:13])] = numbers(row)
            assert len(block.values[int(row[3:13])]) == len(components)
        else:
            row = next(lines)
        assert row == " -3"
        found.blocks.append(block)
        line = next(lines)
    return found
