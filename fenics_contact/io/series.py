"""Series of states for ParaView: load steps, designs of an optimisation."""

from __future__ import annotations

import math
import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.checkpoint import remove_abandoned
from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.io.collection import Member, collection, read_collection, stem_of
from fenics_contact.io.names import checked_name
from fenics_contact.io.replacing import write_text
from fenics_contact.io.vtu import write_vtu
from fenics_contact.io.vtx import require_vtx, write_vtx
from fenics_contact.io.xdmf import write_xdmf

if TYPE_CHECKING:
    from fenics_contact.optimize import Record
    from fenics_contact.shape import LoadPath, ShapeProblem

FORMATS = ("vtu", "xdmf", "vtx")


class ResultSeries:
    """A sequence of states in files that ParaView plays as an animation.

    | written | what to open |
    |---|---|
    | ``NAME.pvd``, with VTU files in the folder ``NAME/`` | always; all bodies, all fields of `write_vtu` |
    | ``NAME/NAME_0000_BODY.xdmf``, with HDF5 files | with "xdmf": displacement and von Mises stress |
    | ``NAME/NAME_0000_BODY_FIELD.bp`` | with "vtx" (ADIOS2): one folder per state, body and field |

    Every member has its own mesh, so that designs may differ in shape. After each `add` all files are
    complete, and the PVD file refers to complete members only, also if a run is killed at any
    moment.

    A run that continues, for example from a checkpoint, continues the series: members are identified by their
    values. The first member added removes those that an earlier run left at the same and higher values, as
    they belong to a discarded continuation; earlier ones stay. A value added twice replaces its member.

    Attributes:
        path: The PVD file.

    Example:
        >>> series = ResultSeries("output", "history", comm)  # doctest: +SKIP
        >>> for number, state in enumerate(solve_steps(ContactProblem(scene, comm), steps)):  # doctest: +SKIP
        ...     series.add(state, number, steps[number].name)
    """

    def __init__(
        self, folder: str | Path, name: str, comm: MPI.Comm, *, formats: Sequence[str] = ("vtu",)
    ) -> None:
        """Read existing members; nothing is written yet. Collective on ``comm``.

        Args:
            folder: Output folder; created with the first member.
            name: Name of the series, the beginning of all file names.
            comm: Communicator of the states.
            formats: Any of "vtu", "xdmf" and "vtx"; VTU files are always written.

        Raises:
            InvalidInputError: If the name contains a folder, a format is unknown or unavailable, or a PVD
                file of that name does not belong to a series.
        """
        inherited: list[Member] = []
        with together(comm):
            self.path = checked_name(folder, name, ".pvd")
            _check_formats(formats)
            if comm.rank == 0 and self.path.exists():
                inherited = read_collection(self.path)
        self._name, self._comm, self._formats = name, comm, tuple(formats)
        self._inherited: list[Member] = comm.bcast(inherited)
        self._added: list[Member] = []

    path: Path

    @property
    def members(self) -> tuple[Member, ...]:
        """All members in the order of their values, including those of an earlier run."""
        return tuple(sorted([*self._inherited, *self._added]))

    def add(
        self,
        state: State,
        value: float,
        label: str = "",
        *,
        cell_fields: Mapping[str, Mapping[str, np.ndarray]] | None = None,
    ) -> Path:
        """Write a state as the member at a value. Collective.

        Args:
            state: The state.
            value: Time, load factor or number of the step or design; shown by ParaView as time.
            label: Description, for example the name of the load step.
            cell_fields: Further fields of the VTU files, as for `write_vtu`.

        Returns:
            The PVD file.

        Raises:
            InvalidInputError: If the value is not finite or the label is not a line of text.
            OutputError: If a file cannot be written; earlier members are unchanged.
        """
        value = _checked(value, label)
        number = self._make_room(value)
        stem, folder = stem_of(self._name, number), self.path.with_suffix("")
        write_vtu(state, folder, stem, cell_fields=cell_fields)
        if "xdmf" in self._formats:
            write_xdmf(state, folder / f"{stem}.xdmf")
        if "vtx" in self._formats:
            write_vtx(state, folder, stem, value=value)
        self._added.append(Member(value, number, label))
        with together(self._comm):
            if self._comm.rank == 0:
                self._write_index()
        return self.path

    def follow(self, problem: ShapeProblem | LoadPath) -> Callable[[Record, np.ndarray], None]:
        """Return a callback for `minimize` that adds the first design and every better one.

        Their values are the numbers of the evaluations, their labels the objectives.

        Args:
            problem: The minimised problem.

        Example:
            >>> minimize(problem, start, callback=series.follow(problem))  # doctest: +SKIP
        """

        def add(record: Record, best: np.ndarray) -> None:
            point = problem.last
            if record.kind.value in ("start", "serious") and point is not None:
                self.add(point.state, record.evaluations, f"J = {record.value:.6g}")

        return add

    def _make_room(self, value: float) -> int:
        """Remove the members that a value replaces and return the number of the new one. Collective."""
        before = self.members
        later = [] if self._added else [member for member in self._inherited if member.value >= value]
        equal = [member for member in before if member.value == value]
        gone = {*later, *equal}
        self._inherited = [member for member in self._inherited if member not in gone]
        self._added = [member for member in self._added if member not in gone]
        with together(self._comm):
            if self._comm.rank == 0 and self.path.parent.is_dir():
                remove_abandoned(self.path.parent)
                if gone:  # first the index file, then the files
                    self._write_index()
                if not self._added:
                    self._remove_unnamed()
        if equal:
            return equal[0].number
        return 1 + max((member.number for member in self.members), default=-1)

    def _write_index(self) -> None:
        """Write the PVD file, which refers to the files of all members."""
        if not self.members:  # readers reject a series without members
            self.path.unlink(missing_ok=True)
            return
        write_text(self.path, collection(self._name, self.members))

    def _remove_unnamed(self) -> None:
        """Remove the files of removed members, and of those that a killed run did not complete."""
        folder = self.path.with_suffix("")
        if not folder.is_dir():
            return
        named = {member.number for member in self.members}
        pattern = re.compile(rf"{re.escape(self._name)}_(\d{{4,}})(_.*)?\.(vtm|vtu|xdmf|h5|bp)")
        # Index files are removed before the files to which they refer.
        for path in sorted(folder.iterdir(), key=lambda path: path.suffix not in (".vtm", ".xdmf")):
            match = pattern.fullmatch(path.name)
            if match and int(match.group(1)) not in named:
                shutil.rmtree(path) if path.is_dir() else path.unlink()


def _check_formats(formats: Sequence[str]) -> None:
    unknown = [name for name in formats if name not in FORMATS]
    if unknown or isinstance(formats, str):
        raise InvalidInputError(
            f"formats must be some of {list(FORMATS)}, got {formats!r}: give a tuple such as ('vtu', 'xdmf')"
        )
    if "vtx" in formats:
        require_vtx()


def _checked(value: float, label: str) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise InvalidInputError(
            f"the value of a member must be finite, got {number}: give the time, the load factor or the "
            "number of the step"
        )
    if not label.isprintable():
        raise InvalidInputError(f"the label of a member must be one line of text, got {label!r}: shorten it")
    return number
