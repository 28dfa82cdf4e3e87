"""Settings of runs, and the runs that a sweep makes of them."""

from __future__ import annotations

import json
from typing import Any

import pytest

from fenics_contact.errors import InvalidInputError
from fenics_contact.study import BALANCED, Parameters, Sweep


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("size", 0, "size must be a positive integer, got 0"),
        ("cell", "cube", r"cell must be one of \['hexahedron', .*got 'cube'"),
        ("discretisation", "dual", r"discretisation must be one of \['node', 'mortar'\], got 'dual'"),
        ("tolerance", 2.0, 'tolerance must be a number between 0 and 1, or "balanced", got 2.0'),
        ("tolerance", "tight", "or \"balanced\", got 'tight'"),
        ("solver", "cg", r"solver must be one of \['newton', 'fixed point'\], got 'cg'"),
        ("subdomains", 0, "subdomains must be a positive integer, or None, got 0"),
    ],
)
def test_a_setting_that_no_scene_knows_is_refused(name: str, value: Any, allowed: str) -> None:
    with pytest.raises(InvalidInputError, match=allowed):
        Parameters(**{"size": 2, name: value})


def test_settings_survive_json() -> None:
    for given in (Parameters(3), Parameters(2, "tetrahedron", "mortar", 1e-3, "fixed point", 8)):
        assert Parameters(**json.loads(json.dumps(given.as_dict()))) == given


def test_settings_are_told_in_a_few_words() -> None:
    assert str(Parameters(2)) == "size 2, hexahedron, node, balanced"
    other = Parameters(2, tolerance=1e-3, solver="fixed point", subdomains=8)
    assert str(other) == "size 2, hexahedron, node, 1e-03, fixed point, 8 subdomains"


def test_a_sweep_varies_one_setting_at_a_time_and_mesh_with_tolerance() -> None:
    sweep = Sweep(
        Parameters(4),
        sizes=(2, 4),
        tolerances=(1e-2, 1e-8, BALANCED),
        cells=("tetrahedron",),
        discretisations=("mortar",),
        fixed_points=(1e-4,),
        subdomains=(8,),
    )
    runs = sweep.runs()
    assert len(runs) == len(set(runs)) == 6 + 2 + 2 + 1 + 1
    assert [run.size for run in runs] == sorted(run.size for run in runs)
    assert {(run.size, run.tolerance) for run in runs} >= {
        (n, t) for n in (2, 4) for t in (1e-2, 1e-8, BALANCED)
    }
    apart = [run.differences(sweep.base) for run in runs]
    assert max(len(set(names) - {"size", "tolerance"}) for names in apart) == 1
    assert ("tolerance", "solver") in apart
