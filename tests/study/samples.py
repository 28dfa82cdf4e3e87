"""Studies that nobody had to compute, and the smallest that somebody can."""

from __future__ import annotations

from collections.abc import Sequence

from fenics_contact.study import BALANCED, Parameters, Results, Run
from fenics_contact.study.runner import Job, Record
from fenics_contact.study.study import QuantityFacts, SceneFacts

SIZES = (2, 4, 8)
BASE = Parameters(4, discretisation="mortar")
FACTS = SceneFacts(
    name="sample",
    title="A sample",
    about="Nothing was computed.",
    size_name="cells on the radius",
    spacing_unit="mm",
    energy_rate=1.0,
    spacing={size: 1.0 / size for size in SIZES},
    quantities=(
        QuantityFacts("peak pressure", "MPa", "theory", 1.0),
        QuantityFacts("energy", "N mm", "", 2.0),
        QuantityFacts("gradient", "N", "", None, ("adjoint",)),
    ),
)


def run(
    size: int, tolerance: float | str = BALANCED, *, seconds: float | None = None, error: float | None = None
) -> Run:
    """One run whose peak pressure errs by 16/size² percent and whose energy converges to −10 with rate 2."""
    exact = 200.0
    wrong = 0.16 / size**2 if error is None else error
    algebraic = 1e-3 if tolerance == BALANCED else float(tolerance)
    quantities = {
        "peak pressure": {"value": exact * (1 + wrong), "exact": exact, "error": wrong},
        "energy": {"value": -10.0 + 1.0 / size**2},
        "gradient": {"value": [1.0 + 1.0 / size, 2.0]},
    }
    return Run(
        Parameters(size, discretisation="mortar", tolerance=tolerance),  # type: ignore[arg-type]
        seconds=0.1 * size**2 * (1.0 if tolerance == BALANCED else 1.5) if seconds is None else seconds,
        spread=(0.1, 0.2),
        repeats=3,
        phases={"mesh": 0.02, "factor": 0.03 * size, "solve": 0.05 * size},
        phases_after={"adjoint": 0.5},
        memory=100 * 2**20,
        load_average=0.5,
        counts={
            "torn_unknowns": 100 * size**3,
            "subdomains": size,
            "f_products": 50 if tolerance == BALANCED else 80,
        },
        residual=algebraic,
        quantities=quantities,
        parts={"algebraic": 2 * algebraic, "friction": 0.0, "discretisation": 0.5 / size},
        true_errors={"algebraic": algebraic, "total": algebraic, "uncertainty": 1e-12, "tolerance": 1e-11},
    )


def results(runs: Sequence[Run] | None = None) -> Results:
    """A study of three meshes with two tolerances and a run that failed."""
    failed = Run(Parameters(8, cell="tetrahedron"), failed="ConvergenceError: it did not converge")
    known = [run(size, tolerance) for size in SIZES for tolerance in (1e-8, BALANCED)]
    return Results(FACTS, 2, (*(known if runs is None else runs), failed), BASE, {"python": "3.11"})


#: What a process writes that ran well.
GOOD: Record = {
    "seconds": 2.0, "phases": {"solve": 1.0}, "phases_after": {}, "memory": 100, "load_average": 0.1,
    "counts": {"f_products": 10}, "residual": 1e-7, "parts": None, "true_errors": None,
    "quantities": {"shortening": {"value": 0.01, "exact": 0.01, "error": 0.0}},
}  # fmt: skip


class Machine:
    """Stands in for processes: counts what it is asked for, and answers as it is told."""

    def __init__(self) -> None:
        self.asked: list[int] = []
        self.verified: list[bool] = []
        self.answers: dict[int, Record | BaseException] = {}
        self.seconds = 2.0

    def __call__(self, job: Job, *, first: bool = True) -> Record:
        size = job.arguments["parameters"]["size"]
        self.asked.append(size)
        self.verified.append(first and job.first["verify"])
        answer = self.answers.get(size, GOOD)
        if isinstance(answer, BaseException):
            raise answer
        seconds = self.seconds + 0.1 * len(self.asked)
        return answer if "failed" in answer else {**answer, "seconds": seconds}


#: A block pressed on a plane, whose shortening is exact on every mesh; its size 3 cannot be built.
BLOCK = """
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import rectangle
from fenics_contact import Body, ContactPair, RigidPlane, Scene, Support, Surface, Traction
from fenics_contact.materials import PlaneStress
from fenics_contact.study import Parameters, Problem, Quantity, StudyScene, Sweep


def build(parameters, comm):
    if parameters.size == 3:
        raise InvalidInputError("three cells cannot be built")
    mesh = rectangle((0.0, 0.0), (1.0, 1.0), (parameters.size, parameters.size))
    floor = ContactPair(Surface("block", "y0"), RigidPlane((0.0, 0.0), (0.0, 1.0)))
    scene = Scene(
        {"block": Body(mesh, PlaneStress(100.0, 0.3))}, [Support("block", "x0", (0.0, None))],
        [Traction("block", "y1", (0.0, -1.0))], [floor],
    )
    return Problem(scene)


def shortening(outcome):
    return -float(outcome.state.gather_displacement("block")[:, 1].min())


sweep = Sweep(Parameters(2, cell="quadrilateral", tolerance=1e-6), sizes=(2, 3, 4), tolerances=(1e-6,))
study = StudyScene(
    "pressed_block", "A pressed block", build, (Quantity("shortening", "mm", shortening, 0.01),), sweep, sweep
)
"""
