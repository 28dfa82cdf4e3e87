# # A snap-fit hook: easy in, hard out
#
# ![The hook on its way over the ledge](../docs/pictures/snap_fit_stress.png)
#
# ![Force in and out](../docs/pictures/snap_fit_force.png)
#
# A hook of a stiff polymer is pushed over a ledge. Its ramp lifts it, its nose slides over the top, its back
# slips down behind the ledge: there it snaps in and pulls itself forward. To draw it out again takes more
# force, since the back is steeper than the ramp. Handbooks take the hook for a beam that is bent by $y$ [mm],
# and the surface for a wedge of the angle $\alpha$ with friction (Snap-Fit Joints for Plastics, Bayer 1998),
# per mm of depth:
#
# $$ P = \frac{E}{1 - \nu^2}\,\frac{h^3 y}{4 L^3}, \qquad
#    W = P\,\frac{\mu + \tan\alpha}{1 - \mu\tan\alpha}\ [\mathrm{N/mm}]. $$
#
# The end of the beam turns by $3y/2L$ as it bends. That makes the ramp steeper and the back flatter, which
# the formula leaves out: the hook goes in with more force, and holds less well.
#
# Run it with `make demo DEMO=snap_fit`, on two ranks with `make demo DEMO=snap_fit NP=2`.

from itertools import pairwise
from pathlib import Path

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    DistanceObstacle,
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
output = Path("output/snap_fit")

# ## Hook
#
# A beam with a nose at its end: back, tip and ramp are its lower side. Cells are small along the nose.

length, height, nose, tip = 12.0, 1.2, 1.0, 0.5  # mm
back, ramp = np.deg2rad(60), np.deg2rad(30)
ends = length + np.cumsum([0.0, nose / np.tan(back), tip, nose / np.tan(ramp)])
along = [np.linspace(0.0, length, 31)]
along += [np.linspace(a, b, round((b - a) / 0.12) + 1)[1:] for a, b in pairwise(ends)]
straight = gallery.rectangle_lattice([np.concatenate(along), np.linspace(0.0, 1.0, 7)])
x, part = straight.points.T
lower = np.interp(x, ends, [0.0, -nose, -nose, 0.0])
hook = straight.moved(np.column_stack([x, lower + (height - lower) * part]))

# ## Ledge
#
# Rigid, its edges rounded off. A distance is all that is needed: that from a rectangle, less the radius.

edge, width, clearance, start = 0.6, 1.6, 0.05, ends[-1] + 0.02  # mm


def from_ledge(points: np.ndarray) -> np.ndarray:
    """Return the signed distance from a high rectangle with round corners."""
    half = np.array([width / 2, 5.0])
    beyond = abs(points - (start + width / 2, -clearance - 5.0)) - half + edge
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0) - edge


polymer = materials.NeoHooke(young_modulus=2800.0, poisson_ratio=0.35)  # N/mm², POM
friction = 0.2
scene = Scene(
    {"hook": Body(hook, polymer)},
    [Support("hook", "x0")],
    contacts=[ContactPair(Surface("hook", "y0"), DistanceObstacle(from_ledge), Coulomb(friction))],
)

# ## In and out
#
# The root of the hook is moved, not pushed by a force: so the snap can be followed, too. Then it is drawn
# back until the nose is on the ledge again.

IN = 36  # load steps
home = start + width - length - 0.15  # the root's way until the nose is behind the ledge, mm
way = np.concatenate([np.linspace(0.0, home, IN + 1)[1:], np.linspace(home, home - 1.0, 13)[1:]])
steps = [LoadStep(f"{d:.2f} mm", supports=[Support("hook", "x0", (float(d), 0.0))]) for d in way]
with show_progress(comm):
    states = solve_steps(ContactProblem(scene, comm), steps)

# ## Forces
#
# What pushes the root; and the formula, with ramp and back as they are, and as the beam turns them. They
# leave the round edge of the ledge, of radius $r$, where the beam is bent by $r\,(1 - \cos\alpha)$ less than
# at most.

push = np.array([state.reactions()[0].force for state in states])
lever = length + nose / np.tan(back) + tip / 2


def wedge(angle: float, turning: float) -> float:
    """Return the formula's force, N/mm, where a surface leaves the round edge; turned 0, 1 or −1 times."""
    bent = nose - clearance - edge * (1 - np.cos(angle))
    slope = np.tan(angle + turning * 1.5 * bent / lever)
    across = 2800.0 / (1 - 0.35**2) * height**3 * bent / (4 * lever**3)
    return float(across * (friction + slope) / (1 - friction * slope))


inward, outward = float(push[:, 0].max()), float(-push[IN:, 0].min())
formula = {"in": (wedge(ramp, 0), wedge(ramp, 1)), "out": (wedge(back, 0), wedge(back, -1))}
on_top = int(np.argmax([state.gather_displacement("hook")[:, 1].max() for state in states[:IN]]))
half_way = int(np.argmax(push[:IN, 0]))

# ## Pictures

pictures.plot_curves(
    {"in": (way[:IN], push[:IN, 0]), "out": (way[IN - 1 :], push[IN - 1 :, 0])},
    output / "force.png",
    xlabel="way of the root (mm)",
    ylabel="pushing force (N/mm)",
    reference={
        "formula, in": (way[[0, IN - 1]], [formula["in"][1]] * 2),
        "formula, out": (way[[0, IN - 1]], [-formula["out"][1]] * 2),
    },
    connected=True,
    title="In, with the snap, and out",
    comm=comm,
)
pictures.plot_stress(states[half_way], output / "stress.png", title="Half way over the ledge", scale=1.0)
pictures.plot_stress(states[on_top], output / "stress_on_top.png", title="On the ledge", scale=1.0)
series = ResultSeries(output, "history", comm)
for number, state in enumerate(states):
    series.add(state, number, steps[number].name)

# ## Result

newton = NewtonSteps.of(states)
imbalance = max(state.balance().imbalance for state in states)
record = {
    "way": way,
    "push": push[:, 0],
    "inward": inward,
    "outward": outward,
    "snap": float(push[:IN, 0].min()),
    "formula": formula,
    "reduction": newton.reduction,
}
write_result(states[-1], output, more=record)

# Every rank has the same numbers; one prints them.

if comm.rank == 0:
    ranks = "1 rank" if comm.size == 1 else f"{comm.size} ranks"
    print(f"snap fit: {len(hook.points)} nodes, {len(states)} load steps, {ranks}")
    print("              computed   formula   formula, turned")
    print(f"  in          {inward:8.3f} {formula['in'][0]:9.3f} {formula['in'][1]:9.3f}   N/mm")
    print(f"  out         {outward:8.3f} {formula['out'][0]:9.3f} {formula['out'][1]:9.3f}   N/mm")
    print(f"  snap        {record['snap']:8.3f}   N/mm: it pulls itself in")
    print(f"  {newton}")
    print(f"  loads, reactions and contact forces balance to {imbalance:.1e}")
    print(f"pictures and files in {output}/")

# As the formula predicts for turned surfaces, to a fifth: it takes a tip for a point. Out takes more than in,
# the snap pulls, forces balance as well as they were solved, and Newton's method is superlinear.

for found, name in ((inward, "in"), (outward, "out")):
    assert abs(found / formula[name][1] - 1) < 0.2
assert outward > 1.3 * inward > 0 > record["snap"]
assert imbalance < 1e-8
assert np.median(newton.reduction) < 1e-3

# ## What to try next
#
# - `Coulomb(0.05)`: a lubricated hook falls out more easily than it goes in.
# - `back = np.deg2rad(80)`: with this friction the formula has no finite force; nothing draws the hook out
#   but a screwdriver.
# - A longer beam: strains and forces fall, and so does the hold.
