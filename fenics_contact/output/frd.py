"""Results as CalculiX writes them, ``.frd`` in ASCII: cgx, FreeCAD, PrePoMax and converters read them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from functools import singledispatch
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from fenics_contact._base.checks import naming_arguments
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.materials.plane_stress import is_sheet
from fenics_contact.materials.plastic import has_history
from fenics_contact.mesh.collapsed import by_shape
from fenics_contact.output.files import replacing
from fenics_contact.output.result import own_version
from fenics_contact.results.fields import ContactNodes, in_space
from fenics_contact.results.on_bodies import OnBodies
from fenics_contact.results.state import State

if TYPE_CHECKING:
    from mpi4py import MPI


@dataclass(frozen=True, eq=False)
class FrdCells:
    """Cells of one type.

    `dim`: dimension of their space; `nodes`: numbers of their nodes in the order of decks, (n, k).
    """

    dim: int
    numbers: np.ndarray
    nodes: np.ndarray

    #: Number of the type by dimension and number of nodes.
    kinds: ClassVar[Mapping[tuple[int, int], int]] = {
        (3, 8): 1, (3, 6): 2, (3, 4): 3, (3, 20): 4, (3, 15): 5, (3, 10): 6,
        (2, 3): 7, (2, 6): 8, (2, 4): 9, (2, 8): 10, (1, 2): 11, (1, 3): 12,
    }  # fmt: skip
    #: Where the file has other orders than decks: nodes on upright edges come before those on top.
    orders: ClassVar[Mapping[int, Sequence[int]]] = {
        4: [*range(12), *range(16, 20), *range(12, 16)],
        5: [*range(9), *range(12, 15), *range(9, 12)],
    }

    @property
    def text(self) -> str:
        """The lines of the cells: number and type, then up to ten nodes a line."""
        count = self.nodes.shape[1]
        kind = self.kinds[self.dim, count]
        nodes = self.nodes[:, self.orders.get(kind, range(count))]
        lines = [" -2" + "%10d" * len(part) for part in np.split(np.arange(count), range(10, count, 10))]
        row = "\n".join([f" -1%10d{kind:5d}    0    1", *lines, ""])
        return formatted(row, np.column_stack([self.numbers, nodes]))


@dataclass(frozen=True, eq=False)
class FrdMesh:
    """The mesh of a file: numbers of nodes, ascending, their points, (n, 3), and cells."""

    numbers: np.ndarray
    points: np.ndarray
    cells: Sequence[FrdCells]

    @property
    def text(self) -> str:
        """Nodes and cells."""
        count = sum(len(each.numbers) for each in self.cells)
        head = "{}{:30d}{:38d}\n"
        return "".join([
            head.format("    2C", len(self.numbers), 1), table(self.numbers, self.points), " -3\n",
            head.format("    3C", count, 1), *(each.text for each in self.cells), " -3\n",
        ])  # fmt: skip


@dataclass(frozen=True, eq=False)
class FrdField:
    """A field on nodes: `kind`, a name of `kinds`, and values, (n, k), at nodes by their numbers."""

    kind: str
    numbers: np.ndarray
    values: np.ndarray

    tensor: ClassVar[Sequence[tuple[int, int]]] = ((1, 1), (2, 2), (3, 3), (1, 2), (2, 3), (3, 1))
    #: Names of components; of displacements and forces the length is one that readers compute.
    kinds: ClassVar[Mapping[str, Sequence[str]]] = {
        "DISP": ("D1", "D2", "D3"),
        "STRESS": ("SXX", "SYY", "SZZ", "SXY", "SYZ", "SZX"),
        "TOSTRAIN": ("EXX", "EYY", "EZZ", "EXY", "EYZ", "EZX"),
        "FORC": ("F1", "F2", "F3"),
        "PE": ("PE",),
        "RFL": ("RFL",),
        "CONTACT": ("COPEN", "CSLIP1", "CSLIP2", "CPRESS", "CSHEAR1", "CSHEAR2"),
        "NDTEMP": ("T",),
        "FLUX": ("F1", "F2", "F3"),
    }
    #: Names of those that all results but states have, by that of their fields on nodes.
    others: ClassVar[Mapping[str, str]] = {"temperature": "NDTEMP", "nodal_heat_flux": "FLUX"}

    @property
    def text(self) -> str:
        """The head of the field and its values."""
        names = self.kinds[self.kind]
        if len(names) == 3:
            lines = [f" -5  {name:8s}    1    2{k:5d}    0" for k, name in enumerate(names, start=1)]
            lines.append(" -5  ALL         1    2    0    0    1ALL")
        elif len(names) == 1:
            lines = [f" -5  {names[0]:8s}    1    1    0    0"]
        else:
            places = zip(names, self.tensor, strict=True)
            lines = [f" -5  {name:8s}    1    4{i:5d}{j:5d}" for name, (i, j) in places]
        head = [f" -4  {self.kind:8s}{len(lines):5d}    1", *lines, ""]
        return "\n".join(head) + table(self.numbers, self.values) + " -3\n"


def formatted(row: str, values: np.ndarray, at_once: int = 20_000) -> str:
    """Return lines of numbers, all by one format, (n, k)."""
    parts = (values[first : first + at_once] for first in range(0, len(values), at_once))
    return "".join(row * len(part) % tuple(part.ravel().tolist()) for part in parts)


def table(numbers: np.ndarray, values: np.ndarray) -> str:
    """Return lines with the numbers of nodes and their values; below 1e-99 they have no room: zero."""
    rows = np.column_stack([numbers, np.where(np.abs(values) < 1e-99, 0.0, values)])
    return formatted(" -1%10d" + "%12.5E" * values.shape[1] + "\n", rows)


@dataclass(eq=False)
class FrdWriter:
    """Writes a file increment after increment; `counts`: increments and fields so far."""

    path: Path
    mesh: FrdMesh
    materials: Sequence[str] = ()
    counts: list[int] = field(default_factory=lambda: [0, 0])

    def begin(self) -> None:
        """Write head and mesh."""
        now = datetime.now()
        header = {
            "USER": "", "DATE": now.strftime("%d.%B.%Y").lower(), "TIME": now.strftime("%H:%M:%S"),
            "HOST": "", "PGM": "fenics_contact", "VERSION": f"Version {own_version()}",
            "DIR": "", "DBN": "",
        }  # fmt: skip
        head = ["    1C", *(f"    1U{name:18s}{words:48s}" for name, words in header.items())]
        head += [f"    1UMAT{k:5d}{name:58s}" for k, name in enumerate(self.materials, start=1)]
        self.path.write_text("\n".join([*head, ""]) + self.mesh.text, encoding="utf-8")

    def add(self, fields: Sequence[FrdField], time: float, step: int, increment: int) -> None:
        """Add the fields of an increment, numbered from 1 in its step, at a time since the first step."""
        self.counts[0] += 1
        with self.path.open("a", encoding="utf-8") as file:
            for each in fields:
                self.counts[1] += 1
                file.write(f"    1PSTEP{self.counts[1]:26d}{increment:12d}{step:12d}{'':10s}\n")
                number, count = self.counts[0], len(each.numbers)
                head = f"  100CL{100 + number:5d}{_time(time)}{count:12d}{'':20s} 0{number:5d}{'':10s} 1\n"
                file.write(head + each.text)

    def end(self) -> None:
        """Write the end."""
        with self.path.open("a", encoding="utf-8") as file:
            file.write(" 9999\n")


def _time(time: float) -> str:
    """Return a time in twelve characters, with as many digits as have room."""
    digits = 9 - max(len(f"{abs(time):.0f}") - 1, 0)
    return f"{time:12.{digits}f}" if 1.0 <= time < 1e9 else f"{time:12.5E}"


@naming_arguments
def write_frd(path: str | Path, states: OnBodies | Sequence[OnBodies], times: Sequence[float] = ()) -> Path:
    """Write states as CalculiX writes its results, for cgx, FreeCAD, PrePoMax and converters.

    Nodes and cells are numbered from 1 body by body, materials are named by bodies. On nodes are DISP,
    STRESS, TOSTRAIN, FORC, of materials with a history PE, the accumulated plastic strain, and, where there
    is contact, CONTACT: COPEN is the gap, CSLIP the slip since the
    undeformed state with its elastic part, CPRESS the pressure and CSHEAR the friction on the master, along
    the projection of the axis x on the surface (of z where x is normal) and across it; at nodes of slaves,
    zero at others. A `HeatState` has NDTEMP, its temperature, and FLUX, the heat flux. Numbers have six
    digits. Stresses and strains are extrapolated from the Gauss points of each cell to its nodes and averaged
    over all cells around a node, as CalculiX does: less accurate at surfaces than
    `State.gather_nodal_stress`. FORC is `State.gather_internal_forces`. Complete quadratic cells are written
    without their centres and the forces there, pyramids as linear hexahedra. With nonlinear sheets in plane
    stress there is no TOSTRAIN: strains normal to them are not known.

    Args:
        path: File to write, ``.frd``; its folder is created, and a file of that name replaced when the new
            one is complete.
        states: A state, or several of one mesh, in their order.
        times: Time of each, ascending; by default 1, 2, ...

    Returns:
        The path.

    Raises:
        InvalidInputError: If there are no states, or not a time for each.
        OutputError: If the file cannot be written; one that was there is unchanged.

    Note:
        Collective on the communicator of the states; rank 0 writes.

    Example:
        >>> write_frd("block.frd", solve_scene(scene, comm))  # doctest: +SKIP
    """
    several = [states] if isinstance(states, OnBodies) else list(states)
    if not several:
        raise InvalidInputError("write_frd needs at least one state, got none: solve a scene or its steps")
    given = list(times) or list(range(1, len(several) + 1))
    if len(given) != len(several):
        raise InvalidInputError(f"times must have one for each of {len(several)} states, got {len(given)}")
    comm, numbering = several[0].comm, BodyNumbers.of(several[0])
    bodies = several[0].geometry.bodies
    materials = [material for body in bodies.values() for material in body.materials]
    left_out = {"PE"} if not any(map(has_history, materials)) else set()
    left_out |= {"TOSTRAIN"} if any(map(is_sheet, materials)) else set()
    kinds = [kind for kind in FrdField.kinds if kind not in left_out]
    with writing(comm, Path(path), numbering.mesh, list(bodies)) as writer:
        for number, (state, time) in enumerate(zip(several, given, strict=True), start=1):
            add_on_first(comm, writer, nodal_fields(state, numbering, kinds), time, number, 1)
    return Path(path)


@contextmanager
def writing(comm: MPI.Comm, path: Path, mesh: FrdMesh, materials: Sequence[str]) -> Iterator[FrdWriter]:
    """Yield a writer, which has begun; the file takes its place at the end of the block. Collective."""
    owner = replacing(path)
    writer = FrdWriter(path, mesh, materials)
    with together(comm):
        if comm.rank == 0:
            (writer.path,) = owner.__enter__()
            writer.begin()
    try:
        yield writer
    except BaseException as error:
        if comm.rank == 0:
            owner.__exit__(type(error), error, error.__traceback__)
        raise
    with together(comm):
        if comm.rank == 0:
            writer.end()
            owner.__exit__(None, None, None)


def add_on_first(
    comm: MPI.Comm, writer: FrdWriter, fields: Sequence[FrdField], time: float, step: int, increment: int
) -> None:
    """Let rank 0 add the fields of an increment. Collective."""
    with together(comm):
        if comm.rank == 0:
            writer.add(fields, time, step, increment)


@dataclass(frozen=True, eq=False)
class BodyNumbers:
    """Numbers of the nodes of each body in the file, 0 for those that it has not, and the mesh.

    `thickness`: of plane bodies, by which forces are multiplied.
    """

    nodes: Mapping[str, np.ndarray]
    mesh: FrdMesh
    thickness: float = 1.0

    @classmethod
    def of(cls, state: OnBodies) -> BodyNumbers:
        """Return those of a scene: body by body."""
        nodes, cells, points, first, count = {}, [], [], 0, 0
        for name, body in state.geometry.deforming.items():
            mesh, own = body.mesh, list[np.ndarray]()
            for shape, (_, part) in by_shape(mesh.cells, mesh.dim).items():
                own.append(_lean(shape, part, mesh.dim))
            used = np.unique(np.concatenate([each.ravel() for each in own]))
            nodes[name] = np.zeros(mesh.n_nodes, dtype=np.int64)
            nodes[name][used] = first + 1 + np.arange(len(used))
            for part in own:
                numbers = count + 1 + np.arange(len(part))
                cells.append(FrdCells(mesh.dim, numbers, nodes[name][part]))
                count += len(part)
            points.append(in_space(mesh.points[used]))
            first += len(used)
        return cls(nodes, FrdMesh(np.arange(1, first + 1), np.concatenate(points), cells))

    def summed(self, of_bodies: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return values at the nodes of the file, (n, k), those of bodies that share nodes added up."""
        at = np.concatenate([self.nodes[name][self.nodes[name] > 0] for name in of_bodies])
        # Sections of preloads add nodes behind those of the mesh: the other sides of its cut.
        ours = {name: values[: len(self.nodes[name])] for name, values in of_bodies.items()}
        values = np.concatenate([ours[name][self.nodes[name] > 0] for name in ours])
        place = np.searchsorted(self.mesh.numbers, at)
        flat = values.reshape(len(values), -1)
        sums = [np.bincount(place, column, minlength=len(self.mesh.numbers)) for column in flat.T]
        return np.stack(sums, axis=1)


def _lean(shape: str, nodes: np.ndarray, dim: int) -> np.ndarray:
    """Return the nodes of cells that the file has, in the order of decks."""
    if shape == "pyramid":
        return nodes[:, [0, 1, 2, 3, 4, 4, 4, 4]]
    there = [count for at, count in FrdCells.kinds if at == dim and count <= nodes.shape[1]]
    corners = {"quadrilateral": (4, 8), "triangle": (3, 6), "hexahedron": (8, 20), "prism": (6, 15)}
    return nodes[:, : max(each for each in there if each in corners.get(shape, (4, 10)))]


def nodal_fields(state: OnBodies, numbering: BodyNumbers, kinds: Sequence[str]) -> list[FrdField]:
    """Return the fields of a state by the kinds of `FrdField` that are asked for. Collective."""
    bodies, numbers = state.geometry.deforming, numbering.mesh.numbers
    ones = numbering.summed({name: np.ones((body.mesh.n_nodes, 1)) for name, body in bodies.items()})
    found = _values(state, numbering, kinds, np.maximum(ones, 1.0))
    return [
        FrdField(kind, numbers, found[kind]) for kind in FrdField.kinds if kind in kinds and kind in found
    ]


@singledispatch
def _values(
    state: Any, numbering: BodyNumbers, kinds: Sequence[str], count: np.ndarray
) -> dict[str, np.ndarray]:
    """Return values at nodes by kind; `count`: bodies that share each node, (n, 1). Collective."""
    found: dict[str, np.ndarray] = {}
    for part in state.parts:
        found |= _values(part, numbering, kinds, count)
    fields = {name: state.gather_fields(name).points for name in state.geometry.deforming}
    for key, kind in FrdField.others.items():
        known = {name: own[key] for name, own in fields.items() if key in own}
        found[kind] = in_space(numbering.summed(known) / count)
    return found


@_values.register
def _(state: State, numbering: BodyNumbers, kinds: Sequence[str], count: np.ndarray) -> dict[str, np.ndarray]:
    bodies, found = state.scene.deforming, dict[str, np.ndarray]()
    if "DISP" in kinds:
        moved = numbering.summed({name: state.gather_displacement(name) for name in bodies})
        found["DISP"] = in_space(moved / count)
    if {"STRESS", "TOSTRAIN", "PE"} & set(kinds):
        found |= _on_nodes(state, numbering, kinds)
    if "FORC" in kinds:
        forces = numbering.summed({name: state.gather_internal_forces(name) for name in bodies})
        found["FORC"] = in_space(forces * numbering.thickness)
    if "CONTACT" in kinds and state.scene.contacts:
        found["CONTACT"] = numbering.summed({name: contact_values(state, name) for name in bodies})
    return found


def _on_nodes(state: State, numbering: BodyNumbers, kinds: Sequence[str]) -> dict[str, np.ndarray]:
    """Return those of stresses, strains and equivalent plastic strains at nodes that are asked for."""
    every = {"stress": "STRESS", "strain": "TOSTRAIN", "plastic_strain": "PE"}
    names = {name: kind for name, kind in every.items() if kind in kinds}
    parts: dict[str, dict[str, np.ndarray]] = {kind: {} for kind in names}
    counts = {}
    for name, body in state.scene.deforming.items():
        at = state.gather_at_points(name)
        for kind, values in parts.items():
            total, count = at.at_nodes(getattr(at, kind), body.mesh)
            values[name] = total[:, None]
            if total.ndim == 3:
                values[name] = np.stack([total[:, i - 1, j - 1] for i, j in FrdField.tensor], axis=1)
            counts[name] = count[:, None]
    count = np.maximum(numbering.summed(counts), 1.0)
    return {names[kind]: numbering.summed(values) / count for kind, values in parts.items()}


def contact_values(state: State, body: str) -> np.ndarray:
    """Return gap, slip, pressure and shear of a body's nodes, (n_nodes, 6), as CONTACT has them."""
    contact, scene = state.contact, state.scene
    at = ContactNodes(contact, scene, state.torn.decomposition.tearing, body)
    normal, along = in_space(contact.points.normal[:, : scene.dim]), contact.points.tangents
    first, second = contact_axes(normal)
    columns = [contact.gap]
    shear = np.einsum("na,nad->nd", contact.traction, along)
    soft = np.array([1.0 / (pair.stick_stiffness or np.inf) for pair in scene.contacts])[contact.points.pair]
    slip = np.einsum("na,nad->nd", contact.total_slip, along) + soft[:, None] * shear
    for vectors in (slip, shear):
        full = np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))
        columns += [np.einsum("nd,nd->n", full, axis) for axis in (first, second)]
    gap, slip1, slip2, shear1, shear2 = (at.summed(each) for each in columns)
    pressure = np.maximum(at.summed(contact.pressure, filled=True), 0.0)
    return np.column_stack([gap, slip1, slip2, pressure, shear1, shear2])


def contact_axes(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return both tangents of surfaces with outward normals, (n, 3): x projected, or z where x is normal."""
    steep = np.abs(normal[:, :1]) > 1.0 - 1e-6
    axis = np.where(steep, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    first = axis - np.einsum("nd,nd->n", axis, normal)[:, None] * normal
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return first, np.cross(normal, first)
