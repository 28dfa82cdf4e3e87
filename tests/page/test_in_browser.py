"""A page in a browser: it asks for nothing, makes no mistake, and shows what one chooses."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import AccurateResult, Level, Status, result_page, write_result
from fenics_contact.output import ResultSeries
from tests.page.browser import CHROMIUM, DRIVER, MISSING, Browser, browser
from tests.pictures.plane_states import flat_pad, plane_block, tall_pad
from tests.pictures.states import pixels, touching_blocks

pytestmark = pytest.mark.skipif(DRIVER is None or CHROMIUM is None, reason=MISSING)

#: What is drawn: the coloured skin, the faces of the section, the outline; and the colours and axes.
DRAWN = """
    const {data, layout, _fullLayout} = document.getElementById("view");
    const kept = (trace) => ["x", "y", "z", "i", "j", "k", "intensity", "name"].map((key) => trace[key]);
    return {
        skin: kept(data[1]), cut: kept(data[2]), outline: kept(data[3]), names: data.map(({name}) => name),
        colours: [layout.coloraxis.cmin, layout.coloraxis.cmax], bar: layout.coloraxis.colorbar.title.text,
        caption: document.getElementById("caption").textContent, x: layout.scene.xaxis.range,
    };
"""


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browser(tmp_path_factory.mktemp("browser")) as opened:
        yield opened


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A page in space of a folder with two steps, and one in the plane."""
    folder, state = tmp_path_factory.mktemp("pages"), touching_blocks()
    series = ResultSeries(folder, "history", MPI.COMM_SELF)
    for value, label in enumerate(("first", "second")):
        series.add(state, value, label)
    numbers = (
        "iterations",
        "products",
        "open",
        "stick",
        "slip",
        "normal_force",
        "friction_force",
        "peak_pressure",
    )
    steps = {"number": [0, 1], "name": ["first", "second"], **{name: [123.456, 65.4321] for name in numbers}}
    levels = [
        Level(9 * k, 30 * k, 2.0, error, 7, 0.5, 0.4, 2.1, 2.0)
        for k, error in ((1, np.inf), (2, 0.2), (4, 0.1))
    ]
    accurate = AccurateResult(state, 2.0, 0.1, 0.01, False, "as far as it goes", tuple(levels))
    write_result(state, folder, more={"title": "Two blocks", "steps": steps}, accuracy=accurate)
    result_page(folder, folder / "space.html")
    result_page(plane_block(), folder / "plane.html")
    return {name: folder / f"{name}.html" for name in ("space", "plane")}


def label_of(page: Browser, label: str) -> str:
    """Return the value of a field in the menu."""
    found = "return [...document.getElementById('field').options].find((o) => o.text === arguments[0]).value"
    return str(page.run(found, label))


def drawn(page: Browser) -> dict[str, Any]:
    """Return what is drawn: arrays of points and triangles of skin and section, and words."""
    found = dict(page.run(DRAWN))
    for part in ("skin", "cut"):
        x, y, z, i, j, k, values, _ = found[part]
        found[part] = np.array([x, y, z]).T, np.array([i, j, k], dtype=int).T, np.array(values)
    return found


def areas(surface: tuple[np.ndarray, np.ndarray, np.ndarray]) -> np.ndarray:
    """Return the area vectors of triangles, (n, 3)."""
    points, triangles, _ = surface
    corners = points[triangles]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2


def require_no_trouble(page: Browser, path: Path) -> None:
    """Require that a page has asked for itself alone, and that neither it nor the browser has complained."""
    asked = [url for url in page.requests() if not url.startswith(("chrome://", "data:"))]
    assert asked == [path.as_uri()]
    assert [line for line in page.messages() if "willReadFrequently" not in line] == []
    assert page.trouble() == ""


@pytest.mark.parametrize("name", ["space", "plane"])
@pytest.mark.parametrize("width", [1280, 400])
def test_a_page_asks_for_nothing_and_nothing_is_cut_off(
    name: str, width: int, chromium: Browser, pages: dict[str, Path]
) -> None:
    chromium.open(pages[name], width)
    chromium.wait("return document.querySelectorAll('#history .trace').length === 3")
    whole, screen = chromium.run("return [document.documentElement.scrollWidth, innerWidth]")
    assert whole <= screen == width
    wider = """
        const right = (part) => part.getBoundingClientRect().right;
        const inside = (part) => part.closest(".js-plotly-plot") || right(part) <= innerWidth;
        const all = [...document.querySelectorAll("body *")];
        return all.filter((part) => !inside(part)).map((part) => part.outerHTML);
    """
    assert chromium.run(wider) == []
    require_no_trouble(chromium, pages[name])


@pytest.mark.parametrize("width", [1280, 400])
@pytest.mark.parametrize("name", ["flat", "tall"])
def test_names_of_plane_axes_stand_whole_in_the_view(
    name: str, width: int, chromium: Browser, tmp_path: Path
) -> None:
    """They are what changes in the picture where they are left out."""
    result_page({"flat": flat_pad, "tall": tall_pad}[name](), tmp_path / "page.html")
    chromium.open(tmp_path / "page.html", width)
    images = []
    for axes in (["x (mm)", "y (mm)"], ["", "y (mm)"], ["x (mm)", ""]):
        words = {f"scene.{axis}axis.title.text": text for axis, text in zip("xy", axes, strict=True)}
        chromium.run("return Plotly.relayout('view', arguments[0]).then(() => 1)", words)
        chromium.picture(tmp_path / "page.png")
        images.append(pixels(tmp_path / "page.png"))
    left, top, right, bottom = chromium.run(
        "const b = document.getElementById('view').getBoundingClientRect();"
        "return [b.left, b.top, b.right, b.bottom]"
    )
    for axis, without in zip("xy", images[1:], strict=True):
        rows, columns = np.nonzero(np.abs(images[0] - without).max(axis=2) > 0.25)
        assert len(rows) > 30, f"{axis} has no name"
        assert min(columns.min() - left, right - columns.max()) > 4, f"the name of {axis} is cut off"
        assert min(rows.min() - top, bottom - rows.max()) > 4, f"the name of {axis} is cut off"


def test_the_menu_changes_colours_and_numbers(chromium: Browser, pages: dict[str, Path]) -> None:
    chromium.open(pages["space"])
    state = touching_blocks()
    first = drawn(chromium)
    assert first["bar"] == "von Mises stress at nodes (MPa)"
    chromium.choose("field", label_of(chromium, "displacement, magnitude"))
    second = drawn(chromium)
    largest = max(
        np.linalg.norm(state.gather_displacement(name), axis=1).max() for name in state.scene.bodies
    )
    assert second["bar"] == "displacement, magnitude (mm)"
    assert second["skin"][2].max() == pytest.approx(largest, rel=1e-3)
    assert second["colours"][1] == pytest.approx(largest, rel=0.3)
    assert "displacement, magnitude: " in second["caption"]
    chromium.choose("high", "0.5")
    assert drawn(chromium)["colours"][1] == 0.5
    chromium.choose("field", label_of(chromium, "von Mises stress of cells"))
    peaks = [state.gather_von_mises(name).max() for name in state.scene.bodies]
    skin = drawn(chromium)["skin"]
    assert len(skin[2]) == len(skin[1]), "one value per triangle"
    assert skin[2].max() == pytest.approx(max(peaks), rel=1e-3)


def test_the_section_shows_the_inside(chromium: Browser, pages: dict[str, Path]) -> None:
    chromium.open(pages["space"])
    chromium.choose("scale", "0")
    whole = drawn(chromium)
    assert len(whole["cut"][1]) == 0
    lower = touching_blocks().scene.bodies["lower"].mesh.points
    for axis, place in ((0, 50), (2, 30)):
        chromium.choose("axis", str(axis))
        chromium.choose("place", str(place))
        found = drawn(chromium)
        points = found["cut"][0]
        at = points[:, axis].mean()
        assert np.ptp(points[:, axis]) < 1e-6
        sides = found["skin"][0][:, axis] - at
        assert min(abs(sides.min()), abs(sides.max())) < 1e-6, "something is left on the side that is cut off"
        assert f"{'xyz'[axis]} = " in found["caption"]
        through_lower = np.all(points[found["cut"][1]][:, :, 2] <= 1e-6, axis=1)
        sizes = np.delete(np.ptp(lower, axis=0), axis)
        cut = np.linalg.norm(areas(found["cut"]), axis=1)[through_lower].sum()
        assert cut == pytest.approx(sizes.prod(), rel=1e-4), "faces are missing or twice"
        chromium.choose("other", True)
        both = drawn(chromium)["skin"]
        chromium.choose("other", False)
        total = sum(np.linalg.norm(areas(part), axis=1).sum() for part in (both, found["skin"]))
        assert total == pytest.approx(np.linalg.norm(areas(whole["skin"]), axis=1).sum(), rel=1e-5)


def test_sliders_move_bodies_and_steps(chromium: Browser, pages: dict[str, Path]) -> None:
    chromium.open(pages["space"])
    state = touching_blocks()
    chromium.choose("scale", "0")
    still = drawn(chromium)["skin"][0]
    chromium.choose("scale", "3")
    told = chromium.run("return Number(document.getElementById('scale-name').textContent)")
    moved = drawn(chromium)["skin"][0]
    most = max(np.abs(state.gather_displacement(name)).max() for name in state.scene.bodies)
    assert np.abs(moved - still).max() == pytest.approx(told * most, rel=1e-3)
    chromium.choose("scale", "6")
    low, high = drawn(chromium)["x"]
    x = drawn(chromium)["skin"][0][:, 0]
    assert low < x.min()
    assert still[:, 0].max() + 0.02 < x.max() < high, "bodies that leave the view are cut off"
    assert "step 2 of 2, second" in drawn(chromium)["caption"]
    chromium.choose("step", "0")
    assert "step 1 of 2, first" in drawn(chromium)["caption"]


def test_contact_is_shown_on_slave_surfaces(chromium: Browser, pages: dict[str, Path]) -> None:
    chromium.open(pages["space"])
    contact = touching_blocks().contact
    chromium.choose("field", label_of(chromium, "contact status"))
    names = [name for name in drawn(chromium)["names"] if name]
    assert names == [f"{status.name.lower()} ({contact.count(status)})" for status in Status]
    chromium.choose("field", label_of(chromium, "contact pressure"))
    skin = drawn(chromium)["skin"]
    assert len(skin[0]) == len(contact.status)
    assert skin[2].max() == pytest.approx(contact.pressure.max(), rel=1e-3)
    far = np.ptp(drawn(chromium)["x"])
    chromium.choose("near", True)
    assert np.ptp(drawn(chromium)["x"]) <= far
    chromium.open(pages["plane"])
    chromium.choose("field", label_of(chromium, "contact pressure"))
    assert "contact pressure: 0 to " in drawn(chromium)["caption"]
    require_no_trouble(chromium, pages["plane"])


def test_bodies_can_be_left_out(chromium: Browser, pages: dict[str, Path]) -> None:
    chromium.open(pages["space"])
    before = len(drawn(chromium)["skin"][0])
    chromium.run("document.querySelector('#bodies input').click()")
    chromium.wait("return Number(document.getElementById('view').dataset.drawn) > 1")
    assert 0 < len(drawn(chromium)["skin"][0]) < before


def test_errors_of_meshes_are_drawn_where_there_are_some(chromium: Browser, pages: dict[str, Path]) -> None:
    drawn_of = "return document.getElementById(arguments[0]).data?.map(({x, y}) => [x, y]) ?? null"
    chromium.open(pages["space"])
    chromium.wait("return document.querySelectorAll('#by-seconds .trace').length === 1")
    assert chromium.run(drawn_of, "by-unknowns") == [[[30, 60, 120], [None, 0.1, 0.05]]]
    assert chromium.run(drawn_of, "by-seconds") == [[[0.5, 1.0, 1.5], [None, 0.1, 0.05]]]
    require_no_trouble(chromium, pages["space"])
    chromium.open(pages["plane"])
    chromium.wait("return document.querySelectorAll('#history .trace').length === 3")
    assert chromium.run(drawn_of, "by-unknowns") is None


def test_a_page_that_was_cut_says_so(chromium: Browser, pages: dict[str, Path], tmp_path: Path) -> None:
    text = pages["plane"].read_text()
    at = text.index("H4sI")  # where the compressed arrays begin
    (tmp_path / "cut.html").write_text(text[: at + 200] + text[text.index("</script>", at) :])
    chromium.go(tmp_path / "cut.html")
    with pytest.raises(AssertionError, match="Something is not shown"):
        chromium.wait("return false", seconds=20)


def test_a_notebook_shows_the_page_in_its_frame(chromium: Browser, tmp_path: Path) -> None:
    shown = result_page(plane_block())._repr_mimebundle_()["text/html"]
    (tmp_path / "notebook.html").write_text(f'<!DOCTYPE html><meta charset="utf-8"><body>{shown}</body>')
    chromium.go(tmp_path / "notebook.html", 800)
    chromium.wait(
        "const view = document.querySelector('iframe').contentDocument.getElementById('view');"
        "return view && Number(view.dataset.drawn) > 0"
    )
    wide, told = chromium.run(
        "const {contentDocument, clientWidth} = document.querySelector('iframe');"
        "return [contentDocument.documentElement.scrollWidth <= clientWidth,"
        " contentDocument.getElementById('trouble').textContent]"
    )
    assert (wide, told) == (True, "")
