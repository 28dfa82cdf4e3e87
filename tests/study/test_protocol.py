"""What a scene must offer to be studied."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fenics_contact.errors import InvalidInputError
from fenics_contact.study.scenes import find_study


def test_a_study_without_anything_to_measure_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="a study needs at least one quantity, got none: say what"):
        replace(find_study("hertz"), quantities=())


def test_quantities_of_one_name_are_refused() -> None:
    study = find_study("hertz")
    with pytest.raises(InvalidInputError, match=r"quantities must have different names, got .*: rename one"):
        replace(study, quantities=study.quantities[:1] * 2)


@pytest.mark.parametrize("name", ["", "my/scene", "a b"])
def test_a_name_that_no_file_can_bear_is_refused(name: str) -> None:
    with pytest.raises(InvalidInputError, match=r"the name of a study is part of file names, got "):
        replace(find_study("hertz"), name=name)


def test_facts_hold_every_mesh_size_that_occurs() -> None:
    study = find_study("chain_links")
    facts = study.facts
    assert set(facts.spacing) == {run.size for run in (*study.sweep.runs(), *study.quick.runs())}
    assert facts.spacing[4] == pytest.approx(2.0)  # mm, through the wire
    assert facts.quantity("gradient").phases == ("objective", "adjoint", "gradient")
    assert facts.quantity("gradient").source == ""
