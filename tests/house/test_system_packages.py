"""The environment of the set-up sees, of the system's Python packages, FEniCSx and what it needs."""

from __future__ import annotations

import importlib.util
import os
import shutil
import sys
from pathlib import Path
from types import ModuleType

import pytest

from fenics_contact import clean_environment
from fenics_contact._base.launching import finished
from tests.conftest import ROOT

#: Status, name, what it depends on, what it provides; and the entries of the folder of modules.
PACKAGES = {
    "python3-dolfinx-real": (
        "libc6, python3-numpy (>= 1:1.21), python3-cffi | python3-none, python3-abi9",
        "",
        ["dolfinx", "fenics_dolfinx-0.9.dist-info", "petsc.pth"],
    ),
    "python3-numpy": ("python3:any", "python3-abi9 (= 1), python3-array", ["numpy", "numpy-1.24.egg-info"]),
    "python3-cffi": ("python3-pycparser", "", ["cffi", "_cffi.cpython-311.so"]),
    "python3-pycparser": ("", "", ["pycparser.py"]),
    "python3-matplotlib": ("python3-numpy", "", ["matplotlib", "mpl_toolkits", "matplotlib-nspkg.pth"]),
    "python3-unused": ("", "", ["unused.py"]),
}
#: What Debian's package has in place of an __init__.py: it makes the name before any other folder is read.
NAMESPACE = (
    "import sys, types; m = sys.modules.setdefault('mpl_toolkits', types.ModuleType('mpl_toolkits')); "
    "m.__path__ = [{path!r}]\n"
)


class System:
    """A folder of modules as Debian's packages fill it, and dpkg's answers."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for _, _, names in PACKAGES.values():
            for name in names:
                self.add(name)
        (folder / "petsc.pth").write_text(f"{folder.parent / 'petsc'}\n")
        (folder / "matplotlib-nspkg.pth").write_text(NAMESPACE.format(path=str(folder / "mpl_toolkits")))

    def add(self, name: str) -> None:
        """Make a module, or a package with one."""
        if "." in name:
            (self.folder / name).write_text("")
        else:
            (self.folder / name).mkdir(parents=True)
            (self.folder / name / "__init__.py").write_text("")

    def dpkg(self, *words: str) -> str:
        """Return what dpkg-query prints for all packages, or for the files of some."""
        if words[0] == "-W":
            rows = [
                f"installed\t{name}\t{needs}, \t{provides}" for name, (needs, provides, _) in PACKAGES.items()
            ]
            return "\n".join([*rows, "config-files\tpython3-none\t, \t"])
        lists = ([self.folder / name for name in PACKAGES[package][2]] for package in words[1:])
        return "\n\n".join("\n".join(map(str, ["/usr", *paths])) for paths in lists)


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "scripts")
    spec = importlib.util.spec_from_file_location("links", ROOT / "scripts" / "link_system_packages.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def system(script: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> System:
    made = System(tmp_path / "dist-packages")
    monkeypatch.setattr(script, "asked", made.dpkg)
    monkeypatch.setattr(script, "places", lambda: [str(made.folder)])
    return made


@pytest.fixture
def environment(tmp_path: Path) -> Path:
    """An environment without anything of the system, in which pip has installed some modules."""
    answer = finished([sys.executable, "-m", "venv", "--without-pip", str(tmp_path / "venv")], 60.0)
    assert answer.status == 0, answer.errors
    (modules,) = (tmp_path / "venv" / "lib").glob("python3*/site-packages")
    for name in ("mpl_toolkits", "pycparser"):
        (modules / name).mkdir()
    return tmp_path / "venv"


def links(environment: Path) -> set[str]:
    """Return the names of all links."""
    return set(os.listdir(environment.with_name(".system-venv")))


def python(environment: Path, code: str) -> list[str]:
    """Return the lines that an environment's Python prints."""
    settings = {name: value for name, value in clean_environment().items() if name != "PYTHONPATH"}
    answer = finished([str(environment / "bin" / "python"), "-c", code], 60.0, environment=settings)
    assert answer.status == 0, answer.errors
    return answer.output.splitlines()


def test_what_fenicsx_needs_is_seen_and_nothing_else(
    script: ModuleType, system: System, environment: Path
) -> None:
    script.link(str(environment), ["python3-dolfinx-real", "python3-not-installed"])
    seen = {"dolfinx", "fenics_dolfinx-0.9.dist-info", "petsc.pth", "numpy", "numpy-1.24.egg-info", "cffi"}
    assert links(environment) == seen | {"_cffi.cpython-311.so"}
    code = """if True:
        import sys, cffi, dolfinx, numpy, pycparser, mpl_toolkits
        from importlib.util import find_spec
        print(mpl_toolkits.__path__[0])
        print(find_spec("matplotlib"), find_spec("unused"))
        print(sys.path[-1])
        print(*sorted({module.__path__[0] for module in (cffi, dolfinx, numpy)}))
    """
    toolkits, hidden, last, behind = python(environment, code)
    assert behind.split() == [str(system.folder / name) for name in ("cffi", "dolfinx", "numpy")], "not links"
    assert toolkits.startswith(str(environment)), "the system's mpl_toolkits wins"
    assert hidden == "None None"
    assert last == str(environment.with_name(".system-venv")) or last == str(system.folder.parent / "petsc")


def test_a_package_of_which_pip_has_a_module_is_left_out_as_a_whole(
    script: ModuleType, system: System, environment: Path
) -> None:
    script.link(str(environment), ["python3-matplotlib"])
    assert links(environment) == {"numpy", "numpy-1.24.egg-info"}
    assert python(environment, "import sys; print('mpl_toolkits' in sys.modules)") == ["False"]


def test_links_follow_what_pip_and_the_system_install(
    script: ModuleType, system: System, environment: Path
) -> None:
    script.link(str(environment), ["python3-dolfinx-real"])
    (modules,) = environment.glob("lib/python3*/site-packages")
    (modules / "cffi").mkdir()
    shutil.rmtree(system.folder / "dolfinx")
    script.link(str(environment), ["python3-dolfinx-real"])
    assert links(environment) == {"fenics_dolfinx-0.9.dist-info", "petsc.pth", "numpy", "numpy-1.24.egg-info"}


def test_the_set_up_makes_an_environment_that_sees_links_alone() -> None:
    script = (ROOT / "scripts" / "setup.sh").read_text()
    assert "link_system_packages.py $venv" in script
    assert "--system-site-packages" not in script


def test_links_lie_where_pip_leaves_older_versions_alone(script: ModuleType, tmp_path: Path) -> None:
    """Whatever begins with the path of the environment belongs to it, as pip sees it."""
    for name in (".venv", "contact"):
        links = script.system_packages.folder_of_links(str(tmp_path / name))
        assert Path(links).parent == tmp_path
        assert not links.startswith(str(tmp_path / name))


def test_packages_of_this_system_are_found(environment: Path) -> None:
    system = "/usr/bin/python3"
    if os.path.realpath(sys.executable) != os.path.realpath(system) or shutil.which("dpkg-query") is None:
        pytest.skip("this Python is not Debian's")
    if not finished(["dpkg-query", "-L", "python3-dolfinx-real"], 60.0).output:
        pytest.skip("FEniCSx is not of Debian here")
    script = ROOT / "scripts" / "link_system_packages.py"
    (own,) = environment.glob("lib/python3*/site-packages/pycparser")
    own.rmdir()
    answer = finished([system, str(script), str(environment), "python3-dolfinx-real"], 60.0)
    assert answer.status == 0, answer.errors
    code = "from importlib.util import find_spec as f; print(*(f(n) is None for n in {!r}.split()))"
    needed = "dolfinx ufl ffcx basix petsc4py mpi4py numpy scipy cffi apt_pkg matplotlib"
    assert python(environment, code.format(needed)) == [" ".join(9 * ["False"] + 2 * ["True"])]
    loads = "from mpi4py import MPI; import dolfinx, ufl; print(ufl.__file__)"
    assert python(environment, loads) == ["/usr/lib/python3/dist-packages/ufl/__init__.py"]
