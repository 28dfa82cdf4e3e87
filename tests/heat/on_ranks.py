"""A scene with all kinds of laws, cut in three ways, and one that is refused on one rank alone."""

from __future__ import annotations

import json
import sys

import numpy as np
from mpi4py import MPI

from fenics_contact import Surface, Tie, box_partition
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.heat import (
    ConductingBody,
    Conductor,
    Convection,
    GapConductance,
    GapRadiation,
    HeatFlux,
    HeatOfHeld,
    HeatScene,
    HeldTemperature,
    Radiation,
    TemperatureTable,
    ThermalContact,
    solve_heat,
    solve_heat_to,
)

CUTS = ((1, 1, 2), (2, 1, 1), (3, 2, 2))


def negative_where_hot(temperature: np.ndarray) -> np.ndarray:
    """Return what is no conductivity above 400 degrees."""
    return 400.0 - temperature


def scene(discretisation: str, above: Conductor) -> HeatScene:
    """Return three blocks with odd numbers of cells, across a gap and tied."""
    low = block((0, 0, 0), (1, 1, 1), (5, 5, 5))
    up = block((0.1, 0.05, 1.02), (1, 0.9, 2), (7, 3, 4))
    top = block((0.1, 0.05, 2), (1, 0.9, 3), (3, 5, 3))
    middle = Conductor(TemperatureTable((300.0, 900.0), (20.0, 60.0)))
    bodies = {
        "low": ConductingBody(low, Conductor(50.0)),
        "up": ConductingBody(up, middle),
        "top": ConductingBody(top, above),
    }
    film = Convection("low", "y0", TemperatureTable((300.0, 900.0), (5.0, 50.0)), 290.0)
    law = GapConductance(5.0, 1e-2) + GapRadiation(0.8, 0.7)
    return HeatScene(
        bodies,
        [HeldTemperature("low", "z0", 300.0)],
        [HeatFlux("top", "z1", 5e3), Radiation("up", "x0", 0.8, 300.0), film],
        [ThermalContact(Surface("up", "z0"), Surface("low", "z1"), law, discretisation=discretisation)],  # type: ignore[arg-type]
        [Tie(Surface("top", "z0"), Surface("up", "z1"), discretisation=discretisation)],  # type: ignore[arg-type]
    )


def flat() -> HeatScene:
    """Return two rectangles with a film between them, of a table and radiation."""
    shapes = {"low": ((0.0, 0.0), (1.0, 1.0), (3, 3)), "up": ((0.2, 1.0), (1.0, 1.5), (4, 2))}
    middle = Conductor(TemperatureTable((300.0, 900.0), (20.0, 60.0)))
    bodies = {name: ConductingBody(rectangle(*given, "triangle"), middle) for name, given in shapes.items()}
    heating = [HeatFlux("up", "y1", 5e3), Radiation("up", "x0", 0.8, 300.0)]
    film = ThermalContact(Surface("up", "y0"), Surface("low", "y1"), 100.0)
    return HeatScene(bodies, [HeldTemperature("low", "x0", 300.0)], heating, [film])


def main() -> None:
    """Write counts and temperatures of all cuts, or what was refused, from the first rank."""
    comm, kind = MPI.COMM_WORLD, sys.argv[1]
    if kind == "refused":
        given = scene("node", Conductor(negative_where_hot))
        try:
            solve_heat(given, comm)
        except InvalidInputError as error:
            every = comm.gather(str(error)) or []
            print(*every, sep="\n", end="\n" * bool(every))
        return
    if kind == "levels":
        way = solve_heat_to(flat(), HeatOfHeld("low", "x0"), 0.01, comm)
        if comm.rank == 0:
            print(json.dumps([[level.cells for level in way.levels], way.value, way.error]))
        return
    for cut in CUTS:
        given = scene(kind, Conductor(5.0))
        parts = {name: box_partition(body.mesh, cut) for name, body in given.bodies.items()}
        state = solve_heat(given, comm, partitions=parts)
        if comm.rank == 0:
            print(state.iterations, state.products, state.balance.error, *map(repr, state.values.tolist()))


if __name__ == "__main__":
    main()
