"""Subdomains of heat from one solution to the next."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from fenics_contact.gallery import rectangle
from fenics_contact.heat import ConductingBody, Conductor, HeatFlux, HeatProblem, HeatScene, HeldTemperature
from fenics_contact.heat.assembly import Rate


def test_steps_of_other_lengths_have_other_matrices():
    # Matrices of the step before are freed, and others may take their places in memory.
    slab = ConductingBody(rectangle((0, 0), (1, 0.1), (8, 1)), Conductor(1.0, 1.0))
    scene = HeatScene({"slab": slab}, [HeldTemperature("slab", "x0", 1.0)])
    stepping = HeatProblem(scene, MPI.COMM_SELF)
    for factor in (10.0, 15.0, 20.0, 30.0):
        rate = Rate(factor, np.zeros(slab.mesh.n_nodes), stepping.no_rate.history)
        alone = HeatProblem(scene, MPI.COMM_SELF)
        wanted = alone.solve(rate=Rate(factor, rate.before, alone.no_rate.history)).values
        assert np.abs(stepping.solve(rate=rate).values - wanted).max() < 1e-9


def test_loads_of_other_times_are_forgotten():
    slab = ConductingBody(rectangle((0, 0), (1, 0.1), (4, 1)), Conductor(1.0))
    held = [HeldTemperature("slab", "x0", 1.0)]
    scenes = [HeatScene({"slab": slab}, held, [HeatFlux("slab", "x1", value)]) for value in (1.0, 2.0, 3.0)]
    problem = HeatProblem(scenes[0], MPI.COMM_SELF)
    ends = [problem.solve(scene).values.max() for scene in scenes]
    assert np.abs(np.array(ends) - (2.0, 3.0, 4.0)).max() < 1e-9
    assert [len(each._known) for each in problem._assemblies] == [1] * len(problem._assemblies)
