"""Pictures of states show what the state holds."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fenics_contact import Status
from fenics_contact.errors import InvalidInputError
from fenics_contact.pictures import Units, plot_contact_pressure, plot_stress
from fenics_contact.pictures.section import component, contact_places, drawn_bodies, field_entries, refined
from fenics_contact.pictures.states import chosen_scale, plot_field
from fenics_contact.pictures.unrolled import contact_patches
from tests.viz.states import contains, painted, pixels, pulled, touching_blocks

SMALL = 320


def test_stress_is_drawn_with_and_without_sections(tmp_path: Path) -> None:
    state = touching_blocks("tetrahedron")
    with_sections = pixels(plot_stress(state, tmp_path / "both.png", width=SMALL))
    without = pixels(plot_stress(state, tmp_path / "whole.png", width=SMALL, sections=False))
    assert with_sections.shape[1] == without.shape[1] == SMALL
    assert with_sections.shape[0] > 1.3 * without.shape[0]
    assert painted(with_sections) > 0.3
    assert painted(without) > 0.3


def test_the_same_range_makes_pictures_comparable(tmp_path: Path) -> None:
    state = touching_blocks()
    draw = {"width": SMALL, "sections": False}
    images = [
        pixels(plot_stress(state, tmp_path / f"{number}.png", clim=clim, **draw))
        for number, clim in enumerate([(0.0, 4.0), (0.0, 4.0), (0.0, 40.0)])
    ]
    np.testing.assert_array_equal(images[0], images[1])
    assert images[2].mean() > images[0].mean() + 0.02, "stresses low in their range are drawn pale"


def test_chosen_scale_and_range_are_round_and_fit() -> None:
    bodies = drawn_bodies(touching_blocks())
    stresses = np.concatenate([body["von_mises"] for body in bodies.values()])
    (entry,) = (each for each in field_entries([bodies], Units()) if each["name"] == "von_mises")
    low, high = entry["range"]
    assert low == 0.0
    assert np.quantile(stresses, 0.99) < high < 2 * stresses.max()
    assert chosen_scale(bodies) >= 1.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scale": np.nan}, r"scale must be finite, got nan"),
        ({"clim": (1.0, 0.0)}, r"clim must be a finite range"),
        ({"reach": -1.0}, r"reach must be positive, got -1.0"),
    ],
)
def test_stress_refuses_options_that_cannot_be_drawn(
    options: dict[str, object], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        plot_stress(touching_blocks(), tmp_path / "stress.png", **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("cell", "name"), [("hexahedron27", "stress_xx"), ("triangle6", "displacement_x")])
def test_any_field_of_bodies_is_drawn(cell: str, name: str, tmp_path: Path) -> None:
    blocks = pulled(cell).to_pyvista()
    bodies = {body: blocks[body] for body in blocks.keys()}
    (entry,) = (each for each in field_entries([bodies], Units()) if each["name"] == name)
    column = component(bodies["bar"], entry)
    data = bodies["bar"].cell_data["stress"] if "stress" in name else bodies["bar"].point_data["displacement"]
    np.testing.assert_array_equal(column, data[:, 0])
    image = pixels(plot_field(bodies, name, tmp_path / "field.png", width=SMALL))
    assert painted(image) > 0.2
    other = pixels(plot_field(bodies, name, tmp_path / "more.png", width=SMALL, scale=20.0))
    assert image.shape != other.shape, "the bar is longer where it has moved"
    with pytest.raises(InvalidInputError, match=r"field must be one of nodal_von_mises, .* got 'heat'"):
        plot_field(bodies, "heat")


@pytest.mark.parametrize("name", ["warmth", "contact_status"])
def test_a_field_of_one_body_or_of_statuses_is_drawn(name: str) -> None:
    bodies = drawn_bodies(touching_blocks())
    bodies["upper"].point_data["warmth"] = bodies["upper"].points[:, 2]
    assert painted(pixels(plot_field(bodies, name, width=SMALL))) > 0.2


def test_pressure_and_status_are_drawn(tmp_path: Path) -> None:
    units = Units("m", "kN", "kPa")
    path = plot_contact_pressure(touching_blocks(), tmp_path / "pressure.png", width=800, units=units)
    image = pixels(path)
    assert image.shape[1] == 800
    left, right = image[:, :400], image[:, 400:]
    assert painted(left) > 0.2
    for colour in ("#0072b2", "#d55e00"):  # sticking and slipping points
        assert contains(right, colour)
        assert not contains(left[:, :300], colour, 0.005)


def test_patch_holds_the_points_of_the_pair_where_they_are() -> None:
    state = touching_blocks()
    patch, contact = contact_patches([state], 0, None)[0], state.contact
    assert len(patch.points) == contact.points.count
    np.testing.assert_allclose(patch.pressure[patch.points], contact.pressure)
    np.testing.assert_array_equal(patch.status, contact.status)
    places = contact_places(state, drawn_bodies(state))
    np.testing.assert_allclose(patch.places[patch.points], patch.view.project(places))
    assert patch.force == pytest.approx(contact.normal_force.sum())
    slips = contact.status == Status.SLIP
    expected = np.linalg.norm(contact.slip[slips], axis=1)
    np.testing.assert_allclose(np.linalg.norm(patch.slip[slips], axis=1), expected, rtol=0.01)
    assert expected.max() > 0


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_refined_patch_keeps_the_integral_of_the_pressure(cell: str) -> None:
    patch = contact_patches([touching_blocks(cell)], 0, None)[0]
    mesh, values = refined(patch.places, patch.facets, patch.pressure)
    corners = np.column_stack([mesh.x, mesh.y])[mesh.triangles]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    assert area.sum() == pytest.approx(1.8 * 0.9, rel=1e-6)
    assert values.max() == pytest.approx(patch.pressure.max())
    assert values.min() >= 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"pair": 1}, r"pair must number one of the scene's 1 contact pairs from 0, got 1"),
        ({"reach": 0.0}, r"reach must be positive, got 0"),
        ({"clim": (0.0, 0.0)}, r"clim must be a finite range"),
    ],
)
def test_pressure_refuses_options_that_cannot_be_drawn(
    options: dict[str, object], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        plot_contact_pressure(touching_blocks(), tmp_path / "pressure.png", **options)
    assert not list(tmp_path.iterdir())


RANKS = """
    import sys
    from pathlib import Path
    from mpi4py import MPI
    from fenics_contact import solve_scene
    from fenics_contact import Coulomb
    from fenics_contact.pictures import plot_contact_pressure, plot_decomposition, plot_stress
    from tests.contact.gallery import partitions, two_blocks

    comm, folder = MPI.COMM_WORLD, Path(sys.argv[1])
    scene = two_blocks(Coulomb(0.4))
    state = solve_scene(scene, comm, partitions=partitions(scene), tolerance=1e-6)
    drawn = [
        plot_stress(state, folder / "stress.png", width=320, clim=(0, 4)),
        plot_contact_pressure(state, folder / "pressure.png", width=320, clim=(0, 8)),
        plot_decomposition(scene, partitions(scene), folder / "parts.png", width=320, comm=comm),
        plot_contact_pressure(state, width=320),
    ]
    shown = comm.gather([picture.png is not None for picture in drawn])
    known = comm.gather([picture.path and picture.path.name for picture in drawn])
    (folder / "file").touch()
    comm.barrier()
    caught = None
    try:
        plot_stress(state, folder / "file" / "stress.png", width=320)
    except Exception as error:
        caught = type(error).__name__
    everyone = comm.gather(caught)
    if comm.rank == 0:
        names = ["stress.png", "pressure.png", "parts.png", None]
        print(*everyone, shown == [[True] * 4, [False] * 4] and known == [names, names])
"""


def test_two_ranks_draw_the_same_pictures_and_share_their_errors(
    mpirun: Callable[..., str], tmp_path: Path
) -> None:
    answers = mpirun(RANKS, 2, tmp_path).split()
    assert answers == ["FileExistsError", "RemoteError", "True"], "or both ranks hold the same pictures"
    state = touching_blocks()
    plot_stress(state, tmp_path / "stress_1.png", width=SMALL, clim=(0, 4))
    plot_contact_pressure(state, tmp_path / "pressure_1.png", width=SMALL, clim=(0, 8))
    for name in ("stress", "pressure"):
        difference = pixels(tmp_path / f"{name}.png") - pixels(tmp_path / f"{name}_1.png")
        assert np.abs(difference).mean() < 0.002
    assert painted(pixels(tmp_path / "parts.png")) > 0.3
