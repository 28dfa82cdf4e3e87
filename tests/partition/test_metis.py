"""METIS gives the same answer in this process and in one of its own, and a failure there is told."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from fenics_contact.errors import MissingRequirementError
from fenics_contact.gallery import rectangle
from fenics_contact.mesh import metis
from fenics_contact.mesh.metis import _dual_graph
from fenics_contact.mesh.partition import face_areas

MESH = rectangle((0, 0), (7, 5), (7, 5), "triangle")
GRAPH = _dual_graph(MESH.n_cells, *face_areas(MESH))
EVEN = np.ones(GRAPH.shape[0], dtype=np.int64)


@pytest.mark.parametrize("parts", [3, 11])
def test_a_process_of_its_own_cuts_alike(parts: int, monkeypatch: pytest.MonkeyPatch) -> None:
    here = metis.part_graph(GRAPH, EVEN, parts)
    asked = []
    monkeypatch.setattr(metis, "_may_have_lost_its_calls", lambda: asked.append(parts) or True)
    monkeypatch.setattr(metis.metis_call, "part_graph", None)  # type: ignore[attr-defined]
    elsewhere = metis.part_graph(GRAPH, EVEN, parts)
    assert asked, "nothing was asked: the same way was taken twice"
    assert np.array_equal(here, elsewhere)
    assert here.dtype == elsewhere.dtype == np.int64
    assert np.unique(here).tolist() == list(range(parts))


def test_a_process_that_fails_is_told_with_its_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(metis, "_may_have_lost_its_calls", lambda: True)
    monkeypatch.setattr(metis.metis_call, "__file__", "/nowhere/metis_call.py")  # type: ignore[attr-defined]
    message = r"needs pymetis .* does not run in a process of its own \(exit status 2: .*No such file"
    with pytest.raises(MissingRequirementError, match=message):
        metis.part_graph(GRAPH, EVEN, 3)


def test_how_libraries_are_opened_is_left_as_it_was() -> None:
    flags = sys.getdlopenflags()
    metis.part_graph(GRAPH, EVEN, 2)
    assert sys.getdlopenflags() == flags
