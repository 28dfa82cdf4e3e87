"""Arrays by name in a file of NumPy's .npz format, with their kind and the fingerprint of the problem.

The format is a zip archive with one .npy file per array, which `numpy.load` reads with
``allow_pickle=False``, as do libraries for other languages. The arrays are those of the whole problem,
independent of the number of ranks. HDF5 would need h5py, built for the MPI and the HDF5 of dolfinx, which
Debian's FEniCSx lacks, without any saving: a file that must be complete is rewritten anyway.

| array | what it is |
|---|---|
| ``_format``, ``_version`` | "fenics_contact checkpoint", 2 |
| ``_kind`` | "load history" or "minimisation by the bundle trust method" |
| ``_fingerprint`` | JSON text: parts of the problem by name with their descriptions, see `described` |
| ``_digest`` | SHA-256, hexadecimal, of all other arrays in the order of their names: of each the text \
"NAME TYPE SHAPE " as NumPy prints type and shape, then its bytes in C order |

A load history has ``steps``, the number of steps done, and for each, numbered from 000000, ``NUMBER.step``
(JSON text that describes it), ``NUMBER.multiplier`` (λ of all rows, [force]), ``NUMBER.origin`` (from where
slip is measured, [length]), ``NUMBER.slid`` (the same of points without friction) and ``NUMBER.motion``
(coefficients of the rigid motions); a state without multipliers has only the description.

A minimisation has ``centre.*`` (best point ``x``, ``value``, ``subgradient``), ``bundle.*``, ``trust.*`` and
``first_t``, ``careful`` (state of the method), ``history.*`` (a list for each attribute of a `Record` of the
optimiser) and ``fun.*``, the memory of the function: of a shape problem the states of the first, best and
last design, and the one to start from.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fenics_contact.checkpoint.whole_file import write_whole
from fenics_contact.errors import InvalidInputError
from fenics_contact.fingerprint import differences

FORMAT = "fenics_contact checkpoint"
VERSION = 2

Arrays = dict[str, NDArray[Any]]


def write_archive(path: Path, kind: str, fingerprint: Mapping[str, str], arrays: Mapping[str, Any]) -> None:
    """Write arrays with their kind and the problem's fingerprint, atomically.

    Args:
        path: File to replace.
        kind: Kind of the arrays.
        fingerprint: Identifies the problem, see `described`.
        arrays: Numbers and text by name; names must not start with an underscore.

    Raises:
        CheckpointError: If it cannot be written.
    """
    buffer = io.BytesIO()
    head = {
        "_format": FORMAT,
        "_version": VERSION,
        "_kind": kind,
        "_fingerprint": json.dumps(dict(fingerprint)),
    }
    members: dict[str, Any] = {name: np.asarray(value) for name, value in {**head, **arrays}.items()}
    np.savez(buffer, **members, _digest=np.array(_digest(members)))
    write_whole(path, buffer.getvalue())


def read_archive(path: Path, kind: str, fingerprint: Mapping[str, str]) -> Arrays:
    """Read the arrays of a problem.

    Raises:
        InvalidInputError: If the file is missing, cannot be read, is not a complete checkpoint, or is of
            another version, kind or problem; states what differs.
    """
    arrays = _loaded(path)
    if str(arrays.pop("_format", "")) != FORMAT:
        raise InvalidInputError(
            f"a checkpoint is needed, but {str(path)!r} is another file: give the path of a checkpoint, or a "
            "new name to start anew"
        )
    version, stored_kind = int(arrays.pop("_version")), str(arrays.pop("_kind"))
    if version != VERSION:
        raise InvalidInputError(
            f"a checkpoint of version {VERSION} is needed, {str(path)!r} is of version {version}: go on with "
            "the version of fenics_contact that wrote it, or give a new name to start anew"
        )
    if stored_kind != kind:
        raise InvalidInputError(
            f"a checkpoint of a {kind} is needed, {str(path)!r} is one of a {stored_kind}: give another path"
        )
    unlike = differences(json.loads(str(arrays.pop("_fingerprint"))), fingerprint)
    if unlike:
        raise InvalidInputError(
            f"the checkpoint {str(path)!r} is of another problem; there and here differ "
            f"{'; '.join(unlike)}: give the same problem to go on, or a new name to start anew"
        )
    return arrays


def _digest(members: Arrays) -> str:
    """Return a hash of names and contents: the checksums of the format exclude the names."""
    digest = hashlib.sha256()
    for name in sorted(members):
        digest.update(f"{name} {members[name].dtype.str} {members[name].shape} ".encode())
        digest.update(np.ascontiguousarray(members[name]).tobytes())
    return digest.hexdigest()


def _loaded(path: Path) -> Arrays:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InvalidInputError(
            f"a checkpoint is needed at {str(path)!r}, which cannot be read: {error.strerror or error}; give "
            "the path of one that can"
        ) from error
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            spoilt = archive.testzip()  # before any stored length is trusted
        if spoilt is None:
            with np.load(io.BytesIO(content), allow_pickle=False) as members:
                arrays = {name: members[name] for name in members.files}
            digest = str(arrays.pop("_digest", ""))
            if "_format" not in arrays or digest == _digest(arrays):
                return arrays
        reason = "its checksums do not agree"
    except Exception as error:  # arbitrary bytes can make the libraries raise anything
        reason = str(error) or type(error).__name__
    raise InvalidInputError(
        f"a whole checkpoint is needed, {str(path)!r} with {len(content)} bytes is none ({reason}): bring "
        "back a copy of it, or move it away to start anew"
    )
