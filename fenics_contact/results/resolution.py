"""What meshes leave uncertain about the largest pressure of a contact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from fenics_contact._base.display import counted

#: By how much the largest pressure may be off, by the edges of facets from its point to the next open one.
OFF = {1: "by a half or more", 2: "by a tenth"}
#: What refines meshes until the largest pressure is good enough.
CALL = "solve_to(scene, 'peak_pressure', 0.02, comm)"


@dataclass(frozen=True)
class CoarsePeak:
    """A largest pressure so near to the edge of its contact that the cells do not resolve it.

    Cylinders by mortar on meshes that do not match, the master's facets a third to five times as wide as the
    slave's, in 312 random positions: with one cell to the edge the largest pressure was off by 17 % in the
    median on quadrilaterals and 29 % on triangles (at most 85 % and 135 %), with two by 1.3 % and 5.4 % (13 %
    and 23 %), with more by 0.2 % and 1.2 % (1.8 % and 3.5 %). `points`: how many points press; `cells`: cells
    from its point to the next open one, of the coarser surface, rounded up: 1 or 2.
    """

    place: str
    points: int
    cells: int

    @property
    def warning(self) -> str:
        """What is uncertain, why, and what to do."""
        points = counted(self.points, "point presses", "points press")
        cells = counted(self.cells, "cell")
        force = ", and so may the force where displacements are given" if self.cells == 1 else ""
        return (
            f"the contact of {self.place} is too small for its cells: {points}, and it ends within "
            f"{cells} of the largest pressure, which may be off {OFF[self.cells]}{force}; four cells on "
            f"the half width of a contact have it to about a percent: refine the meshes there, as {CALL} does"
        )

    def __str__(self) -> str:
        """Return it in one line."""
        return (
            f"may be off {OFF[self.cells]}, {self.place} touch within {counted(self.cells, 'cell')} of it: "
            f"{CALL} refines the meshes there"
        )


@dataclass(frozen=True)
class BetweenNodes:
    """A contact that lies between the nodes of its slave, or partly so.

    `depth`: by how much surfaces overlap inside a facet, deeper than at its nodes; `moved`: how far they move
    against each other.
    """

    place: str
    depth: float
    moved: float
    at: tuple[float, ...]

    #: Whether most of the force may be found all the same, as where many nodes press.
    can_be_small: ClassVar[bool] = True

    @property
    def _where(self) -> str:
        return ", ".join(f"{x:.4g}" for x in self.at)

    @property
    def warning(self) -> str:
        """What is missed, where, and what to do."""
        return (
            f"the contact of {self.place} lies between nodes: inside a facet of the slave, at "
            f"({self._where}), surfaces overlap by {self.depth:.2g} more than at its nodes, where they "
            f"move by {self.moved:.2g} against each other: cells are too large for this contact, and its "
            "force, not only its largest pressure, may be off by a half or more: refine the meshes there, as "
            f"{CALL} does"
        )

    def __str__(self) -> str:
        """Return it in one line."""
        return (
            f"may be off by a half or more, and so may the force: {self.place} touch between nodes: {CALL} "
            "refines the meshes there"
        )


@dataclass(frozen=True)
class CornerBetweenNodes(BetweenNodes):
    """A corner or an edge of a master that presses between the nodes of its slave.

    `depth`: how far the corner lies inside the slave, deeper than nodes around.
    """

    can_be_small: ClassVar[bool] = False

    @property
    def warning(self) -> str:
        """What is missed, where, and what to do."""
        return (
            f"the contact of {self.place} lies between nodes: a corner of the master, at ({self._where}), "
            f"lies {self.depth:.2g} inside the slave, where it moves by {self.moved:.2g} against it: size "
            "and direction of the contact force may be wrong: exchange slave and master, as nodes of the "
            f"slave find the other body, or refine the slave there, as {CALL} does"
        )


@dataclass(frozen=True)
class CornerKeptAway(BetweenNodes):
    """A corner or an edge of a master that does not touch the slave, which presses on it all the same.

    `depth`: how far the surfaces are apart.
    """

    can_be_small: ClassVar[bool] = False

    @property
    def warning(self) -> str:
        """What is wrong, where, and what to do."""
        return (
            f"the contact of {self.place} presses where nothing touches: a corner of the master, at "
            f"({self._where}), is kept {self.depth:.2g} away from the slave, where it moves by "
            f"{self.moved:.2g} against it, as cells are too large: "
            "size and direction of the contact force may be wrong: "
            f"exchange slave and master, or refine the slave there, as {CALL} does"
        )


@dataclass(frozen=True)
class UnmatchedNodes:
    """Contact by nodes on linear meshes that do not match, whose pressures waver however fine these are."""

    place: str

    def __str__(self) -> str:
        """Return it in one line."""
        return (
            f"wavers by some percent, {self.place} touch by nodes where meshes do not match: leave out "
            "discretisation='node'"
        )


@dataclass(frozen=True)
class FacetsOutside:
    """Facets outside the surfaces of a pair that pass into its other body, where they would press."""

    place: str
    facets: int

    def __str__(self) -> str:
        """Return it in one line."""
        facets = counted(self.facets, "facet passes", "facets pass")
        return (
            f"may be off, and so may the force: outside the surfaces of {self.place} {facets} into the other "
            "body: name more of its facets in the pair"
        )


#: What is uncertain about the largest pressure of a pair.
PeakUncertainty = CoarsePeak | BetweenNodes | UnmatchedNodes | FacetsOutside


def in_words(doubts: Sequence[PeakUncertainty]) -> str:
    """Return the first of some doubts in one line, and how many pairs have others."""
    words = str(doubts[0])
    others = {each.place for each in doubts[1:]} - {doubts[0].place}
    return f"{words}; likewise {counted(len(others), 'further pair')}" if others else words
