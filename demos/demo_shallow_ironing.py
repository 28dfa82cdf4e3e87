# # Shallow ironing: a die is pressed into a soft bed and drawn along it
#
# ![Half way](../docs/pictures/shallow_ironing_stress.png)
#
# ![Forces on the die](../docs/pictures/shallow_ironing_forces.png)
#
# A stiff die with a round underside sinks 0.8 mm into a bed and is drawn 10 mm along it, with friction, until
# it comes to the bed's end. Codes for large sliding are compared by this problem (K. A. Fischer, P. Wriggers,
# Comput. Methods Appl. Mech. Eng. 195, 2006): every node of the die passes forty facets of the bed, which
# bends around the die's corners. Published forces differ by a quarter and more:
#
# | | vertical, half way, N/mm | horizontal, N/mm |
# |---|---|---|
# | Poulios and Renard 2015 | 337 | 102 |
# | Yastrebov 2011 | 360 | 171 |
# | Fischer and Wriggers 2006 | 365 | 189 |
# | Hartmann and Oliver 2009 | 408 | 160 |
# | code_aster 2020 | 421 | 143 |
#
# [A study](../docs/studies/large_deformations.md) has the limit of finer meshes, and GetFEM's forces on the
# same ones.
#
# Run it with `make demo DEMO=shallow_ironing`, on two ranks with `make demo DEMO=shallow_ironing NP=2`.

from dataclasses import replace
from pathlib import Path

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    NewtonSteps,
    Scene,
    Support,
    Surface,
    gallery,
    materials,
    pictures,
    show_progress,
    solve_steps,
    write_result,
)
from fenics_contact.output import ResultSeries

comm = MPI.COMM_WORLD
output = Path("output/shallow_ironing")

# ## Bed and die
#
# The bed has square cells at its top, higher ones below. The die's underside is an arc; its sides may touch
# the bed as well.

columns, friction = 48, 0.3
down = gallery.growing_ticks(4.0, 12.0 / columns, 1.3)  # mm
bed = gallery.rectangle_lattice([np.linspace(0.0, 12.0, columns + 1), 4.0 - down[::-1]])

arc = 0.3  # its height, mm
radius = (0.6**2 + arc**2) / (2 * arc)
die = gallery.rectangle((0.2, 4.2), (1.4, 5.4), (8, 8))
x, y = die.points.T
under = 4.2 + radius - np.sqrt(radius**2 - (x - 0.8) ** 2)
skin = np.concatenate([die.surfaces[side] for side in ("x0", "y0", "x1")])
die = replace(
    die.moved(np.column_stack([x, under + (5.4 - under) * (y - 4.2) / 1.2])),
    surfaces={**die.surfaces, "skin": skin},
)


def held(across: float, down: float) -> list[Support]:
    """Return the supports with the die's top moved, mm."""
    return [Support("bed", "y0"), Support("die", "y1", (across, -down))]


scene = Scene(
    {
        "bed": Body(bed, materials.NeoHooke(young_modulus=689.6, poisson_ratio=0.32)),  # N/mm²
        "die": Body(die, materials.NeoHooke(young_modulus=6896.0, poisson_ratio=0.32)),
    },
    held(0.0, 0.0),
    contacts=[ContactPair(Surface("die", "skin"), Surface("bed", "y1"), Coulomb(friction), "mortar")],
)

# ## Down, then along
#
# A facet of the bed a load step, with means over the die's facets: its nodes alone would have forces that
# ripple by a tenth.

way = np.linspace(0.0, 10.0, 41)[1:]  # mm
places = [(0.0, 0.25), (0.0, 0.5), (0.0, 0.75), (0.0, 1.0), *((float(d), 1.0) for d in way)]
steps = [LoadStep(f"{across:.2f} mm along", supports=held(across, down)) for across, down in places]
with show_progress(comm):
    states = solve_steps(ContactProblem(scene, comm), steps)

# ## Forces
#
# What holds the die; published curves are known here at six times, with straight lines between.

force = np.array([state.reactions()[1].force for state in states])
time = np.concatenate([np.linspace(0.25, 1.0, 4), 1.0 + way / 10.0])
half_way = 23
at = (0.5, 1.0, 1.25, 1.5, 1.75, 1.95)
published = {  # at these times: vertical and horizontal, N/mm
    "Poulios, Renard": ([81.5, 267.9, 334.9, 337.4, 335.2, 309.0], [15.5, 55.3, 100.2, 102.1, 100.5, 78.8]),
    "Hartmann, Oliver": ([95.1, 319.5, 408.4, 408.4, 401.2, 362.9], [17.6, 67.2, 158.8, 160.2, 154.5, 118.5]),
    "code_aster": ([96.2, 332.0, 419.7, 421.0, 415.6, 376.9], [18.7, 71.0, 141.3, 143.3, 141.8, 103.6]),
}

# ## Pictures

pictures.plot_curves(
    {"vertical": (time, -force[:, 1]), "horizontal": (time, force[:, 0])},
    output / "forces.png",
    xlabel="time: down until 1, along until 2",
    ylabel="force (N/mm)",
    reference={
        name: (np.array([*at, np.nan, *at]), np.array([*down, np.nan, *along]))
        for name, (down, along) in published.items()
    },
    connected=True,
    title="Forces on the die",
    comm=comm,
)
pictures.plot_stress(states[half_way], output / "stress.png", title="Half way", scale=1.0)
pictures.plot_stress(states[-1], output / "stress_at_the_end.png", title="At the end", scale=1.0)
series = ResultSeries(output, "history", comm)
for number, state in enumerate(states):
    series.add(state, time[number], steps[number].name)

# ## Result

newton = NewtonSteps.of(states)
imbalance = max(state.balance().imbalance for state in states)
record = {
    "time": time,
    "vertical": -force[:, 1],
    "horizontal": force[:, 0],
    "reduction": newton.reduction,
}
write_result(states[-1], output, more=record)

# Every rank has the same numbers; one prints them.

if comm.rank == 0:
    ranks = "1 rank" if comm.size == 1 else f"{comm.size} ranks"
    print(f"shallow ironing: {len(bed.points) + len(die.points)} nodes, {len(states)} load steps, {ranks}")
    print("   time   vertical   horizontal   N/mm")
    for number in (1, 3, 13, 23, 33, 41, 43):
        print(f"  {time[number]:5.2f} {-force[number, 1]:10.1f} {force[number, 0]:12.1f}")
    print(f"  {newton}")
    print(f"  loads, reactions and contact forces balance to {imbalance:.1e}")
    print(f"pictures and files in {output}/")

# Within what is published, at all of its times; forces balance, and Newton's method is superlinear.

for number, moment in ((1, 0), (3, 1), (13, 2), (23, 3), (33, 4), (41, 5)):
    assert time[number] == at[moment]
    for found, part in ((-force[number, 1], 0), (force[number, 0], 1)):
        known = [curves[part][moment] for curves in published.values()]
        assert 0.97 * min(known) < found < 1.03 * max(known)
assert imbalance < 1e-8
assert np.median(newton.reduction) < 1e-3

# ## What to try next
#
# - `Coulomb(0.0)`: the horizontal force that is left is what the bed's heap in front of the die takes.
# - `"node"` for `"mortar"`, with `steps=AutomaticSteps(snaps=True)` for the problem: forces ripple as nodes
#   pass facets, and near the end the bed springs off the die's corner, where no equilibrium is near.
# - `columns = 72` and a die of 12 x 12 cells: the horizontal force falls by 3 %.
