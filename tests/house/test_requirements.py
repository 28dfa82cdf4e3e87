"""A missing or wrong library is reported by name, before anything of it is used."""

from __future__ import annotations

import importlib
import importlib.util
import logging
import os
import re
import sys
import sysconfig
import tomllib
from collections.abc import Callable, Iterator
from importlib import metadata
from io import StringIO
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from packaging.requirements import Requirement

from fenics_contact import _dolfinx, clean_environment
from fenics_contact._base import requirements as _requirements
from fenics_contact._base.launching import finished
from fenics_contact._base.progress import Log, _writer
from fenics_contact._dolfinx import loading as loading_of_dolfinx
from fenics_contact.errors import MissingRequirementError
from tests.conftest import ROOT, launch

LIBRARIES = ["numpy", "scipy", "clarabel", "mpi4py", "petsc4py", "dolfinx"]
find_spec = importlib.util.find_spec
versions = _requirements.installed_versions
import_module = importlib.import_module


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Return a function that hides a library."""

    def hide(module: str) -> None:
        def answer(name: str) -> object:
            return None if name == module else find_spec(name)

        monkeypatch.setattr(importlib.util, "find_spec", answer)

    return hide


@pytest.fixture
def with_version(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str | None], None]:
    """Return a function that gives a distribution another version, or none."""

    def pretend(distribution: str, version: str | None) -> None:
        def answer(places: tuple[str, ...]) -> dict[str, str]:
            others = {name: each for name, each in versions(places).items() if name != distribution}
            return others if version is None else {**others, distribution: version}

        monkeypatch.setattr(_requirements, "installed_versions", answer)

    return pretend


@pytest.fixture
def loading(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, object], None]:
    """Return a function that makes a module load as something else, or fail with an exception."""

    def pretend(module: str, outcome: object) -> None:
        def answer(name: str) -> object:
            if name != module:
                return import_module(name)
            if isinstance(outcome, Exception):
                raise outcome
            return outcome

        monkeypatch.setattr(importlib, "import_module", answer)

    return pretend


def petsc(scalar: type, packages: tuple[str, ...]) -> SimpleNamespace:
    """Return a PETSc of the given scalar type that factors with the given packages only."""
    real: Any = import_module("petsc4py.PETSc")

    class PC(real.PC):  # type: ignore[name-defined,misc]
        def setFactorSetUpSolverType(self) -> None:
            if self.getFactorSolverType() not in packages:
                raise real.Error(92)

        def setFactorSolverType(self, package: str) -> None:
            self.package = package

        def getFactorSolverType(self) -> str:
            return self.package

    return SimpleNamespace(ScalarType=scalar, Mat=real.Mat, PC=PC, Error=real.Error, COMM_SELF=real.COMM_SELF)


def test_what_is_installed_here_will_do(caplog: pytest.LogCaptureFixture) -> None:
    _requirements.check()
    _requirements.load_petsc()
    _requirements.check_gmsh()
    assert caplog.messages == []


def test_versions_are_those_of_the_metadata() -> None:
    found = _requirements.installed_versions(tuple(sys.path))
    for name in ("numpy", "scipy", "clarabel", "threadpoolctl", "mpi4py", "petsc4py"):
        assert found[name] == metadata.version(name)
    assert _requirements.installed_versions(("/nowhere",)) == {}


@pytest.mark.parametrize("module", LIBRARIES)
def test_a_missing_library_is_named(
    module: str, without: Callable[[str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    without(module)
    monkeypatch.setattr(_requirements, "hidden", str)  # as where packages of the system are seen
    with pytest.raises(
        MissingRequirementError, match=rf"needs {module} \d.* or newer, found none\. Debian: .*conda-forge: "
    ) as caught:
        _requirements.check()
    assert caught.value.name == module


@pytest.mark.parametrize("module", LIBRARIES[:-1])
def test_a_library_that_is_too_old_is_named_with_its_version(
    module: str, with_version: Callable[[str, str | None], None]
) -> None:
    with_version(module, "0.0.9.dev0")
    with pytest.raises(MissingRequirementError, match=rf"needs {module} .*found 0\.0\.9\.dev0\. Debian: "):
        _requirements.check()


def test_a_dolfinx_that_is_too_old_is_named_by_its_own_version(
    loading: Callable[[str, object], None],
) -> None:
    loading("dolfinx", SimpleNamespace(__version__="0.4.9.dev0"))
    with pytest.raises(MissingRequirementError, match=r"needs dolfinx .*found 0\.4\.9\.dev0\. Debian: "):
        _requirements.load_dolfinx()


@pytest.fixture
def dolfinx_version(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], None]]:
    """Return a function that gives dolfinx another version, of which nobody was warned."""

    def pretend(version: str) -> None:
        monkeypatch.setattr(loading_of_dolfinx, "release", lambda: version)
        _dolfinx.version.cache_clear()
        _dolfinx.warn_if_untested.cache_clear()

    yield pretend
    monkeypatch.undo()
    _dolfinx.version.cache_clear()


@pytest.mark.parametrize("version", ["0.5.2", "0.9.0", "0.9.0.post1", "0.10.0.post5", "0.11.0.post0"])
def test_a_tested_dolfinx_passes_in_silence(version: str, dolfinx_version: Callable[[str], None]) -> None:
    dolfinx_version(version)
    assert not _dolfinx.untested()


@pytest.mark.parametrize("version", ["0.7.3", "0.12.0", "1.0"])
def test_an_untested_dolfinx_is_named_once_where_something_is_solved(
    version: str, dolfinx_version: Callable[[str], None], caplog: pytest.LogCaptureFixture
) -> None:
    dolfinx_version(version)
    for rank in (1, 0, 0):
        _dolfinx.warn_if_untested(rank)
    (record,) = caplog.records
    assert record.levelno == logging.WARNING
    tested = "0.5, 0.9, 0.10, 0.11"
    assert f"dolfinx {version} was never tested with fenics_contact, only {tested}" in record.message


@pytest.mark.parametrize("module", ["mpi4py.MPI", "petsc4py.PETSc"])
def test_a_library_that_does_not_load_is_named_with_the_reason(
    module: str, loading: Callable[[str, object], None]
) -> None:
    library = module.partition(".")[0]
    loading(module, ImportError("numpy.core.multiarray failed to import"))
    with pytest.raises(
        MissingRequirementError, match=rf"needs {library} .*cannot be loaded \(numpy\.core\.multiarray failed"
    ):
        _requirements.load_petsc()


def test_a_petsc_with_complex_numbers_is_refused(
    loading: Callable[[str, object], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    loading("petsc4py.PETSc", petsc(np.complex128, ("cholmod", "mumps")))
    monkeypatch.delenv("PETSC_DIR", raising=False)
    with pytest.raises(MissingRequirementError, match=r"with complex numbers, where real ones are needed\."):
        _requirements.load_petsc()
    monkeypatch.setenv("PETSC_DIR", "/opt/complex")
    with pytest.raises(MissingRequirementError, match=r"needed \(PETSC_DIR=/opt/complex may select it"):
        _requirements.load_petsc()


@pytest.mark.parametrize("package", ["cholmod", "mumps"])
def test_one_sparse_factorisation_is_enough(package: str, loading: Callable[[str, object], None]) -> None:
    loading("petsc4py.PETSc", petsc(np.float64, (package,)))
    assert _requirements.load_petsc().ScalarType is np.float64


def test_a_petsc_without_sparse_factorisation_is_refused(loading: Callable[[str, object], None]) -> None:
    loading("petsc4py.PETSc", petsc(np.float64, ("petsc",)))
    with pytest.raises(MissingRequirementError, match="with neither CHOLMOD nor MUMPS, where one is needed"):
        _requirements.load_petsc()


def test_a_package_that_petsc_does_not_have_is_recognised() -> None:
    real = import_module("petsc4py.PETSc")
    assert not _requirements.factors(real, "nonsense")


def test_a_missing_gmsh_is_named_only_when_a_geometry_needs_it(without: Callable[[str], None]) -> None:
    without("gmsh")
    _requirements.check()
    with pytest.raises(MissingRequirementError, match=r"needs gmsh 4\.8 or newer, found none.*python3-gmsh"):
        _requirements.check_gmsh()


def test_a_gmsh_whose_libraries_are_missing_is_named(loading: Callable[[str, object], None]) -> None:
    loading("gmsh", OSError("libGLU.so.1: cannot open shared object file"))
    with pytest.raises(MissingRequirementError, match=r"needs gmsh .*cannot be loaded \(libGLU\.so\.1"):
        _requirements.check_gmsh()


def test_a_gmsh_without_metadata_is_judged_by_its_own_version(
    loading: Callable[[str, object], None], with_version: Callable[[str, str | None], None]
) -> None:
    with_version("gmsh", None)
    loading("gmsh", SimpleNamespace(__version__="4.7.1"))
    with pytest.raises(MissingRequirementError, match=r"needs gmsh 4\.8 or newer, found 4\.7\.1"):
        _requirements.check_gmsh()


HIDING = """
import importlib.abc, importlib.util, sys

class Hidden(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name.partition(".")[0] == "{module}":
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, Hidden())
find_spec = importlib.util.find_spec
importlib.util.find_spec = lambda name: None if name == "{module}" else find_spec(name)
"""


@pytest.mark.parametrize("module", LIBRARIES)
def test_the_package_itself_reports_what_is_missing(module: str) -> None:
    answer = launch(1, "-c", HIDING.format(module=module) + "import fenics_contact")
    assert answer.returncode == 1, answer.stderr
    last = answer.stderr.strip().splitlines()[-1]
    assert last.startswith("fenics_contact.errors.MissingRequirementError: fenics_contact needs " + module)


@pytest.mark.parametrize("module", LIBRARIES)
def test_the_program_reports_what_is_missing_in_one_line(module: str, tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(HIDING.format(module=module))
    environment = {**clean_environment(), "PYTHONPATH": f"{tmp_path}:{ROOT}"}
    answer = finished([sys.executable, "-m", "fenics_contact", "info"], 60.0, environment=environment)
    assert answer.status == 5
    (line,) = answer.errors.splitlines()
    assert line.startswith(f"error: fenics_contact needs {module} ")
    assert "found none" in line


def test_a_virtual_environment_that_hides_the_system_is_named(
    without: Callable[[str], None], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    without("dolfinx")
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    (tmp_path / "pyvenv.cfg").write_text("include-system-site-packages = false\n")
    with pytest.raises(MissingRequirementError, match=r"does not see the packages .* --system-site-packages"):
        _requirements.check()
    with monkeypatch.context() as linked:
        linked.setattr(sys, "path", [*sys.path, str(tmp_path.with_name(f".system-{tmp_path.name}"))])
        with pytest.raises(MissingRequirementError, match=r"has links to .* up to date by scripts/setup\.sh"):
            _requirements.check()
    (tmp_path / "pyvenv.cfg").write_text("include-system-site-packages = true\n")
    with pytest.raises(MissingRequirementError, match=r"found none\. Debian"):
        _requirements.check()


def test_two_mpis_in_one_process_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    two = ["/usr/lib/libmpi.so.40.30.4", "/venv/lib/libmpi.so.12.3.4"]
    found = _requirements.loaded_libraries(r"libmpi(?:ch)?\.so\S*")
    assert len(found) == 1, "the one that this process has loaded"
    monkeypatch.setattr(_requirements, "loaded_libraries", lambda _: two)
    with pytest.raises(
        MissingRequirementError,
        match=r"two MPIs in one process, .*so\.40.* and .*so\.12\S*\. Take .* mpi4py in /.*dolfinx in /",
    ):
        _requirements.load_petsc()


def test_a_petsc_of_another_mpi_is_named_with_its_place(loading: Callable[[str, object], None]) -> None:
    loading("petsc4py.PETSc", ImportError("libmpi.so.12: cannot open shared object file"))
    with pytest.raises(MissingRequirementError, match=r"loaded \(libmpi.*one source.* petsc4py in /"):
        _requirements.load_petsc()


@pytest.mark.parametrize(("machine", "offered"), [("x86_64", True), ("aarch64", False)])
@pytest.mark.parametrize("module", LIBRARIES)
def test_the_wheel_is_offered_where_it_exists(
    module: str, machine: str, offered: bool, without: Callable[[str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "uname", lambda: SimpleNamespace(machine=machine))
    monkeypatch.setattr(sys, "version_info", (3, 12, 0))
    without(module)
    with pytest.raises(MissingRequirementError) as caught:
        _requirements.check()
    remedy = r"; without either: pip install 'fenics_contact\[wheel\]' .*\(third party, alpha\)$"
    expected = offered and module in ("mpi4py", "petsc4py", "dolfinx")
    assert bool(re.search(remedy, str(caught.value))) == expected


def test_the_extra_has_the_conditions_under_which_it_is_offered(monkeypatch: pytest.MonkeyPatch) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    lines = [Requirement(line) for line in project["optional-dependencies"]["wheel"]]
    assert {line.name for line in lines} == {"dolfinx-solver-real", "gmsh"}
    places = product(("linux", "darwin"), ("x86_64", "aarch64"), ("3.11", "3.12", "3.14"))
    for system, machine, version in places:
        there = {"sys_platform": system, "platform_machine": machine, "python_version": version}
        monkeypatch.setattr(sys, "platform", system)
        monkeypatch.setattr(os, "uname", lambda machine=machine: SimpleNamespace(machine=machine))
        monkeypatch.setattr(sys, "version_info", tuple(map(int, version.split("."))))
        brought = [line.marker is None or line.marker.evaluate(there) for line in lines]
        assert brought == [_requirements.wheel_exists()] * 2, there


def test_complex_numbers_of_the_wheel_are_named_with_the_real_one(
    loading: Callable[[str, object], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = {"dolfinx_solver": find_spec("numpy")}
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: found.get(name) or find_spec(name))
    loading("petsc4py.PETSc", petsc(np.complex128, ("cholmod", "mumps")))
    with pytest.raises(MissingRequirementError, match=r"complex numbers.*Take dolfinx-solver-real.*wheel"):
        _requirements.load_petsc()


@pytest.mark.parametrize(
    ("compiler", "found"),
    [("no-such-gcc -O1", r"'no-such-gcc'"), ("false", r"false does not work"), ("gcc -O1", "")],
)
def test_a_c_compiler_that_does_not_work_is_named(
    compiler: str, found: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", compiler)
    if not found:
        _requirements.check_compiler()
        return
    with pytest.raises(MissingRequirementError, match=rf"forms need a C compiler .*{found}\. .* gcc"):
        _requirements.check_compiler()


def test_missing_headers_of_python_are_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(sysconfig, "get_paths", lambda: {"include": str(tmp_path)})
    with pytest.raises(MissingRequirementError, match=r"headers, found: .*Python\.h.*python3-dev"):
        _requirements.check_compiler()


COMPILED = """
import os, sys
from mpi4py import MPI
from fenics_contact import Body, Scene, Support, gallery, materials, solve_scene
from fenics_contact.errors import MissingRequirementError
os.environ["CC"] = "no-such-gcc"
block, soft = gallery.block((0, 0, 0), (1, 1, 1), (2, 2, 2)), materials.IsotropicElasticity(1.0, 0.3)
scene = Scene({"a": Body(block, soft)}, [Support("a", "x0")])
try:
    solve_scene(scene, MPI.COMM_WORLD)
except MissingRequirementError as error:
    sys.stdout.write(str(error).count("need a C compiler") * "named ")
"""


def test_forms_without_a_compiler_name_it_on_all_ranks(
    mpirun: Callable[..., str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert mpirun(COMPILED, 2, fresh=True).split() == ["named"] * 2


#: What solves, and what it never loads.
SOLVING = "materials gallery readers mesh shapes design results output errors theory qp feti".split()
EXTRAS = {"matplotlib", "pydantic", "pyvista", "rich", "tomlkit", "typer"}


def test_what_solves_loads_no_extra() -> None:
    imports = "; ".join(f"from fenics_contact.{name} import *" for name in SOLVING)
    imports += "; from fenics_contact import solve_scene"
    solving = f"import sys; {imports}; sys.stdout.write(' '.join(sys.modules))"
    answer = launch(1, "-c", solving)
    loaded = {name.partition(".")[0] for name in answer.stdout.split()}
    assert "scipy" in loaded, answer.stderr
    assert loaded & EXTRAS == set()


def test_extras_are_listed_as_such() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    needed, cli = (
        {line.partition(">")[0] for line in lines}
        for lines in (project["dependencies"], project["optional-dependencies"]["cli"])
    )
    assert "scipy" in needed
    assert needed & EXTRAS == set()
    assert cli == {"pydantic", "rich", "tomlkit", "typer"}


@pytest.mark.parametrize(
    ("script", "use", "module"),
    [
        ("from fenics_contact import read_scene_file", "scene files", "tomlkit"),
        ("from fenics_contact import read_scene_file", "scene files", "pydantic"),
        ("from fenics_contact.__main__ import main; sys.exit(main([]))", "commands", "typer"),
        ("import fenics_contact.pictures", "pictures", "pyvista"),
    ],
)
def test_a_missing_extra_is_named_with_its_remedy(script: str, use: str, module: str) -> None:
    answer = launch(1, "-c", HIDING.format(module=module) + script)
    extra = "viz" if use == "pictures" else "cli"
    assert answer.returncode == (5 if use == "commands" else 1)
    last = answer.stderr.strip().splitlines()[-1]
    assert last.endswith(f"{use} need {module}: pip install 'fenics_contact[{extra}]'"), last


def test_progress_is_told_in_lines_where_nothing_draws_bars(
    without: Callable[[str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    without("rich")
    monkeypatch.setattr(sys.modules[_writer.__module__], "at_terminal", lambda _: True)
    assert isinstance(_writer(StringIO(), 1.0), Log)
