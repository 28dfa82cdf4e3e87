"""Objectives of pressures and stresses: values, weighted sums and optima."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    RigidPlane,
    Scene,
    ShapeProblem,
    State,
    Status,
    Support,
    Surface,
    SurfaceDesign,
    ThermalStrain,
    Traction,
    minimize,
)
from fenics_contact.design import (
    BundleTrust,
    ContactArea,
    DesignPoint,
    FrictionWork,
    LargestPressure,
    LargestStress,
    Maximum,
    Movement,
    Objective,
    Partials,
    PressureNonuniformity,
    PressureNorm,
    StrainEnergy,
    TotalPotential,
)
from fenics_contact.design.forms import ShapeForms
from fenics_contact.design.objective import WeightedSum
from fenics_contact.errors import InvalidDesignError, InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from tests.design import moved_blocks
from tests.design.blocks import RUBBER, block_on_floor, problem
from tests.design.objectives import objectives
from tests.design.quotients import Remembering
from tests.scenes import FLOOR, crowned

#: Of force and length in those of the numbers below; the last one's stresses are of the order 1e40.
UNITS = {"N and mm": (1.0, 1.0), "N and m": (1.0, 1e-3), "tiny": (1e20, 1e-10)}
WIDTH, DEPTH, HEIGHT, YOUNG, PRESSURE = 2.0, 1.0, 0.5, 100.0, 3.0


@dataclass(frozen=True)
class Column:
    """An evenly pressed block on a floor, cut into unequal cells, in some units.

    Attributes:
        force: Unit of force.
        length: Unit of length.
    """

    force: float
    length: float

    @property
    def stress(self) -> float:
        return self.force / self.length**2

    def state(self, *more: ThermalStrain, pressure: float = PRESSURE, gap: float = 0.0) -> State:
        mesh = block((0.0, 0.0, 0.0), (WIDTH, DEPTH, HEIGHT), (5, 3, 2), "tetrahedron")
        mesh = mesh.moved(self.length * mesh.points)
        material = IsotropicElasticity(YOUNG * self.stress, 0.3, 1e-5)
        floor = RigidPlane((0.0, 0.0, -gap * self.length), (0.0, 0.0, 1.0))
        sides = [Support("block", "x0", (0.0, None, None)), Support("block", "y0", (None, 0.0, None))]
        held = [Support("block", "z1", (None, None, 0.0))] if pressure == 0.0 else []
        scene = Scene(
            {"block": Body(mesh, material)},
            [*sides, *held],
            [Traction("block", "z1", (0.0, 0.0, -pressure * self.stress)), *more],
            [ContactPair(Surface("block", "z0"), floor)],
        )
        return ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-11).solve(design=True)


def value(objective: Objective, state: State) -> float:
    return objective.value(state, ShapeForms(state.torn.decomposition.comm))


#: Of the column: objective, value, powers of force and length in its unit.
EVEN: dict[str, tuple[Objective, float, int, int]] = {
    "strain energy": (StrainEnergy(), 0.5 * PRESSURE**2 / YOUNG * WIDTH * DEPTH * HEIGHT, 1, 1),
    "potential": (TotalPotential(), -0.5 * PRESSURE**2 / YOUNG * WIDTH * DEPTH * HEIGHT, 1, 1),
    "largest pressure": (LargestPressure(), PRESSURE, 1, -2),
    "pressure norm": (PressureNorm(p=30.0), PRESSURE, 1, -2),
    "area": (ContactArea(0), WIDTH * DEPTH, 0, 2),
    "largest stress": (LargestStress("block", p=30.0), PRESSURE, 1, -2),
    "movement": (Movement("block", "z1", (0, 0, -3)), PRESSURE / YOUNG * HEIGHT, 0, 1),
    "across": (Movement("block", "x1", (1, 0, 0)), 0.3 * PRESSURE / YOUNG * WIDTH, 0, 1),
}


@cache
def even(units: str) -> State:
    return Column(*UNITS[units]).state()


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("name", EVEN)
def test_a_column_under_even_pressure_has_the_closed_form(name: str, units: str) -> None:
    objective, expected, of_force, of_length = EVEN[name]
    unit = UNITS[units][0] ** of_force * UNITS[units][1] ** of_length
    assert value(objective, even(units)) == pytest.approx(expected * unit, rel=1e-6)


@pytest.mark.parametrize("units", UNITS)
def test_an_even_pressure_has_no_unevenness(units: str) -> None:
    assert value(PressureNonuniformity(), even(units)) == pytest.approx(0.0, abs=1e-8)


@cache
def mixed() -> State:
    """A crowned block whose points stick, slip and lift off."""
    state = moved_blocks.line("floor").state()
    assert all(state.contact.count(status) > 0 for status in Status)
    return state


def test_pressures_are_judged_with_all_points_of_the_slave() -> None:
    contact = mixed().contact
    pressure, area = contact.pressure, contact.points.area
    mean, total = (area * pressure).sum() / area.sum(), area.sum()
    assert value(LargestPressure(), mixed()) == pytest.approx(pressure.max(), rel=1e-12)
    spread = (area * (pressure - mean) ** 2).sum() / (mean**2 * total)
    assert spread > 0.1
    assert value(PressureNonuniformity(), mixed()) == pytest.approx(spread, rel=1e-12)
    assert value(ContactArea(), mixed()) == pytest.approx(total / (1 + spread), rel=1e-12)
    for p in (2.0, 8.0, 100.0):
        norm = value(PressureNorm(p=p), mixed())
        assert norm == pytest.approx(((area * pressure**p).sum() / total) ** (1 / p), rel=1e-12)
        bound = norm * (total / area[pressure.argmax()]) ** (1 / p)
        assert norm < pressure.max() < bound * (1 + 1e-12)


@pytest.mark.parametrize("p", [2.0, 100.0])
def test_powers_of_pressures_neither_overflow_nor_vanish(p: float) -> None:
    force = np.array([1e300, 0.5e300, 0.0])
    found, by_force, by_area = PressureNorm(p=p).of_points(force, np.ones(3))
    assert found == pytest.approx(1e300 * ((1 + 0.5**p) / 3) ** (1 / p))
    assert np.isfinite([*by_force, *by_area]).all()


@pytest.mark.parametrize(("dim", "share"), [(2, 8 / 9), (1, 3 * np.pi**2 / 32)])
def test_the_area_of_hertzian_contact_is_a_known_share_of_the_true_one(dim: int, share: float) -> None:
    x = (np.arange(1000) + 0.5) / 1000
    weight = 2 * np.pi * x if dim == 2 else np.full_like(x, 2.0)
    area = weight / 1000
    found, *_ = ContactArea().of_points(area * np.sqrt(1 - x**2), area)
    assert found / area.sum() == pytest.approx(share, rel=1e-4)


def test_the_first_of_equal_pressures_is_lowered() -> None:
    force = np.array([1.0, 2.0, 2.0 * (1 + 1e-15), 0.0])
    _, by_force, by_area = LargestPressure().of_points(force, np.ones(4))
    assert by_force.tolist() == [0.0, 1.0, 0.0, 0.0]
    assert by_area.tolist() == [0.0, -2.0, 0.0, 0.0]


def test_stress_is_the_norm_of_that_of_the_cells() -> None:
    state = moved_blocks.line("blocks, tetrahedra").state()
    mesh, stress = state.scene.bodies["upper"].mesh, state.gather_von_mises("upper")
    corners = mesh.points[mesh.cells]
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
    for p in (2.0, 8.0, 100.0):
        judge = LargestStress("upper", p=p)
        expected = ((stress / stress.max()) ** p @ volume / volume.sum()) ** (1 / p) * stress.max()
        assert value(judge, state) == pytest.approx(expected, rel=1e-6)
        assert judge.largest(state) == pytest.approx(stress.max(), rel=1e-12)
    assert expected > 0.85 * stress.max()


def test_the_work_of_friction_is_that_of_the_sliding_points() -> None:
    contact = mixed().contact
    slides = contact.status == Status.SLIP
    work = contact.slip_bound[slides] @ np.linalg.norm(contact.slip[slides], axis=1)
    assert work > 1e-4
    assert value(FrictionWork(), mixed()) == pytest.approx(work, rel=1e-6)
    assert value(FrictionWork(0), mixed()) == pytest.approx(mixed().energies.friction, rel=1e-6)


def test_the_potential_is_what_is_stored_and_what_the_load_gains_on_the_gaps() -> None:
    mesh = crowned(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3)), 0.02)
    sides = [Support("block", "x0", (0.0, None, None)), Support("block", "y0", (None, 0.0, None))]
    pair = ContactPair(Surface("block", "z0"), FLOOR)
    scene = Scene({"block": Body(mesh, RUBBER)}, sides, [Traction("block", "z1", (0, 0, -2.0))], [pair])
    state = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-11).solve(design=True)
    gained = float(state.contact.normal_force @ state.contact.points.gap)
    stored = value(StrainEnergy(), state)
    assert min(gained, stored) > 1e-3
    assert value(TotalPotential(), state) == pytest.approx(-stored - gained, rel=1e-6)


def test_the_largest_is_the_largest_and_the_first_of_equals() -> None:
    state, forms = mixed(), ShapeForms(mixed().torn.decomposition.comm)
    low, high = LargestPressure(), 2.0 * StrainEnergy()
    scale = 3.0 * low.value(state, forms) / high.value(state, forms)
    both = Maximum([low, scale * high])  # type: ignore[arg-type]
    assert both.value(state, forms) == pytest.approx(3.0 * low.value(state, forms))
    found, expected = both.partials(state, forms), (scale * high).partials(state, forms)
    np.testing.assert_array_equal(found.by_displacement, expected.by_displacement)
    equal = Maximum((low, PressureNorm(), low + 0.0 * high)).partials(state, forms)
    assert not equal.by_displacement.any()
    assert np.count_nonzero(equal.by_multiplier) == 1


def test_a_node_by_a_number_of_numpy_is_that_node() -> None:
    moved = mixed().gather_displacement("block")
    highest = np.argmax(moved[:, 0])
    found = value(Movement("block", highest, (2.0, 0.0, 0.0)), mixed())  # type: ignore[arg-type]
    assert found == pytest.approx(moved[highest, 0], rel=1e-9)
    assert found > 1e-3


def refused(objective: Objective, state: State) -> str:
    """What is said both when the value is asked for and when derivatives are."""
    forms, said = ShapeForms(state.torn.decomposition.comm), []
    for ask in (objective.value, objective.partials):
        with pytest.raises((InvalidInputError, InvalidDesignError)) as caught:
            ask(state, forms)
        said.append(str(caught.value))
    assert said[0] == said[1]
    return said[0]


@pytest.mark.parametrize("objective", [LargestPressure(1), PressureNonuniformity(7), FrictionWork(-1)])
def test_a_pair_that_is_not_there_is_refused(objective: Objective) -> None:
    name, number = type(objective).__name__, objective.pair  # type: ignore[attr-defined]
    known = f"{name}.pair must be the number of a contact pair of the scene, 0 to 0, got {number}"
    assert refused(objective, mixed()).startswith(known)


def test_bodies_surfaces_and_nodes_that_are_not_there_are_refused() -> None:
    assert "LargestStress.body must name a body of the scene, got 'part'" in refused(
        LargestStress("part"), mixed()
    )
    assert "Movement.body must name a body of the scene, got 'part'" in refused(
        Movement("part", "z1", (1, 0, 0)), mixed()
    )
    message = "Movement.at must be a surface of body 'block', one of ['x0', "
    assert refused(Movement("block", "top", (1, 0, 0)), mixed()).startswith(message)
    assert refused(Movement("block", 10**6, (1, 0, 0)), mixed()).startswith(message)
    assert "Movement.direction must be 3 finite numbers" in refused(
        Movement("block", "z1", (0, 0, 0)), mixed()
    )


@pytest.mark.parametrize("kind", [PressureNorm, LargestStress])
@pytest.mark.parametrize("p", [0.5, 1.9, -8.0, 101.0, np.nan, np.inf])
def test_exponents_that_smooth_too_much_or_overflow_are_refused(kind: type, p: float) -> None:
    given = {"body": "block"} if kind is LargestStress else {}
    with pytest.raises(InvalidInputError, match=f"{kind.__name__}.p must be from 2 to 100, got"):
        kind(**given, p=p)


@pytest.mark.parametrize(
    "objective", [LargestPressure(), PressureNorm(0), PressureNonuniformity(), ContactArea()]
)
def test_a_design_that_touches_nothing_is_refused(objective: Objective) -> None:
    apart = Column(1.0, 1.0).state(pressure=0.0, gap=0.1)
    said = refused(objective, apart)
    assert said.startswith(f"{type(objective).__name__} needs surfaces that touch, but no")


def test_nothing_is_stressed_where_nothing_is_loaded() -> None:
    apart = Column(1.0, 1.0).state(pressure=0.0, gap=0.1)
    found = LargestStress("block").partials(apart, ShapeForms(apart.torn.decomposition.comm))
    assert found.value == 0.0
    assert not found.by_displacement.any()


def test_work_of_friction_needs_friction() -> None:
    assert refused(FrictionWork(), even("N and mm")).startswith(
        "FrictionWork needs friction, but the scene's"
    )


def test_strain_energy_of_a_heated_body_is_refused_and_its_stress_is_not() -> None:
    hot = Column(1.0, 1.0).state(ThermalStrain("block", 50.0))
    assert refused(StrainEnergy(), hot).startswith("StrainEnergy needs loads without ThermalStrain")
    # It expands freely: no stress is added.
    assert value(LargestStress("block"), hot) == pytest.approx(PRESSURE, rel=1e-6)


@pytest.mark.parametrize("given", [(), None, (StrainEnergy(), 2.0), "energy"])
def test_the_largest_of_what_are_no_objectives_is_refused(given: object) -> None:
    with pytest.raises(InvalidInputError, match="Maximum needs "):
        Maximum(given)  # type: ignore[arg-type]


# A punch with a flat edge presses hardest at its corners: each objective takes away what it is about.
AIMS_OPTIMISED_RUBBER, MEAN = PlaneStrain(100.0, 0.3), 2.0


def punch() -> Scene:
    return Scene(
        {
            "punch": Body(rectangle((1.03, 0.0), (2.97, 1.0), (16, 8)), AIMS_OPTIMISED_RUBBER),
            "layer": Body(rectangle((0.0, -1.0), (4.0, 0.0), (24, 6)), AIMS_OPTIMISED_RUBBER),
        },
        [Support("layer", "y0")],
        [Traction("punch", "y1", (0.0, -MEAN))],
        [ContactPair(Surface("punch", "y0"), Surface("layer", "y1"), Coulomb(0.2), discretisation="node")],
    )


def designs(objective: Objective, scale: float = 1.0) -> tuple[DesignPoint, DesignPoint]:
    """The first and the best design."""
    contact = ContactProblem(punch(), MPI.COMM_SELF, tolerance=1e-8)
    problem = ShapeProblem(contact, SurfaceDesign("punch", "y0", net=5), objective)
    method = BundleTrust(tolerance=1e-3, value_scale=scale)
    result = minimize(problem, np.zeros(5), method, bounds=(-0.05, 0.05))
    assert result.reason.success
    assert problem.first is not None
    assert problem.best is not None
    return problem.first, problem.best


@pytest.mark.parametrize("objective", [LargestPressure(), PressureNorm(p=12.0)])
def test_the_peak_falls_almost_to_the_mean_pressure(objective: Objective) -> None:
    first, best = (point.state.contact.pressure.max() for point in designs(objective))
    assert first > 1.9 * MEAN
    assert MEAN < best < 1.1 * MEAN


def test_the_larger_of_two_stresses_falls_until_both_are_equal() -> None:
    both = (LargestStress("punch", p=12.0), 1.5 * LargestStress("layer", p=12.0))
    first, best = designs(Maximum(both))
    assert best.value < 0.9 * first.value
    forms = ShapeForms(MPI.COMM_SELF)
    before, after = ([judge.value(point.state, forms) for judge in both] for point in (first, best))
    assert before[0] > 1.1 * before[1]
    assert after[0] == pytest.approx(after[1], rel=0.02)


def test_nothing_slips_any_more() -> None:
    first, best = designs(FrictionWork(), 1e-4)
    assert first.value > 3e-4
    assert best.value < 1e-2 * first.value


# Objectives can be added and scaled.
ALL = objectives("block")
ENERGY, STRESS, FORCES = ALL["energy"], ALL["stress"], ALL["friction forces"]
DESIGN = 0.01 * np.random.default_rng(3).standard_normal(6)


@cache
def solved() -> Remembering:
    return problem(block_on_floor(Coulomb(0.4), load=(0.4, 0.1, -2.0)))


@cache
def alone(name: str) -> tuple[float, np.ndarray]:
    point = solved().evaluate_by(ALL[name], DESIGN)
    return point.value, point.gradient


class Own:
    """The energy, by a class that knows of no sums."""

    def value(self, state: State, forms: ShapeForms) -> float:
        return TotalPotential().value(state, forms)

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        return TotalPotential().partials(state, forms)


SUMS: dict[str, tuple[Objective, dict[str, float]]] = {
    "sum": (ENERGY + 2.0 * STRESS, {"energy": 1.0, "stress": 2.0}),
    "three": (ENERGY + 2.0 * STRESS + 0.5 * FORCES, {"energy": 1.0, "stress": 2.0, "friction forces": 0.5}),
    "difference": (ENERGY - STRESS * 3, {"energy": 1.0, "stress": -3.0}),
    "negative": (-(ENERGY + STRESS), {"energy": -1.0, "stress": -1.0}),
    "product of a sum": (2.0 * (ENERGY + STRESS), {"energy": 2.0, "stress": 2.0}),
    "number of NumPy": (np.float64(2.0) * ENERGY, {"energy": 2.0}),
    "own class": (Own() + STRESS, {"energy": 1.0, "stress": 1.0}),
    "own class behind": (STRESS + Own(), {"energy": 1.0, "stress": 1.0}),
}


@pytest.mark.parametrize("name", SUMS)
def test_value_and_gradient_are_those_of_the_terms(name: str) -> None:
    objective, weights = SUMS[name]
    point = solved().evaluate_by(objective, DESIGN)
    assert point.value == pytest.approx(sum(w * alone(term)[0] for term, w in weights.items()), rel=1e-12)
    wanted = sum(w * alone(term)[1] for term, w in weights.items())
    assert np.linalg.norm(wanted) > 0.0
    np.testing.assert_allclose(point.gradient, wanted, atol=1e-6 * np.abs(wanted).max())
    assert solved().value_by(objective, DESIGN) == pytest.approx(point.value, rel=1e-12)


def test_the_terms_count() -> None:
    parts = [np.linalg.norm(weight * alone(term)[1]) for term, weight in SUMS["three"][1].items()]
    assert min(parts) > 1e-4 * max(parts), "a term without weight would not be missed"


@pytest.mark.parametrize("weight", [np.nan, np.inf, "2", None])
def test_a_weight_that_is_no_finite_number_is_refused(weight: object) -> None:
    with pytest.raises(InvalidInputError, match="weight must be a finite number, got"):
        weight * ENERGY  # type: ignore[operator]


@pytest.mark.parametrize("other", [1.0, "energy", None])
def test_what_is_no_objective_is_not_added(other: object) -> None:
    with pytest.raises(
        InvalidInputError, match=f"objects with value and partials, got {type(other).__name__}"
    ):
        ENERGY + other  # type: ignore[operator]


def test_a_sum_of_nothing_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="WeightedSum needs a term, got none"):
        WeightedSum(())
