# # A hub shrunk onto a shaft: pressure, and the torque it transmits
#
# ![Torque over twist](../docs/pictures/shrink_fit_torque.png)
#
# A hub is put onto a shaft of the same radius $b$ [mm] while it is hot. As it cools by $\Delta T$ [K] it
# would shrink by $\alpha\,\Delta T\,b$; the shaft is in its way, and they press each other with Lamé's
# pressure $p$ [MPa]:
#
# $$ p = \frac{\alpha\,\Delta T}{C_h + C_s}, \qquad
#    C_h = \frac{1}{E}\Bigl(\frac{c^2 + b^2}{c^2 - b^2} + \nu\Bigr), \qquad
#    C_s = \frac{1 - \nu^2}{E}\,\frac{1 - a^2/b^2}{(1 + \nu) + (1 - \nu)\,a^2/b^2} $$
#
# for a thin disc (plane stress), a free rim of radius $c$ and a shaft that is bonded to a rigid arbor of
# radius $a$. Friction then transmits a torque per unit of thickness [N mm/mm] up to $T = \mu\,p\,2\pi b^2$,
# beyond which the hub slips.
#
# Run it with `make demo DEMO=shrink_fit`, on two ranks with `make demo DEMO=shrink_fit NP=2`.

from pathlib import Path

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    Scene,
    Support,
    Surface,
    ThermalStrain,
    Tie,
    materials,
    pictures,
    show_progress,
    solve_steps,
    write_result,
)
from fenics_contact.output import ResultSeries

comm = MPI.COMM_WORLD
output = Path("output/shrink_fit")

# ## Rings
#
# Three rings, one in the other: shaft, hub and a soft mount around the hub.

arbor, seat, rim, housing = 10.0, 30.0, 60.0, 70.0  # mm
AROUND = 96


def ring(inner: float, outer: float, through: int) -> BodyMesh:
    """Mesh a ring with ``AROUND`` cells around it; surfaces "inner" and "outer"."""
    radii, angles = np.linspace(inner, outer, through + 1), 2 * np.pi * np.arange(AROUND) / AROUND
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    number = np.arange((through + 1) * AROUND).reshape(through + 1, AROUND)
    ahead = np.roll(number, -1, axis=1)
    cells = np.stack([number[:-1], number[1:], ahead[1:], ahead[:-1]], axis=-1).reshape(-1, 4)
    surfaces = {
        "inner": np.column_stack([ahead[0], number[0]]),
        "outer": np.column_stack([number[-1], ahead[-1]]),
    }
    return BodyMesh((radii[:, None, None] * circle).reshape(-1, 2), cells, surfaces)


# ## Scene
#
# The mount of hard rubber only keeps the hub from turning with the shaft: it is so much softer than steel
# that it hardly changes the pressure. It is bonded to the hub and held at the housing. Nodes of shaft and hub
# face each other.

friction_coefficient = 0.1
steel = materials.PlaneStress(young_modulus=2.1e5, poisson_ratio=0.3, thermal_expansion=1.2e-5)  # N/mm², 1/K
rubber = materials.PlaneStress(young_modulus=60.0, poisson_ratio=0.45)
scene = Scene(
    bodies={
        "shaft": Body(ring(arbor, seat, 10), steel),
        "hub": Body(ring(seat, rim, 14), steel),
        "mount": Body(ring(rim, housing, 4), rubber),
    },
    contacts=[ContactPair(Surface("hub", "inner"), Surface("shaft", "outer"), Coulomb(friction_coefficient))],
    ties=[Tie(Surface("mount", "inner"), Surface("hub", "outer"))],
)

# ## Load steps
#
# First the hub cools by 60 K, then the arbor turns forth and back, step by step.


def held(angle: float) -> list[Support]:
    """Turn the arbor by an angle (small, in radians) and hold the housing."""
    turned = (lambda x: -angle * x[:, 1], lambda x: angle * x[:, 0])
    return [Support("shaft", "inner", turned), Support("mount", "outer", (0.0, 0.0))]


cooling = 60.0  # K
angles = np.concatenate([np.linspace(0.0, 0.016, 9), np.linspace(0.016, -0.008, 13)[1:]])  # rad
shrunk = [ThermalStrain("hub", -cooling)]
steps = [LoadStep(f"{angle:g}", loads=shrunk, supports=held(angle)) for angle in angles]
with show_progress(comm):
    states = solve_steps(ContactProblem(scene, comm, tolerance=1e-6), steps)

# ## Lamé
#
# The formulas above, and the torque that the pressure holds.

young, nu, ratio = steel.young_modulus, steel.poisson_ratio, (arbor / seat) ** 2
hub = ((rim**2 + seat**2) / (rim**2 - seat**2) + nu) / young
shaft = (1 - nu**2) / young * (1 - ratio) / ((1 + nu) + (1 - nu) * ratio)
pressure = steel.thermal_expansion * cooling / (hub + shaft)
limit = friction_coefficient * pressure * 2 * np.pi * seat**2

# Found: the mean pressure, and the moment of the contact forces on the hub about the axis.

fitted = states[0].contact
found_pressure = fitted.normal_force.sum() / (2 * np.pi * seat)
place = scene.points[fitted.points.slave]
around = np.column_stack([-place[:, 1], place[:, 0]])
torques = np.array([np.sum(around * state.contact.force) for state in states])

# ## Pictures

turned = int(np.argmax(angles))
bound = 1e-3 * np.array([limit, limit])
pictures.plot_curves(
    {"computed": (1e3 * angles, 1e-3 * torques)},
    output / "torque.png",
    xlabel="angle of the arbor (mrad)",
    ylabel="torque (kN mm/mm)",
    reference={
        "μ p 2π b²": (1e3 * angles[[-1, turned]], bound),
        "−μ p 2π b²": (1e3 * angles[[-1, turned]], -bound),
    },
    connected=True,
    title=f"Torque of a shrink fit, Lamé's pressure {pressure:.1f} MPa",
    comm=comm,
)

# Stress when fitted and when turned, and pressure and friction along the seat.

pictures.plot_stress(states[0], output / "stress_fitted.png", title="Fitted")
pictures.plot_stress(states[turned], output / "stress_turned.png", title="Turned until it slips", scale=1.0)
pictures.plot_contact_pressure(states[turned], output / "contact.png", title="All of the seat slips")
pictures.plot_decomposition(scene, scene.partition(comm.size), output / "decomposition.png", comm=comm)

# ## Files for ParaView
#
# All steps as a film: open `turning.pvd`.

series = ResultSeries(output, "turning", comm)
for number, state in enumerate(states):
    series.add(state, number, f"turned by {angles[number]:g} rad")

# ## Result

found_limit = float(np.abs(torques).max())
record = {
    "pressure": found_pressure,
    "pressure_lame": pressure,
    "torque_limit": found_limit,
    "torque_limit_theory": limit,
    "angle": angles,
    "torque": torques,
}
write_result(states[-1], output, more=record)
imbalance = max(state.balance().imbalance for state in states)

# Every rank has the same numbers; one prints them.

if comm.rank == 0:
    ranks = "1 rank" if comm.size == 1 else f"{comm.size} ranks"
    counts = states[0].counts
    print(f"shrink fit: {counts['torn_unknowns']} unknowns in {counts['subdomains']} subdomains, {ranks}")
    print("                  computed     theory      error")
    print(
        f"  pressure      {found_pressure:10.3f} {pressure:10.3f} {found_pressure / pressure - 1:10.2%}   MPa"
    )
    print(f"  torque limit  {found_limit:10.0f} {limit:10.0f} {found_limit / limit - 1:10.2%}   N mm/mm")
    print(f"  loads, reactions and contact forces balance to {imbalance:.1e}")
    print(f"pictures and files in {output}/")

# Lamé's pressure, and the torque that it holds, to 1 %. The reactions of arbor and housing balance, forces
# and moments, to rounding.

assert abs(found_pressure / pressure - 1) < 0.01
assert abs(found_limit / limit - 1) < 0.01
assert imbalance < 1e-9

# ## What to try next
#
# - `PlaneStrain` for a long shaft: in the formulas $E/(1 - \nu^2)$ takes the place of $E$, $\nu/(1 - \nu)$
#   that of $\nu$, and $(1 + \nu)\,\alpha$ that of $\alpha$.
# - A harder mount: as the hub shrinks, the mount pulls at its rim, and the pressure falls.
# - `Coulomb(0.05)`: it slips at half of the torque.
# - No temperature, but the overlap that it would cause:
#   `ContactPair(..., interference=steel.thermal_expansion * cooling * seat)`.
