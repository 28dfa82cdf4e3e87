"""Files for ParaView: VTU with indices, XDMF, and series of states (PVD), and how they are read back."""

from __future__ import annotations

import hashlib
import math
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.files import remove_abandoned
from fenics_contact._base.libraries import MPI
from fenics_contact._base.requirements import require_extra
from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.mesh.collapsed import by_shape
from fenics_contact.output.files import replacing, replacing_together, write_text
from fenics_contact.results.fields import in_space
from fenics_contact.results.multi_block import vtk_nodes
from fenics_contact.results.on_bodies import OnBodies

if TYPE_CHECKING:
    import meshio
    import pyvista

    from fenics_contact._optimize.result import Record
    from fenics_contact.design.problem import ShapeProblem
    from fenics_contact.design.several import JointProblem


#: Suffixes of the files of fields that are read back.
FIELD_FILES = (".vtu", ".vtm", ".pvd")


@dataclass(frozen=True)
class StoredFields:
    """A file with the fields of one state.

    `value`: its time, load factor or number in a series, 0 where there is none; `label`: its description in a
    series, such as the name of a load step; ParaView's field datum "Name".
    """

    file: Path
    value: float = 0.0
    label: str = ""

    def read(self) -> dict[str, pyvista.UnstructuredGrid]:
        """Return body name -> grid with all fields."""
        require_extra("files of fields", "viz", "pyvista")
        import pyvista

        if not self.file.is_file():
            raise InvalidInputError(f"a file of fields must exist, '{self.file}' does not: write it again")
        data = pyvista.read(self.file)
        if isinstance(data, pyvista.MultiBlock):
            return {str(name): data[name] for name in data.keys()}
        return {self.file.stem: data}


def fields_of_result(folder: Path) -> Path | None:
    """Return the file of fields to open in a folder of results: a series before a single state."""
    files = [*sorted(folder.glob("*.pvd")), *sorted(folder.glob("*.vtm"))]
    return files[0] if files else None


def stored_fields(path: str | Path) -> list[StoredFields]:
    """Return the members of a PVD file in the order of their values; any other file as the only one.

    Example:
        >>> [member.label for member in stored_fields("output/history.pvd")]  # doctest: +SKIP
        ['pressed', 'sheared']
    """
    path = Path(path)
    if path.suffix != ".pvd":
        return [StoredFields(path)]
    try:
        members = [
            StoredFields(
                path.parent / entry.attrib["file"], float(entry.get("timestep", 0)), entry.get("name", "")
            )
            for entry in ET.parse(path).getroot().iter("DataSet")
        ]
    except (ET.ParseError, KeyError, OSError, ValueError) as error:
        raise InvalidInputError(f"'{path}' must be a whole .pvd file, got {error}: write it again") from error
    if not members:
        raise InvalidInputError(f"'{path}' must name at least one file of fields, it names none")
    return sorted(members, key=lambda member: member.value)


@dataclass(frozen=True, order=True)
class Member:
    """One state of a series."""

    value: float
    number: int
    label: str = ""


def stem_of(name: str, number: int) -> str:
    """Return the stem of a member's file names."""
    return f"{name}_{number:04d}"


def collection(name: str, members: Sequence[Member]) -> str:
    """Return the text of a PVD file with the multi-block file of every member."""
    lines = "".join(
        f'    <DataSet timestep="{member.value!r}" group="" part="0" '
        f"file={quoteattr(f'{name}/{stem_of(name, member.number)}.vtm')}"
        f"{f' name={quoteattr(member.label)}' if member.label else ''}/>\n"
        for member in sorted(members)
    )
    return (
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n'
        f"  <Collection>\n{lines}  </Collection>\n</VTKFile>\n"
    )


def read_collection(path: Path) -> list[Member]:
    """Return the members of a PVD file whose multi-block files exist."""
    name, members = path.stem, []
    try:
        for stored in stored_fields(path):
            number = int(stored.file.stem.removeprefix(f"{name}_"))
            ours = path.parent / name / f"{stem_of(name, number)}.vtm"
            if stored.file != ours or not math.isfinite(stored.value):
                raise ValueError(f"it names '{stored.file}' at {stored.value}")
            if ours.is_file():
                members.append(Member(stored.value, number, stored.label))
    except (InvalidInputError, ValueError) as error:
        raise InvalidInputError(
            f"a series needs a PVD file that a ResultSeries wrote, or none, {str(path)!r} is another one "
            f"({error}): give the series another name, or move the file away"
        ) from error
    return sorted(members)


#: Bytes of a file's name before its suffix: most disks take 255, also for the hidden ones of files in work.
LONGEST = 200


def file_of_each(bodies: Iterable[str], folder: Path, stem: str, suffix: str) -> dict[str, Path]:
    """Name one file for each body: "state_link_1.vtu" for the body "link 1".

    Names that differ only in special characters are numbered, those that no disk takes are cut and end in a
    number made from the whole name.
    """
    files: dict[str, Path] = {}
    for body in bodies:
        plain = f"{stem}_{re.sub(r'[^A-Za-z0-9.-]+', '_', body)}"
        if len(os.fsencode(plain)) > LONGEST:
            plain = f"{plain[: LONGEST - 9]}_{hashlib.sha256(f'{stem}_{body}'.encode()).hexdigest()[:8]}"
        path, number = folder / f"{plain}{suffix}", 1
        while path in files.values():
            number += 1
            path = folder / f"{plain}_{number}{suffix}"
        files[body] = path
    return files


def checked_name(folder: str | Path, name: str, suffix: str) -> Path:
    """Return the path of a file name in a folder."""
    if not name.strip(".") or Path(name).name != name:
        raise InvalidInputError(f"name must be the beginning of a file's name, got {name!r}: use folder=")
    if len(os.fsencode(name)) > LONGEST:
        raise InvalidInputError(f"name must have at most {LONGEST} bytes, got {len(os.fsencode(name))}")
    return Path(folder) / f"{name}{suffix}"


#: meshio's names of shapes of cells by order, and the number of nodes that they have there.
_MESHIO_SHAPES = {
    1: {
        "triangle": ("triangle", 3), "quadrilateral": ("quad", 4), "tetrahedron": ("tetra", 4),
        "pyramid": ("pyramid", 5), "prism": ("wedge", 6), "hexahedron": ("hexahedron", 8),
    },
    2: {
        "triangle": ("triangle6", 6), "quadrilateral": ("quad9", 9), "tetrahedron": ("tetra10", 10),
        "pyramid": ("pyramid", 5), "prism": ("wedge18", 18), "hexahedron": ("hexahedron27", 27),
    },
}  # fmt: skip


@collectively("write_vtu", lambda state, *_, **__: state.comm)
@naming_arguments
def write_vtu(
    state: OnBodies,
    folder: str | Path,
    name: str = "state",
    *,
    cell_fields: Mapping[str, Mapping[str, np.ndarray]] | None = None,
) -> Path:
    """Write a state for ParaView: a file for each body and a multi-block file to open. Collective.

    They hold the fields of `results.GatheredFields`, and the given fields on cells. Plane bodies lie in the
    plane z = 0, their vectors have zero z component.

    Args:
        state: The state.
        folder: Output folder; created.
        name: Beginning of the files' names: "state" gives "state.vtm" and, for a body "link 1",
            "state_link_1.vtu". Files are replaced when the new ones are complete.
        cell_fields: Further fields: name -> body -> a number or a row for every cell, such as
            ``{"discretisation_error": {body: estimate.by_cell(body) for body in state.scene.deforming}}``.

    Returns:
        The multi-block file.

    Raises:
        InvalidInputError: If the name contains a folder, or a field does not fit the cells of a body.
    """
    import meshio  # takes a tenth of a second

    index = checked_name(folder, name, ".vtm")
    more = {body: _checked(state, body, cell_fields or {}) for body in state.geometry.deforming}
    meshes = {body: _gathered(state, body, more[body]) for body in state.geometry.deforming}
    files = list(file_of_each(meshes, index.parent, name, ".vtu").values())
    comm = state.comm
    with together(comm):
        if comm.rank == 0:
            # The index last: when it exists, so do its files.
            with replacing(*files, index) as paths:
                for path, mesh in zip(paths, meshes.values(), strict=False):
                    meshio.write(path, mesh, file_format="vtu")
                paths[-1].write_text(_multi_block(list(meshes), files), encoding="utf-8")
    return index


def _checked(
    state: OnBodies, body: str, fields: Mapping[str, Mapping[str, np.ndarray]]
) -> dict[str, np.ndarray]:
    count, arrays = state.geometry.bodies[body].mesh.n_cells, {}
    for name, values in fields.items():
        arrays[name] = np.asarray(values[body]) if body in values else np.zeros(0)
        if arrays[name].shape[:1] != (count,):
            given = f"shape {arrays[name].shape}" if body in values else "none"
            raise InvalidInputError(
                f"the cell field {name!r} must have {count} rows for body {body!r}, one per cell, got {given}"
            )
    return arrays


def _gathered(state: OnBodies, body: str, more: Mapping[str, np.ndarray]) -> meshio.Mesh:
    mesh = state.geometry.bodies[body].mesh
    fields = state.gather_fields(body)
    import meshio

    names = _MESHIO_SHAPES[mesh.order]
    blocks = [
        (names[shape][0], mine, own[:, vtk_nodes(shape, names[shape][1])])
        for shape, (mine, own) in by_shape(mesh.cells, mesh.dim).items()
    ]
    return meshio.Mesh(
        in_space(mesh.points),
        [(name, cells) for name, _, cells in blocks],
        point_data={key: in_space(values) for key, values in fields.points.items()},
        cell_data={
            key: [in_space(values[mine]) for _, mine, _ in blocks]
            for key, values in {**fields.cells, **more}.items()
        },
    )


def _multi_block(bodies: list[str], files: list[Path]) -> str:
    blocks = "".join(
        f"    <DataSet index={quoteattr(str(number))} name={quoteattr(body)} file={quoteattr(file.name)}/>\n"
        for number, (body, file) in enumerate(zip(bodies, files, strict=True))
    )
    return (
        '<?xml version="1.0"?>\n<VTKFile type="vtkMultiBlockDataSet" version="1.0">\n'
        f"  <vtkMultiBlockDataSet>\n{blocks}  </vtkMultiBlockDataSet>\n</VTKFile>\n"
    )


@collectively("write_xdmf", lambda state, *_, **__: state.comm)
@naming_arguments
def write_xdmf(state: OnBodies, path: str | Path) -> dict[str, Path]:
    """Write displacement and von Mises stress of every body to XDMF, all ranks together. Collective.

    The data are in HDF5 files beside them. ParaView opens them with its "Xdmf3 Reader S".

    Args:
        state: The state.
        path: Name from which those of the files are derived: for the body "link 1" "chain.xdmf" becomes
            "chain_link_1.xdmf" and "chain_link_1.h5". The folder is created; files are replaced when the new
            ones are complete.

    Returns:
        Body name -> its XDMF file.

    Raises:
        InvalidInputError: If the name does not end in ".xdmf".
    """
    base = Path(path)
    if base.suffix != ".xdmf":
        raise InvalidInputError(f"the file must be an XDMF file, got the name {base.name!r}: use .xdmf")
    files = file_of_each(state.geometry.deforming, base.parent, base.stem, ".xdmf")
    for name, target in files.items():
        _write_xdmf(state.comm, target, state.functions(name))
    return files


#: The standard name of the rule that grids include the mesh, and what dolfinx 0.9 writes instead, with which
#: ParaView finds no mesh and VTK's reader crashes.
_XINCLUDE, _UNKNOWN = "http://www.w3.org/2001/XInclude", "https://www.w3.org/2001/XInclude"


def _write_xdmf(comm: MPI.Comm, target: Path, fields: list[_dolfinx.fem.Function]) -> None:
    mesh = fields[0].function_space.mesh
    # The XDMF file names its HDF5 file: both keep their names and are written in a separate folder.
    replacing_together(
        comm,
        [target.with_suffix(".h5"), target],
        lambda hidden: _dolfinx.write_xdmf(hidden / target.name, mesh, fields),
        size=parallel_size(mesh),
        repair=lambda hidden: _repair(hidden / target.name),
    )


def parallel_size(mesh: _dolfinx.mesh.Mesh) -> int:
    """Return the approximate bytes of a file with a mesh, its displacement and a field on its cells."""
    nodes = mesh.geometry.index_map().size_global
    cells = mesh.topology.index_map(mesh.topology.dim).size_global
    return int(8 * (6 * nodes + 28 * cells) + 2**16)


def _repair(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace(_UNKNOWN, _XINCLUDE), encoding="utf-8")


FORMATS = ("vtu", "xdmf")


class ResultSeries:
    """A sequence of states in files that ParaView plays as an animation.

    | written | what to open |
    |---|---|
    | ``NAME.pvd``, with VTU files in the folder ``NAME/`` | always; all bodies, all fields of `write_vtu` |
    | ``NAME/NAME_0000_BODY.xdmf``, with HDF5 files | with "xdmf": displacement and von Mises stress |

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
            formats: Any of "vtu" and "xdmf"; VTU files are always written.

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
        state: OnBodies,
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
        value = _finite(value, label)
        number = self._make_room(value)
        stem, folder = stem_of(self._name, number), self.path.with_suffix("")
        write_vtu(state, folder, stem, cell_fields=cell_fields)
        if "xdmf" in self._formats:
            write_xdmf(state, folder / f"{stem}.xdmf")
        self._added.append(Member(value, number, label))
        with together(self._comm):
            if self._comm.rank == 0:
                self._write_index()
        return self.path

    def follow(self, problem: ShapeProblem | JointProblem) -> Callable[[Record, np.ndarray], None]:
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
        pattern = re.compile(rf"{re.escape(self._name)}_(\d{{4,}})(_.*)?\.(vtm|vtu|xdmf|h5)")
        # Index files are removed before the files to which they refer.
        for path in sorted(folder.iterdir(), key=lambda path: path.suffix not in (".vtm", ".xdmf")):
            match = pattern.fullmatch(path.name)
            if match and int(match.group(1)) not in named:
                path.unlink()


def _check_formats(formats: Sequence[str]) -> None:
    unknown = [name for name in formats if name not in FORMATS]
    if unknown or isinstance(formats, str):
        raise InvalidInputError(f"formats must be some of {list(FORMATS)}, got {formats!r}")


def _finite(value: float, label: str) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise InvalidInputError(f"the value of a member must be finite, got {number}: give its time or step")
    if not label.isprintable():
        raise InvalidInputError(f"the label of a member must be one line of text, got {label!r}: shorten it")
    return number
