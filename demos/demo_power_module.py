# # How warm a chip gets
#
# ![Temperatures of the module](../docs/pictures/power_module_temperature.png)
#
# ![The harder it is clamped, the cooler the chip](../docs/pictures/power_module_pressure.png)
#
# A chip of silicon of 10 mm × 10 mm turns 60 W into heat. It is soldered to a plate of copper of 40 mm ×
# 40 mm, which is clamped dry on a heat sink of aluminium, which air cools. Where copper and aluminium touch,
# heat crosses the peaks of both surfaces, the more of them the harder they are pressed, and the air between.
# Cooper, Mikic and Yovanovich's law says how much: with the pressure $p$, the hardness $H$ and the roughness
# $\sigma$ with its slope $m$
#
# $$ h = 1.25\,\frac{k\,m}{\sigma}\left(\frac pH\right)^{0.95} + \frac{k_\mathrm{air}}{g_0}. $$
#
# **By hand.** Under a thin chip the flux into the copper is nearly even. In cosines over the plate,
# $\cos\frac{m\pi x}{L}\cos\frac{n\pi y}{L}$, each of which decays with
# $\kappa = \frac{\pi}{L}\sqrt{m^2+n^2}$, layers and joints are resistances in a row: a layer of thickness $t$
# and conductivity $k$ on a resistance $Z$ has
#
# $$ Z' = \frac{Z + \tanh(\kappa t)/(k\kappa)}{1 + k\kappa Z\tanh(\kappa t)}, $$
#
# a joint adds $1/h$, and air below is $Z = 1/h_\mathrm{air}$.
#
# A quarter is computed; nothing flows through planes of symmetry. Units: mm, W, degrees Celsius.
# Run it with `make demo DEMO=power_module`, on two ranks with `make demo DEMO=power_module NP=2`.

from pathlib import Path

import numpy as np
from mpi4py import MPI

from fenics_contact import BodyMesh, Surface, gallery, output, pictures, write_result, write_vtu
from fenics_contact.heat import (
    ConductingBody,
    Conductor,
    Convection,
    GapConductance,
    HeatScene,
    HeatSource,
    HeatState,
    PressureConductance,
    ThermalContact,
    harmonic_mean,
    solve_heat,
)

comm = MPI.COMM_WORLD
folder = Path("output/power_module")

# ## Bodies
#
# Fine cells under the chip, coarser ones away from it; the meshes of copper and sink do not match.

silicon, copper, aluminium = 0.12, 0.39, 0.2  # W/(mm K)
chip_size, size = 5.0, 20.0  # mm, halves
chip_height, copper_height, sink_height = 0.2, 3.0, 10.0  # mm


def along(cells: int, growth: float) -> np.ndarray:
    """Return lines of a mesh: cells of one size up to the edge of the chip, growing ones beyond."""
    edge = np.linspace(0.0, chip_size, cells + 1)
    return np.append(edge, chip_size + gallery.growing_ticks(size - chip_size, edge[1], growth)[1:])


def layer(bottom: float, height: float, cells: int, lines: np.ndarray) -> BodyMesh:
    """Return the mesh of a plate."""
    return gallery.box_lattice([lines, lines, np.linspace(bottom, bottom + height, cells + 1)])


near, far = along(10, 1.25), along(6, 1.3)
middle, top = sink_height, sink_height + copper_height
bodies = {
    "sink": ConductingBody(layer(0.0, sink_height, 6, far), Conductor(aluminium)),
    "copper": ConductingBody(layer(middle, copper_height, 5, near), Conductor(copper)),
    "chip": ConductingBody(layer(top, chip_height, 2, np.linspace(0.0, chip_size, 16)), Conductor(silicon)),
}

# ## Joints, heat and air
#
# Solder is a film: 0.1 mm of 0.05 W/(mm K).

solder, film, air = 0.05 / 0.1, 1e-3, 25.0  # W/(mm² K), W/(mm² K), °C
power = 60.0 / 4.0  # W, of a quarter
rough = PressureConductance.cooper_mikic_yovanovich(
    harmonic_mean(copper, aluminium), 1100.0, roughness=2e-3, slope=0.15
)
dry = rough + GapConductance(2.6e-5, least_gap=1e-2)
source = HeatSource("chip", power / (chip_size**2 * chip_height))
cooling = Convection("sink", "z0", film, ambient=air)
soldered = ThermalContact(Surface("chip", "z0"), Surface("copper", "z1"), solder)


def clamped(pressure: float) -> HeatState:
    """Return the temperatures of the module that is clamped with a pressure, in N/mm²."""
    joint = ThermalContact(Surface("copper", "z0"), Surface("sink", "z1"), dry, pressure=pressure)
    return solve_heat(HeatScene(bodies, loads=[source, cooling], contacts=[soldered, joint]), comm)


pressures = [0.02, 0.1, 0.5, 2.0]
states = {pressure: clamped(pressure) for pressure in pressures}
state = states[0.5]


def mean_of_chip(found: HeatState) -> float:
    """Return the mean temperature of the chip."""
    temperature, mesh = found.temperature["chip"], bodies["chip"].mesh
    return float(temperature[mesh.cells].mean())


# ## The same by hand


def joint_conductance(pressure: float) -> float:
    """Return h between copper and sink."""
    k = 2 * copper * aluminium / (copper + aluminium)
    return float(1.25 * k * 0.15 / 2e-3 * (pressure / 1100.0) ** 0.95 + 2.6e-5 / 1e-2)


def by_hand(pressure: float, waves: int = 400) -> float:
    """Return the mean temperature of the chip by the series."""
    number = np.arange(waves)
    share = np.sinc(number * chip_size / size)  # mean of each cosine over the chip
    m, n = np.meshgrid(number, number, indexing="ij")
    kappa = np.maximum(np.pi / size * np.hypot(m, n), 1e-9)
    Z = np.full_like(kappa, 1.0 / film)
    for height, k, joint in (
        (sink_height, aluminium, joint_conductance(pressure)),
        (copper_height, copper, solder),
    ):
        bend = np.tanh(kappa * height)
        Z = (Z + bend / (k * kappa)) / (1.0 + k * kappa * Z * bend)
        if k == aluminium:
            Z = Z + 1.0 / joint
    twice = np.where(m > 0, 2.0, 1.0) * np.where(n > 0, 2.0, 1.0)
    spread = power / size**2 * float((twice * np.outer(share, share) ** 2 * Z).sum())
    flux = power / chip_size**2
    return air + spread + flux / solder + flux * chip_height / (3 * silicon)


# ## Pictures and files

units = pictures.Units(temperature="°C")
pictures.plot_field(
    state, "temperature", folder / "temperature.png", title="A quarter of the module", units=units
)
pictures.plot_field(
    state, "heat_flux", folder / "flux.png", bodies=["copper", "sink"], title="Under the chip", units=units
)
pictures.plot_field(
    state,
    "contact_temperature_jump",
    folder / "jump.png",
    bodies=["copper"],
    clip=((0.0, 0.0, middle + 0.1), (0.0, 0.0, 1.0)),
    units=units,
)
line = np.geomspace(0.01, 3.0, 40)
pictures.plot_curves(
    {"computed": (pressures, [mean_of_chip(each) for each in states.values()])},
    folder / "pressure.png",
    xlabel="pressure of the clamp (N/mm²)",
    ylabel="mean temperature of the chip (°C)",
    reference={"by hand": (line, [by_hand(each) for each in line])},
    title="The harder the module is clamped, the cooler the chip",
    comm=comm,
)
write_vtu(state, folder, "module")
output.write_contact_table(state, folder / "joints.csv")
output.write_heat_balance(list(states.values()), folder / "balance.csv", pressures)

# ## Result

found = {pressure: mean_of_chip(each) for pressure, each in states.items()}
hand = {pressure: by_hand(pressure) for pressure in pressures}
joint = state.contacts[1]
record = {
    "chip": list(found.values()),
    "by_hand": list(hand.values()),
    "hottest": float(state.temperature["chip"].max()),
    "joint_resistance": float((joint.heat @ joint.jump) / joint.total / (4 * joint.total)),
}
write_result(state, folder, more=record)

if comm.rank == 0:
    ranks = "1 rank" if comm.size == 1 else f"{comm.size} ranks"
    print(f"power module: {len(state.values)} temperatures, {state.products} products, {ranks}")
    for pressure in pressures:
        print(f"  {pressure:5.2f} N/mm²: chip {found[pressure]:7.3f} °C, by hand {hand[pressure]:7.3f} °C")
    print(f"  hottest point {record['hottest']:.2f} °C, joint {record['joint_resistance']:.4f} K/W")
    print(state.balance)
    print(f"pictures and files in {folder}/")

for pressure in pressures:
    assert abs(found[pressure] - hand[pressure]) < 0.01 * (hand[pressure] - air)
    assert states[pressure].balance.error < 1e-9
assert list(found.values()) == sorted(found.values(), reverse=True)

# ## What to try next
#
# - Grease in the joint: `GapConductance(2e-3, least_gap=2e-2)` in place of air.
# - A copper plate of 1 mm: the heat spreads less, and `flux.png` shows it.
# - `Convection("sink", "z0", ...)` with a `TemperatureTable`: air that rises cools better where it is hot.
