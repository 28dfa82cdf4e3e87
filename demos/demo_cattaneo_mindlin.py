# # Two cylinders pressed and sheared: the contact of Cattaneo and Mindlin
#
# ![Pressure and tangential traction](../docs/pictures/cattaneo_mindlin_traction.png)
#
# Two equal long cylinders are pressed together by the force $P$ [N/mm] and then sheared by $Q < \mu P$. They
# do not slide off: the edges of the contact slip, its middle $|x| < c$ still sticks. With Hertz's half width
# $a$ [mm] and peak pressure $p_0$ [MPa] the tangential traction $q$ [MPa] is
#
# $$ q(x) = \mu p_0 \Bigl[ \sqrt{1 - x^2/a^2} - \frac{c}{a} \sqrt{1 - x^2/c^2} \Bigr], \qquad
#    \frac{c}{a} = \sqrt{1 - \frac{Q}{\mu P}}, $$
#
# the second root only where $|x| < c$ (Cattaneo 1938, Mindlin 1949; Johnson, Contact Mechanics, section 7.2).
#
# Run it with `make demo DEMO=cattaneo_mindlin`, on two ranks with `make demo DEMO=cattaneo_mindlin NP=2`.

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
from fenics_contact.fatigue import Findley, assess_cycle
from fenics_contact.output import ResultSeries

comm = MPI.COMM_WORLD
output = Path("output/cattaneo_mindlin")

# ## Bodies
#
# The formulas hold where pressing shifts the surfaces by equal ways, so that it calls for no friction, and
# where shear changes no pressure. Two bodies of the same material that mirror each other do that exactly,
# even if they are no half planes. So only the middle of the cylinders is meshed, 30 times as wide as the
# contact: blocks with a round face of radius $R$.

radius, size = 2000.0, 30.0  # mm; the contact will be about 1 mm wide on either side


def ticks(fine: float, cell: float) -> np.ndarray:
    """Return equal cells up to ``fine``, then cells that grow by a tenth each up to ``size``, from zero."""
    growing = np.cumsum(1.1 ** np.arange(1, round(np.log1p(0.1 * (size - fine) / cell) / np.log(1.1))))
    return np.concatenate([np.arange(0.0, fine, cell), fine + (size - fine) * growing / growing[-1]])


def half(side: float) -> BodyMesh:
    """Mesh the upper body (side 1) or the lower one (side −1), round where they face each other."""
    across, down = ticks(1.25, 1 / 24), ticks(1 / 12, 1 / 24)
    lines = np.concatenate([-across[:0:-1], across]), down if side > 0 else -down[::-1]
    mesh = gallery.rectangle_lattice(lines)
    x, y = mesh.points.T
    return mesh.moved(np.column_stack([x, y + side * x**2 / (2 * radius) * (1 - np.abs(y) / size)]))


# ## Scene
#
# Steel would do the same at other forces: only $\mu$ and the ratio $Q/P$ matter for the shape of $q$.

friction_coefficient = 0.4
material = materials.PlaneStrain(young_modulus=1000.0, poisson_ratio=0.3)  # N/mm²
scene = Scene(
    bodies={"upper": Body(half(1.0), material), "lower": Body(half(-1.0), material)},
    contacts=[ContactPair(Surface("upper", "y0"), Surface("lower", "y1"), Coulomb(friction_coefficient))],
)

# ## Load steps
#
# The far edges are moved: pressed by 0.002 mm, then sheared in three steps. How much $P$ and $Q$ that takes
# depends on the size of the blocks, because a line load on a half plane shifts everything by an amount that
# grows with the logarithm of the size. The tractions do not know about it: they belong to the measured $P$
# and $Q$.

# In the end it is sheared back and forth again, which is a cycle.

shifts = {"pressed": 0.0, "sheared a little": 0.0004, "sheared": 0.00075, "sheared more": 0.00105}  # mm
base = Support("lower", "y0", (0.0, 0.0))
both = {"sheared back": -0.00105, "sheared again": 0.00105}
steps = [
    LoadStep(name, supports=[base, Support("upper", "y1", (shift, -0.00205))])
    for name, shift in (shifts | both).items()
]
with show_progress(comm):
    solved = solve_steps(ContactProblem(scene, comm, tolerance=1e-6), steps)
    *first, back, again = solved
states = dict(zip(shifts, first, strict=True))

# ## Theory for measured forces
#
# Two cylinders of radius $R$ touch like one of $R/2$ on a plane.

stiffness = material.young_modulus / (2 * (1 - material.poisson_ratio**2))
force = states["pressed"].contact.normal_force.sum()
half_width = np.sqrt(2 * force * radius / (np.pi * stiffness))
peak = 2 * force / (np.pi * half_width)


def ellipse(x: np.ndarray, a: float) -> np.ndarray:
    """Return √(1 − x²/a²), zero outside."""
    return np.sqrt(np.maximum(0.0, 1 - (x / a) ** 2))


def theory(x: np.ndarray, ratio: float) -> np.ndarray:
    """Return q(x) for Q/(μP) = ``ratio``, [MPa]."""
    c = half_width * np.sqrt(1 - ratio)
    return friction_coefficient * peak * (ellipse(x, half_width) - c / half_width * ellipse(x, c))


# ## Stick width
#
# Inside the stick zone $(\mu p - q)^2$ falls with $x^2$ along a straight line that ends at $c^2$: fitted to
# the nodes that stick, it measures $c$ better than counting them.

place = scene.points
place = place[states["pressed"].contact.points.slave, 0]
found = {}
for name, state in list(states.items())[1:]:
    contact = state.contact
    sticks = contact.status == Status.STICK
    traction = np.abs(contact.friction_force[:, 0]) / contact.points.area
    reserve = (friction_coefficient * contact.pressure - traction)[sticks]
    slope, start = np.polyfit(place[sticks] ** 2, reserve**2, 1)
    ratio = abs(contact.friction_force.sum()) / (friction_coefficient * contact.normal_force.sum())
    found[name] = (ratio, np.sqrt(-start / slope), half_width * np.sqrt(1 - ratio))

# ## Pictures
#
# All tractions over the contact, compared with theory.

order = np.argsort(place)
order = order[np.abs(place[order]) < 1.2 * half_width]
x = np.linspace(-1.2 * half_width, 1.2 * half_width, 801)
curves = {"pressure × μ": (place[order], friction_coefficient * states["pressed"].contact.pressure[order])}
known = {"Hertz × μ": (x, friction_coefficient * peak * ellipse(x, half_width))}
for name, (ratio, _, _) in found.items():
    contact = states[name].contact
    traction = np.abs(contact.friction_force[:, 0]) / contact.points.area
    curves[f"q, Q = {ratio:.2f} μP"] = (place[order], traction[order])
    known[f"theory, {ratio:.2f}"] = (x, theory(x, ratio))

# Symbols are nodes, lines are theory. Of one step also what each point does and which way it slips, and the
# stress around the contact.
#
# ![Pressure, traction and slip](../docs/pictures/cattaneo_mindlin_contact.png)

pictures.plot_curves(
    curves,
    output / "traction.png",
    xlabel="x (mm)",
    ylabel="traction (MPa)",
    reference=known,
    title="Pressed and sheared cylinders",
    comm=comm,
)
last = states["sheared"]
pictures.plot_contact_pressure(last, output / "contact.png", title="Sheared cylinders")
pictures.plot_stress(last, output / "stress.png", scale=1.0, title="Sheared cylinders")

# ## Fatigue
#
# Over the cycle of shear the pressure does not change, and $q$ and the stress $\sigma$ along the surface
# change their sign. The amplitude of shear on the critical plane, Findley's parameter for $k = 0$, is that of
# Mohr's circle, with the surface stress of the two ellipses of $q$:
#
# $$ \tau_a = \sqrt{\tfrac14 \sigma^2 + q^2}, \qquad
#    \sigma = -2 \mu p_0 \Bigl[ g(x/a) - \frac{c}{a} g(x/c) \Bigr], \qquad
#    g(s) = s \mp \sqrt{s^2 - 1} \text{ outside, } s \text{ inside.} $$
#
# In the slip zones it is the same everywhere, $\mu p_0 \sqrt{Q/(\mu P)}$; the guide has a page on
# [fatigue](../docs/guide/fatigue.md).
#
# ![Shear amplitude along the surface](../docs/pictures/cattaneo_mindlin_fatigue.png)


def of_ellipse(s: np.ndarray) -> np.ndarray:
    """Return g, the surface stress of an ellipse of shear."""
    return s - np.sign(s) * np.sqrt(np.maximum(0.0, s**2 - 1))


def amplitude(x: np.ndarray, ratio: float) -> np.ndarray:
    """Return τ_a for shear to and fro of Q/(μP) = ``ratio``, [MPa]."""
    c = half_width * np.sqrt(1 - ratio)
    along = of_ellipse(x / half_width) - c / half_width * of_ellipse(x / c)
    return np.hypot(friction_coefficient * peak * along, theory(x, ratio))


def near(points: np.ndarray) -> np.ndarray:
    """Choose the nodes on the lower surface around the contact."""
    on_surface = np.isin(np.arange(len(points)), scene.bodies["lower"].mesh.surfaces["y1"])
    return on_surface & (np.abs(points[:, 0]) < 1.6 * half_width)


damage = assess_cycle([first[-1], back, again], Findley(0.0), ["lower"], where=near)
surface = near(damage.points["lower"])
along = damage.points["lower"][surface, 0]
shear = damage.planes["lower"].parameter[surface]
ratio = found["sheared more"][0]
slipping = friction_coefficient * peak * np.sqrt(ratio)
x = np.linspace(-1.6 * half_width, 1.6 * half_width, 801)
pictures.plot_curves(
    {"nodes": (np.sort(along), shear[np.argsort(along)])},
    output / "fatigue.png",
    xlabel="x (mm)",
    ylabel="shear amplitude (MPa)",
    reference={f"theory, Q = ±{ratio:.2f} μP": (x, amplitude(x, ratio))},
    title="Fatigue of sheared cylinders",
    comm=comm,
)
off = np.sqrt(np.mean((shear - amplitude(along, ratio)) ** 2)) / slipping

# ## Files for ParaView
#
# The steps one after the other: open `shear.pvd`.

series = ResultSeries(output, "shear", comm)
for number, (name, state) in enumerate(states.items()):
    series.add(state, number, name)

# ## Result

error = max(abs(measured / exact - 1) for _, measured, exact in found.values())
record = {
    "normal_force": force,
    "half_width": half_width,
    "peak_pressure": peak,
    "shear_ratio": [values[0] for values in found.values()],
    "stick_half_width": [values[1] for values in found.values()],
    "stick_half_width_theory": [values[2] for values in found.values()],
    "largest_error": error,
    "shear_amplitude": damage.largest,
    "shear_amplitude_theory": slipping,
}
write_result(last, output, more=record)
imbalance = max(state.balance().imbalance for state in states.values())

# Every rank has the same numbers; one prints them.

if comm.rank == 0:
    ranks = "1 rank" if comm.size == 1 else f"{comm.size} ranks"
    counts = last.counts
    print(f"cylinders: {counts['torn_unknowns']} unknowns in {counts['subdomains']} subdomains, {ranks}")
    print(f"  P = {force:.4f} N/mm, a = {half_width:.4f} mm, p0 = {peak:.4f} MPa")
    print("  Q/(μP)      stick half width c (mm)")
    print("              computed     theory      error")
    for ratio, measured, exact in found.values():
        print(f"  {ratio:6.4f} {measured:13.4f} {exact:10.4f} {measured / exact - 1:10.2%}")
    print(f"  shear to and fro: largest amplitude {damage.largest:.4f} MPa, theory {slipping:.4f} MPa")
    print(f"  loads, reactions and contact forces balance to {imbalance:.1e}")
    print(f"pictures and files in {output}/")

# Stick width and largest shear amplitude to 2 %, and that of all nodes to 3 % (rms), as meshes round off the
# edges. Reactions and forces of contact balance, forces and moments, to rounding.

assert error < 0.02
assert abs(damage.largest / slipping - 1) < 0.02
assert off < 0.03
assert imbalance < 1e-9

# ## What to try next
#
# - Shear back: slip begins at the edges again, in the other direction, and leaves locked traction behind.
# - Cells of 1/48 mm: the error of $c$ falls at least as fast as the size of the cells.
# - Another material below: pressing alone makes the surfaces slip, and the formulas no longer hold.
