"""Meshes from numbers that are none, too many or too large: an error that names them, and no memory gone."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from fenics_contact import BodyMesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import blocks, bolted, hertz, links, ring
from fenics_contact.gallery import round as whole
from fenics_contact.gallery.blocks import BYTES_A_CELL, memory, require_room

#: What no size and no count can be.
NO_NUMBERS: list[Any] = [
    None, "3", "", b"3", float("nan"), float("inf"), -float("inf"), 1e300, 10**400, -(10**5000), 1j, (), [1],
    {}, True, np.zeros((2, 2)), object(),
]  # fmt: skip
NO_COUNTS: list[Any] = [*NO_NUMBERS, 0, -1, 2.0, 10**9, 10**30, np.int64(-3)]


def name(value: Any) -> str:
    """Name a case; Python refuses to write the largest integers."""
    return type(value).__name__


def link(**changes: Any) -> object:
    return ring.LinkShape(**{"n_around": 12, "n_a": 1, "n_b": 2, **changes})


BUILDERS: list[tuple[Callable[..., object], dict[str, Any], list[str]]] = [
    (hertz.hemisphere, {"radius": 1.0, "n": 2, "grading": 1.0}, ["n"]),
    (hertz.half_disc, {"radius": 1.0, "n": 3, "grading": 1.0}, ["n"]),
    (hertz.half_cylinder, {"radius": 1.0, "length": 2.0, "n": 3, "n_length": 1}, ["n", "n_length"]),
    (whole.disc, {"radius": 1.0, "n": 3, "hole": 0.5, "grading": 1.0}, ["n"]),
    (whole.ball, {"radius": 1.0, "n": 2, "hole": 0.5}, ["n"]),
    (whole.cylinder, {"radius": 1.0, "length": 2.0, "n": 3, "n_length": 1}, ["n", "n_length"]),
    (
        partial(bolted.drilled_plate, ends=(-3.0, 3.0), heights=(0.0, 1.0)),
        {"hole": 1.0, "half_width": 2.0, "n": 1, "n_radial": 1},
        ["n"],
    ),
    (
        partial(bolted.bolt, grip=(0.0, 1.0), layers=(1, 1)),
        {"shank": 0.9, "head": 1.6, "head_height": 0.5, "n": 1},
        ["n"],
    ),
    (blocks.growing_ticks, {"length": 2.0, "first": 0.1, "ratio": 1.2}, []),
    (
        link,
        {"inner_radius": 11.0, "straight": 26.0, "thickness": 16.0, "width": 16.0, "grading": 1.0, "n_a": 3},
        ["n_a"],
    ),
]
CASES = [
    (build, good, name, NO_COUNTS if name in counts else NO_NUMBERS)
    for build, good, counts in BUILDERS
    for name in good
    if name != "n_radial"
]


@pytest.mark.parametrize(("build", "good", "name", "wrong"), CASES)
def test_what_is_no_size_and_no_count_is_refused_by_its_name(
    build: Callable[..., object], good: dict[str, Any], name: str, wrong: list[Any]
) -> None:
    build(**good)
    for value in wrong:
        with pytest.raises(InvalidInputError, match=rf"\b{name}\b") as error:
            build(**{**good, name: value})
        assert len(str(error.value)) < 500


@pytest.mark.parametrize(
    "value", [*NO_NUMBERS, 3, (2, 1), (2, 1, 0), (2.0, 1, 1), "abc", (10**9, 1, 1)], ids=name
)
def test_what_are_no_counts_of_a_block_is_refused(value: Any) -> None:
    with pytest.raises(InvalidInputError, match=r"counts(\[\d\])? must be"):
        blocks.block((0, 0, 0), (1, 1, 1), value)
    with pytest.raises(InvalidInputError, match=r"counts(\[\d\])? must be"):
        blocks.rectangle((0, 0), (1, 1), (2, 1, 1) if isinstance(value, tuple) else value)


@pytest.mark.parametrize(
    "value", [*NO_NUMBERS, 3, (2, 1), (1, 1, float("nan")), (1, 1, 1e80), "abc", (0, 0, 0)], ids=name
)
def test_what_are_no_corners_of_a_block_is_refused(value: Any) -> None:
    with pytest.raises(InvalidInputError, match="upper must exceed lower in x, y and z"):
        blocks.block((0, 0, 0), value, (1, 1, 1))


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (
            lambda: blocks.block((0,) * 3, (1,) * 3, (3, 10**6, 10**5)),
            "3 x 1000000 x 100000 cells, which take",
        ),
        (lambda: blocks.block((0,) * 3, (1,) * 3, (9999,) * 3, "tetrahedron"), r"which take 1\.2 PB"),
        (lambda: blocks.rectangle((0, 0), (1, 1), (10**6, 10**6)), "must fit into the memory"),
        (lambda: blocks.growing_ticks(1e20, 1e-3, 1.0 + 1e-15), "must fit into the memory"),
        (lambda: hertz.hemisphere(1.0, 10**5), "must fit into the memory"),
        (lambda: hertz.half_disc(1.0, 10**6), "must fit into the memory"),
        (lambda: whole.ball(1.0, 10**5, hole=0.999), "must fit into the memory"),
        (lambda: whole.disc(1.0, 10**5, hole=0.5, layers=10**6), "must fit into the memory"),
        (
            lambda: bolted.drilled_plate(1.0, 2.0, (-1e50, 4.0), (0, 1), 2),
            "along the strip must be at most",
        ),
        (lambda: bolted.drilled_plate(1.0, 2.0, (-4.0, 4.0), (0, 1), 10**6), "must fit into the memory"),
        (lambda: links.chain_link(ring.LinkShape(n_around=999_996, n_b=10**5)), "must fit into the"),
        (lambda: links.chain([ring.LinkShape()] * 10**5), "4800000 x 8 x 20 cells"),
    ],
)
def test_meshes_without_room_are_refused_before_they_are_built(
    build: Callable[[], object], words: str
) -> None:
    before, begun = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    with pytest.raises(InvalidInputError, match=words):
        build()
    assert time.process_time() - begun < 5.0
    assert 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) < 2**29


def test_the_room_is_that_of_this_machine() -> None:
    fitting = memory() // BYTES_A_CELL[3]
    require_room(fitting, 1, 1)
    with pytest.raises(InvalidInputError, match=rf"got {fitting + 1} x 1 x 1 cells"):
        require_room(fitting + 1, 1, 1)


@pytest.mark.parametrize(
    "points", ["abc", [["a", "b"]] * 3, [[1e61, 0], [0, 1], [0, 0]], {}, [[10**400] * 2] * 3], ids=name
)
def test_points_that_are_no_coordinates_are_refused(points: Any) -> None:
    with pytest.raises(InvalidInputError, match=r"points must (be|have)"):
        BodyMesh(points, np.array([[0, 1, 2]]), {})
