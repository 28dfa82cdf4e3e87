"""Requirements of the package, checked before they are used.

dolfinx, petsc4py, mpi4py and gmsh come from the system and not from pip, so no installer has compared their
versions with the requirements. Presence and versions in metadata are checked when the package is imported,
features of a library when it is loaded, as is the version of dolfinx: its distributions have several names.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import re
import signal
import sys
import threading
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from fenics_contact.errors import MissingRequirementError

if TYPE_CHECKING:
    from mpi4py import MPI


@dataclass(frozen=True)
class Requirement:
    """A library, its oldest supported version, and how to install it.

    `debian`: the command that brings it with FEniCSx or gmsh; pip where it is empty. `in_wheel`: whether the
    extra `wheel` brings it, too.
    """

    module: str
    oldest: str
    debian: str = ""
    conda: str = ""
    in_wheel: bool = False

    def version(self) -> str | None:
        """Return the installed version without importing the library; None if it has no metadata."""
        return installed_versions(tuple(sys.path)).get(self.module)

    def error(self, found: str) -> MissingRequirementError:
        """Return the error that states what is needed, what was found and how to install it."""
        where = hidden() if self.debian and found == "none" else ""
        return self.error_with(
            found,
            f"{where}Debian: {self.debian or f'pip install {self.module}'}; "
            f"conda-forge: conda install -c conda-forge {self.conda or self.module}"
            + (f"; without either: {_WHEEL}" if self.in_wheel and wheel_exists() else ""),
        )

    def error_with(self, found: str, cure: str) -> MissingRequirementError:
        """Return the error that states what is needed, what was found and what to do."""
        return MissingRequirementError(
            f"fenics_contact needs {self.module} {self.oldest} or newer, found {found}. {cure}",
            name=self.module,
        )


_WHEEL = "pip install 'fenics_contact[wheel]' in a virtual environment of its own (third party, alpha)"


def wheel_exists() -> bool:
    """Return whether the extra `wheel` brings anything here: the markers of pyproject.toml."""
    return sys.platform == "linux" and os.uname().machine == "x86_64" and sys.version_info >= (3, 12)


def hidden() -> str:
    """Return what to do in a virtual environment that does not see the system's packages, or nothing."""
    config = Path(sys.prefix, "pyvenv.cfg")
    if not config.is_file() or re.search(r"include-system-site-packages\s*=\s*true", config.read_text()):
        return ""
    links = Path(sys.prefix).with_name(f".system-{Path(sys.prefix).name.lstrip('.')}")
    if str(links) in sys.path:
        return (
            f"The virtual environment {sys.prefix} has links to what FEniCSx needs of the system's packages: "
            "bring them up to date by scripts/setup.sh, which installs what is missing, too. "
        )
    return (
        f"The virtual environment {sys.prefix} does not see the packages of the system: make it with "
        "python3 -m venv --system-site-packages, or install there what brings its own. "
    )


_APT = "apt-get install --no-install-recommends"
_FENICSX = f"{_APT} python3-dolfinx-real"
_MPI4PY = Requirement("mpi4py", "3.1", _FENICSX, in_wheel=True)
_PETSC4PY = Requirement("petsc4py", "3.18", _FENICSX, 'petsc4py "petsc=*=real*"', in_wheel=True)
_DOLFINX = Requirement("dolfinx", "0.5", _FENICSX, "fenics-dolfinx", in_wheel=True)
_NUMERICAL = [
    Requirement("numpy", "1.24", _FENICSX),
    Requirement("scipy", "1.10", _FENICSX),
    Requirement("clarabel", "0.11"),
    Requirement("threadpoolctl", "3.1"),
]
_GMSH = Requirement("gmsh", "4.8", f"{_APT} python3-gmsh", "python-gmsh")


@cache
def installed_versions(places: tuple[str, ...]) -> dict[str, str]:
    """Return versions by distribution, read off the names of their metadata's folders.

    `importlib.metadata` reads the metadata themselves, with the parser of electronic mail: 25 ms a start.
    """
    found: dict[str, str] = {}
    for place in places:
        with suppress(OSError):  # of an archive, or a place that does not exist
            for entry in os.listdir(place or "."):
                stem, _, kind = entry.rpartition(".")
                if kind in ("dist-info", "egg-info") and "-" in stem:
                    name, version = stem.split("-")[:2]
                    found.setdefault(name.lower(), version)
    return found


def for_the_program() -> bool:
    """Return whether this process is that of `fenics-contact`, or of `python -m fenics_contact`."""
    words = sys.orig_argv
    return Path(sys.argv[0]).name == "fenics-contact" or ("-m", "fenics_contact") in pairwise(words)


def check() -> None:
    """Check all libraries that every part of the package needs, without loading or starting them."""
    for requirement in [*_NUMERICAL, _MPI4PY, _PETSC4PY, _DOLFINX]:
        _check_installed(requirement)


def load_mpi() -> ModuleType:
    """Return ``mpi4py.MPI``; starts MPI unless ``mpi4py.rc`` prevents it."""
    return _load(_MPI4PY, "mpi4py.MPI")


def petsc_is_started() -> bool:
    """Return whether PETSc can be used; starts nothing."""
    petsc = sys.modules.get("petsc4py.PETSc")
    return petsc is not None and bool(petsc.Sys.isInitialized())


def load_petsc(world: MPI.Comm | None = None) -> ModuleType:
    """Return ``petsc4py.PETSc``; starts it on ``world``, by default all ranks, unless it runs. Collective."""
    load_mpi()
    if world is not None:
        _load(_PETSC4PY, "petsc4py").init(comm=world)
    petsc = _load(_PETSC4PY, "petsc4py.PETSc")
    _restore_handlers()
    _check_petsc(_PETSC4PY, petsc)
    _check_one_mpi(_MPI4PY)
    return petsc


def load_dolfinx() -> ModuleType:
    """Return ``dolfinx``."""
    load_petsc()  # names what is wrong with it; dolfinx would fail in its own words
    dolfinx = _load(_DOLFINX, "dolfinx")
    _check_version(_DOLFINX, dolfinx.__version__)
    return dolfinx


def _restore_handlers() -> None:
    """Give signals that were handled or ignored back to Python: PETSc's handlers would end all ranks.

    Python ignores SIGPIPE, so that writes to closed pipes raise errors.
    """
    if threading.current_thread() is threading.main_thread():
        for number in signal.valid_signals() - {signal.SIGKILL, signal.SIGSTOP}:
            handler = signal.getsignal(number)
            if handler not in (None, signal.SIG_DFL):
                signal.signal(number, handler)


def require_extra(use: str, extra: str, *modules: str) -> None:
    """Check libraries that only a part of the package needs, without loading them."""
    for module in modules:
        if importlib.util.find_spec(module) is None:
            raise MissingRequirementError(
                f"{use} need {module}: pip install 'fenics_contact[{extra}]'", name=module
            )


def check_gmsh() -> None:
    """Check gmsh, which only geometries need."""
    _check_installed(_GMSH)
    module = _load(_GMSH, "gmsh")
    if _GMSH.version() is None:  # Debian 12 installs it without metadata
        _check_version(_GMSH, module.__version__)


def _check_installed(requirement: Requirement) -> None:
    """Raise if a library is missing or too old, without importing it."""
    if importlib.util.find_spec(requirement.module) is None:
        raise requirement.error("none")
    version = requirement.version()
    if version is not None:
        _check_version(requirement, version)


def _check_version(requirement: Requirement, version: str) -> None:
    """Raise if a version is too old."""
    if _numbers(version) < _numbers(requirement.oldest):
        raise requirement.error(version)


def _numbers(version: str) -> tuple[int, ...]:
    """Return the leading numbers of a version: (0, 10, 0) for "0.10.0.post2"."""
    leading = re.match(r"\d+(\.\d+)*", version)
    return tuple(map(int, leading.group().split("."))) if leading else ()


def _load(requirement: Requirement, module: str) -> ModuleType:
    """Import a module of an installed library, and name the library if that fails.

    One that was built against another NumPy or MPI, for instance, is found but cannot be loaded.
    """
    try:
        return importlib.import_module(module)
    except (ImportError, OSError) as reason:
        version = requirement.version() or "one"
        found = (
            f"{version} that cannot be loaded ({reason}): a library under it is missing or of another version"
        )
        if re.search(r"libmpi|mpi_", str(reason), re.IGNORECASE):
            raise requirement.error_with(found, one_source()) from reason
        raise requirement.error(found) from reason


def one_source() -> str:
    """Return what to do where mpi4py, petsc4py and dolfinx use different MPIs."""
    specs = {name: importlib.util.find_spec(name) for name in ("mpi4py", "petsc4py", "dolfinx")}
    places = (f"{name} in {Path(it.origin).parents[1]}" for name, it in specs.items() if it and it.origin)
    return (
        "Take mpi4py, petsc4py and dolfinx from one source, which uses one MPI; here are "
        f"{', '.join(places)}: make a virtual environment without --system-site-packages that has all three, "
        "or with it and none"
    )


def _check_petsc(requirement: Requirement, petsc: ModuleType) -> None:
    """Raise where PETSc computes with complex numbers or cannot factor a sparse matrix."""
    version = requirement.version() or "one"
    if petsc.ScalarType(0).dtype.kind != "f":
        found = f"{version} with complex numbers, where real ones are needed"
        if "PETSC_DIR" in os.environ:
            found += f" (PETSC_DIR={os.environ['PETSC_DIR']} may select it: unset this variable first)"
        if importlib.util.find_spec("dolfinx_solver") is None:
            raise requirement.error(found)
        # Wheels for both have files of the same names: one cannot replace the other in place.
        raise requirement.error_with(found, f"Take dolfinx-solver-real, not dolfinx-solver-complex: {_WHEEL}")
    if not (factors(petsc, "cholmod") or factors(petsc, "mumps")):
        raise requirement.error(f"{version} with neither CHOLMOD nor MUMPS, where one is needed")


def compiler_problem() -> str:
    """Return why forms cannot be compiled here, or nothing: a C compiler and Python's headers are needed."""
    import shlex
    import sysconfig

    from fenics_contact._base.launching import finished

    command = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc")
    header = ["-I", sysconfig.get_paths()["include"], "-include", "Python.h"]
    try:
        tried = finished([*command, *header, "-fsyntax-only", "-x", "c", os.devnull], 60.0)
    except OSError as error:
        return str(error)
    if tried.status == 0:
        return ""
    errors = [line for line in tried.errors.splitlines() if "error" in line]
    return errors[0] if errors else f"{command[0]} does not work"


def check_compiler() -> None:
    """Raise unless forms can be compiled here."""
    problem = compiler_problem()
    if problem:
        raise MissingRequirementError(
            f"forms need a C compiler and Python's headers, found: {problem}. Debian: {_APT} gcc libc6-dev "
            "python3-dev; conda-forge: conda install -c conda-forge c-compiler",
            name="compiler",
        )


def loaded_libraries(pattern: str) -> list[str]:
    """Return the shared libraries of this process whose paths match, as far as the system reports them."""
    try:
        maps = Path("/proc/self/maps").read_text()
    except OSError:
        return []
    return sorted({os.path.realpath(file) for file in re.findall(rf"/\S*/{pattern}", maps)})


def _check_one_mpi(requirement: Requirement) -> None:
    """Raise where mpi4py and PETSc have loaded two MPIs, between which communicators cannot be passed."""
    libraries = loaded_libraries(r"libmpi(?:ch)?\.so\S*")
    if len(libraries) > 1:
        raise requirement.error_with(f"two MPIs in one process, {' and '.join(libraries)}", one_source())


def factors(petsc: ModuleType, package: str) -> bool:
    """Try a package on a matrix of one entry: ``hasExternalPackage`` is wrong on some builds."""
    matrix = petsc.Mat().createAIJ((1, 1), nnz=1, comm=petsc.COMM_SELF)
    matrix.setValue(0, 0, 1.0)
    matrix.assemble()
    preconditioner = petsc.PC().create(petsc.COMM_SELF)
    preconditioner.setOperators(matrix)
    preconditioner.setType(petsc.PC.Type.CHOLESKY)
    preconditioner.setFactorSolverType(package)
    try:
        preconditioner.setFactorSetUpSolverType()
    except petsc.Error:
        return False
    finally:
        preconditioner.destroy()
        matrix.destroy()
    return True
