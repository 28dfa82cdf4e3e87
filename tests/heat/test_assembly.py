"""Subdomains of heat from one solution to the next."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from fenics_contact.gallery import rectangle
from fenics_contact.heat import ConductingBody, Conductor, HeatProblem, HeatScene, HeldTemperature
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
