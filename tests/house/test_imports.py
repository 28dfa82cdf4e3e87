"""Imports point down the floors of the house, and FEniCSx is met where it may be met."""

from __future__ import annotations

import graphlib
import importlib
from pathlib import Path

import pytest

from tests.conftest import launch
from tests.house.floors import FLOORS
from tests.house.source import PACKAGE, Module, modules, room_of

FLOOR = {room: height for height, rooms in enumerate(FLOORS) for room in rooms}
BESIDE = {"viz", "io", "study", "scene_file"}
#: On top of everything: the study of accuracy and web pages draw and write, the command line does all that
#: there is.
ABOVE = {
    "study": {"viz", "io"},
    "page": {"viz", "io"},
    "cli": {"viz", "io", "study", "scene_file", "page"},
    "__main__": {"cli"},
}
#: Rooms that are tested with small dense matrices, and what they never meet.
WITHOUT_FENICS = {
    "qp": {"dolfinx", "ufl", "basix", "ffcx", "gmsh"},
    "optimize": {"dolfinx", "ufl", "basix", "ffcx", "gmsh", "petsc4py", "mpi4py"},
}

#: What stands for libraries that are loaded when they are first used.
LATE = {f"{PACKAGE}._libraries.MPI": "mpi4py", f"{PACKAGE}._libraries.PETSc": "petsc4py"}


def pointing_up(module: Module) -> list[str]:
    """List the imports of a module that do not point to a lower floor, or point beside the house."""
    here = module.room
    wrong = []
    for found in module.imports():
        there = room_of(found.target)
        if there is None or there == here:
            continue
        on_top = here in BESIDE or here in ABOVE or here == ""
        below = (there in FLOOR and (on_top or FLOOR[there] < FLOOR[here])) or there in ABOVE.get(here, set())
        # The package itself is above everything: it may offer names, and nobody asks it for them.
        if not below:
            wrong.append(f"{module.path.name}:{found.line} ({module.name}) imports {found.target}")
    return wrong


def hidden_files(house: list[Module]) -> set[str]:
    """Return the files of rooms; not those after whose one function they are called, which a face offers."""
    offered = {
        f"{module.name}.{found.target.rpartition('.')[2]}"
        for module in house
        if module.path.name == "__init__.py"
        for found in module.imports()
    }
    return {module.name for module in house if module.name.count(".") > 1} - offered


def past_faces(module: Module, hidden: set[str]) -> list[str]:
    """List the imports of a module that reach past the ``__init__`` of another room into one of its files."""
    return [
        f"{module.name}:{found.line} imports {found.target}"
        for found in module.imports()
        if room_of(found.target) not in {None, module.room}
        and (found.target.count(".") > 2 or found.target in hidden)
    ]


def reached(room: str, house: list[Module]) -> set[str]:
    """Return the outside libraries that a room imports, itself or through other rooms."""
    rooms, waiting, outside = {room}, [room], set()
    while waiting:
        current = waiting.pop()
        for module in house:
            if module.room != current:
                continue
            for found in module.imports():
                there = room_of(found.target)
                if (there is None or found.target in LATE) and not found.for_types:
                    outside.add(LATE.get(found.target, found.target.partition(".")[0]))
                elif there and there not in rooms:
                    rooms.add(there)
                    waiting.append(there)
    return outside


def dolfinx_imports(module: Module) -> list[str]:
    """List the imports of dolfinx that a type checker is not alone to see."""
    return [
        f"{module.name}:{found.line}"
        for found in module.imports()
        if found.target.partition(".")[0] == "dolfinx" and not found.for_types
    ]


def a_module(room: str, source: str, root: Path) -> Module:
    """Parse ``source`` as the file ``example.py`` of a room."""
    path = root / PACKAGE / room / "example.py"
    path.parent.mkdir(parents=True)
    path.write_text(source)
    (module,) = modules(root)
    return module


def test_every_module_has_a_floor_or_stands_beside_the_house() -> None:
    homeless = [module.name for module in modules() if module.room not in {"", *FLOOR, *BESIDE, *ABOVE}]
    assert homeless == [], "give it a floor here and in the architecture"


def test_every_floor_is_inhabited() -> None:
    assert {module.room for module in modules()} >= set(FLOOR)


def test_imports_point_down() -> None:
    house = modules()
    inner = [found for module in house for found in module.imports() if room_of(found.target)]
    assert len(inner) > len(FLOOR), "no imports were found: nothing was tested"
    assert [line for module in house for line in pointing_up(module)] == []


@pytest.mark.parametrize(
    ("room", "line"),
    [
        ("feti", "from fenics_contact._equilibrium import coulomb"),
        ("feti", "from fenics_contact import contact"),
        ("feti", "from ..contact.coulomb import solve"),
        ("feti", "def f():\n    import fenics_contact.design"),
        ("feti", "from fenics_contact import solve"),
        ("scene", "from fenics_contact.qp import minimise"),
        ("optimize", "import fenics_contact.pictures"),
        ("viz", "import fenics_contact.output"),
        ("viz", "import fenics_contact.study"),
        ("io", "from fenics_contact.study import run_study"),
        ("scene_file", "from fenics_contact.pictures import Units"),
        ("io", "from fenics_contact._scene_file import read_scene_file"),
        ("study", "from fenics_contact._cli import main"),
    ],
)
def test_an_import_that_does_not_point_down_is_found(room: str, line: str, tmp_path: Path) -> None:
    assert len(pointing_up(a_module(room, line, tmp_path))) == 1


@pytest.mark.parametrize(
    ("room", "line"),
    [
        ("feti", "from fenics_contact._scene import Scene"),
        ("feti", "from . import rows\nfrom .rows import gap\nfrom ..qp import minimise"),
        ("viz", "from fenics_contact._equilibrium import State"),
        ("study", "def draw():\n    from fenics_contact.pictures.canvas import sheet"),
        ("__main__", "from fenics_contact import cli"),
        ("cli", "from fenics_contact.study.scenes import find_study"),
        ("scene_file", "from fenics_contact.design import ShapeProblem"),
        ("qp", "import numpy"),
    ],
)
def test_an_import_that_points_down_passes(room: str, line: str, tmp_path: Path) -> None:
    module = a_module(room, line, tmp_path)
    assert module.imports()
    assert pointing_up(module) == []


def test_rooms_are_entered_by_their_faces() -> None:
    house = modules()
    hidden = hidden_files(house)
    assert f"{PACKAGE}.qp.face" in hidden, "no files of rooms were found: nothing was tested"
    assert [line for module in house for line in past_faces(module, hidden)] == []


@pytest.mark.parametrize(
    "line",
    [
        "from fenics_contact.qp.face import Face",
        "from fenics_contact.qp import face",
        "def f():\n    import fenics_contact.qp.face",
    ],
)
def test_an_import_past_a_face_is_found(line: str, tmp_path: Path) -> None:
    hidden = {f"{PACKAGE}.qp.face"}
    assert len(past_faces(a_module("feti", line, tmp_path), hidden)) == 1
    assert past_faces(a_module("qp", line, tmp_path / "inside"), hidden) == []


@pytest.mark.parametrize("room", sorted(WITHOUT_FENICS))
def test_a_room_without_fenics_stays_so_also_through_others(room: str) -> None:
    outside = reached(room, modules())
    assert "numpy" in outside, "no imports were found: nothing was tested"
    assert outside & WITHOUT_FENICS[room] == set()


def test_fenics_reached_through_another_room_is_found() -> None:
    assert {"dolfinx", "petsc4py", "mpi4py"} <= reached("feti", modules())


def test_mpi_and_petsc_are_loaded_late_everywhere() -> None:
    at_once = {"mpi4py", "petsc4py"}
    assert [
        f"{module.name}:{found.line}"
        for module in modules()
        for found in module.imports()
        if found.target.partition(".")[0] in at_once and not found.for_types
    ] == []


def test_only_the_private_module_imports_dolfinx() -> None:
    importing = {module.room for module in modules() if dolfinx_imports(module)}
    assert importing == {"_dolfinx"}


def test_dolfinx_is_found_inside_functions_and_allowed_for_types(tmp_path: Path) -> None:
    source = """
        from typing import TYPE_CHECKING
        if TYPE_CHECKING:
            import dolfinx.mesh
        else:
            import dolfinx.fem
        def late():
            from dolfinx import __version__
    """
    lines = "\n".join(line[8:] for line in source.splitlines())
    assert dolfinx_imports(a_module("feti", lines, tmp_path)) == [
        "fenics_contact.feti.example:6",
        "fenics_contact.feti.example:8",
    ]


def test_only_dolfinx_and_requirements_ask_for_its_version() -> None:
    asking = {module.room for module in modules() if "fenics-dolfinx" in module.path.read_text()}
    assert "_requirements" in asking, "the name has changed: nothing was tested"
    assert asking <= {"_requirements", "_dolfinx"}


def test_contact_alone_loads_neither_sensitivity_nor_pictures() -> None:
    code = f"import sys, {PACKAGE}.contact; print(*sorted(sys.modules))"
    answer = launch(1, "-c", code)
    assert answer.returncode == 0, answer.stderr
    loaded = set(answer.stdout.split())
    assert f"{PACKAGE}.contact" in loaded
    rooms = {f"{PACKAGE}.{room}" for room in ("shape", "viz", "optimize", "outer", "study")}
    assert loaded & (rooms | {"pyvista", "matplotlib"}) == set()


def order(house: list[Module]) -> list[str]:
    """Sort modules so that each comes after all that it imports, also for types alone.

    Raises:
        graphlib.CycleError: Modules import each other.
    """
    names = {module.name for module in house}
    sorter: graphlib.TopologicalSorter[str] = graphlib.TopologicalSorter()
    for module in house:
        found = {each.target for each in module.imports()}
        found |= {target.rpartition(".")[0] for target in found - names}
        sorter.add(module.name, *(found & names - {module.name}))
    return list(sorter.static_order())


def test_no_modules_import_each_other() -> None:
    house = modules()
    assert len(order(house)) == len(house) > 100


def test_modules_that_import_each_other_are_found(tmp_path: Path) -> None:
    for name, other in (("first", "second"), ("second", "first")):
        folder = tmp_path / PACKAGE / "qp"
        folder.mkdir(parents=True, exist_ok=True)
        line = f"from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from {PACKAGE}.qp.{other} import x"
        (folder / f"{name}.py").write_text(line)
    with pytest.raises(graphlib.CycleError, match=r"qp\.(first|second)"):
        order(modules(tmp_path))


def test_a_name_of_a_face_stands_for_one_thing() -> None:
    rooms = sorted({module.room for module in modules()} - {"", "__main__"})
    faces = {room: importlib.import_module(f"{PACKAGE}.{room}") for room in rooms if room[0] != "_"}
    meanings: dict[str, dict[str, object]] = {}
    for room, face in faces.items():
        for name in getattr(face, "__all__", []):
            meanings.setdefault(name, {})[room] = getattr(face, name)
    assert len(meanings) > 300, "no names were found: nothing was tested"
    assert {name: list(of) for name, of in meanings.items() if len(set(map(id, of.values()))) > 1} == {}
