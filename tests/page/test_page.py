"""A page holds the bodies, their fields and the tables of a result, as they are."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Mapping
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from fenics_contact import State, Status, result_page, write_result, write_vtu
from fenics_contact.__main__ import main
from fenics_contact._page.arrays import rounded
from fenics_contact._page.obstacles import obstacle_entries
from fenics_contact._page.page import Page, sections, status_words
from fenics_contact.errors import InvalidInputError, MissingRequirementError
from fenics_contact.output import ResultSeries
from fenics_contact.output.result import readable, result_record
from fenics_contact.pictures import Units
from fenics_contact.pictures.section import rounded_up
from fenics_contact.shapes import Box, Cone, SurfaceShape, Torus
from tests.page.contents import content
from tests.pictures.moving_states import block_among_movers, pressed_by_a_lid
from tests.pictures.plane_states import plane_block
from tests.pictures.states import pulled, touching_blocks


def text_of(page: str | None) -> str:
    """Return the text of the tables of a page."""
    assert page is not None
    tables = " ".join(re.findall(r"<section>.*?</section>", page, re.DOTALL))
    return " ".join(unescape(re.sub(r"<[^>]*>", " ", tables)).split())


def field(data: Mapping[str, Any], label: str) -> dict[str, Any]:
    """Return the field of a label."""
    (found,) = (entry for entry in data["fields"] if entry["label"] == label)
    return dict(found)


@pytest.mark.parametrize("state", [touching_blocks, plane_block], ids=["space", "plane"])
def test_a_page_holds_the_bodies_and_their_fields(state: Callable[[], State]) -> None:
    data, arrays = content(result_page(state()).html)
    assert data["bodies"] == list(state().scene.bodies)
    for name, body in zip(data["bodies"], data["steps"][0]["bodies"], strict=True):
        mesh = state().scene.bodies[name].mesh
        points, skin = arrays[body["points"]], arrays[body["triangles"]]
        assert points[:, : mesh.dim] == pytest.approx(mesh.points, rel=1e-6)
        assert np.array_equal(arrays[body["cells"]], mesh.cells)
        moved = arrays[body["nodes"]["displacement"]][:, : mesh.dim]
        assert np.any(moved)
        assert moved == pytest.approx(state().gather_displacement(name), rel=2e-4, abs=1e-12)
        stress = arrays[body["on_cells"]["von_mises"]].ravel()
        assert stress == pytest.approx(state().gather_von_mises(name), rel=2e-4)
        sides = points[skin[:, 1]] - points[skin[:, 0]], points[skin[:, 2]] - points[skin[:, 0]]
        area = np.linalg.norm(np.cross(*sides), axis=1).sum() / 2
        box = np.ptp(points, axis=0)
        if mesh.dim == 2:
            assert area == pytest.approx(box[0] * box[1], rel=0.02)
        else:
            assert area == pytest.approx(2 * (box * np.roll(box, 1)).sum(), rel=0.05)
        assert len(arrays[body["owner"]]) == len(skin)


@pytest.mark.parametrize(("cell", "pieces"), [("hexahedron27", 8), ("triangle6", 4)])
def test_quadratic_cells_are_cut_into_linear_ones(cell: str, pieces: int) -> None:
    state = pulled(cell)
    data, arrays = content(result_page(state).html)
    (body,) = data["steps"][0]["bodies"]
    assert len(arrays[body["cells"]]) == pieces * state.scene.bodies["bar"].mesh.n_cells
    assert len(arrays[body["on_cells"]["von_mises"]]) == len(arrays[body["cells"]])


def test_fields_have_words_units_and_ranges() -> None:
    state = touching_blocks()
    data, _ = content(result_page(state, units=Units("m", "kN", "kPa")).html)
    labels = [entry["label"] for entry in data["fields"]]
    assert labels[:3] == ["von Mises stress at nodes", "displacement, magnitude", "displacement, x"]
    assert {"contact pressure", "contact status", "stress, xy", "principal stress, first (largest)"} < set(
        labels
    )
    stress = field(data, "von Mises stress of cells")
    largest = max(state.gather_von_mises(name).max() for name in data["bodies"])
    assert stress["unit"] == "kPa"
    assert stress["extremes"][0][1] == pytest.approx(largest)
    assert (stress["range"][0], stress["colours"]) == (0.0, "size")
    assert 0.5 * largest < stress["range"][1] < 2 * largest
    low, high = field(data, "stress, zz")["range"]
    assert low == -high < 0
    pressure = field(data, "contact pressure")
    assert pressure["contact"]
    assert pressure["extremes"][0][1] == pytest.approx(state.contact.pressure.max())
    assert field(data, "displacement, x")["unit"] == "m"
    three = ("von Mises stress at nodes", "stress of cells, xy", "subdomain")
    parts = [field(data, label)["part"] for label in three]
    assert parts == ["at nodes", "means over cells", "more"]


def test_pages_of_bodies_that_deform_much_have_two_pressures() -> None:
    state, linear = pressed_by_a_lid(), touching_blocks()
    data, _ = content(result_page(state).html)
    nominal = field(data, "contact pressure by undeformed area")
    assert nominal["extremes"][0][1] == pytest.approx(state.contact.nominal_pressure.max())
    (entry,) = result_record(state)["contact"]
    assert entry["peak_nominal_pressure"] == state.contact.nominal_pressure.max()
    assert "largest nominal pressure" in result_page(state).html
    assert "nominal pressure" not in result_page(linear).html
    assert "peak_nominal_pressure" not in result_record(linear)["contact"][0]


def test_the_mesh_of_all_load_steps_is_kept_once() -> None:
    state = touching_blocks()
    one, _ = content(result_page(state).html)
    three, _ = content(result_page({"a": state, "b": state, "c": state}).html)
    assert [step["label"] for step in three["steps"]] == ["a", "b", "c"]
    assert len(three["arrays"]) == len(one["arrays"])


def test_files_give_the_page_of_their_state(tmp_path: Path) -> None:
    state = touching_blocks()
    write_vtu(state, tmp_path)
    steps = {"number": [0], "name": ["pressed"], "stick": [11], "normal_force": [1234.5678]}
    more = {"title": "Blocks <of> steel", "unit_names": {"stress": "psi"}, "steps": steps}
    write_result(state, tmp_path, more=more)
    page = result_page(tmp_path).html
    assert page is not None
    data, arrays = content(page)
    same, others = content(result_page(state, title="Blocks <of> steel", units=Units(stress="psi")).html)
    assert data["title"] == "Blocks <of> steel"
    assert "Load steps step stick sum of normal forces (N) 0 pressed 11 1234.6" in text_of(page)
    assert "<title>Blocks &lt;of&gt; steel</title>" in page
    assert "<of>" not in page.replace("\\u003c", "")
    for ours, theirs in zip(data["steps"][0]["bodies"], same["steps"][0]["bodies"], strict=True):
        for kind, name in (("nodes", "contact_force"), ("on_cells", "stress")):
            assert arrays[ours[kind][name]] == pytest.approx(others[theirs[kind][name]], rel=1e-3, abs=1e-9)
    assert data["fields"][0]["unit"] == "psi"
    assert data["history"]["residuals"] == same["history"]["residuals"]
    assert content(result_page(tmp_path / "result.json").html)[0]["title"] == data["title"]
    alone = result_page(write_vtu(state, tmp_path / "alone")).html
    assert content(alone)[0]["title"] == "alone"
    assert text_of(alone) == ""


def test_a_series_becomes_load_steps(tmp_path: Path) -> None:
    series = ResultSeries(tmp_path, "history", MPI.COMM_SELF)
    series.add(plane_block(), 0.0, "stuck")
    series.add(plane_block(friction=0.0), 0.5)
    data, arrays = content(result_page(series.path).html)
    assert [step["label"] for step in data["steps"]] == ["stuck", "0.5"]
    first, second = (arrays[step["bodies"][0]["nodes"]["displacement"]] for step in data["steps"])
    assert np.abs(first - second).max() > 1e-4
    assert len(field(data, "von Mises stress at nodes")["extremes"]) == 2


def test_tables_tell_the_numbers_of_the_result() -> None:
    state = touching_blocks()
    told = text_of(result_page(state).html)
    contact = state.contact
    for status in Status:
        assert f"{contact.count(status)} {status.name.lower()}" in told
    assert f"sum of normal forces {contact.normal_force.sum():.5g} N" in told
    held = state.reactions()[0]
    numbers = [f"{part:.5g}".replace("-", "−") for part in held.force]
    assert f"reaction 0 lower z0 force (N) {' '.join(numbers)}" in told
    assert "sum of loads" in told
    assert "dolfinx" in told
    assert "tolerance 1e−06" in told
    assert "errors not computed" in told


def test_results_of_before_some_entries_were_added_are_told(tmp_path: Path) -> None:
    state = plane_block()
    write_vtu(state, tmp_path)
    record = json.loads(write_result(state, tmp_path).read_text())
    whole = text_of(result_page(tmp_path).html)
    for name in ("force_scale", "moment_scale"):
        del record["forces"]["balance"][name]
    (tmp_path / "result.json").write_text(json.dumps(record))
    assert text_of(result_page(tmp_path).html) == whole
    kept = {name: record[name] for name in ("format", "format_version", "kind", "scene", "contact")}
    (tmp_path / "result.json").write_text(json.dumps(kept))
    page = result_page(tmp_path).html
    assert "Forces" not in text_of(page)
    assert content(page)[0]["history"]["residuals"] == {}


def test_moments_in_the_plane_are_one_number_and_rounding_is_zero() -> None:
    state = plane_block()
    told = text_of(result_page(state).html)
    reaction = state.reactions()[0]
    force = " ".join(f"{part:.5g}".replace("-", "−") for part in reaction.force)
    moment = f"{reaction.moment:.5g}".replace("-", "−")
    assert "x y z reaction 0 block y1" in told
    assert "contact block y0 on rigid plane" in told
    assert f"force (N/mm) {force} about" in told
    assert f"moment (N mm/mm) {moment}" in told
    assert f"energy, strain {state.energies.strain:.5g} N mm/mm" in told
    assert f"sum of normal forces {state.contact.normal_force.sum():.5g} N/mm" in told
    forces = told.partition("Forces and moments")[2].partition("Imbalance")[0]
    assert "e−1" not in forces, "rounding is told"


def test_moments_of_plane_bodies_stand_under_z_and_energies_that_are_unknown_nowhere() -> None:
    page = result_page(plane_block()).html
    assert page is not None
    moment = re.search(r"moment \(N mm/mm\)</td>(.*?)</tr>", page)
    assert moment is not None
    assert [cell != "" for cell in re.findall(r"<td[^>]*>(.*?)</td>", moment[1])] == [False, False, True]
    told = sections({"energies": {"strain": 1.0, "dual": None}}, Units())
    assert "energy, strain" in told
    assert "dual" not in told


def test_motions_of_rigid_surfaces_are_told() -> None:
    plane = {"body": "arm", "surface": "end", "about": [1.0, 2.0]}
    plane |= {"displacement": [0.5, -0.25], "rotation": 0.01}
    told = sections({"rigid_motions": [plane]}, Units("m"))
    assert "0 arm end, point 1, 2" in told
    assert "displacement 0.5, −0.25 m; rotation 0.01 rad" in told


@pytest.mark.parametrize(
    ("laws", "words"),
    [
        ([{"type": "Coulomb", "friction_coefficient": 0.3}], ("open", "stick", "slip")),
        ([None, {"type": "Tresca", "traction": 0.0}], ("open", "", "closed")),
        ([None, {"type": "Tresca", "traction": 1.0}], ("open", "stick", "slip or closed")),
    ],
)
def test_without_friction_points_are_closed(laws: list[Any], words: tuple[str, ...]) -> None:
    assert status_words([{"friction": law} for law in laws]) == words


def test_obstacles_are_lines() -> None:
    data, _ = content(result_page(plane_block()).html)
    (floor,) = data["obstacles"]
    (line,) = floor["lines"]
    assert floor["type"] == "RigidPlane"
    assert np.asarray(line)[:, 1:] == pytest.approx(0.0)
    assert np.ptp(np.asarray(line)[:, 0]) > 2.0
    assert data["scale"] == 1.0, "bodies are drawn inside of obstacles"


def test_obstacles_that_move_are_lines_where_they_are() -> None:
    *_, state = block_among_movers()
    data, _ = content(result_page(state).html)
    assert [entry["type"] for entry in data["obstacles"]] == ["RigidPlane", "RigidSphere", "RigidCylinder"]
    for entry, pair in zip(data["obstacles"], state.scene.contacts, strict=True):
        points = np.concatenate([np.asarray(line) for line in entry["lines"]])
        there, before = pair.master.at(1.0), pair.master  # type: ignore[union-attr]
        assert np.abs(there.distance(points)).max() < 1e-6
        assert np.abs(before.distance(points)).max() > 0.02, "it has moved"
    (lid,) = content(result_page(pressed_by_a_lid()).html)[0]["obstacles"]
    assert np.asarray(lid["lines"][0])[:, 1:] == pytest.approx(np.tile([0.9, 0.0], (2, 1)))


def test_tools_are_lines_where_they_have_moved_to() -> None:
    shapes: dict[str, SurfaceShape] = {
        "box": Box((1.0, 1.0, 1.6), (1.0, 0.6, 1.0), radius=0.2, rotation=(0.0, 0.0, 0.4)),
        "square": Box((1.0, 1.0, 1.5), (1.0, 0.6, 1.0)),
        "cone": Cone((1.0, 1.0, 1.1), (0.0, 0.0, 1.0), 1.0, radius=0.3),
        "ring": Torus((1.0, 1.0, 1.4), (0.0, 0.0, 1.0), 0.6, 0.3),
    }
    at, turn = (1.0, 1.0, 2.0), np.array([0.0, 0.3, 0.1])
    master = {"type": "RigidTool", "name": "t", "at": list(at)}
    moved = {"t": {"displacement": [0.1, 0.0, -0.2], "rotation": turn.tolist()}}
    points = np.array([[0.0, 0.0, 0.0], [2.0, 2.0, 1.0]])
    for shape in shapes.values():
        pair = {"master": {**master, "shape": readable(shape)}}
        ((entry),) = obstacle_entries({"scene": {"contacts": [pair]}, "tools": moved}, points)
        lines = np.concatenate([np.asarray(line) for line in entry["lines"]])
        matrix = Rotation.from_rotvec(turn).as_matrix()
        before = (lines - np.array(at) - np.array([0.1, 0.0, -0.2])) @ matrix + np.array(at)
        np.testing.assert_allclose(shape.distance(before), 0.0, atol=0.02)
        assert np.abs(shape.distance(lines)).max() > 0.05, "it has moved"


def test_residuals_and_objectives_are_there_to_draw(tmp_path: Path) -> None:
    state = touching_blocks()
    history = content(result_page(state).html)[0]["history"]
    assert history["residuals"]["natural"] == [step.residuals.natural for step in state.solution.history]
    assert history["tolerance"] == 1e-6
    write_vtu(state, tmp_path)
    record = result_record(state)
    record["optimisation"] = {"history": {"evaluations": [1, 2], "value": [3.0, None], "best": [3.0, 3.0]}}
    (tmp_path / "result.json").write_text(json.dumps(record, default=np.ndarray.tolist))
    history = content(result_page(tmp_path).html)[0]["history"]
    assert history["evaluations"]["value"] == [3.0, None]


def test_numbers_keep_four_digits() -> None:
    values = np.array([0.0, -0.0, np.nan, 1.0, -np.pi, 1e-30, 3.4e38, 0.1], dtype=np.float32)
    kept = rounded(values)
    assert np.array_equal(np.isnan(kept), np.isnan(values))
    known = values[~np.isnan(values)].astype(float)
    assert np.abs(kept[~np.isnan(values)] - known).max() > 0
    assert np.all(np.abs(kept[~np.isnan(values)] - known) <= 2**-13 * np.abs(known))


@pytest.mark.parametrize(
    ("value", "top"), [(0.0, 1.0), (0.4038, 0.45), (2405.0, 2500.0), (5.0, 5.0), (10.0, 10.0)]
)
def test_ranges_end_at_round_numbers(value: float, top: float) -> None:
    assert rounded_up(value) == pytest.approx(top)


def test_a_page_is_whole_and_loads_nothing(tmp_path: Path) -> None:
    shown = result_page(plane_block(), tmp_path / "new" / "page.html")
    assert shown.html is not None
    assert Path(shown).read_text() == shown.html
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["page.html"]
    assert "default-src 'none'" in shown.html
    assert re.findall(r'<(?:script|link|img)[^>]*(?:src|href)="[^"]*"', shown.html) == []
    assert str(shown) == str(tmp_path / "new" / "page.html")
    framed = shown._repr_mimebundle_()["text/html"]
    assert framed.startswith("<iframe srcdoc=")
    assert "height: 900px" in framed


@pytest.mark.parametrize(
    ("result", "path", "message"),
    [
        ({}, None, r"a page needs a state, states by name, or a file, got none"),
        ({"a": 1}, None, r"a page needs a state, states by name, or a file, got int"),
        ("nowhere", None, r"a result is needed at 'nowhere/?.*'"),
        ("{folder}", "page.png", r"pages are HTML files, got the name 'page.png': let it end in '.html'"),
        ("{folder}", None, r"needs the fields of a result, .* has no .vtm or .pvd file: write them"),
    ],
)
def test_what_makes_no_page_is_refused(result: Any, path: str | None, message: str, tmp_path: Path) -> None:
    write_result(plane_block(), tmp_path)
    given = result.format(folder=tmp_path) if isinstance(result, str) else result
    with pytest.raises(InvalidInputError, match=message):
        result_page(given, path)


def test_a_page_shows_the_field_of_choice_first() -> None:
    data, _ = content(result_page(plane_block(), field="contact_pressure").html)
    assert data["fields"][data["first"]]["label"] == "contact pressure"
    with pytest.raises(InvalidInputError, match=r"field must be one of nodal_von_mises, .*, got 'heat'"):
        result_page(plane_block(), field="heat")


def test_a_page_without_a_file_has_no_path_and_shows_nothing_on_other_ranks() -> None:
    with pytest.raises(InvalidInputError, match=r"the page was not written: give result_page a path"):
        Path(Page("<html>"))
    assert Page(None)._repr_mimebundle_() == {"text/plain": ""}


def test_without_the_library_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_vtu(plane_block(), tmp_path)
    monkeypatch.setitem(sys.modules, "plotly", None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "plotly" else name)
    with pytest.raises(MissingRequirementError, match=r"web pages need plotly: pip .*\[viz\]"):
        result_page(tmp_path / "state.vtm")
    assert main(["view", str(tmp_path / "state.vtm"), "--page"]) == 5
    assert not (tmp_path / "page.html").exists()


@pytest.mark.parametrize("place", ["after", "before"])
def test_the_command_writes_a_page_beside_the_result_or_where_told(
    place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_vtu(plane_block(), tmp_path)
    write_result(plane_block(), tmp_path)
    words = [str(tmp_path), "--page"] if place == "after" else ["--page", str(tmp_path)]
    assert main(["view", *words]) == 0
    told = capsys.readouterr().out
    assert f"page in {tmp_path / 'page.html'}" in told
    assert "without a display" not in told
    data, _ = content((tmp_path / "page.html").read_text())
    assert data["title"] == tmp_path.name
    assert main(["view", str(tmp_path), "--save", str(tmp_path / "b" / "mine.html")]) == 0
    assert (tmp_path / "b" / "mine.html").exists()
    assert main(["view", str(tmp_path), "--save", "mine.jpg"]) == 2


RANKS = """
    import sys
    from pathlib import Path
    from mpi4py import MPI
    from fenics_contact import solve_scene
    from fenics_contact import result_page
    from fenics_contact._page.page import Page
    from fenics_contact import Coulomb
    from tests.scenes import partitions, two_blocks

    comm, folder = MPI.COMM_WORLD, Path(sys.argv[1])
    scene = two_blocks(Coulomb(0.4))
    state = solve_scene(scene, comm, partitions=partitions(scene), tolerance=1e-6)
    shown = result_page(state, folder / "page.html")
    answers = comm.gather((shown.html is not None, Path(shown).exists()))
    if comm.rank == 0:
        print(*answers, *(path.name for path in folder.glob("*.html")))
"""


@pytest.mark.slow
def test_of_two_ranks_one_writes_the_page(mpirun: Callable[..., str], tmp_path: Path) -> None:
    assert mpirun(RANKS, 2, tmp_path).strip() == "(True, True) (False, True) page.html"


def test_meshes_of_an_accuracy_are_there_to_draw(tmp_path: Path) -> None:
    state = touching_blocks()
    write_vtu(state, tmp_path)
    record = result_record(state)
    assert content(result_page(state).html)[0]["history"]["levels"] == {}
    levels = {
        "cells": [10, 40], "unknowns": [30, 90], "value": [-2.0, -4.0], "error": [None, 0.1],
        "products": [7, 9], "seconds": [0.5, 0.25], "predicted": [None, 0.3],
    }  # fmt: skip
    record["accuracy"] = {"wanted": 0.05, "reason": "reached, 1 < 2", "levels": levels}
    (tmp_path / "result.json").write_text(json.dumps(record, default=np.ndarray.tolist))
    page = str(result_page(tmp_path).html)
    history = content(page)[0]["history"]["levels"]
    assert history == {"unknowns": [30, 90], "seconds": [0.5, 0.75], "error": [None, 0.025], "wanted": 0.05}
    table = page[page.index("<h2>Accuracy</h2>") :].split("</section>")[0]
    assert "<p>reached, 1 &lt; 2</p>" in table
    assert [word in table for word in (">unknown<", ">2.5 %<", ">40<", ">−4<")] == [True] * 4
