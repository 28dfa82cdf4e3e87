"""A file that is no whole checkpoint of the same problem is refused, and the words say what to do."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Checkpoint
from fenics_contact._base import checkpoint as archive
from fenics_contact._base.checkpoint import read_archive, write_archive
from fenics_contact.errors import InvalidInputError
from tests.equilibrium.step_cases import sequence, shears

PROBLEM = {"size": "3", "bounds": "a box"}
ARRAYS = {"x": np.linspace(0.0, 1.0, 40), "names": np.array(["start", "serious"])}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    target = tmp_path / "run.npz"
    write_archive(target, "test", PROBLEM, ARRAYS)
    return target


def test_what_was_written_is_read_bit_by_bit(path: Path) -> None:
    found = read_archive(path, "test", PROBLEM)
    assert set(found) == set(ARRAYS)
    assert all(found[name].tobytes() == ARRAYS[name].tobytes() for name in ARRAYS)


def test_the_file_is_an_ordinary_one_of_numpy(path: Path) -> None:
    with np.load(path, allow_pickle=False) as members:
        assert str(members["_format"]) == "fenics_contact checkpoint"
        assert members["x"].tolist() == ARRAYS["x"].tolist()


def test_the_digest_is_what_its_description_says(path: Path) -> None:
    digest = hashlib.sha256()
    with np.load(path, allow_pickle=False) as members:
        assert "_digest" in members.files
        for name in sorted(set(members.files) - {"_digest"}):
            digest.update(f"{name} {members[name].dtype.str} {members[name].shape} ".encode())
            digest.update(members[name].tobytes())
        assert str(members["_digest"]) == digest.hexdigest()


def test_the_arrays_of_a_load_history_have_the_names_that_are_described(tmp_path: Path) -> None:
    steps = sequence(Checkpoint(tmp_path / "run.npz"), MPI.COMM_SELF)
    for step in shears((0.0, 0.006)):
        steps.advance(step)
    parts = ("step", "multiplier", "origin", "slid", "motion")
    with np.load(tmp_path / "run.npz") as members:
        assert set(members.files) == {
            *("_format", "_version", "_kind", "_fingerprint", "_digest", "steps"),
            *(f"00000{k}.{part}" for k in (0, 1) for part in parts),
        }
        assert str(members["_kind"]) == "load history"
        assert members["000001.multiplier"].any()


def test_a_file_cut_anywhere_is_refused(path: Path) -> None:
    content = path.read_bytes()
    for length in np.linspace(0, len(content) - 1, 60).astype(int):
        path.write_bytes(content[:length])
        with pytest.raises(InvalidInputError, match=r"is not a complete checkpoint.*restore or remove it"):
            read_archive(path, "test", PROBLEM)


def test_a_spoilt_byte_is_noticed_wherever_it_matters(path: Path) -> None:
    content, refused = path.read_bytes(), 0
    places = np.random.default_rng(1).choice(len(content), 300, replace=False)
    for place in places:
        spoilt = bytearray(content)
        spoilt[place] ^= 0xFF
        path.write_bytes(spoilt)
        try:
            found = read_archive(path, "test", PROBLEM)
            assert all(found[name].tobytes() == ARRAYS[name].tobytes() for name in ARRAYS)
        except InvalidInputError:
            refused += 1
    # The rest are dates and other entries of the archive's directory that nothing depends on.
    assert refused > 0.6 * len(places)


@pytest.mark.parametrize(
    ("content", "message"),
    [(b"", "0 bytes;"), (b"no archive\n", "restore or remove it")],
)
def test_a_file_of_another_kind_is_refused(path: Path, content: bytes, message: str) -> None:
    path.write_bytes(content)
    with pytest.raises(InvalidInputError, match=message):
        read_archive(path, "test", PROBLEM)


def test_arrays_of_another_program_are_refused(path: Path) -> None:
    np.savez(path, **ARRAYS)
    with pytest.raises(InvalidInputError, match=r"run.npz' is another file: give a checkpoint"):
        read_archive(path, "test", PROBLEM)


def test_objects_that_run_code_are_refused(path: Path) -> None:
    np.savez(path, _format=np.array([path], dtype=object))
    with pytest.raises(InvalidInputError, match="is not a complete checkpoint"):
        read_archive(path, "test", PROBLEM)


def test_another_version_is_refused(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archive, "VERSION", 3)
    write_archive(path, "test", PROBLEM, ARRAYS)
    monkeypatch.undo()
    with pytest.raises(InvalidInputError, match=r"has version 3, not 2: use that release"):
        read_archive(path, "test", PROBLEM)


def test_another_kind_is_refused(path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"must be of a load history, is of a test"):
        read_archive(path, "load history", PROBLEM)


def test_another_problem_is_refused_and_what_differs_is_named(path: Path) -> None:
    other = {"size": "3", "bounds": "another box", "solver": "new"}
    with pytest.raises(
        InvalidInputError,
        match=r"differs \(there, here\) in bounds \(a box, another box\); solver \(absent, new\): give",
    ):
        read_archive(path, "test", other)


def test_what_to_do_with_a_file_that_is_there_is_the_callers_choice(path: Path) -> None:
    assert Checkpoint(path).read("test", PROBLEM, None) is not None
    assert Checkpoint(path, resume=True).read("test", PROBLEM, None) is not None
    assert Checkpoint(path, resume=False).read("test", PROBLEM, None) is None
    path.unlink()
    assert Checkpoint(path).read("test", PROBLEM, None) is None
    with pytest.raises(InvalidInputError, match=r"cannot be read: No such file.*give one that can"):
        Checkpoint(path, resume=True).read("test", PROBLEM, None)


def test_all_ranks_hear_of_what_rank_0_found(mpirun, tmp_path: Path) -> None:
    script = f"""
        import sys
        from pathlib import Path
        import numpy as np
        from mpi4py import MPI
        from fenics_contact import Checkpoint, CheckpointError
        from fenics_contact.errors import InvalidInputError
        comm = MPI.COMM_WORLD
        checkpoint = Checkpoint(Path({str(tmp_path)!r}) / "run.npz")
        # Only what rank 0 says is written.
        checkpoint.write("test", {{}}, {{"rank": np.array(comm.rank)}}, comm)
        assert int(checkpoint.read("test", {{}}, comm)["rank"]) == 0
        try:
            checkpoint.read("other", {{}}, comm)
            said = "nothing"
        except InvalidInputError as error:
            said = str(error)
        below = Checkpoint(Path({str(tmp_path)!r}) / "run.npz" / "below.npz")
        try:
            below.write("test", {{}}, {{}}, comm)
        except CheckpointError as error:
            said += str(error)
        words = comm.gather(said)
        if comm.rank == 0:
            print(sum("is of a test" in each and "could not be written" in each for each in words))
    """
    assert mpirun(script, 2).strip() == "2"
