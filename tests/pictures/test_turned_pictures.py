"""Pictures and pages of bodies of revolution that are turned around their axis."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    RigidPlane,
    RigidSphere,
    RigidTool,
    Scene,
    State,
    Support,
    Surface,
    ToolMotion,
    result_page,
    solve_scene,
    write_result,
    write_vtu,
)
from fenics_contact._page.page import source_of_files
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.pictures import states
from fenics_contact.pictures.drawing import ColouredField, turned_shape
from fenics_contact.shapes import Box, Plane, Sphere, Torus
from tests.page.contents import content

BALL = RigidSphere((0.0, 2.0), 1.0)


@lru_cache
def pressed(cell: str) -> State:
    """A disc under a ball that moves down, on a floor."""
    disc = Body(rectangle((0, 0), (2, 1), (5, 2), cell), IsotropicElasticity(100.0, 0.3), axisymmetric=True)
    ball = ContactPair(Surface("disc", "y1"), RigidTool("ball", BALL, (0.0, 2.0)))
    floor = ContactPair(Surface("disc", "y0"), RigidPlane((0, 0), (0, 1)))
    motion = [ToolMotion("ball", (0.0, -0.1), 0.0)]
    return solve_scene(Scene({"disc": disc}, motion, [], [ball, floor]), MPI.COMM_SELF, tolerance=1e-6)


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_pictures_turn_sections_their_values_and_obstacles(
    cell: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[tuple[Any, ColouredField, dict[str, Any]]] = []
    monkeypatch.setattr(states, "draw_field_on_bodies", lambda b, f, *_, **more: drawn.append((b, f, more)))
    state = pressed(cell)
    hoop = state.gather_fields("disc").cells["stress"][:, 2]
    states.plot_stress(state, revolved=270.0)
    states.plot_field(state, "stress_zz", revolved=90.0)
    states.plot_field(state, {"disc": np.arange(len(hoop))}, revolved=90.0)
    for (bodies, field, more), copies in zip(drawn, (54, 18, 18), strict=True):
        body = bodies["disc"]
        assert body.volume == pytest.approx(np.pi * 4.0 * copies / 72.0, rel=2e-3)
        assert len(field.values["disc"]) in (body.n_points, body.n_cells)
        ball, floor = more["obstacles"]
        assert isinstance(ball, Sphere)
        assert ball.centre == pytest.approx((0.0, 0.0, 1.9))
        assert floor == Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert "spot" not in drawn[0][2]
    assert drawn[1][1].label == "stress of cells, zz of the section (MPa)"
    np.testing.assert_allclose(drawn[1][1].values["disc"], np.tile(hoop, 18))
    np.testing.assert_allclose(drawn[2][1].values["disc"], np.tile(np.arange(len(hoop)), 18))


def test_shapes_beside_the_axis_become_rings() -> None:
    points = np.random.default_rng(1).uniform(-2.0, 2.0, (50, 3))
    ring, torus = turned_shape(Sphere((1.0, 0.5), 0.3)), Torus((0.0, 0.0, 0.5), (0.0, 0.0, 1.0), 1.0, 0.3)
    np.testing.assert_allclose(ring.distance(points), torus.distance(points), atol=1e-12)
    bush, flat = turned_shape(Box((1.0, 0.5), (0.4, 0.6))), Box((1.0, 0.5), (0.4, 0.6))
    r = np.column_stack([np.hypot(points[:, 0], points[:, 1]), points[:, 2]])
    np.testing.assert_allclose(bush.distance(points), flat.distance(r), atol=1e-12)


@pytest.mark.parametrize(("cell", "corners"), [("triangle", 4), ("quadrilateral", 8)])
def test_pages_show_turned_bodies_also_of_files(cell: str, corners: int, tmp_path: Path) -> None:
    state = pressed(cell)
    data, arrays = content(result_page(state, revolved=270.0).html)
    assert not data["plane"]
    points = np.asarray(arrays[data["steps"][0]["bodies"][0]["points"]])
    assert np.ptp(points[:, 0]) == pytest.approx(4.0, rel=1e-3)
    assert np.ptp(points[:, 2]) == pytest.approx(1.0)
    assert np.asarray(arrays[data["steps"][0]["bodies"][0]["cells"]]).shape[1] == corners
    ball, floor = data["obstacles"]
    lines = np.concatenate([np.asarray(line) for line in ball["lines"]])
    np.testing.assert_allclose(Sphere((0.0, 0.0, 1.9), 1.0).distance(lines), 0.0, atol=0.01)
    assert np.ptp(np.asarray(floor["lines"][0]), axis=0) == pytest.approx([4.24, 4.24, 0.0], rel=0.1)
    write_vtu(state, tmp_path)
    write_result(state, tmp_path)
    source = source_of_files(tmp_path).turned(90.0)
    assert source.steps[0][1]["disc"].volume == pytest.approx(np.pi, rel=3e-3)


def test_angles_that_nothing_is_turned_by_are_refused() -> None:
    state = pressed("triangle")
    plane = Body(rectangle((0, 0), (2, 1), (2, 2)), PlaneStrain(100.0, 0.3))
    other = solve_scene(Scene({"a": plane}, [Support("a", "y0")]), MPI.COMM_SELF)
    for draw in (states.plot_stress, result_page):
        with pytest.raises(InvalidInputError, match="above 0 and up to 360 degrees, of bodies of revolution"):
            draw(state, revolved=400.0)  # type: ignore[operator]
        with pytest.raises(InvalidInputError, match="for other bodies"):
            draw(other, revolved=270.0)  # type: ignore[operator]
    with pytest.raises(InvalidInputError, match="for other bodies"):
        states.plot_field(other, revolved=270.0)
