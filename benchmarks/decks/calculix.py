"""Results of CalculiX: its .dat and .frd files, and runs of the program on a copy of a deck.

A .dat file has what a deck asks for with *NODE PRINT and *EL PRINT, a .frd file what it asks for with
*NODE FILE and *EL FILE. Both are read as `Block`: one quantity, for one set, at one time.
"""

from __future__ import annotations

import gzip
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

from fenics_contact._base.launching import clean_environment

#: What a line of a .dat file begins with -> quantity, and how many numbers of a row are labels.
PRINTED = {
    "displacements": ("U", 1),
    "forces": ("RF", 1),
    "total force": ("RF", 0),
    "stresses": ("S", 2),
    "strains": ("E", 2),
}
#: The same of results in .frd files.
FILED = {"DISP": "U", "FORC": "RF", "STRESS": "S", "STRAIN": "E"}
#: The head of a table, and a number of Fortran, which drops the E of an exponent of three digits.
_HEAD = re.compile(r"^ *(.+?) *(?:\([^)]*\))? *for ?set (\S+) and time +(\S+)$")
_NUMBER = re.compile(r"([+-]?\d*\.\d+)(?:[EeDd]?([+-]\d+))?|([+-]?\d+)|(NaN)", re.IGNORECASE)


@dataclass(frozen=True)
class Block:
    """One table of results.

    Attributes:
        quantity: "U", displacement; "RF", force; "S", stress; "E", strain.
        place: Name of the set of nodes or elements, in capitals; of a .frd file "", all nodes.
        time: Total time.
        labels: Number of the node, (n, 1), or of the element and its point of integration, (n, 2); of a sum
            (1, 0).
        values: Three components of displacements and forces; of stresses and strains xx, yy, zz, xy, xz and
            yz in .dat files, and xx, yy, zz, xy, yz and zx in .frd files; (n, 3 | 6).
    """

    quantity: str
    place: str
    time: float
    labels: np.ndarray
    values: np.ndarray


def text_of(path: Path) -> str:
    """Return the text of a file, which may be compressed: then there is one with .gz behind its name."""
    packed = path.with_name(path.name + ".gz")
    data = path.read_bytes() if path.exists() else gzip.decompress(packed.read_bytes())
    return data.decode(errors="replace")


def read_dat(text: str) -> list[Block]:
    """Return the displacements, forces, stresses and strains of a .dat file, in its order."""
    blocks: list[Block] = []
    lines = iter(text.splitlines())
    for line in lines:
        head = _HEAD.match(line)
        if head and head[1] in PRINTED:
            quantity, labels = PRINTED[head[1]]
            rows = np.array(list(_rows(lines)), dtype=np.float64)
            if rows.size:
                numbers = rows[:, :labels].astype(np.int64)
                blocks.append(Block(quantity, head[2], float(head[3]), numbers, rows[:, labels:]))
    return blocks


def _rows(lines: Iterator[str]) -> Iterator[list[float]]:
    """Yield the rows up to the empty line that follows them."""
    started = False
    for line in lines:
        if line.strip():
            started = True
            yield _numbers(line)
        elif started:
            return


def _numbers(line: str) -> list[float]:
    """Return the numbers of a line, that may follow each other without a blank."""
    found = []
    for mantissa, exponent, whole, _ in _NUMBER.findall(line):
        found.append(float(whole or (f"{mantissa}e{exponent or 0}" if mantissa else "nan")))
    return found


def read_frd(text: str) -> list[Block]:
    """Return the displacements, forces, stresses and strains of a .frd file in text form, in its order."""
    blocks: list[Block] = []
    name, time, short = "", 0.0, False
    labels: list[int] = []
    values: list[list[float]] = []
    for line in text.splitlines():
        if line.startswith("  100C"):
            time, short = float(line[12:24]), line.rstrip().endswith(" 0")
        elif line.startswith(" -4"):
            name = line[5:13].strip()
            labels, values = [], []
        elif line.startswith((" -1", " -2")) and name in FILED:
            start = 8 if short else 13
            row = [float(line[i : i + 12]) for i in range(start, len(line.rstrip()), 12)]
            if line.startswith(" -1"):
                labels.append(int(line[3:start]))
                values.append(row)
            else:
                values[-1] += row
        elif line.startswith(" -3") and name in FILED and values:
            array = np.array(values)[:, : 3 if FILED[name] in ("U", "RF") else 6]
            blocks.append(Block(FILED[name], "", time, np.array(labels)[:, None], array))
        if line.startswith(" -3"):
            name = ""
    return blocks


def program() -> str | None:
    """Return the path of CalculiX's program, None where it is not installed."""
    return shutil.which("ccx")


#: Elements in a plane, whose results are wanted where the deck has nodes, not where the program has them.
_PLANE = re.compile(r"TYPE *= *C(PS|PE|AX)", re.IGNORECASE)


def with_requests(text: str, tight: bool) -> str:
    """Return a deck that asks for all displacements and forces at the end of its steps.

    `tight`: whether iterations end at a hundred-thousandth of the forces in place of the program's 0.5 %, and
    linear systems are solved directly.
    """
    # Without GLOBAL results of nodes with *TRANSFORM are along their axes.
    plane = ",GLOBAL=YES,OUTPUT=2D" if _PLANE.search(text) else ",GLOBAL=YES"
    wanted = [f"*NODE FILE,FREQUENCY=99999{plane}", "U,RF"]
    if tight:
        wanted += ["*CONTROLS,PARAMETERS=FIELD", "1.E-5,1.E-5"]
    lines = []
    for line in text.splitlines():
        if line.upper().replace(" ", "").startswith("*ENDSTEP"):
            lines += wanted
        if tight:
            line = re.sub(r", *SOLVER *= *ITERATIVE *(CHOLESKY|SCALING)", "", line, flags=re.IGNORECASE)
        if re.match(r"\*NODE *PRINT", line, re.IGNORECASE) and "GLOBAL" not in line.upper():
            line = f"{line.rstrip().rstrip(',')},GLOBAL=YES"
        lines.append(line)
    return "\n".join(lines) + "\n"


def run_calculix(text: str, limit: float = 120.0) -> tuple[list[Block], float]:
    """Run CalculiX on one core on a deck in a temporary folder.

    Args:
        text: The deck.
        limit: Longest time [s].

    Returns:
        What is in its .dat and its .frd file, and the seconds.

    Raises:
        RuntimeError: If the program reports an error or takes too long.
    """
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "model.inp").write_text(text)
        start = perf_counter()
        environment = clean_environment() | {"OMP_NUM_THREADS": "1", "CCX_NPROC_EQUATION_SOLVER": "1"}
        try:
            done = subprocess.run(
                [str(program()), "model"],
                cwd=folder, capture_output=True, text=True, errors="replace", timeout=limit, env=environment,
            )  # fmt: skip
        except subprocess.TimeoutExpired as error:
            raise RuntimeError(f"CalculiX took more than {limit:g} s") from error
        seconds = perf_counter() - start
        wrong = [line.strip() for line in done.stdout.splitlines() if "*ERROR" in line]
        if wrong or done.returncode:
            raise RuntimeError(wrong[0] if wrong else f"CalculiX ended with {done.returncode}")
        blocks: list[Block] = []
        for suffix, read in ((".dat", read_dat), (".frd", read_frd)):
            path = folder / f"model{suffix}"
            blocks += read(path.read_text(errors="replace")) if path.exists() else []
        return blocks, seconds


def reference(folder: Path, name: str) -> list[Block]:
    """Return what the reference files of a deck have: that of the .dat file before that of the .frd file."""
    blocks: list[Block] = []
    for suffix, read in ((".dat.ref", read_dat), (".frd.ref", read_frd)):
        path = folder / f"{name}{suffix}"
        if path.exists() or path.with_name(path.name + ".gz").exists():
            blocks += read(text_of(path))
    return blocks
