"""Files of fields are read back, those of a series in their order and with their labels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import write_vtu
from fenics_contact.errors import InvalidInputError
from fenics_contact.output import ResultSeries
from fenics_contact.output.paraview import StoredFields, fields_of_result, stored_fields
from tests.io.states import touching_blocks


def test_a_state_is_read_by_body(tmp_path: Path) -> None:
    state = touching_blocks()
    (member,) = stored_fields(write_vtu(state, tmp_path))
    grids = member.read()
    assert list(grids) == ["lower", "upper block"]
    moved = grids["lower"].point_data["displacement"]
    assert np.array_equal(moved, state.gather_displacement("lower"))
    (single,) = stored_fields(tmp_path / "state_lower.vtu")
    assert list(single.read()) == ["state_lower"]


def test_members_of_a_series_come_in_their_order(tmp_path: Path) -> None:
    series = ResultSeries(tmp_path, "history", MPI.COMM_SELF)
    for value, label in ((0.0, "pressed"), (0.5, ""), (1.0, "sheared")):
        series.add(touching_blocks(), value, label)
    write_vtu(touching_blocks(), tmp_path)
    found = fields_of_result(tmp_path)
    assert found == series.path, "a single state comes before a series"
    members = stored_fields(found)
    assert [(member.value, member.label) for member in members] == [
        (0.0, "pressed"),
        (0.5, ""),
        (1.0, "sheared"),
    ]
    assert all(list(member.read()) == ["lower", "upper block"] for member in members)


def test_a_folder_without_fields_has_none(tmp_path: Path) -> None:
    assert fields_of_result(tmp_path) is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<VTKFile><Collection>", r"must be a whole .pvd file, got .*: write it again"),
        ("<VTKFile><Collection/></VTKFile>", r"must name at least one file of fields, it names none"),
        ('<VTKFile><DataSet timestep="a" file="b"/></VTKFile>', r"must be a whole .pvd file, got could not"),
        ('<VTKFile><DataSet timestep="1"/></VTKFile>', r"must be a whole .pvd file, got 'file'"),
    ],
)
def test_what_is_no_series_is_refused(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.pvd").write_text(text)
    with pytest.raises(InvalidInputError, match=message):
        stored_fields(tmp_path / "a.pvd")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"a file of fields must exist, '.*gone.vtm' does not"):
        StoredFields(tmp_path / "gone.vtm").read()
