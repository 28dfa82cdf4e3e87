# # A shaft wears its bush
#
# ![Depth worn off around the bore](../docs/pictures/worn_bush_depth.png)
#
# ![The largest pressure falls while the bush wears](../docs/pictures/worn_bush_pressure.png)
#
# A shaft of steel of radius $R - c$ turns in a bush of bronze with a bore of radius $R$ and is pressed down
# by a force $F$ per length. Archard's law takes the depth $k\,p\,\Delta s$ off the bush where the shaft
# slides by $\Delta s$ under the pressure $p$; in one turn that is $2\pi R$ everywhere.
#
# At first the pressure is that of a round bar in a hole that is a little wider. Then the bush takes the shape
# of the shaft: once it has sunk by $\delta$, the depth at the angle $\varphi$ from the bottom is
#
# $$ w(\varphi) = \delta\cos\varphi - c\,(1 - \cos\varphi), \qquad |\varphi| < \varphi_0, \quad
# \cos\varphi_0 = \frac{c}{c + \delta}, $$
#
# but for what the bush gives way. A further turn takes $\delta' \cos\varphi = 2\pi R\,k\,p$ off, so that the
# pressure is proportional to $\cos\varphi$, and balance with the force gives
#
# $$ \frac{\mathrm d\delta}{\mathrm dN} = \frac{2\pi k F}{\varphi_0 + \sin\varphi_0\cos\varphi_0}. $$
#
# Run it with `make demo DEMO=worn_bush`, on two ranks with `make demo DEMO=worn_bush NP=2`.

from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.integrate import quad
from scipy.optimize import brentq

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    RigidSphere,
    RigidTool,
    Scene,
    Support,
    Surface,
    ToolMotion,
    Wear,
    WearLimits,
    gallery,
    materials,
    pictures,
    show_progress,
    wear_to,
    write_result,
    write_vtu,
)

comm = MPI.COMM_WORLD
output = Path("output/worn_bush")

# ## Bush and shaft
#
# Half a ring, held outside; a bar that is rigid and touches the bore at the bottom.

bore, outside, clearance = 10.0, 14.0, 0.05  # mm
force, coefficient, turns = 100.0, 1e-8, 20_000.0  # N/mm, mm²/N

flat = gallery.rectangle((bore, -np.pi), (outside, 0.0), (8, 96))
radius, angle = flat.points.T
bush = flat.moved(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))
bronze = materials.PlaneStrain(1.1e5, 0.34)  # N/mm²

at = (0.0, -clearance)
shaft = RigidTool("shaft", RigidSphere(at, bore - clearance), at=at)
turning = Wear(coefficient, sliding=2 * np.pi * bore)
scene = Scene(
    {"bush": Body(bush, bronze)},
    [Support("bush", "x1"), ToolMotion("shaft", (0.0, None), 0.0, (0.0, -force))],
    contacts=[ContactPair(Surface("bush", "x0"), shaft, wear=turning)],
)

# ## Wear
#
# Turns are followed in jumps, which are short at first and grow as the bush runs in. Two histories side by
# side say how much they err.

problem = ContactProblem(scene, comm, tolerance=1e-8)
new = problem.solve()
with show_progress(comm):
    worn = wear_to(problem, turns, follow=0.2)
    thin = wear_to(scene, 1e6, comm, follow=0.2, limits=WearLimits(depth=0.1))

# ## The same by hand
#
# A bush that gives way only by wear.


def turns_for(sunk: float) -> float:
    """Return the turns after which the shaft has sunk so far."""

    def inverse_rate(depth: float) -> float:
        half = np.arccos(clearance / (clearance + depth))
        return float((half + np.sin(half) * np.cos(half)) / (2 * np.pi * coefficient * force))

    return float(quad(inverse_rate, 0.0, sunk)[0])


sunk = float(brentq(lambda depth: turns_for(depth) - turns, 1e-6, 1.0))
half = float(np.arccos(clearance / (clearance + sunk)))
volume = 2 * bore * ((sunk + clearance) * np.sin(half) - clearance * half)
rigid_peak = force / (bore * (half + np.sin(half) * np.cos(half)))

# ## Pictures
#
# Depth and pressure around the bore.

contact = worn.state.contact
places = scene.points[contact.points.slave]
phi = np.degrees(np.arctan2(places[:, 0], -places[:, 1]))
order = np.argsort(phi)
smooth = np.linspace(-90, 90, 181)
rigid = np.maximum((sunk + clearance) * np.cos(np.radians(smooth)) - clearance, 0.0)
pictures.plot_curves(
    {"computed": (phi[order], 1e3 * worn.depth[order])},
    output / "depth.png",
    xlabel="angle from the bottom (degrees)",
    ylabel="depth worn off (µm)",
    reference={"rigid bush": (smooth, 1e3 * rigid)},
    title=f"After {turns:g} turns",
    comm=comm,
)
pictures.plot_curves(
    {
        name: (phi[order], state.contact.pressure[order])
        for name, state in {"new": new, "worn": worn.state}.items()
    },
    output / "pressure.png",
    xlabel="angle from the bottom (degrees)",
    ylabel="pressure (N/mm²)",
    title="Pressure on the bore",
    comm=comm,
)
pictures.plot_stress(worn.state, output / "stress.png", title="Stress in the worn bush")

# ## Result

deepest, peak = float(worn.depth.max()), float(contact.pressure.max())
first = float(new.contact.pressure.max())
record = {
    "volume": worn.volume[0],
    "volume_rigid": volume,
    "depth": deepest,
    "depth_error": float(worn.depth_error.max()),
    "depth_rigid": sunk,
    "pressure_rigid": rigid_peak,
    "new_pressure": first,
    "worn_pressure": peak,
    "life": thin.jumps[-1].cycles,
}
write_result(worn.state, output, more=record)
write_vtu(worn.state, output, "bush")

if comm.rank == 0:
    ranks = "1 rank" if comm.size == 1 else f"{comm.size} ranks"
    print(f"worn bush: {len(bush.points)} nodes, {len(worn.jumps)} jumps, {ranks}")
    print(worn)
    print(f"  volume        {worn.volume[0]:9.5f} mm², rigid {volume:.5f}")
    print(
        f"  depth         {1e3 * deepest:9.2f} µm ± {1e3 * record['depth_error']:.2f}, rigid {1e3 * sunk:.2f}"
    )
    print(f"  pressure      {first:9.2f} N/mm² new, {peak:.2f} worn, rigid {rigid_peak:.2f}")
    print(f"  0.1 mm after  {record['life']:9.0f} turns")
    print(f"pictures and files in {output}/")

# All is that of a rigid bush, but for half a per cent that bronze gives way.

assert abs(worn.volume[0] / volume - 1) < 0.01
assert abs(deepest / sunk - 1) < 0.01
assert abs(peak / rigid_peak - 1) < 0.01
assert record["depth_error"] < 0.01 * deepest
assert peak < 0.2 * first

# ## What to try next
#
# - `clearance = 0.2`: the shaft wears a narrow groove first.
# - `Wear(coefficient, exponent=1.5, ...)`: a law that punishes peaks.
# - Friction in place of `sliding`: let the pair have `Coulomb(0.1)`, and load steps move the shaft.
