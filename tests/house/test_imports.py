"""Imports point down the floors of the house, and FEniCSx is met where it may be met."""

from __future__ import annotations

import graphlib
from pathlib import Path

import pytest

from tests.conftest import launch
from tests.house.floors import FLOORS
from tests.house.source import PACKAGE, Module, modules, room_of

FLOOR = {room: height for height, rooms in enumerate(FLOORS) for room in rooms}
ROOMS = {f"{PACKAGE}.{room}" for room in FLOOR if room not in {"theory", "_responses"}}
#: Rooms that are tested with small dense matrices, and what they never meet.
WITHOUT_FENICS = {
    "qp": {"dolfinx", "ufl", "basix", "ffcx", "gmsh"},
    "_optimize": {"dolfinx", "ufl", "basix", "ffcx", "gmsh", "petsc4py", "mpi4py"},
}

#: What stands for libraries that are loaded when they are first used.
LATE = {f"{PACKAGE}._base.libraries.MPI": "mpi4py", f"{PACKAGE}._base.libraries.PETSc": "petsc4py"}


#: Rooms whose names are imported from their faces; all others from the modules that define them.
FACES = {"errors", "_dolfinx"}


def pointing_up(module: Module) -> list[str]:
    """List the imports of a module that do not point to a lower floor."""
    wrong = []
    for found in module.imports():
        there = room_of(found.target)
        if there is None or there == module.room or module.room == "":
            continue
        # The package itself is above everything: it offers names, and no module takes them from it.
        if there not in FLOOR or module.room not in FLOOR or FLOOR[there] >= FLOOR[module.room]:
            wrong.append(f"{module.path.name}:{found.line} ({module.name}) imports {found.target}")
    return wrong


def detours(module: Module, house: set[str]) -> list[str]:
    """List the imports from a face instead of the module that defines the name, and of private names."""
    wrong = []
    for found in module.imports():
        place, _, name = found.target.rpartition(".")
        room = room_of(found.target)
        if room is None or module.path.name == "__init__.py" or found.target in house:
            continue
        past = place == PACKAGE or (place in ROOMS and room not in FACES)
        private = name.startswith("_") and not name.startswith("__")
        if past or private:
            wrong.append(f"{module.name}:{found.line} imports {found.target}")
    return wrong


def reached(room: str, house: list[Module]) -> set[str]:
    """Return the outside libraries that the modules of a room import, themselves or through others."""
    by_name = {module.name: module for module in house}
    waiting, seen, outside = [module for module in house if module.room == room], set(), set()
    while waiting:
        module = waiting.pop()
        seen.add(module.name)
        for found in module.imports():
            place = found.target if found.target in by_name else found.target.rpartition(".")[0]
            if found.target in LATE or room_of(found.target) is None:
                outside |= (
                    set() if found.for_types else {LATE.get(found.target, found.target.partition(".")[0])}
                )
            elif place in by_name and place not in seen:
                waiting.append(by_name[place])
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


def test_every_module_has_a_floor() -> None:
    homeless = [module.name for module in modules() if module.room not in {"", *FLOOR}]
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
        ("feti", "from fenics_contact._equilibrium import steps"),
        ("feti", "from fenics_contact import design"),
        ("feti", "from ..design.problem import ShapeProblem"),
        ("feti", "def f():\n    import fenics_contact.design"),
        ("feti", "from fenics_contact import solve_scene"),
        ("_scene", "from fenics_contact.gallery.blocks import block"),
        ("_optimize", "import fenics_contact.pictures"),
        ("pictures", "import fenics_contact.output"),
        ("pictures", "import fenics_contact.study"),
        ("output", "from fenics_contact._scene_file.reading import read_scene_file"),
        ("study", "from fenics_contact._cli.app import main"),
    ],
)
def test_an_import_that_does_not_point_down_is_found(room: str, line: str, tmp_path: Path) -> None:
    assert len(pointing_up(a_module(room, line, tmp_path))) == 1


@pytest.mark.parametrize(
    ("room", "line"),
    [
        ("feti", "from fenics_contact._scene.scene import Scene"),
        ("feti", "from . import rows\nfrom .rows import gap\nfrom ..qp.solve import solve"),
        ("study", "def draw():\n    from fenics_contact.pictures.canvas import sheet"),
        ("__main__", "from fenics_contact._cli import app"),
        ("_scene_file", "from fenics_contact.design.problem import ShapeProblem"),
        ("qp", "import numpy"),
    ],
)
def test_an_import_that_points_down_passes(room: str, line: str, tmp_path: Path) -> None:
    module = a_module(room, line, tmp_path)
    assert module.imports()
    assert pointing_up(module) == []


def test_names_are_imported_from_where_they_are_defined() -> None:
    house = modules()
    names = {module.name for module in house}
    assert f"{PACKAGE}.qp.face" in names, "no modules were found: nothing was tested"
    assert [line for module in house for line in detours(module, names)] == []


@pytest.mark.parametrize(
    ("line", "is_one"),
    [
        ("from fenics_contact.qp import Face", True),
        ("from fenics_contact import solve_scene", True),
        ("from fenics_contact.qp.face import _faces", True),
        ("from fenics_contact.qp.face import Face", False),
        ("from fenics_contact.errors import InvalidInputError", False),
        ("from fenics_contact._scene import loads", False),
    ],
)
def test_an_import_by_a_detour_is_found(line: str, is_one: bool, tmp_path: Path) -> None:
    house = {f"{PACKAGE}.qp.face", f"{PACKAGE}._scene.loads"}
    assert bool(detours(a_module("feti", line, tmp_path), house)) == is_one


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
    asking = {module.room for module in modules() if "dolfinx.__version__" in module.path.read_text()}
    assert asking == {"_base", "_dolfinx"}


def test_equilibrium_alone_loads_neither_sensitivity_nor_pictures() -> None:
    code = f"import sys, {PACKAGE} as fc; fc.solve_scene; print(*sorted(sys.modules))"
    answer = launch(1, "-c", code)
    assert answer.returncode == 0, answer.stderr
    loaded = set(answer.stdout.split())
    assert f"{PACKAGE}._equilibrium" in loaded
    rooms = {f"{PACKAGE}.{room}" for room in ("design", "pictures", "_optimize", "_responses", "study")}
    assert loaded & (rooms | {"pyvista", "matplotlib", f"{PACKAGE}._large_deformations.newton"}) == set()


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
