"""The study of constants changes what it says it changes, and its record is of the constants there are."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks.constants.listed import NOT_RUN, constants, scaled
from benchmarks.constants.measuring import compared
from benchmarks.constants.report import CLASSES, HOME, class_of, described, study, tables
from benchmarks.constants.scenes import SCENES
from benchmarks.study import filled
from fenics_contact.study.runner import Job, measure

MATTERS, IDLE, ASIDE = (
    "mesh.near_surfaces:FACING",
    "mesh.body_mesh:RESOLVED",
    "mesh.quality:_BEST_CORNER",
)


#: Tolerances of a scene by which its answer may differ on another machine.
ALLOWED = 3.0


@pytest.fixture(scope="module")
def study_record() -> dict[str, Any]:
    return json.loads((HOME / "constants.json").read_text())


@pytest.fixture
def record(study_record: dict[str, Any]) -> dict[str, Any]:
    return study_record["constants"]


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_answers_as_when_it_was_recorded(name: str, study_record: dict[str, Any]) -> None:
    """So no constant that changes answers by more than a few tolerances can change unseen."""
    change = compared({name: study_record["answers"][name]}, {name: SCENES[name]()})
    assert "failed" not in change
    assert change["excess"] < ALLOWED, change


def test_constants_are_numbers_tuples_and_mappings_with_what_is_said_of_them() -> None:
    known = {constant.key: constant for constant in constants()}
    assert len(known) == len(constants()) > 200
    assert known["qp.face:STEEP"].value == 1e6
    assert known["_accuracy.state_errors:STEP"].value == (1e-4, 0.3)
    assert known["mesh.bisection:TARGET_NODES"].value == {3: 700, 2: 1000}
    assert known["qp.coarse:RANK_TOLERANCE"].meaning.startswith("Null vectors")
    assert known["mesh.quality:FARTHEST"].meaning.startswith("Largest distance of nodes"), "below"
    assert known["_optimize.scipy:_SLOPE"].meaning.startswith("of the wall around invalid designs"), "behind"


def test_every_constant_that_answers_may_depend_on_is_explained() -> None:
    measured = [each for each in constants() if each.room not in NOT_RUN]
    assert len(measured) > 100
    assert [each.key for each in measured if not each.meaning] == []


@pytest.mark.parametrize(
    ("value", "halved", "doubled"),
    [
        (0.3, 0.15, 0.6),
        (1, 1, 2),
        (2, 1, 4),
        (5, 2, 10),
        ((0.5, 4), (0.25, 2), (1.0, 8)),
        ({2: 3}, {2: 2}, {2: 6}),
    ],
)
def test_values_are_halved_and_doubled_and_none_becomes_nothing(
    value: Any, halved: Any, doubled: Any
) -> None:
    assert (scaled(value, 0.5), scaled(value, 2.0)) == (halved, doubled)


def test_what_matters_is_seen_to_matter_and_what_does_not_is_not() -> None:
    names = [MATTERS, IDLE, ASIDE]
    arguments = {"room": "mesh", "scenes": ["mortar blocks"], "names": names}
    found = measure(Job("some", "benchmarks.constants.measuring:run", arguments))
    assert sorted(found.get("constants", found)) == sorted(names)
    matters, idle, aside = (found["constants"][name] for name in names)
    assert class_of(matters) in CLASSES[2:]
    assert [change["same"] for change in idle["factors"].values()] == [True] * 2
    assert aside == {"reached": False, "factors": {}}


def test_changes_are_judged_by_the_tolerance_of_their_scene() -> None:
    before = {
        "loose": {"energy": [2.0], "tolerance": 0.1, "products": 10},
        "strict": {"energy": [2.0], "tolerance": 1e-6, "products": 10},
    }
    after = {"loose": {**before["loose"], "energy": [2.1]}, "strict": {**before["strict"], "products": 15}}
    change = compared(before, after)
    assert change["energy"] == pytest.approx(0.05)
    assert change["excess"] == pytest.approx(0.5)
    assert (change["scene"], change["products"], change["same"]) == ("loose", 1.5, False)
    assert class_of({"reached": True, "factors": {"2": change}}) == "within tolerance"
    worse = compared(before, {**after, "strict": {"failed": "InfeasibleError: nothing holds it"}})
    assert worse["failed"] == {"strict": "InfeasibleError: nothing holds it"}
    assert class_of({"reached": True, "factors": {"0.5": change, "2": worse}}) == "changes the answer"
    assert class_of({"reached": True, "factors": {"2": compared(before, before)}}) == "no effect"


def test_every_constant_is_measured_with_the_value_that_it_has(record: dict[str, Any]) -> None:
    now = {each.key: described(each)["value"] for each in constants() if each.room not in NOT_RUN}
    assert {key: each["value"] for key, each in record.items()} == json.loads(json.dumps(now)), (
        "a constant is new, gone or has another value: measure its part by "
        "`python -m benchmarks constants --only PART`"
    )


def test_the_page_has_the_tables_of_the_record(record: dict[str, Any], tmp_path: Path) -> None:
    page = (HOME / "constants.md").read_text()
    study.write(tmp_path, {}, False)
    assert json.loads((tmp_path / "constants.json").read_text())["constants"].keys() == record.keys()
    assert filled(page, {name: "" for name in tables(record)}) != page
    for key, each in record.items():
        lines = [line for line in page.splitlines() if line.startswith(f"| `{key}` |")]
        assert any(line.endswith(f"| {class_of(each)} |") for line in lines)
