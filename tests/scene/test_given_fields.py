"""Fields of position: given, sampled, in files, as gaps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from fenics_contact import Body, ContactPair, SampledField, Scene, Surface, Tie, read_field
from fenics_contact._base.fingerprint import described
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, hemisphere
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.output.result import described_scene

RANDOM = np.random.default_rng(7)


def smooth(x: np.ndarray) -> np.ndarray:
    return np.sin(2.0 * x[:, 0]) + x[:, 1] ** 2


def on_a_cylinder(count: int) -> np.ndarray:
    angle, height = RANDOM.random((2, count)) * [[2.0 * np.pi], [2.0]]
    return np.column_stack([np.cos(angle), np.sin(angle), height])


def in_a_box(count: int) -> np.ndarray:
    return RANDOM.random((count, 3))


def on_a_plane(count: int) -> np.ndarray:
    return RANDOM.random((count, 3)) * (1.0, 1.0, 0.0)


PLACES = pytest.mark.parametrize("places", [on_a_cylinder, in_a_box, on_a_plane])


@PLACES
def test_the_given_values_are_kept(places: Any) -> None:
    points = places(300)
    field = SampledField(points, smooth(points))
    np.testing.assert_allclose(field(points), smooth(points), atol=1e-9)
    vector = SampledField(points, np.column_stack([smooth(points)] * 3) * (1.0, 2.0, 3.0))
    np.testing.assert_allclose(vector(points)[:, 1], 2.0 * smooth(points), atol=1e-9)


@PLACES
def test_more_points_make_a_field_more_accurate(places: Any) -> None:
    errors, asked = [], places(300)
    for count in (400, 6400):
        points = places(count)
        found = SampledField(points, smooth(points), 10.0)(asked)
        errors.append(np.sqrt(np.mean((found - smooth(asked)) ** 2)))
    # 16 times as many points: 4 times as dense on surfaces, 2.5 times in the box.
    assert errors[1] < 0.4 * errors[0]
    assert errors[1] < 0.02


def test_on_a_line_it_is_linear_between_neighbours() -> None:
    x = np.array([0.0, 1.0, 3.0, 4.0])
    field = SampledField(np.column_stack([x, 0 * x]), x**2)
    np.testing.assert_allclose(field(np.array([[0.5, 0.0], [2.0, 0.0]])), [0.5, 5.0])


def test_points_of_a_plane_suit_plane_bodies() -> None:
    points = np.array([[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0]])
    assert SampledField(points, np.arange(3.0))(points[:, :2]).tolist() == pytest.approx([0, 1, 2])
    assert SampledField(points, points)(points[:, :2]).shape == (3, 2)


def test_one_point_is_the_same_everywhere_within_its_reach() -> None:
    assert SampledField([[0.0, 0.0]], [3.0])(np.array([[50.0, 1.0], [2.0, 2.0]])).tolist() == [3.0, 3.0]
    with pytest.raises(InvalidInputError, match="it reaches only 2"):
        SampledField([[0.0, 0.0]], [3.0], 2.0)(np.array([[5.0, 0.0]]))


def test_no_value_is_invented_far_from_the_points() -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.5, 0.0, 0.0]])
    field = SampledField(points, np.zeros(3))
    assert field(np.array([[5.4, 0.0, 0.0]])) == 0.0
    with pytest.raises(InvalidInputError, match=r"is 3\.5 from \(6, 0, 0\), and it reaches only 3"):
        field(np.array([[1.0, 0.0, 0.0], [6.0, 0.0, 0.0]]))
    assert SampledField(points, np.zeros(3), reach=4.0)(np.array([[6.0, 0.0, 0.0]])) == 0.0


@pytest.mark.parametrize(
    ("points", "values", "reach", "message"),
    [
        ([1.0, 2.0], [1.0, 2.0], None, "points must be rows of two or three finite numbers, got shape"),
        (np.zeros((0, 3)), [], None, "points must be rows"),
        ([[0, 0, np.nan]], [1.0], None, "points must be rows .* got something other than finite"),
        ([[0, 0, 0]], [1.0, 2.0], None, "values must be 1 finite numbers, or rows of 3"),
        ([[0, 0, 0], [1, 0, 0]], [[1.0, 2.0], [1.0, 2.0]], None, "values must be 2 finite numbers"),
        ([[0, 0, 0], [1, 0, 0], [0, 0, 0]], [1.0, 2.0, 3.0], None, "points 0 and 2 are the same"),
        ([[0, 0, 0]], [1.0], 0.0, "reach must be positive and finite"),
        ([[0, 0, 0]], [1.0], np.inf, "reach must be positive and finite"),
    ],
)
def test_what_is_no_field_is_refused(points: Any, values: Any, reach: Any, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        SampledField(points, values, reach)


def test_points_in_space_do_not_suit_plane_bodies() -> None:
    with pytest.raises(InvalidInputError, match="must have 2 coordinates, as the bodies have, got 3"):
        SampledField(np.eye(3), np.zeros(3))(np.zeros((1, 2)))
    with pytest.raises(InvalidInputError, match="must have 3 coordinates, as the bodies have, got 2"):
        SampledField(np.eye(2), np.zeros(2))(np.zeros((1, 3)))


# Fields from tables and from meshes of other programs.
POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])


@pytest.mark.parametrize(
    "text",
    [
        "x, y, z, pressure\n0, 0, 0, 1\n1, 0, 0, 2\n1, 1, 0, 3\n",
        "# X;Y;Z;pressure\n0;0;0;1\n1;0;0;2\n\n1;1;0;3\n",
        "\ufeffpressure x y z\n1 0 0 0\n2 1 0 0\n3 1 1 0\n",
        "x\ty\tpressure\n0\t0\t1\n1\t0\t2\n1\t1\t3",
    ],
)
def test_a_table_is_read(tmp_path: Path, text: str) -> None:
    path = tmp_path / "wind.csv"
    path.write_text(text, encoding="utf-8")
    field = read_field(path)
    asked = POINTS[:3, : field.points.shape[1]]
    np.testing.assert_allclose(field(asked), [1.0, 2.0, 3.0], atol=1e-12)


def test_columns_make_a_vector(tmp_path: Path) -> None:
    path = tmp_path / "flow.txt"
    path.write_text("x y z tx ty tz\n0 0 0 1 2 3\n1 0 0 4 5 6\n")
    np.testing.assert_allclose(read_field(path, ["tz", "ty", "tx"])(POINTS[:2]), [[3, 2, 1], [6, 5, 4]])


def test_fields_of_nodes_and_cells_are_read(tmp_path: Path) -> None:
    path = tmp_path / "heat.vtu"
    mesh = meshio.Mesh(
        POINTS,
        [("triangle", [[0, 1, 2]]), ("triangle", [[0, 2, 3]])],
        point_data={"temperature": [1.0, 2.0, 3.0, 4.0]},
        cell_data={"source": [[10.0], [20.0]]},
    )
    mesh.write(path)
    np.testing.assert_allclose(read_field(path, "temperature")(POINTS), [1, 2, 3, 4], atol=1e-12)
    centres = np.array([[2.0, 1.0, 0.0], [1.0, 2.0, 0.0]]) / 3.0
    np.testing.assert_allclose(read_field(path, "source")(centres), [10.0, 20.0])
    with pytest.raises(InvalidInputError, match="it has temperature, source, and none was named"):
        read_field(path)


@pytest.mark.parametrize(
    ("name", "text", "field", "message"),
    [
        ("none.csv", None, None, "none.csv"),
        ("a.csv", "", None, "must name its columns, x, y, z and others, each once, got nothing"),
        ("a.csv", "0, 0, 0, 1\n", None, "got 0, 0, 0, 1: write a line such as x, y, z, pressure"),
        ("a.csv", "x, y, x, p\n", None, "each once"),
        ("a.csv", "x, y, z, p\n", None, "must have 4 entries, .* got no rows"),
        ("a.csv", "x, y, z, p\n1, 2, 3\n", None, "must have 4 entries, .* got 3 in row 1"),
        ("a.csv", "x, y, z, p\n1, 2, 3, much\n", None, "but the first must be numbers"),
        ("a.csv", "x, y, z, p, q\n1, 2, 3, 4, 5\n", None, "it has p, q, and none was named"),
        ("a.csv", "x, y, z, p\n1, 2, 3, 4\n", "q", "it has p, and q was asked for"),
        ("a.csv", "x, y, z\n1, 2, 3\n", None, "it has none, and none was named"),
        ("a.csv", "x, y, z, p\n1, 2, 3, nan\n", None, "values must be 1 finite numbers"),
        ("a.odd", "x", None, "must end in one of"),
    ],
)
def test_what_holds_no_field_is_refused(
    tmp_path: Path, name: str, text: str | None, field: str | None, message: str
) -> None:
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(InvalidInputError, match=message):
        read_field(tmp_path / name, field)


# What a contact pair says about its gap, and what it may not say.
SIDES = (Surface("a", "top"), Surface("b", "bottom"))


def pair(**given: Any) -> ContactPair:
    return ContactPair(*SIDES, **given)


@pytest.mark.parametrize(
    ("given", "match"),
    [
        (
            {"gap": 0.1, "interference": 0.1},
            r"a gap or an interference, got 0\.1 and 0\.1: keep",
        ),
        ({"gap": 0.0, "interference": "measured"}, "a gap or an interference"),
        ({"gap": -0.1}, r"ContactPair\.gap must be zero or positive and finite, got -0\.1: give clearances"),
        ({"interference": -0.1}, r"ContactPair\.interference must be zero or positive"),
        ({"adjust": -0.1}, r"ContactPair\.adjust must be zero or positive"),
        ({"gap": np.nan}, r"ContactPair\.gap must be zero or positive and finite, got nan"),
        ({"interference": np.inf}, r"ContactPair\.interference must be .* got inf"),
        ({"gap": "measured"}, r"ContactPair\.gap must be a number, a function or None, got 'measured'"),
        (
            {"interference": "all"},
            r"interference must be a number, a function, 'measured' or None, got 'all'",
        ),
        ({"gap": np.zeros(3)}, r"ContactPair\.gap must be a number, a function or None, got array"),
        ({"adjust": True}, r"ContactPair\.adjust must be a number or None, got True"),
        ({"adjust": lambda x: x[:, 0]}, r"ContactPair\.adjust must be a number or None"),
    ],
)
def test_what_is_no_gap_is_refused(given: dict[str, Any], match: str) -> None:
    with pytest.raises(InvalidInputError, match=match):
        pair(**given)


def test_ties_have_no_gap() -> None:
    with pytest.raises(TypeError, match="gap"):
        Tie(*SIDES, gap=0.1)  # type: ignore[call-arg]


def test_it_is_told_in_words() -> None:
    assert pair().given_gap == ""
    assert pair(gap=0.0).given_gap == "gap 0"
    assert pair(interference=np.ones_like, adjust=0.25).given_gap == (
        "interference by a function, in touch within 0.25"
    )
    assert pair(interference="measured").given_gap == "interference measured"


def test_descriptions_and_fingerprints_contain_it() -> None:
    for name, value in {"gap": 0.125, "interference": 0.125, "adjust": 0.125}.items():
        assert described(pair(**{name: value}), "pair")[f"pair.{name}"] == "0.125"
    bodies = {
        name: Body(block((0, 0, low), (1, 1, low + 1), (1, 1, 1)), IsotropicElasticity(1.0, 0.3))
        for name, low in (("a", 1), ("b", 0))
    }
    sides = Surface("a", "z0"), Surface("b", "z1")
    contact = ContactPair(*sides, discretisation="best", interference="measured", adjust=0.5)
    scene = Scene(bodies, contacts=[contact])
    (entry,) = described_scene(scene, {"a": 1, "b": 1})["contacts"]
    assert (entry["gap"], entry["interference"], entry["adjust"]) == (None, "measured", 0.5)
    assert (entry["discretisation"], entry["reason"]) == ("node", "node, as the meshes match")
    assert "a z0 on b z1, without friction, interference measured" in repr(scene)
    assert str(scene.plan().contacts[0]).startswith(
        "flat on flat; node, as the meshes match; interference measured, in touch within 0.5; no error by"
    )


def test_facets_miss_nothing_where_all_gaps_are_given() -> None:
    ball = hemisphere(10.0, 6)
    steel = IsotropicElasticity(2.1e5, 0.3)
    plate = block((-4, -4, -2), (4, 4, 0), (4, 4, 2))
    bodies = {"ball": Body(ball, steel), "plate": Body(plate, steel)}
    surfaces = Surface("plate", "z1"), Surface("ball", "contact")
    heights = {
        str(given): Scene(bodies, contacts=[ContactPair(*surfaces, **given)]).plan().contacts[0].height
        for given in ({}, {"gap": 0.1}, {"gap": 0.1, "adjust": 0.1}, {"interference": "measured"})
    }
    assert heights.pop("{'gap': 0.1}") == 0.0
    assert len(set(heights.values())) == 1
    assert heights["{}"] > 0.01
