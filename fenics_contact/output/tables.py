"""Results as tables (CSV) for spreadsheets and scripts: contact points, load steps."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import singledispatch
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.sparse import ROUNDING, rounded
from fenics_contact._scene.pairs import pair_number
from fenics_contact.errors import collectively, together
from fenics_contact.output.files import write_text
from fenics_contact.results.area import contact_area
from fenics_contact.results.contact import Status, worn_from
from fenics_contact.results.forces import Balance, Resultant
from fenics_contact.results.joints import joint_results
from fenics_contact.results.on_bodies import OnBodies
from fenics_contact.results.state import State

if TYPE_CHECKING:
    from mpi4py import MPI

    from fenics_contact._scene.pairs import ContactPair


@collectively("write_contact_table", lambda state, *_, **__: state.comm)
@naming_arguments
def write_contact_table(state: OnBodies, path: str | Path, *, pair: int | str | None = None) -> Path:
    """Write what happens at every contact point as a table (CSV). Collective.

    After a remark that begins with "#", a line names the columns, in the plane without those of z:

    | column | |
    |---|---|
    | ``pair``, ``node`` | the pair in words, and the node of the slave's mesh |
    | ``x``, ``y``, ``z`` and ``x_moved``, ... | where it is before and after deformation, [length] |
    | ``status`` | open, stick or slip; without friction open or closed |
    | ``gap`` | after deformation, [length] |
    | ``pressure``, ``traction_x``, ... | on the slave, by friction, [force / length²] |
    | ``slip_x``, ... | motion of the slave along the master in the last load step, [length] |
    | ``total_slip_x``, ... | the same since the undeformed state, [length] |
    | ``normal_x``, ... | unit normal from master to slave |
    | ``area`` | that belongs to the point, [length²], in the plane [length] |
    | ``wet`` | 1 where fluid has reached it, else 0; only where a pair has a fluid |
    | ``worn_depth`` | lost by both surfaces since the start, [length]; only where a pair wears |

    That of a `HeatState` has ``contact``, ``node``, ``x``, ..., the temperatures of ``slave`` and ``master``,
    ``conductance``, and from slave to master ``heat``, [power], and ``flux``, [power / length²]. Rows are in
    the order of pairs and nodes, on any number of ranks.

    Args:
        state: The state.
        path: File to write; its folder is created.
        pair: Number of a contact pair, or its name, that of its slave or of both surfaces; all unless given.

    Returns:
        The path.

    Raises:
        InvalidInputError: If the scene has no such pair.

    Example:
        >>> write_contact_table(state, "output/contact.csv", pair="lid bottom")  # doctest: +SKIP
    """
    comm, target = state.comm, Path(path)
    with together(comm):
        chosen = None if pair is None else pair_number(state.geometry.contacts, pair)
    number, columns = _contact_columns(state)
    with together(comm):
        if comm.rank == 0:
            mine = np.lexsort((columns["node"], number))
            rows = mine if chosen is None else mine[number[mine] == chosen]
            remark = "one row a contact point; forces act on the slave, heat leaves it; units of the scene"
            table = zip(*([values[row] for row in rows] for values in columns.values()), strict=True)
            write_text(target, csv_text([remark], list(columns), table))
    return target


@singledispatch
def _contact_columns(state: Any) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return the pair of each contact point and the columns of the table, by default its own. Collective."""
    own: tuple[np.ndarray, dict[str, np.ndarray]] = state.contact_columns()
    return own


@_contact_columns.register
def _(state: State) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    scene, contact, points = state.scene, state.contact, state.contact.points
    displacement = np.concatenate([state.gather_displacement(name) for name in scene.bodies])
    numbers = state.torn.decomposition.tearing
    first = [numbers.first_of(pair.slave.body) for pair in scene.contacts]
    offset = np.array(first, dtype=int)[points.pair]
    places, in_space = state.contact_places, points.tangents
    vectors = {
        "": places,
        "moved": places + displacement[points.slave, : scene.dim],
        "traction": -np.einsum("na,nad->nd", contact.traction, in_space),
        "slip": contact.slip_in_space,
        "total_slip": np.einsum("na,nad->nd", contact.total_slip, in_space),
        "normal": points.normal,
    }
    split = {
        name: {
            axis if not name else f"{axis}_moved" if name == "moved" else f"{name}_{axis}": part
            for axis, part in zip("xyz", values.T, strict=False)
        }
        for name, values in vectors.items()
    }
    kinds = zip(points.pair, contact.status, strict=True)
    status = [_status(scene.contacts[pair], kind) for pair, kind in kinds]
    return points.pair, {
        "pair": np.array([pair.place for pair in scene.contacts], dtype=object)[points.pair],
        "node": points.slave - offset,
        **split[""],
        **split["moved"],
        "status": np.array(status, dtype=object),
        "gap": contact.gap,
        "pressure": contact.pressure,
        **split["traction"],
        **split["slip"],
        **split["total_slip"],
        **split["normal"],
        "area": contact.area,
        **({} if contact.wet is None else {"wet": contact.wet.astype(int)}),
        **({"worn_depth": contact.worn_depth} if scene.wears else {}),
    }


def _status(pair: ContactPair, status: int) -> str:
    """Return the status of a point in a word: a closed one without friction is "closed"."""
    word = Status(status).name.lower()
    return word if pair.has_friction or word == "open" else "closed"


def csv_text(remarks: Sequence[str], names: Sequence[str], rows: Iterable[Iterable[Any]]) -> str:
    """Return a table as text: remarks behind "#", names of columns, rows; numbers have twelve digits."""
    text = io.StringIO()
    text.writelines(f"# {' '.join(remark.split())}\n" for remark in remarks)
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([_cell(value) for value in row] for row in rows)
    return text.getvalue()


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value + 0.0:.12g}" if isinstance(value, float | np.floating) else str(value)


def step_row(number: int, name: str, state: State) -> dict[str, Any]:
    """Return what a load step cost and what contact is like at its end."""
    contact, counts = state.contact, state.counts
    pressing = [contact.normal_forces(number) for number in range(len(state.scene.contacts))]
    drawn = state.preloads() if state.scene.preloads else {}
    return {
        "number": number,
        "name": name,
        "iterations": counts["solver_steps"],
        "products": counts["f_products"],
        **{status.name.lower(): contact.count(status) for status in Status},
        "normal_force": sum(each.sum for each in pressing),
        "normal_resultant": sum(each.resultant for each in pressing),
        "friction_force": _resultant(state),
        "peak_pressure": float(contact.pressure.max(initial=0.0)),
        **{f"preload {name}": each.force for name, each in drawn.items()},
    }


def _resultant(state: State) -> float:
    """Return the magnitude of the sum of all friction forces, zero below what the solver left, [force]."""
    contact = state.contact
    tangential = contact.force - contact.normal_force[:, None] * contact.points.normal
    size = float(np.linalg.norm(tangential.sum(axis=0)))
    left = max(ROUNDING, float(np.nan_to_num(state.solution.natural_residual)))
    return size if size > left * float(np.abs(contact.force).sum()) else 0.0


class StepTable:
    """A table (CSV) of load steps: loads, reactions, forces of contacts, energies and work, a row a step.

    After remarks that begin with "#", which give the points of moments, a line names the columns:

    | column | |
    |---|---|
    | ``number``, ``name``, ``time`` | of the load step |
    | ``iterations``, ``products`` | of the solver, and with F |
    | ``open``, ``stick``, ``slip`` | contact points by status; closed ones without friction slip |
    | ``normal_force`` | sum of all normal forces, Σ λ_N, [force] |
    | ``normal_resultant`` | sizes of the pairs' vector sums Σ n λ_N, added up: as much on flat surfaces |
    | ``friction_force`` | size of the vector sum of all friction forces, [force] |
    | ``peak_pressure`` | of all pairs, [force / length²] |
    | ``strain_energy``, ``load_energy``, ``friction_energy`` | as in `results.Energies`; empty if not known |
    | ``surface_energy`` | where surfaces give way or wear |
    | ``preload NAME`` | force of each preload |
    | ``loads Fx``, ... | force of all loads, and its moment ``loads Mx``, ... |
    | ``loads Fr``, ``loads Fz`` | the same of bodies of revolution, a revolution; with torsion ``loads T`` |
    | ``lid top Fx``, ... | reaction of the supports of the surface "top" of the body "lid" |
    | ``foundation slab bottom Fx``, ... | force of springs to the ground |
    | ``tool NAME ux``, ..., ``tool NAME turn x``, ... | displacement and rotation of each rigid tool |
    | ``tool NAME Fx``, ..., ``tool NAME Mx``, ... | force of contact on it, and moment about its point |
    | ``spring NAME tension``, ``... elongation`` | of springs between surfaces, with the axis if in several |
    | ``constraint NAME lid Fx``, ... | force of a linear constraint on a body |
    | ``lid bottom on pot rim Fx``, ... | force on the slave of a pair or tie |
    | ``lid bottom on pot rim pressure``, ``... area`` | the largest pressure, and the area of contact |
    | ``lid bottom on pot rim worn volume``, ``... worn depth`` | of pairs that wear; the largest depth |

    The file is complete after every `add`, the same on any number of ranks.

    Attributes:
        path: The file.

    Example:
        >>> table = StepTable("output/steps.csv", comm)  # doctest: +SKIP
        >>> for number, state in enumerate(solve_steps(ContactProblem(scene, comm), steps)):  # doctest: +SKIP
        ...     table.add(state, steps[number].name)
    """

    path: Path

    def __init__(self, path: str | Path, comm: MPI.Comm) -> None:
        """Begin a new table; nothing is written yet.

        Args:
            path: File to write; its folder is created, and a file of that name replaced, with the first row.
            comm: Communicator of the states.
        """
        self.path, self._comm = Path(path), comm
        self._rows: list[Mapping[str, Any]] = []
        self._about: dict[str, np.ndarray] = {}

    @collectively("StepTable.add", lambda self, *_, **__: self._comm)
    def add(self, state: State, name: str = "", time: float | None = None) -> Path:
        """Add the row of a state and write the table. Collective.

        Args:
            state: The state after the step.
            name: Name of the step.
            time: Time of the step; that of the state unless given.

        Returns:
            The path.

        Raises:
            OutputError: If the file cannot be written; the table before is unchanged.
        """
        values = self._forces(state)
        for number, each in enumerate(_names([pair.place for pair in state.scene.contacts])):
            pressure = state.contact.pressure[state.contact.on_pair(number)]
            values[f"{each} pressure"] = float(pressure.max(initial=0.0))
            values[f"{each} area"] = contact_area(state, number)
            worn = worn_from(state.scene, state.contact, number)
            values |= {f"{each} {key}": value for key, value in worn.items()}
        soft = state.scene.wears or any(pair.closure is not None for pair in state.scene.contacts)
        kinds = ("strain", "load", "friction", *(("surface",) if soft else ()))
        energies = {key: getattr(state.energies, key) for key in kinds}
        named = {"number": len(self._rows), "name": name, "time": state.time if time is None else float(time)}
        known = {f"{key}_energy": value if np.isfinite(value) else None for key, value in energies.items()}
        self._rows.append({**named, **step_row(len(self._rows), name, state), **known, **values})
        with together(self._comm):
            if self._comm.rank == 0:
                write_text(self.path, self._text())
        return self.path

    def _forces(self, state: State) -> dict[str, float]:
        """Return forces and moments by their columns, rounding as zero. Collective."""
        balance, pairs = state.balance(self._about.get("loads")), state.resultants()
        reactions = state.reactions()
        found = {"loads": balance.loads, **{place: reactions[place] for place in reactions.places}}
        if state.scene.foundations:
            beds = state.foundations()
            found |= {f"foundation {place}": beds[place] for place in beds.places}
        for listed in (pairs.contacts, pairs.ties):
            found |= dict(zip(_names(listed.places), listed, strict=True))
        columns: dict[str, float] = {}
        for each in joint_results(state):
            columns |= each.columns(balance.force_scale)
        columns |= _tools(state, balance)
        for name, part in found.items():
            self._about.setdefault(name, part.about)
            columns |= _of_resultant(name, part, balance)
        return columns

    def _text(self) -> str:
        names = list(dict.fromkeys(name for row in self._rows for name in row))
        size = max(float(np.abs(point).max()) for point in self._about.values())
        places = {name: rounded(point, size) for name, point in self._about.items()}
        about = (f"{each} ({', '.join(f'{x:.6g}' for x in point)})" for each, point in places.items())
        remarks = [
            "one row a load step; forces of pairs act on the slave; units are those of the scene",
            f"moments about: {'; '.join(about)}",
        ]
        return csv_text(remarks, names, ([row.get(name) for name in names] for row in self._rows))


def _of_resultant(name: str, each: Resultant, balance: Balance) -> dict[str, float]:
    """Return force and moment by their columns, rounding of those of all bodies as zero."""
    parts = (each.force, balance.force_scale), (each.moment, balance.moment_scale)
    numbers = np.concatenate([rounded(part, scale) for part, scale in parts])
    return {f"{name} {head}": float(v) for head, v in zip(each.heads, numbers, strict=True)}


def _tools(state: State, balance: Balance) -> dict[str, float]:
    """Return motion, force and moment of rigid tools by their columns. Collective."""
    columns: dict[str, float] = {}
    for name, tool in state.tools().items():
        acting = Resultant(tool.force, tool.moment, tool.displacement)
        axes = [head[1] for head in acting.heads[: len(tool.force)]]
        turns = np.atleast_1d(tool.rotation)[: np.size(tool.moment)]
        around = "xyz"[3 - len(turns) :]
        columns |= {f"tool {name} u{axis}": float(x) for axis, x in zip(axes, tool.displacement, strict=True)}
        columns |= {f"tool {name} turn {axis}": float(x) for axis, x in zip(around, turns, strict=True)}
        columns |= _of_resultant(f"tool {name}", acting, balance)
    return columns


def _names(places: Sequence[str]) -> list[str]:
    """Return the names of columns: places, numbered where pairs of the scene share one."""
    times = Counter(places)
    return [place if times[place] == 1 else f"{place} ({k})" for k, place in enumerate(places)]
