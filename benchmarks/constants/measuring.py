"""What halving and doubling the constants of a room does to the scenes."""

from __future__ import annotations

import importlib
import signal
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.constants.changed import noted, replaced, unchanged
from benchmarks.constants.listed import Constant, constants, scaled

FACTORS = (0.5, 2.0)
#: What is compared by its norm relative to the reference's. Certificates are relative already: by difference.
RELATIVE = ("energy", "force", "gradient", "estimate")
#: The module of the scenes, which is imported anew with the package.
SCENES = "benchmarks.constants.scenes"
#: Seconds after which a scene is given up.
LONGEST = 60

Answers = dict[str, dict[str, Any]]


def run(_: MPI.Comm, room: str, scenes: Collection[str] = (), names: Collection[str] = ()) -> dict[str, Any]:
    """Measure the constants of a room, by one process.

    Args:
        room: A part of the package, "qp".
        scenes: Names of the scenes; all of them if empty.
        names: Keys of the constants; all of the room if empty.

    Raises:
        RuntimeError: If the scenes give another answer at the end than at the start.
    """
    reference, read = _reference(scenes)
    wanted = [each for each in constants() if each.room == room and (not names or each.key in names)]
    found = {each.key: _measured(each, reference, read.get(each.key, ())) for each in wanted}
    with unchanged():
        again = solved(reference)
    if not compared(reference, again)["same"]:
        raise RuntimeError(f"the scenes must answer the same after {room} was measured: find what was kept")
    return {"room": room, "constants": found}


def answers(_: MPI.Comm) -> dict[str, Any]:
    """Return the answers of all scenes, which tests compare with."""
    with unchanged():
        return {"answers": solved(importlib.import_module(SCENES).SCENES)}


def _reference(names: Collection[str]) -> tuple[Answers, dict[str, list[str]]]:
    """Return the answers of scenes, and for each constant the scenes that read it."""
    read: set[str] = set()
    found, readers = Answers(), dict[str, list[str]]()
    with noted(read):
        scenes = list(importlib.import_module(SCENES).SCENES)
        always = frozenset(read)  # what modules read when they are loaded all scenes may depend on
        for name in scenes:
            if not names or name in names:
                read.clear()
                found |= solved([name])
                for key in always | read:
                    readers.setdefault(key, []).append(name)
    return found, readers


def _measured(constant: Constant, reference: Answers, readers: Collection[str]) -> dict[str, Any]:
    """Return what factors on a constant do to the scenes that read it."""
    found = {}
    for factor in FACTORS if readers else ():
        if (value := scaled(constant.value, factor)) != constant.value:
            with replaced(constant, value):
                found[f"{factor:g}"] = compared(reference, solved(readers))
    return {"reached": bool(readers), "factors": found}


def solved(names: Collection[str]) -> Answers:
    """Solve scenes by the package as it is imported now; what fails says why."""
    found: Answers = {}
    try:
        scenes = importlib.import_module(SCENES).SCENES
    except Exception as error:  # of a constant with which a module cannot be loaded
        return {"import": {"failed": _in_one_line(error)}}
    for name in names:
        try:
            with _at_most(LONGEST):
                found[name] = scenes[name]()
        except Exception as error:
            found[name] = {"failed": _in_one_line(error)}
    return found


def compared(reference: Answers, answers: Answers) -> dict[str, Any]:
    """Return the largest change of every part of the answers, and the failures.

    Returns:
        ``same`` if no bit has changed; changes by their names; ``excess``, the largest of them in units of
        the tolerance of its scene, and that ``scene``; ``products``, the ratio that is farthest from one.
    """
    if "import" in answers:
        return {"same": False, "failed": {"import": answers["import"]["failed"]}}
    each = {name: _change(reference[name], answer) for name, answer in answers.items()}
    good = {name: change for name, change in each.items() if "failed" not in change}
    found: dict[str, Any] = {"same": all(change["same"] for change in each.values())}
    for kind in (*RELATIVE, "certificate", "excess"):
        found[kind] = max((change[kind] for change in good.values() if kind in change), default=0.0)
    found["scene"] = max(good, key=lambda name: good[name]["excess"], default="")
    ratios = [change["products"] for change in good.values()]
    found["products"] = max(ratios, key=lambda ratio: abs(np.log(ratio)), default=1.0)
    failed = {name: change["failed"] for name, change in each.items() if "failed" in change}
    return found | ({"failed": failed} if failed else {})


def _change(before: Mapping[str, Any], after: Mapping[str, Any]) -> dict[str, Any]:
    """Return how the answer of one scene has changed."""
    if "failed" in after or "failed" in before:
        same = before.get("failed") == after.get("failed")
        words = after.get("failed", "an answer where there was none")
        return {"same": True, "excess": 0.0, "products": 1.0} if same else {"same": False, "failed": words}
    same, found = before["products"] == after["products"], dict[str, Any]()
    for kind in (*RELATIVE, "certificate"):
        if kind in before:
            old, new = np.asarray(before[kind]), np.asarray(after[kind])
            if old.shape != new.shape:
                return {"same": False, "failed": f"{new.size} numbers for {kind}, not {old.size}"}
            if not np.isfinite(new).all():
                return {"same": False, "failed": f"{kind} is not finite"}
            scale = np.linalg.norm(old) if kind in RELATIVE else 1.0
            found[kind] = float(np.linalg.norm(new - old) / (scale or 1.0))
            same = same and np.array_equal(old, new)
    found["excess"] = max(found.values()) / before["tolerance"]
    return {"same": same, "products": after["products"] / before["products"], **found}


@contextmanager
def _at_most(seconds: int) -> Iterator[None]:
    """Raise where something takes too long."""

    def give_up(*_: Any) -> None:
        raise TimeoutError(f"no answer within {seconds} s")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def _in_one_line(error: Exception) -> str:
    """Return an error in one line."""
    words = str(error).splitlines() or [""]
    return f"{type(error).__name__}: {words[0]}"[:200]
