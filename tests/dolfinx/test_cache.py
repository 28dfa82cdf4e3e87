"""Killed compilations and spoilt libraries are done again, and runs at the same time compile a form once."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import ufl
from mpi4py import MPI

from fenics_contact import _dolfinx, clean_environment
from tests.conftest import ROOT

COMPILES = """
    import sys
    import ufl
    from mpi4py import MPI
    from fenics_contact import _dolfinx
    cell = _dolfinx.template("triangle")
    form = ufl.Constant(cell) * ufl.dx(domain=cell, metadata={"quadrature_degree": 1})
    _dolfinx.CompiledForm(MPI.COMM_WORLD, form)
    print("compiled")
"""


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty cache of forms, which this test uses."""
    from fenics_contact._dolfinx.loading import dolfinx, old

    name = "DOLFINX_DEFAULT_JIT_PARAMETERS" if old() else "DOLFINX_DEFAULT_JIT_OPTIONS"
    monkeypatch.setitem(getattr(dolfinx.jit, name), "cache_dir", (tmp_path, ""))
    return tmp_path


def compile_volume(*, known: bool = False) -> object:
    """Compile a form as a new process would, which knows none, or as one that may know it."""
    from fenics_contact._dolfinx import forms

    if not known:
        forms._COMPILED.clear()
    cell = _dolfinx.template("triangle")
    form = ufl.Constant(cell) * ufl.dx(domain=cell, metadata={"quadrature_degree": 1})
    return _dolfinx.CompiledForm(MPI.COMM_SELF, form)


@pytest.mark.parametrize("left", ["by a run of ours", "by a program of dolfinx", "without a library"])
def test_what_a_killed_compiler_left_is_compiled_again(
    left: str, cache: Path, caplog: pytest.LogCaptureFixture
) -> None:
    compile_volume()
    [library] = cache.glob("*.so")
    [source] = cache.glob("*.c")
    library.unlink()
    if left != "without a library":
        source.with_suffix(".c.cached").unlink()
    if left == "by a run of ours":
        source.with_suffix(".lock").touch()
    elif left == "by a program of dolfinx":
        for file in cache.iterdir():
            os.utime(file, (time.time() - 3600,) * 2)
    with caplog.at_level(logging.WARNING):
        compile_volume()
    assert f"{source} has no library" in caplog.text
    assert library.exists()
    assert source.with_suffix(".c.cached").exists()
    assert not list(cache.glob("*.lock"))
    caplog.clear()
    compile_volume()
    assert not caplog.text


def spoilt(library: Path, way: str) -> None:
    """Spoil a library; what a process has loaded stays as it is."""
    content = library.read_bytes()
    library.unlink()
    cut = {"empty": b"", "half": content[: len(content) // 2], "end": content[:-1]}
    library.write_bytes(cut[way])


@pytest.mark.parametrize("way", ["empty", "half", "end"])
def test_a_spoilt_library_is_compiled_again(way: str, cache: Path, caplog: pytest.LogCaptureFixture) -> None:
    compile_volume()
    [library] = cache.glob("*.so")
    whole = library.stat().st_size
    spoilt(library, way)
    with caplog.at_level(logging.WARNING):
        compile_volume()
    assert ["has a part of its library alone" in record.message for record in caplog.records] == [True]
    assert "it is compiled again" in caplog.text
    assert library.stat().st_size == whole
    assert not list(cache.glob("*.lock"))
    caplog.clear()
    compile_volume()
    assert not caplog.text


def test_a_library_that_cannot_be_loaded_is_compiled_again(
    cache: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """As one of another machine. A process that has loaded a library does not load it again: it is played."""
    from ffcx.codegeneration import jit

    compile_volume()
    [library] = cache.glob("*.so")
    old, lookup, calls = library.stat().st_ino, jit.get_cached_module, []

    def unloadable(*arguments: object) -> object:
        calls.append(arguments)
        if len(calls) == 1:
            raise ImportError("libc.so.6: version GLIBC_3 not found")
        return lookup(*arguments)

    (cache / "kept").hardlink_to(library)  # so that its number is not given again
    monkeypatch.setattr(jit, "get_cached_module", unloadable)
    with caplog.at_level(logging.WARNING):
        compile_volume()
    [words] = [record.getMessage() for record in caplog.records]
    assert (
        "library that cannot be loaded (libc.so.6: version GLIBC_3 not found); it is compiled again" in words
    )
    assert len(calls) == 2
    assert library.stat().st_ino != old


def test_a_form_that_was_compiled_is_not_looked_up_again(cache: Path) -> None:
    compile_volume()
    for file in cache.iterdir():
        file.unlink()
    compile_volume(known=True)  # with a constant of its own
    assert not list(cache.iterdir())
    compile_volume()
    assert list(cache.iterdir())


def test_a_compilation_that_is_stopped_leaves_nothing(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(*arguments: object, **options: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("ffcx.codegeneration.jit._compile_objects", stopped)
        with pytest.raises(KeyboardInterrupt):
            compile_volume()
    assert not list(cache.iterdir())


def compiling(cache: Path, seconds: float) -> tuple[list[str], dict[str, str]]:
    """Return command and environment of a process whose compiler notes its calls and waits."""
    calls, compiler, script = cache / "calls", cache / "compiler.sh", cache / "script.py"
    compiler.write_text(f'#!/bin/sh\necho "$@" >> {calls}\nsleep {seconds}\nexec cc "$@"\n')
    compiler.chmod(0o755)
    script.write_text("\n".join(line[4:] for line in COMPILES.splitlines()))
    paths = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    own = {"CC": str(compiler), "XDG_CACHE_HOME": str(cache), "PYTHONPATH": paths}
    return [sys.executable, str(script)], {**clean_environment(), **own}


def calls_of(cache: Path) -> list[str]:
    """Return the calls of the compiler that compiled a source, not those that linked it."""
    calls = cache / "calls"
    lines = calls.read_text().splitlines() if calls.exists() else []
    return [line for line in lines if " -c " in line and "libffcx_forms" in line]


@pytest.mark.slow
def test_a_run_that_was_killed_while_it_compiled_spoils_no_later_one(tmp_path: Path) -> None:
    command, environment = compiling(tmp_path, 30.0)
    with subprocess.Popen(command, env=environment, start_new_session=True) as killed:
        while not calls_of(tmp_path):
            assert killed.poll() is None
            time.sleep(0.1)
        os.killpg(killed.pid, signal.SIGKILL)
    assert list(tmp_path.glob("fenics/*.lock"))
    command, environment = compiling(tmp_path, 0.0)
    again = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=True)
    assert again.stdout == "compiled\n"
    assert "has no library: the run that compiled it was killed" in again.stderr


@pytest.mark.slow
def test_two_runs_at_once_share_one_compilation_however_long_it_takes(tmp_path: Path) -> None:
    command, environment = compiling(tmp_path, 12.0)  # dolfinx would wait 10 s
    runs = [
        subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    for run in runs:
        output, errors = run.communicate(timeout=120)
        assert (output, errors) == ("compiled\n", "")
    assert len(calls_of(tmp_path)) == 1
