# # A block sheared forth and back: stick, slip and hysteresis
#
# ![Shear force over displacement](../docs/pictures/sheared_block_loop.png)
#
# A rubber block lies on a rigid floor. Its top is pressed down by $d_z$ [mm], then shifted along $x$ by
# $d_x$ [mm] forth, back and forth again. Friction on the floor follows Coulomb's law in every point,
#
# $$ \|\tau\| \le \mu\,\lambda_N\ [\mathrm{N}], \qquad
#    \tau = \mu\,\lambda_N\,\frac{\Delta u_T}{\|\Delta u_T\|} \ \text{where it slips}, $$
#
# with the normal force $\lambda_N$ [N] and the slip $\Delta u_T$ [mm] since the last load step. First the
# block sticks and shears like a spring. Slip begins at its edges and spreads, until all of it slides and the
# shear force stays at $\mu N$. On the way back it sticks again: the loop encloses the energy that friction
# takes.
#
# Run it with `make demo DEMO=sheared_block`, on two ranks with `make demo DEMO=sheared_block NP=2`.

from pathlib import Path

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    RigidPlane,
    Scene,
    Status,
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
output = Path("output/sheared_block")

# ## Scene
#
# 40 × 20 × 15 mm of rubber. Only the floor and what is prescribed on the top hold it.

friction_coefficient = 0.5
rubber = materials.IsotropicElasticity(young_modulus=5.0, poisson_ratio=0.45)  # N/mm²
mesh = gallery.block((0.0, 0.0, 0.0), (40.0, 20.0, 15.0), (16, 8, 6))
floor = RigidPlane(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))
scene = Scene(
    bodies={"block": Body(mesh, rubber)},
    contacts=[ContactPair(Surface("block", "z0"), floor, Coulomb(friction_coefficient))],
)

# ## Load steps
#
# Pressed by 0.5 mm first. Slip counts from step to step: what a step begins with is locked in.

forth, back = np.linspace(0.0, 1.5, 7), np.linspace(1.5, -1.5, 13)
path = np.concatenate([forth, back[1:], -back[1:]])  # mm
steps = [
    LoadStep(f"{shift:+.2f} mm", supports=[Support("block", "z1", (shift, 0.0, -0.5))]) for shift in path
]
with show_progress(comm):
    states = solve_steps(ContactProblem(scene, comm, tolerance=1e-6), steps)

# ## Shear force
#
# The friction of the floor acts on the block; what shears it is the opposite. At the end of each stroke
# all of the floor slides.

shear = np.array([-state.contact.force[:, 0].sum() for state in states])
pressed = np.array([state.contact.normal_force.sum() for state in states])
slipping = np.array([state.contact.count(Status.SLIP) for state in states])
sticking = np.array([state.contact.count(Status.STICK) for state in states])
ends = [6, 18, 30]
plateau = np.abs(shear[ends]) / (friction_coefficient * pressed[ends])
loop = slice(6, 31)
work = float(
    np.sum(np.convolve(shear[loop], [0.5, 0.5], "valid") * np.diff(path[loop]))
)  # of the closed loop, N mm

# ## Pictures
#
# The loop between the bounds $\pm\mu N$, and where the floor holds the block. $N$ changes a little on the
# way: a block that bulges freely presses back less.

bound = friction_coefficient * pressed
pictures.plot_curves(
    {"shear force": (path, shear)},
    output / "loop.png",
    xlabel="shift of the top (mm)",
    ylabel="shear force (N)",
    reference={"μN": (path[6:19], bound[6:19]), "−μN": (path[6:19], -bound[6:19])},
    connected=True,
    title=f"Hysteresis of a sheared block, μ = {friction_coefficient:g}",
    comm=comm,
)

# Six of the steps as maps: the edges slip first. On the way back, all sticks at once before they slip again.

chosen = [0, 2, 4, 6, 10, 14]
names = ["pressed", "forth", "forth", "all slides", "back", "back"]
maps = {
    f"{name}, {steps[k].name.replace('-', '−')}": states[k] for name, k in zip(names, chosen, strict=True)
}
pictures.plot_contact_status(maps, output / "status.png", title="Stick and slip on the floor")
pictures.plot_stress(states[6], output / "stress.png", title="Sheared block")

# ## Files for ParaView
#
# All steps as a film: `history.pvd` opens them together, with the shifts as labels.

series = ResultSeries(output, "history", comm)
for number, state in enumerate(states):
    series.add(state, number, steps[number].name)

# ## Result
#
# Where all points slide, the shear force is $\mu N$, but for what points at the edges also slip sideways.

record = {
    "friction_coefficient": friction_coefficient,
    "shift": path,
    "shear_force": shear,
    "normal_force": pressed,
    "slipping_points": slipping,
    "plateau_over_bound": plateau,
    "dissipated_energy": work,
}
write_result(states[-1], output, more=record)
imbalance = max(state.balance().imbalance for state in states)

# Every rank has the same numbers; one prints them.

if comm.rank == 0:
    ranks = "1 rank" if comm.size == 1 else f"{comm.size} ranks"
    print(f"sheared block: {len(states)} load steps, {ranks}")
    print("  shift [mm]   shear [N]   bound μN [N]   sticking   slipping")
    for k in range(0, len(path), 2):
        print(f"  {path[k]:z10.2f} {shear[k]:z11.2f} {bound[k]:14.2f} {sticking[k]:10d} {slipping[k]:10d}")
    print(f"  dissipated in a loop {work:.2f} N mm")
    print(f"  plateau / μN at the ends of the strokes: {', '.join(f'{value:.4f}' for value in plateau)}")
    print(f"  loads, reactions and contact forces balance to {imbalance:.1e}")
    print(f"pictures and files in {output}/")

# At the ends of the strokes nothing sticks, and the plateau is $\mu N$ to 1 %. In every step the reactions of
# the top and the forces of the floor balance, forces and moments, to rounding.

assert np.all(sticking[ends] == 0)
assert np.all(np.abs(plateau - 1.0) < 0.01)
assert imbalance < 1e-9

# ## What to try next
#
# - A lower block: it sticks longer in its middle before it slides.
# - `Tresca(0.2)` instead of `Coulomb`: the plateau no longer depends on how hard the block is pressed.
# - Shift along $y$ as well: the friction force turns with the direction of sliding.
