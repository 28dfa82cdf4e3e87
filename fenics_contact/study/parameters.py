"""The settings of one run, and the runs of a study."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any, Literal, TypeAlias

from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh import CELL_TYPES
from fenics_contact.scene import Discretisation

#: The tolerance that follows the discretisation estimate.
BALANCED: Literal["balanced"] = "balanced"
#: A largest relative residual, or "balanced".
RunTolerance: TypeAlias = float | Literal["balanced"]

#: Discretisations of contact, see `scene.ContactPair`.
DISCRETISATIONS = ("node", "mortar")
#: How Coulomb's law is solved: within every Newton step, or by an outer loop of Tresca problems.
SOLVERS = ("newton", "fixed point")


@dataclass(frozen=True)
class Parameters:
    """The settings that may differ between two runs of a study.

    Attributes:
        size: Mesh resolution in the scene's own count: cells on the contact radius, for instance.
        cell: Type of the cells, a key of `geometry.CELL_TYPES`.
        discretisation: "node" or "mortar", see `scene.ContactPair`.
        tolerance: Largest relative residual, or "balanced".
        solver: "newton" (`qp.FaceNewton`) or "fixed point" (`contact.FixedPoint` around it).
        subdomains: Approximate number of subdomains; None: of a suitable size.
    """

    size: int
    cell: str = "hexahedron"
    discretisation: Discretisation = "node"
    tolerance: RunTolerance = BALANCED
    solver: str = "newton"
    subdomains: int | None = None

    def __post_init__(self) -> None:
        """Reject settings that no scene knows."""
        _require("size", self.size, isinstance(self.size, int) and self.size > 0, "a positive integer")
        _require("cell", self.cell, self.cell in CELL_TYPES, f"one of {sorted(CELL_TYPES)}")
        known = self.discretisation in DISCRETISATIONS
        _require("discretisation", self.discretisation, known, f"one of {list(DISCRETISATIONS)}")
        _require("solver", self.solver, self.solver in SOLVERS, f"one of {list(SOLVERS)}")
        fixed = isinstance(self.tolerance, float) and 0.0 < self.tolerance < 1.0
        allowed = 'a number between 0 and 1, or "balanced"'
        _require("tolerance", self.tolerance, fixed or self.tolerance == BALANCED, allowed)
        enough = self.subdomains is None or self.subdomains > 0
        _require("subdomains", self.subdomains, enough, "a positive integer, or None")

    @property
    def balanced(self) -> bool:
        """Whether the tolerance follows the discretisation estimate."""
        return self.tolerance == BALANCED

    def as_dict(self) -> dict[str, Any]:
        """Return the settings by name, ready for JSON."""
        return asdict(self)

    def __str__(self) -> str:
        """Return the settings in a few words."""
        words = [f"size {self.size}", self.cell, self.discretisation, self.tolerance_words]
        words += [] if self.solver == "newton" else [self.solver]
        words += [] if self.subdomains is None else [f"{self.subdomains} subdomains"]
        return ", ".join(words)

    @property
    def tolerance_words(self) -> str:
        """The tolerance as shown in tables and axes."""
        return str(self.tolerance) if isinstance(self.tolerance, str) else f"{self.tolerance:.0e}"

    def differences(self, other: Parameters) -> tuple[str, ...]:
        """Name the settings in which two runs differ."""
        mine, theirs = self.as_dict(), other.as_dict()
        return tuple(name for name in mine if mine[name] != theirs[name])

    def rank(self) -> tuple[int, float]:
        """Return a sort key: coarse before fine, loose before strict, balanced last."""
        return self.size, 0.0 if isinstance(self.tolerance, str) else -self.tolerance


def parameters_from(data: Mapping[str, Any]) -> Parameters:
    """Return the settings that `Parameters.as_dict` wrote."""
    return Parameters(**data)


def _require(name: str, given: object, holds: bool, allowed: str) -> None:
    if not holds:
        raise InvalidInputError(f"{name} must be {allowed}, got {given!r}: choose one of these")


@dataclass(frozen=True)
class Sweep:
    """The settings that a study varies: one at a time around a base, and mesh and tolerance together.

    Attributes:
        base: Settings around which one at a time is varied.
        sizes: Meshes, all with every tolerance, and with the base's other settings.
        tolerances: Tolerances of the Newton method.
        cells: Cell types, on all meshes.
        discretisations: Contact discretisations, on all meshes.
        fixed_points: Tolerances of the fixed point of Coulomb's law, on the base's mesh.
        subdomains: Numbers of subdomains, on the base's mesh.
    """

    base: Parameters
    sizes: tuple[int, ...]
    tolerances: tuple[RunTolerance, ...] = (BALANCED,)
    cells: tuple[str, ...] = ()
    discretisations: tuple[Discretisation, ...] = ()
    fixed_points: tuple[float, ...] = ()
    subdomains: tuple[int, ...] = ()

    def runs(self) -> tuple[Parameters, ...]:
        """Return all runs, each once, cheap ones first."""
        base = self.base
        settings = [base]
        settings += [replace(base, size=n, tolerance=t) for n, t in product(self.sizes, self.tolerances)]
        settings += [replace(base, size=n, cell=c) for n, c in product(self.sizes, self.cells)]
        settings += [
            replace(base, size=n, discretisation=d) for n, d in product(self.sizes, self.discretisations)
        ]
        settings += [replace(base, solver="fixed point", tolerance=t) for t in self.fixed_points]
        settings += [replace(base, subdomains=count) for count in self.subdomains]
        return tuple(sorted(dict.fromkeys(settings), key=Parameters.rank))
