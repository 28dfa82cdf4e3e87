"""The comparison: its jobs, and the tables of its page."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.peers.scenes import hertz_peak, lame_force
from benchmarks.study import ROOT, Records, Study, filled
from fenics_contact.output import write_json, write_text
from fenics_contact.study.report import table
from fenics_contact.study.runner import Job

HOME, NAME = ROOT / "docs" / "studies", "peers"
OURS, REFERENCE = "fenics_contact", "reference"
#: Most seconds that a job may take, and how often short ones are measured.
LIMIT, REPEATS, SHORT = 1800.0, 3, 5.0

#: Program -> its module, ranks (0: no MPI in the process), arguments and what is said of it in the tables.
Run = tuple[str, int, dict[str, Any]]
PROGRAMS: dict[str, Run] = {
    OURS: ("ours", 1, {}),
    f"{OURS}, node": ("ours", 1, {"discretisation": "node"}),
    "CalculiX, face": ("calculix", 0, {"kind": "face"}),
    "CalculiX, face, 20 times stiffer": ("calculix", 0, {"kind": "face", "stiffness": 1000.0}),
    "CalculiX, node": ("calculix", 0, {"kind": "node"}),
    "GetFEM": ("in_getfem", 0, {}),
    "NGSolve, penalty": ("in_ngsolve", 0, {}),
    "Kratos, mortar": ("in_kratos", 0, {}),
}
#: Programs by scene; those that are left out have no such contact, or took more than ten minutes.
MEASURED: dict[str, tuple[str, ...]] = {
    "block-2k": (OURS, "CalculiX, face", "GetFEM", "NGSolve, penalty"),
    "block-28k": (OURS, "CalculiX, face", "GetFEM", "NGSolve, penalty"),
    "block-92k": (OURS, "CalculiX, face"),
    "ball-2k": (OURS, "CalculiX, face", "CalculiX, node", "NGSolve, penalty", "Kratos, mortar"),
    "ball-14k": (OURS, "CalculiX, face", "CalculiX, node", "NGSolve, penalty", "Kratos, mortar"),
    "cubes": tuple(PROGRAMS),
    "press-fit": (OURS, "CalculiX, face", "GetFEM", "NGSolve, penalty", "Kratos, mortar"),
}
IRONING: dict[str, tuple[str, int]] = {
    OURS: ("ours", 1),
    "GetFEM": ("by_getfem", 0),
    "CalculiX, face": ("by_calculix", 0),
}
#: What the forces of a scene are held against: its name, a finer mesh's or a tighter tolerance's state.
REFERENCES: dict[str, tuple[str, dict[str, Any]]] = {
    **{size: (size, {"tolerance": 1e-9}) for size in ("block-2k", "block-28k", "block-92k")},
    "cubes": ("cubes-finer", {"discretisation": "mortar"}),
}


@dataclass(frozen=True)
class Compared:
    """A value of a scene and what it should be, from the record and that of the reference."""

    title: str
    value: Callable[[Mapping[str, Any]], float]
    reference: Callable[[Mapping[str, Any], Mapping[str, Any]], float]

    def error(self, record: Mapping[str, Any], reference: Mapping[str, Any]) -> float:
        """Return the relative error."""
        return self.value(record) / self.reference(record, reference) - 1.0


_NORMAL = Compared("normal force", lambda each: each["normal"], lambda _, known: known["normal"])
_ALONG = Compared("friction", lambda each: each["tangential"][0], lambda _, known: known["tangential"][0])
_PEAK = Compared("peak pressure", lambda each: each["peak"], lambda each, _: hertz_peak(each["normal"]))
_HOOP = Compared("hoop force", lambda each: each["hoop"], lambda *_: lame_force())
COMPARED = {"block": (_NORMAL, _ALONG), "cubes": (_NORMAL, _ALONG), "ball": (_PEAK,), "press": (_HOOP,)}


def compared(scene: str) -> tuple[Compared, ...]:
    """Return what is compared in a scene."""
    return COMPARED[scene.partition("-")[0]]


def jobs(quick: bool) -> list[Job]:
    """Return a job for every scene and program; the quick comparison has the smallest scenes, once."""
    found = []
    for scene, programs in MEASURED.items():
        for program in programs:
            module, ranks, arguments = PROGRAMS[program]
            found.append(
                _job(f"{scene} {program}", f"{module}:measure", {"scene": scene, **arguments}, ranks)
            )
        if scene in REFERENCES:
            other, arguments = REFERENCES[scene]
            found.append(_job(f"{scene} {REFERENCE}", "ours:measure", {"scene": other, **arguments}, 1))
    small = [job for job in found if job.arguments["scene"] == "block-2k"]
    drawn = [
        _job(f"ironing {name}", f"ironing:{function}", {}, ranks)
        for name, (function, ranks) in IRONING.items()
    ]
    return (
        [_job(job.name, job.function.partition("peers.")[2], job.arguments, job.ranks, 1) for job in small]
        if quick
        else [*found, *drawn]
    )


def _job(name: str, function: str, arguments: Mapping[str, Any], ranks: int, repeats: int = REPEATS) -> Job:
    return Job(
        name,
        f"benchmarks.{NAME}.{function}",
        arguments,
        ranks=ranks,
        repeats=repeats,
        short=SHORT,
        limit=LIMIT,
    )


def summary(records: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return one record of several: seconds and memory are medians."""
    first = records[0]
    found = {
        key: value
        for key, value in first.items()
        if key not in ("name", "arguments", "code", "ranks", "import_memory")
    }
    for key in ("seconds", "process_seconds", "load_average"):
        if key in first:
            found[key] = round(median(each[key] for each in records if key in each), 3)
    if "program_memory" in first:  # not of one that was stopped
        found["memory"] = int(median(each["program_memory"] for each in records))
    return {key: value for key, value in found.items() if key not in ("peak_memory", "program_memory")}


def tables(record: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """Return the tables of the page by their names."""
    found = {scene: _of_scene(scene, record) for scene in MEASURED}
    loads = [each["load_average"] for each in record.values()]
    span = " to ".join(dict.fromkeys(f"{load:.0f}" for load in (min(loads), max(loads))))
    load = f"Load of the machine in the minute before each run: {span}."
    return {"load": load, "better": _better(record), **found, "ironing": _ironing(record)}


def _lines(scene: str, record: Mapping[str, Mapping[str, Any]], programs: Sequence[str]) -> dict[str, Any]:
    return {name: record[f"{scene} {name}"] for name in programs if f"{scene} {name}" in record}


def _start(program: str, found: Mapping[str, Any], ours: float) -> list[str]:
    """Return the first columns of a line, those of `_HEAD`."""
    if "seconds" not in found:
        return [program, found.get("why", ""), "", "", "", ""]
    seconds, whole = found["seconds"], found.get("process_seconds", found["seconds"])
    steps = f"{found['steps']}" + ("" if found["converged"] else ", **no answer**")
    return [
        program,
        f"{seconds:.2f}",
        f"{seconds / ours:.2g}",
        f"{whole:.2f}",
        f"{found['memory'] / 1e6:.0f}",
        steps,
    ]


_HEAD = ("program", "seconds", "× ours", "with imports", "MB", "steps")


def _of_scene(scene: str, record: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the table of a scene."""
    lines, values = _lines(scene, record, MEASURED[scene]), compared(scene)
    reference = record.get(f"{scene} {REFERENCE}", {})
    rows = []
    for program, found in lines.items():
        row = _start(program, found, lines[OURS]["seconds"])
        if found["converged"]:
            row += [f"{100 * each.error(found, reference):+.2f} %" for each in values]
            row += [f"{found['overlap']:.1e}"]
        rows.append(tuple([*row, *[""] * (len(_HEAD) + len(values) + 1 - len(row))]))
    return table((*_HEAD, *(f"{each.title}, error" for each in values), "overlap"), rows)


def _ironing(record: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the table of the ironing, with forces down and along by time."""
    lines, rows = _lines("ironing", record, tuple(IRONING)), []
    times = [each["time"] for each in lines[OURS]["times"]]
    for program, found in lines.items():
        known = {each["time"]: f"{each['vertical']}, {each['horizontal']}" for each in found.get("times", ())}
        row = _start(program, found, lines[OURS]["seconds"])
        rows.append((*row, *(known.get(time, found.get("why", "")) for time in times)))
    return table((*_HEAD, *(f"time {time:g}: down, along" for time in times)), rows)


def _judged(scene: str, found: Mapping[str, Any], reference: Mapping[str, Any]) -> dict[str, str]:
    """Return what a program is judged by, as it is shown: the smaller, the better."""
    judged = {
        "seconds": f"{found['seconds']:.2f}",
        "seconds with imports": f"{found.get('process_seconds', found['seconds']):.2f}",
        "MB": f"{found['memory'] / 1e6:.0f}",
    }
    for each in compared(scene) if scene in MEASURED else ():
        judged[f"error of the {each.title}, %"] = f"{100 * abs(each.error(found, reference)):.3f}"
    return judged


def _better(record: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the table of all lines in which another program is better."""
    rows = []
    for scene in (*MEASURED, "ironing"):
        lines, reference = _lines(scene, record, tuple(PROGRAMS)), record.get(f"{scene} {REFERENCE}", {})
        ours = _judged(scene, lines[OURS], reference)
        rows += [
            (scene, program, what, shown, ours[what])
            for program, found in lines.items()
            if found["converged"] and not program.startswith(OURS)
            for what, shown in _judged(scene, found, reference).items()
            if float(shown) < float(ours[what])
        ]
    return table(("scene", "program", "what", "theirs", "ours"), rows)


def write(folder: Path, records: Records, quick: bool) -> None:
    """Write numbers and page; what was not measured, or is not installed, keeps its numbers."""
    new = {name: summary(found) for name, found in records.items() if "skipped" not in found[0]}
    for name, found in records.items():
        if "skipped" in found[0]:
            print(f"{name}: skipped, {found[0]['skipped']}")
    if quick:
        write_json(folder / f"{NAME}.json", new)
        return
    before = HOME / f"{NAME}.json"
    known = (json.loads(before.read_text()) if before.exists() else {}) | new
    record = {job.name: known[job.name] for job in jobs(quick) if job.name in known}
    if records:
        write_json(folder / f"{NAME}.json", record)
    page = (HOME / f"{NAME}.md").read_text(encoding="utf-8")
    write_text(folder / f"{NAME}.md", filled(page, tables(record)))


study = Study(
    jobs,
    write,
    HOME,
    (Path(__file__).parent, ROOT / "benchmarks" / "large_deformations"),
    warm_up=tuple(
        _job(f"warm-up {scene}", "ours:measure", {"scene": scene}, 1, 1) for scene in ("block-2k", "ball-2k")
    ),
)
