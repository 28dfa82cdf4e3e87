# # A roller on a shaft that tilts: standard profiles, and one for all tilts
#
# ![Profiles and lives](../docs/pictures/tilted_roller_life.png)
#
# The shaft of a roller bearing bends, and rollers of length $L$ and diameter $D$ [mm] tilt by up to three
# minutes of arc. A straight roller digs its end into the raceway. Two profiles are known by formula: that of
# ISO/TS 16281, for $L \le 2.5\,D$,
#
# $$ z = 0.00035\, D \ln\frac{1}{1 - (2y/L)^2}, $$
#
# and the logarithm of Johns and Gohar with three parameters of Fujiwara and Kawase (NTN Technical Review 75,
# 2007): the load it is made for, $K_1$ times the line load $w$ [N/mm], the part $K_2$ of the length that is
# relieved, and the relief $z_m$ of the end,
#
# $$ z = K_1 A \ln \frac{1}{1 - (1 - e^{-z_m / K_1 A})\, t^2}, \quad
#    t = \max\Bigl(0, \frac{2|y|/L - 1}{K_2} + 1\Bigr), \quad A = \frac{w}{\pi E^*}. $$
#
# The life of rolling contacts in line falls with the power 20/3 of the pressure. At the tilt $k$ a profile is
# rated by $J_k = (\frac1S \int p^{20/3} dS)^{3/20}$, and with the shares of time $\varphi_k$ of all tilts, by
# Miner's rule, by $J = (\sum \varphi_k J_k^{20/3})^{3/20}$. This compares profiles; it is no rating life.
#
# Run it with `make demo DEMO=tilted_roller NP=2`, in less than a minute with `SIZE=small`.

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    RigidPlane,
    RigidSurface,
    Scene,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
    gallery,
    materials,
    minimize,
    pictures,
    show_progress,
    theory,
)
from fenics_contact.design import BundleTrust, LargestPressure, LoadCases, Maximum, PressureNorm
from fenics_contact.output import write_optimisation_result

comm = MPI.COMM_WORLD
output = Path("output/tilted_roller")
if sys.argv[1:] not in ([], ["--size", "small"], ["--size", "full"]):
    sys.exit(f"give --size small or --size full, got {' '.join(sys.argv[1:])}")
small = "small" in sys.argv

# ## Dimensions
#
# A roller of 10 × 10 mm on a raceway of 40 mm, both of steel, with Hertz's pressure of 1500 N/mm².

length, diameter, peak = 10.0, 10.0, 1500.0  # mm, mm, N/mm²
radius = 1 / (2 / diameter + 2 / 40.0)
modulus = theory.contact_modulus(2.06e5, 0.3, 2.06e5, 0.3)
half_width = 2 * radius * peak / modulus
line_load = np.pi * half_width * peak / 2  # N/mm
unit = line_load / (np.pi * modulus)  # A, 0.7 µm
tilts = {"0′": 0.4, "1′": 0.3, "2′": 0.2, "3′": 0.1}  # shares of time

# ## Scene
#
# One elastic half space as soft as both bodies, cut at x = 0. The gap of the contact is the distance of the
# bodies, $x^2 / 2R$ and the profile. The far end moves as one piece, pressed by the load, at a given tilt.

CELLS, ENDS, GROWTH, FAR = (3, 1.5, 1.6, 3.0) if small else (4, 1.0, 1.25, 2.0)
cell, far, width = half_width / CELLS, 2 * length, 5 / 3 * half_width
x = np.append(np.arange(0.0, width - cell / 2, cell), width + gallery.growing_ticks(far, 2 * cell, FAR))
y = length / 2 - gallery.growing_ticks(length / 2, ENDS * half_width, GROWTH)[::-1]
y = np.append(y, length / 2 + gallery.growing_ticks(far, 2 * half_width, FAR)[1:])
z = -gallery.growing_ticks(far, 1.5 * cell, FAR)[::-1]
block = gallery.box_lattice([x, np.append(-y[:0:-1], y), z])
corners = abs(block.points[block.surfaces["z1"]][..., :2])
track = block.surfaces["z1"][(corners <= (width + 1e-9, length / 2 + 1e-9)).all(axis=(1, 2))]
mesh = BodyMesh(block.points, block.cells, {**block.surfaces, "track": track})
body = Body(mesh, materials.IsotropicElasticity(2.06e5 / 2, 0.3))


def scene_of(tilt: str, profile) -> Scene:
    """Return the scene of a tilt, for a profile y -> relief."""
    turned, pressed = (np.deg2rad(int(tilt[0]) / 60), 0.0, 0.0), (0, 0, line_load * length / 2)
    shaft = RigidSurface("roller", "z0", (0, 0, 0), (0.0, 0.0, None), turned, force=pressed)

    def gap(points):
        return points[:, 0] ** 2 / (2 * radius) + profile(points[:, 1])

    pair = ContactPair(Surface("roller", "track"), RigidPlane((0, 0, 0), (0, 0, -1)), gap=gap)
    return Scene({"roller": body}, [Support("roller", "x0", (0.0, None, None)), shaft], contacts=[pair])


# ## Profiles by formula


def standard(y):
    return -0.00035 * diameter * np.log(np.maximum(1 - (2 * y / length) ** 2, 1e-4))  # not infinite


def logarithmic(load, part, end):
    def profile(y):
        t = np.maximum(0.0, (2 * abs(y) / length - 1) / part + 1)
        return -load * unit * np.log(1 - (1 - np.exp(-end / (load * unit))) * t**2)

    return profile


# ## Our profile
#
# Seven variables, the same on both sides of the middle: coefficients of a polynomial in arcsin(2|y|/L), which
# can rise steeply at the ends. The first stays zero, as to move the whole roller changes nothing.

p, norm = 20 / 3, PressureNorm(p=20 / 3)
side = gallery.side_of(mesh, "track")
places = mesh.points[side.nodes, 1]
along = 2 / np.pi * np.arcsin(np.minimum(2 * abs(places) / length, 1.0))
side = replace(side, parameters=np.column_stack([side.parameters[:, 0], along]))
design = SurfaceDesign("roller", side, net=(1, 7))
bounds = -0.03 * np.append(0.0, np.ones(6)), np.zeros(7)
first = ShapeProblem(ContactProblem(scene_of("0′", np.zeros_like), comm, tolerance=1e-7), design, norm)
cases = LoadCases({tilt: first.case(scene_of(tilt, np.zeros_like)) for tilt in tilts})


def over_all(values):
    return sum(tilts[tilt] * value**p for tilt, value in values.items()) ** (1 / p)


def mean(alpha):
    """Return J and its gradient."""
    parts = cases.at(alpha).parts
    total = over_all({tilt: part.value for tilt, part in parts.items()})
    weights = {tilt: tilts[tilt] * (parts[tilt].value / total) ** (p - 1) for tilt in tilts}
    return total, sum(weights[tilt] * parts[tilt].gradient for tilt in tilts)


even = peak * (half_width / width / 2 * scipy.special.beta(0.5, p / 2 + 1)) ** (1 / p)


def figures(states):
    """Return the largest pressure over Hertz's, and J over that of his even strip, by tilt."""
    touching = {tilt: (state.contact.normal_force, state.contact.area) for tilt, state in states.items()}
    largest = {tilt: float((force / area).max()) / peak for tilt, (force, area) in touching.items()}
    return largest, {tilt: norm.of_points(*each)[0] / even for tilt, each in touching.items()}


def with_profile(profile):
    return {tilt: each.contact.solve(scene_of(tilt, profile)) for tilt, each in cases.problems.items()}


# ## The best three parameters
#
# Found without derivatives, by the method of Nelder and Mead. The small size knows them.

began, parameters, searched = time.process_time(), np.array([2.25, 0.78, 6.6e-3]), 0
if not small:
    options = {"maxfev": 60, "xatol": 1e-2, "fatol": 1e-4}
    rated = lambda logs: over_all(figures(with_profile(logarithmic(*np.exp(logs))))[1])  # noqa: E731
    search = scipy.optimize.minimize(rated, np.log([2, 0.6, 12e-3]), method="Nelder-Mead", options=options)
    parameters, searched = np.exp(search.x), search.nfev
seconds = [time.process_time() - began]
formulas = {"straight": np.zeros_like, "ISO/TS 16281": standard, "three parameters": logarithmic(*parameters)}
states = {name: with_profile(profile) for name, profile in formulas.items()}

# ## Ours: over all tilts, for each alone, and below the standard in every figure
#
# All begin with the best three parameters, as near as the polynomial comes. "Below ISO" minimises the largest
# of eight ratios: of four means and four largest pressures to those of ISO/TS 16281.

start = np.linalg.lstsq(design.basis, -formulas["three parameters"](places), rcond=None)[0]
start = np.clip(start, *bounds)
largest, means = figures(states["ISO/TS 16281"])
ratios = {
    tilt: Maximum((1 / (means[tilt] * even) * norm, 1 / (largest[tilt] * peak) * LargestPressure()))
    for tilt in tilts
}
eight = LoadCases({tilt: first.case(scene_of(tilt, np.zeros_like), ratios[tilt]) for tilt in tilts})
results = {}
with show_progress(comm):
    for name, function in {"ours": mean, "ours, below ISO": eight, **cases.problems}.items():
        tolerance = 2e-5 if name == "ours" else 1e-3
        began = time.process_time()
        results[name] = minimize(function, start, BundleTrust(tolerance=tolerance), bounds=bounds)
        seconds.append(time.process_time() - began)
states |= {name: cases.states_of(results[name].x) for name in ("ours", "ours, below ISO")}
table = {name: figures(each) for name, each in states.items()}
lives = {name: {tilt: value**-p for tilt, value in means.items()} for name, (_, means) in table.items()}
lives["best at one tilt"] = {tilt: (results[tilt].value / even) ** -p for tilt in tilts}
life = {name: over_all(means) ** -p for name, (_, means) in table.items()}

slope = mean(start)[1]
step = 1e-5 * slope / np.linalg.norm(slope)  # mm
quotient = (mean(start + step)[0] - mean(start - step)[0]) / 2e-5
gradient_error = abs(quotient / np.linalg.norm(slope) - 1)

# ## Pictures


def draw(name, xlabel, ylabel, series):
    labels = {"xlabel": xlabel, "ylabel": ylabel}
    pictures.plot_curves(series, output / f"{name}.png", **labels, connected=True, comm=comm)


upper = np.flatnonzero((mesh.points[side.nodes, 0] < 1e-9) & (places >= 0))
reliefs = {name: 1e3 * profile(places[upper]) for name, profile in formulas.items() if name != "straight"}
reliefs |= {name: -1e3 * (design.basis @ results[name].x)[upper] for name in states if name in results}
draw("profile", "2y/L", "relief (µm)", {name: (2 * places[upper] / length, z) for name, z in reliefs.items()})
by_tilt = {name: (range(4), list(lives[name].values())) for name in (*reliefs, "best at one tilt")}
draw("life", "tilt (minutes of arc)", "life over that of Hertz's even pressure", by_tilt)

# ## Result

evaluations = {"three parameters": searched} | {name: each.evaluations for name, each in results.items()}
record = {"lives": lives, "life": life, "parameters": parameters, "evaluations": evaluations}
record |= {"largest": {name: largest for name, (largest, _) in table.items()}, "gradient": gradient_error}
write_optimisation_result(results["ours"], cases, output, more=record)

if comm.rank == 0:
    ranks = "1 rank" if comm.size == 1 else f"{comm.size} ranks"
    print(f"tilted roller: {len(mesh.points)} nodes, 7 variables, {ranks}")
    print(f"largest pressure over p0 = {peak:.0f} N/mm², life over that of Hertz's even pressure")
    print(" " * 19 + "".join(f"{tilt:>14s}" for tilt in tilts) + "  all tilts")
    for name, (largest, _) in table.items():
        row = "".join(f"{largest[tilt]:8.3f}{lives[name][tilt]:6.3f}" for tilt in tilts)
        print(f"  {name:17s}{row}{life[name]:11.3f}")
    row = "".join(f"{each:14.3f}" for each in lives["best at one tilt"].values())
    print(f"  {'best at one tilt':17s}{row}")
    for (name, count), spent in zip(evaluations.items(), seconds, strict=True):
        if count:
            print(f"  {name}: {count} designs, {spent:.0f} s")
    print(f"gradient against a difference: {gradient_error:.1e}")
    print(f"pictures and files in {output}/")

# "Below ISO" is better than the standard in every figure, by 1 % at least. Ours is the best over all tilts,
# and what is made for one tilt is the best there. The best three parameters come close.

below, iso = table["ours, below ISO"], table["ISO/TS 16281"]
assert all(mine[tilt] < 0.99 * its[tilt] for mine, its in zip(below, iso, strict=True) for tilt in tilts)
assert max(life, key=life.get) == "ours"
assert all(lives["best at one tilt"][tilt] > max(lives[name][tilt] for name in table) for tilt in tilts)
assert gradient_error < 1e-3
