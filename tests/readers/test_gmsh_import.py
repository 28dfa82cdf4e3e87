"""Bodies come out of .msh files and gmsh models whole, named, and with nodes of their own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from fenics_contact import BodyMesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.faces import vector_areas
from fenics_contact.readers import from_gmsh_model, read_msh
from tests.conftest import ROOT
from tests.readers.msh_files import name, own_gmsh, rectangle_surface, two_boxes, within

BOXES = ROOT / "tests" / "data" / "two_boxes_41.msh"
SQUARES = ROOT / "tests" / "data" / "two_squares_22.msh"


@pytest.fixture
def gmsh() -> Iterator[ModuleType]:
    """A session of the caller's own."""
    with own_gmsh() as module:
        yield module


def area(mesh: BodyMesh, surface: str) -> list[float]:
    return [float(x) for x in vector_areas(mesh.points, mesh.surfaces[surface]).sum(axis=0).round(12)]


def check_boxes(bodies: dict[str, BodyMesh]) -> None:
    """Check what the table and the tool look like, however they are meshed."""
    table, tool = bodies["table"], bodies["tool"]
    assert list(bodies) == ["table", "tool"]
    assert (table.cell_type, table.volume, tool.volume) == ("tetrahedron", pytest.approx(2), pytest.approx(1))
    assert set(table.surfaces) == {"bottom", "interface"}
    assert set(tool.surfaces) == {"top", "interface"}
    assert (area(table, "bottom"), area(tool, "top")) == ([0.0, 0.0, -2.0], [0.0, 0.0, 1.0])
    assert (area(table, "interface"), area(tool, "interface")) == ([0.0, 0.0, 1.0], [0.0, 0.0, -1.0])
    assert dict(table.regions) == {}


def test_a_file_of_version_4_1_gives_every_physical_volume_as_a_body() -> None:
    check_boxes(read_msh(BOXES))


def test_nodes_that_bodies_share_in_the_file_are_torn_apart() -> None:
    bodies = read_msh(str(BOXES))
    sides = [body.points[np.unique(body.surfaces["interface"])] for body in bodies.values()]
    assert np.array_equal(*(side[np.lexsort(side.T)] for side in sides))
    assert len(sides[0]) > 3
    for body in bodies.values():
        assert np.array_equal(np.unique(body.cells), np.arange(body.n_nodes))


def test_a_plane_file_of_version_2_2_has_two_coordinates() -> None:
    bodies = read_msh(SQUARES)
    steel, copper = bodies["steel"], bodies["copper"]
    assert (steel.dim, steel.cell_type, steel.n_cells, steel.n_nodes) == (2, "quadrilateral", 4, 9)
    assert (steel.volume, copper.volume) == (pytest.approx(1.0), pytest.approx(2.0))
    assert (area(steel, "bottom"), area(copper, "bottom")) == ([0.0, -1.0], [0.0, -2.0])
    assert set(steel.surfaces) == {"bottom"}
    assert area(copper, "right") == [1.0, 0.0]


@pytest.mark.parametrize("version", [2.2, 4.0, 4.1])
def test_every_version_of_the_format_gives_the_same_bodies(
    gmsh: ModuleType, version: float, tmp_path: Path
) -> None:
    two_boxes(gmsh)
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.write(str(tmp_path / "boxes.msh"))
    bodies, model = read_msh(tmp_path / "boxes.msh"), from_gmsh_model()
    check_boxes(bodies)
    for body in bodies:
        assert np.allclose(bodies[body].points, model[body].points, rtol=0.0, atol=1e-14)
        assert np.array_equal(bodies[body].cells, model[body].cells)
        for surface, facets in model[body].surfaces.items():
            assert np.array_equal(bodies[body].surfaces[surface], facets)


def test_the_callers_gmsh_keeps_its_models(gmsh: ModuleType) -> None:
    two_boxes(gmsh)
    models, nodes = list(gmsh.model.list()), gmsh.model.mesh.getNodes()[0].size
    check_boxes(read_msh(BOXES))
    check_boxes(from_gmsh_model())
    assert (list(gmsh.model.list()), gmsh.model.getCurrent()) == (models, "press")
    assert gmsh.model.mesh.getNodes()[0].size == nodes
    assert gmsh.model.getEntities(3) == [(3, 1), (3, 2)]


def test_groups_become_regions_of_one_body() -> None:
    bodies = read_msh(SQUARES, {"plate": ["steel", "copper"]})
    plate = bodies["plate"]
    assert (list(bodies), plate.n_nodes, plate.n_cells) == (["plate"], 15, 8)
    assert {name: cells.size for name, cells in plate.regions.items()} == {"steel": 4, "copper": 4}
    assert plate.points[plate.cells[plate.regions["steel"]], 0].max() == pytest.approx(1.0)
    assert area(plate, "bottom") == [0.0, -3.0]


def test_bodies_and_regions_may_be_called_otherwise_and_groups_left_out() -> None:
    bodies = read_msh(SQUARES, {"plate": {"soft": "copper", "hard": "steel"}})
    assert {name: cells.size for name, cells in bodies["plate"].regions.items()} == {"soft": 4, "hard": 4}
    alone = read_msh(SQUARES, {"bar": "copper"})
    assert (list(alone), alone["bar"].n_nodes, dict(alone["bar"].regions)) == (["bar"], 9, {})
    assert list(read_msh(SQUARES, ["steel"])) == ["steel"]


def test_surfaces_may_be_chosen_called_otherwise_and_joined() -> None:
    assert set(read_msh(SQUARES, surfaces=["right"])["copper"].surfaces) == {"right"}
    held = read_msh(SQUARES, surfaces={"held": ["bottom", "right"]})["copper"]
    assert (set(held.surfaces), area(held, "held")) == ({"held"}, [1.0, -2.0])
    assert dict(read_msh(BOXES, surfaces=[])["tool"].surfaces) == {}


def test_a_group_without_a_name_goes_by_its_number(gmsh: ModuleType) -> None:
    surface = rectangle_surface(gmsh, [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], 2, False)
    gmsh.model.addPhysicalGroup(2, [surface], 17)
    gmsh.model.mesh.generate(2)
    assert list(from_gmsh_model()) == ["17"]


@pytest.mark.parametrize("quads", [False, True])
@pytest.mark.parametrize("z", [0.0, 2.5])
def test_a_plane_surface_whose_normal_points_down_is_turned(gmsh: ModuleType, quads: bool, z: float) -> None:
    surface = rectangle_surface(gmsh, [(0, 0, z), (0, 1, z), (3, 1, z), (3, 0, z)], 2, quads)
    name(gmsh, 2, [surface], "plate")
    name(gmsh, 1, within(gmsh, 1, (0, 0, z), (3, 0, z)), "bottom")
    gmsh.model.mesh.generate(2)
    plate = from_gmsh_model()["plate"]
    assert (plate.dim, plate.n_cells, plate.volume) == (2, 4 if quads else 8, pytest.approx(3.0))
    assert area(plate, "bottom") == [0.0, -3.0]


def test_hexahedra_come_from_an_extruded_surface(gmsh: ModuleType) -> None:
    surface = rectangle_surface(gmsh, [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], 2, True)
    gmsh.model.geo.extrude([(2, surface)], 0, 0, 2, numElements=[3], recombine=True)
    gmsh.model.geo.synchronize()
    name(gmsh, 3, [1], "bar")
    name(gmsh, 2, [surface], "end")
    gmsh.model.mesh.generate(3)
    bar = from_gmsh_model()["bar"]
    assert (bar.cell_type, bar.n_cells, bar.n_nodes) == ("hexahedron", 12, 36)
    assert (bar.volume, area(bar, "end")) == (pytest.approx(2.0), [0.0, 0.0, -1.0])


def test_all_ranks_receive_the_bodies_that_rank_0_reads(mpirun: Callable[..., str]) -> None:
    script = f"""
        from mpi4py import MPI
        from fenics_contact.readers import read_msh
        bodies = read_msh("{BOXES}", {{"press": ["table", "tool"]}}, ["top"], comm=MPI.COMM_WORLD)
        found = [(name, round(body.volume, 9), *body.surfaces) for name, body in bodies.items()]
        try:
            read_msh("nowhere.msh", comm=MPI.COMM_WORLD)
        except ValueError as error:
            found.append("there is none" in str(error))
        every = MPI.COMM_WORLD.gather(found)
        if every:
            print(every)
    """
    rank = [("press", 3.0, "top"), True]
    assert mpirun(script, 2).strip() == str([rank, rank])


def test_a_model_without_a_session_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="needs a model in memory, gmsh is not initialised: call"):
        from_gmsh_model()


def test_a_model_that_is_not_meshed_is_refused(gmsh: ModuleType) -> None:
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.synchronize()
    with pytest.raises(InvalidInputError, match="model 'press' must hold cells, it has none: mesh it"):
        from_gmsh_model()


def test_a_volume_without_a_group_is_named(gmsh: ModuleType) -> None:
    two_boxes(gmsh)
    gmsh.model.removePhysicalGroups(gmsh.model.getPhysicalGroups(3)[-1:])
    message = r"volumes \[2\] of model 'press' are in none: use gmsh\.model\.addPhysicalGroup\(3"
    with pytest.raises(InvalidInputError, match=message):
        from_gmsh_model()


def test_a_cell_of_two_bodies_or_regions_is_refused(gmsh: ModuleType) -> None:
    two_boxes(gmsh)
    name(gmsh, 3, [1, 2], "all")
    with pytest.raises(InvalidInputError, match=r"are of 'tool' and 'all': say which physical volumes"):
        from_gmsh_model()
    with pytest.raises(
        InvalidInputError, match=r"cells of body 'press' of model 'press' belong to 'tool' and 'all'"
    ):
        from_gmsh_model({"press": ["tool", "all"]})
    assert from_gmsh_model({"press": "all"}, ["top"])["press"].volume == pytest.approx(3.0)


def test_a_surface_inside_a_body_is_refused() -> None:
    message = r"facets of 'interface' of file .*two_boxes_41\.msh' lie inside body 'press': make bodies of"
    with pytest.raises(InvalidInputError, match=message):
        read_msh(BOXES, {"press": ["table", "tool"]})


def test_a_surface_of_a_body_left_out_is_left_out_too() -> None:
    tool = read_msh(BOXES, ["tool"])["tool"]
    assert set(tool.surfaces) == {"top", "interface"}


def test_bodies_that_touch_without_sharing_nodes_stay_two_and_make_no_one(gmsh: ModuleType) -> None:
    two_boxes(gmsh, shared=False)
    bodies = from_gmsh_model(surfaces=["top"])
    assert [round(body.volume, 9) for body in bodies.values()] == [2.0, 1.0]
    message = r"body 'press' of model 'press' is no sound mesh: .* nodes coincide with another"
    with pytest.raises(InvalidInputError, match=message):
        from_gmsh_model({"press": ["table", "tool"]}, [])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            (["anvil"],),
            r"body 'anvil' needs the physical volume 'anvil', file .* has 'table', 'tool'",
        ),
        (({"press": ["tool", "die"]},), "body 'press' needs the physical volume 'die'"),
        (
            (None, ["side"]),
            "surface 'side' needs the physical surface 'side', .* has 'bottom', 'top', 'interface'",
        ),
        (({},), "has no physical volume for a body"),
    ],
)
def test_a_name_that_is_not_there_is_answered_with_those_that_are(
    arguments: tuple[object], message: str
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        read_msh(BOXES, *arguments)  # type: ignore[arg-type]
