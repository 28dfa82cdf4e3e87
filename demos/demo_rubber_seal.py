# # A rubber seal: closing a groove until the seal touches itself
#
# ![The seal when the groove is nearly closed](../docs/pictures/rubber_seal_stress.png)
#
# ![Forces of the seal](../docs/pictures/rubber_seal_force.png)
#
# A hollow rubber seal lies in a groove. A lid closes it: first the hollow profile gives way like a spring,
# then it leans on the walls, and at the end its bore closes and rubber presses on rubber. The seal is tight
# against a pressure that is below the contact pressure on the lid.
#
# At first it is a ring between two plates. For a thin one of radius $R$ and thickness $t$ [mm]
# the force of a squeeze $\delta$ is (S. Timoshenko, Strength of Materials, part II)
#
# $$ F = \frac{E}{1 - \nu^2}\,\frac{t^3}{12 R^3}\,\frac{\delta}{\pi/4 - 2/\pi}\ [\mathrm{N/mm}] $$
#
# A ring as thick as this one is softer by a fifth: it is also sheared.
#
# Run it with `make demo DEMO=rubber_seal`, on two ranks with `make demo DEMO=rubber_seal NP=2`.

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
    MovingObstacle,
    NewtonSteps,
    RigidPlane,
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
output = Path("output/rubber_seal")

# ## Seal
#
# The right half of it; its plane of symmetry is x = 0. Parts of its surface get names: what may meet the
# floor, the lid and the wall.

outer, inner, gap = 4.0, 2.6, 0.6  # mm: radii, and how far the wall is away
flat = gallery.rectangle((inner, -np.pi / 2), (outer, np.pi / 2), (5, 48))
radius, angle = flat.points.T
points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
points[abs(points) < 1e-12] = 0.0
ring = flat.moved(points)


def outside(condition) -> np.ndarray:
    """Return the facets of the outside whose height meets a condition."""
    facets = ring.surfaces["x1"]
    return facets[condition(points[facets, 1].mean(axis=1))]


seal = replace(
    ring,
    surfaces={
        **ring.surfaces,
        "under": outside(lambda y: y < 0.3 * outer),
        "upper": outside(lambda y: y > -0.3 * outer),
        "beside": outside(lambda y: abs(y) < 0.8 * outer),
    },
)

# ## Groove
#
# Floor and wall are fixed, the lid comes down as time goes by. The bore folds: its surface is slave and
# master at once.

rubber = materials.NeoHooke(young_modulus=6.0, poisson_ratio=0.45)  # N/mm²
greased = Coulomb(0.2)
bore = Surface("seal", "x0")
lid = MovingObstacle(RigidPlane((0.0, outer), (0.0, -1.0)), lambda time: (None, (0.0, -time)))
faces = {
    "floor": ContactPair(Surface("seal", "under"), RigidPlane((0.0, -outer), (0.0, 1.0)), greased),
    "lid": ContactPair(Surface("seal", "upper"), lid, greased),
    "wall": ContactPair(Surface("seal", "beside"), RigidPlane((outer + gap, 0.0), (-1.0, 0.0)), greased),
    "bore": ContactPair(bore, bore, greased),
}
symmetry = [Support("seal", side, (0.0, None)) for side in ("y0", "y1")]
scene = Scene({"seal": Body(seal, rubber)}, symmetry, contacts=list(faces.values()))
closure = np.append(np.arange(0.2, 4.7, 0.2), [4.8, 4.9, 5.0])  # mm
steps = [LoadStep(f"{way:.2f} mm", time=float(way)) for way in closure]
with show_progress(comm):
    states = solve_steps(ContactProblem(scene, comm), steps)

# ## Force and pressure
#
# Of the whole seal, per mm of its length.

forces = {
    name: 2 * np.array([state.contact.normal_force[state.contact.on_pair(k)].sum() for state in states])
    for k, name in enumerate(faces)
}
pressures = {
    name: np.array([state.contact.pressure[state.contact.on_pair(k)].max(initial=0.0) for state in states])
    for k, name in enumerate(faces)
}
middle, thickness = (outer + inner) / 2, outer - inner
spring = 6.0 / (1 - 0.45**2) * (thickness / middle) ** 3 / 12 / (np.pi / 4 - 2 / np.pi)

# ## Pictures

pictures.plot_curves(
    {name: (closure, values) for name, values in forces.items()},
    output / "force.png",
    xlabel="closure (mm)",
    ylabel="normal force (N/mm)",
    reference={"thin ring": (closure[:9], spring * closure[:9])},
    connected=True,
    title="Force of the seal",
    comm=comm,
)
pictures.plot_curves(
    {name: (closure, values) for name, values in pressures.items()},
    output / "pressure.png",
    xlabel="closure (mm)",
    ylabel="largest contact pressure (MPa)",
    connected=True,
    title="Pressure of the seal",
    comm=comm,
)
for name, number in (("free", 7), ("stress", -1)):
    pictures.plot_stress(
        states[number], output / f"{name}.png", title=f"Closed by {closure[number]:.1f} mm", scale=1.0
    )
series = ResultSeries(output, "history", comm)
for number, state in enumerate(states):
    series.add(state, number, steps[number].name)

# ## Result

newton = NewtonSteps.of(states)
imbalance = max(state.balance().imbalance for state in states)
record = {
    "closure": closure,
    "forces": forces,
    "pressures": pressures,
    "ring": spring,
    "reduction": newton.reduction,
}
write_result(states[-1], output, more=record)

# Every rank has the same numbers; one prints them.

if comm.rank == 0:
    ranks = "1 rank" if comm.size == 1 else f"{comm.size} ranks"
    print(f"rubber seal: {len(points)} nodes, {len(states)} load steps, {ranks}")
    print("  closure [mm]   " + "".join(f"{name:>8s}" for name in faces) + "   normal force [N/mm]")
    for k in [*range(1, len(states) - 1, 4), len(states) - 1]:
        print(f"  {closure[k]:12.2f}   " + "".join(f"{values[k]:8.3f}" for values in forces.values()))
    print(f"  pressure on the lid up to {pressures['lid'][-1]:.2f} MPa")
    print(f"  stiffness at first {forces['lid'][0] / closure[0]:.3f}, thin ring {spring:.3f} N/mm²")
    print(f"  {newton}")
    print(f"  loads, reactions and contact forces balance to {imbalance:.1e}")
    print(f"pictures and files in {output}/")

# The ring is a little softer than a thin one; the wall and then the bore take part; forces
# balance as well as they were solved, and the last steps of Newton's method are superlinear.

assert 0.75 < forces["lid"][0] / closure[0] / spring < 0.85
assert forces["wall"][6] == 0 < forces["wall"][-1]
assert forces["bore"][-4] == 0 < forces["bore"][-1]
assert imbalance < 1e-8
assert np.median(newton.reduction) < 1e-3

# ## What to try next
#
# - `MooneyRivlin(0.6, 0.15, 20.0, mean_dilatation=True)`: rubber that hardly changes its volume.
# - A wider groove, `gap=2.0`: the bore closes before the wall is reached.
# - `Coulomb(0.6)`: dry rubber. Lid and floor carry more than the middle of the seal shows.
