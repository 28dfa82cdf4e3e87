# # Uncertain friction: how often does it slide, and how high is the pressure?
#
# ![Held and sliding samples](../docs/pictures/uncertain_friction_samples.png)
#
# A steel shoe with a round sole stands on a rigid floor. It is pressed by a load $P$ [N/mm] and pushed by
# inertia, $Q = 220$ N/mm. Nothing but friction holds it: it slides off where $Q > \mu P$. Neither $\mu$ nor
# $P$ is known well. Both are lognormal, with medians $\mu_0 = 0.2$, $P_0 = 1500$ N/mm and deviations of 20 %
# and 10 %, so that it slides with the probability
#
# $$ \Phi\left( \frac{\ln Q - \ln \mu_0 P_0}{\sqrt{\sigma_\mu^2 + \sigma_P^2}} \right) = 8.3\,\%. $$
#
# Where it holds, the largest pressure is about that of Hertz, $\sqrt{P E^* / (\pi R)}$ with
# $E^* = E / (1 - \nu^2)$ [MPa].
#
# The sampling is SciPy's and knows nothing of contact. It runs on rank 0 alone, while all ranks solve:
# `make demo DEMO=uncertain_friction`, on two ranks with `make demo DEMO=uncertain_friction NP=2`.

from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.stats import norm, qmc

from fenics_contact import (
    Body,
    BodyForce,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    SceneResponse,
    Status,
    Surface,
    TotalForce,
    gallery,
    materials,
    pictures,
    write_result,
    write_vtu,
)

comm = MPI.COMM_WORLD
output = Path("output/uncertain_friction")

# ## Scene by its uncertain parameters
#
# The mesh is made once: where it stays, everything that depends on it alone is kept from sample to sample.

radius, young_modulus, poisson_ratio = 20.0, 2.1e5, 0.3  # mm, N/mm²
push = 220.0  # N/mm
half, height = 4.0, 4.0  # mm; the contact will be about 0.45 mm wide on either side
growing = np.cumsum(1.15 ** np.arange(1, 17))
out = np.concatenate([np.arange(0.0, 1.2, 0.04), 1.2 + (half - 1.2) * growing / growing[-1]])
up = np.concatenate([[0.0, 0.04], 0.04 + (height - 0.04) * growing / growing[-1]])
lattice = gallery.rectangle_lattice((np.concatenate([-out[:0:-1], out]), up))
x, y = lattice.points.T
mesh = lattice.moved(np.column_stack([x, y + (1 - y / height) * x**2 / (2 * radius)]))
area = mesh.volume  # mm²; the push acts on the whole shoe, as inertia does
floor = RigidPlane((0.0, 0.0), (0.0, 1.0))


def shoe(friction: float, load: float) -> Scene:
    """Return the shoe with a coefficient of friction under a load, [N/mm]."""
    return Scene(
        bodies={"shoe": Body(mesh, materials.PlaneStrain(young_modulus, poisson_ratio))},
        loads=[TotalForce("shoe", "y1", (0.0, -load)), BodyForce("shoe", (push / area, 0.0))],
        contacts=[ContactPair(Surface("shoe", "y0"), floor, Coulomb(friction))],
    )


# ## What is asked of a state
#
# Any number that a state knows. A shoe that slides has no state: its quantities are not a number, and the
# sampling goes on.

median = {"friction": 0.2, "load": 1500.0}  # -, N/mm
quantities = {
    "largest pressure": lambda state: state.contact.pressure.max(),  # N/mm²
    "sticking points": lambda state: state.contact.count(Status.STICK),
    "closed points": lambda state: np.count_nonzero(state.contact.normal_force > 0.0),
    "imbalance": lambda state: state.balance().imbalance,
}
response = SceneResponse(shoe, median, quantities, comm, failures="nan")

# ## Samples
#
# Sobol's points fill the square evenly; the normal distribution's quantiles make them lognormal.

deviation = np.array([0.2, 0.1])
normal = norm.ppf(qmc.Sobol(2, scramble=True, seed=1).random(64))
samples = np.array(list(median.values())) * np.exp(deviation * normal)

# All ranks ask for the same samples, and have the same answers.

pressure, sticking, closed, imbalances = response.table(samples).T

# ## Slides or holds
#
# Every sample is on its side of the curve $\mu P = Q$.

friction, load = samples.T
slides = np.isnan(pressure)
expected = friction * load < push
probability = norm.cdf(np.log(push / (median["friction"] * median["load"])) / np.linalg.norm(deviation))

# ## Pictures

curve = np.linspace(load.min(), load.max(), 100)
pictures.plot_curves(
    {"holds": (load[~slides], friction[~slides]), "slides": (load[slides], friction[slides])},
    output / "samples.png",
    xlabel="load P (N/mm)",
    ylabel="coefficient of friction μ",
    reference={"μ P = Q": (curve, push / curve)},
    title=f"{np.count_nonzero(slides)} of {len(samples)} samples slide, expected {100 * probability:.1f} %",
    comm=comm,
)

# The distribution of the largest pressure among the samples that hold, compared with Hertz's.

stiffness = young_modulus / (1 - poisson_ratio**2)
hertz = np.sqrt(load * stiffness / (np.pi * radius))
rank = (np.arange(np.count_nonzero(~slides)) + 0.5) / np.count_nonzero(~slides)
pictures.plot_curves(
    {"computed": (np.sort(pressure[~slides]), rank)},
    output / "distribution.png",
    xlabel="largest pressure (MPa)",
    ylabel="share of the held samples below",
    reference={"Hertz": (np.sort(hertz[~slides]), rank)},
    title="Largest pressure",
    comm=comm,
)

# The state of the last sample that held is still there, for pictures and files.

pictures.plot_stress(response.state, output / "stress.png", title="The last sample that holds")
write_vtu(response.state, output, "last_held")

# ## Result

ratio = pressure[~slides] / hertz[~slides]
imbalance = imbalances[~slides].max()
record = {
    "samples": len(samples),
    "slide": int(np.count_nonzero(slides)),
    "probability_expected": probability,
    "largest_pressure_median": np.median(pressure[~slides]),
    "largest_pressure_95": np.quantile(pressure[~slides], 0.95),
    "hertz_median": np.median(hertz[~slides]),
    "ratio_to_hertz": [ratio.min(), ratio.max()],
    "stick_share_median": np.median(sticking[~slides] / closed[~slides]),
    "products": response.products,
}
write_result(response.state, output, more=record)
if comm.rank == 0:
    ranks = "1 rank" if comm.size == 1 else f"{comm.size} ranks"
    print(f"a shoe under {len(samples)} uncertain loads and coefficients of friction, {ranks}")
    print(f"  slides           {record['slide']:8d}     {probability * len(samples):.1f} expected")
    print(f"  largest pressure {record['largest_pressure_median']:8.1f} MPa median")
    print(f"  Hertz's          {record['hertz_median']:8.1f} MPa median")
    print(f"                   {record['largest_pressure_95']:8.1f} MPa at 95 %")
    print(f"  sticking         {100 * record['stick_share_median']:8.1f} %   of the contact, median")
    print(f"  products         {response.products:8d}     {response.products / len(samples):.1f} a sample")
    print(f"  loads, reactions and contact forces balance to {imbalance:.1e}")
    print(f"pictures and files in {output}/")

assert np.array_equal(slides, expected)
assert abs(record["slide"] / len(samples) - probability) < 2.5 / len(samples)
assert abs(np.median(ratio) - 1) < 0.02  # friction adds a little to Hertz's frictionless pressure
assert imbalance < 1e-9  # in every sample that holds

# ## What to try next
#
# - More samples, or uncertain stiffness: parameters of `shoe` are whatever its scene depends on.
# - Designs instead of loads: `fenics_contact.DesignResponse` gives a subgradient with every answer.
# - Another tool in the place of SciPy: whatever calls a Python function can drive.
