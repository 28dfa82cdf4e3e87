# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # What accuracy costs in time
#
# How fine must the mesh be, how strict the tolerance, for 1 % in the peak pressure? A *study* answers from
# measurements: it solves one scene with many settings, each in a process of its own, and compares what it
# finds with theory or, where there is none, with what the meshes converge to. This notebook reads studies
# that were stored with the project, shows how to read their figures, and runs a small one.
#
# On the command line the same is `python -m fenics_contact accuracy hertz`, and `make studies` for all.

# %%
from pathlib import Path

from fenics_contact.study import Errors, read_study

above = (Path.cwd(), *Path.cwd().parents)
folder = next(path / "docs" / "studies" for path in above if (path / "docs" / "studies").is_dir())
hertz = read_study(folder / "hertz")
errors = Errors(hertz)
print(f"{hertz.scene.title}: {len(hertz.good)} runs on {hertz.ranks} rank(s)")

# %% [markdown]
# ## Error against time
#
# ![Error against time](../docs/studies/hertz/accuracy.png)
#
# Each symbol is a run: further left is faster, further down is better. Along a line only the mesh becomes
# finer. The rings mark the Pareto front: every other run is beaten by one of them in time and in accuracy.
# Two questions to ask of such a figure:
#
# 1. *Do two lines lie on each other?* Then the setting in which they differ buys nothing. A tolerance far
#    below the error of the mesh is of this kind.
# 2. *Does a line stop falling?* Then something else than the mesh limits it. Contact by nodes on meshes
#    that do not match is of this kind: its forces cannot represent an even pressure, however fine the
#    mesh is.
#
# The numbers behind the figure:

# %%
base = hertz.base
for parameters in (errors.strictest(base), base):
    name = "balanced" if parameters.balanced else f"{parameters.tolerance:g}"
    print(f"tolerance {name}: cells on the radius, seconds, error of the peak pressure")
    for run in errors.sequence(parameters):
        print(f"  {run.parameters.size:3d} {run.seconds:8.2f} {errors.of(run, 'peak pressure'):9.2%}")

# %% [markdown]
# ## Convergence
#
# ![Convergence](../docs/studies/hertz/convergence.png)
#
# Theory gives a slope, $\text{error} \sim h^p$: $p = 1$ for linear elements in energy norm, $p = 2$ for the
# energy itself. Where a singularity is in the way, at the end of a clamped edge for instance, $p$ is
# smaller, and the studies say so. The peak pressure is one number at one point and need not converge
# monotonically: where a study cannot extrapolate, it says why.

# %%
for quantity in hertz.scene.quantities:
    reference = errors.references[quantity.name]
    rate = errors.rate(errors.strictest(base), quantity.name)
    found = "none" if rate is None else f"{rate:.2f}"
    theory = "-" if quantity.rate is None else f"{quantity.rate:g}"
    print(f"{quantity.name:16s} against {reference.kind:13s} rate {found:5s} theory {theory}", reference.note)

# %% [markdown]
# ## What the error consists of
#
# ![Parts of the error](../docs/studies/cattaneo_mindlin/parts.png)
#
# Every state carries its own errors, relative and in energy norm: `state.errors.algebraic` is a
# certificate, an upper bound of what the solver left; `state.errors.friction` is what is missing to
# Coulomb's law; `state.errors.discretisation` estimates what the mesh cannot represent. By default the
# solver stops as soon as its part is a tenth of that of the mesh. The crosses are true errors, against a
# solution with a residual of $10^{-11}$ on the same mesh: no certificate may lie below its cross.

# %%
ratios = [
    run.parts["algebraic"] / run.true_errors["algebraic"]
    for run in hertz.good
    if run.parts["algebraic"] and run.true_errors
]
print(f"certificate over true error: {min(ratios):.2f} to {max(ratios):.2f} in {len(ratios)} runs")
assert min(ratios) >= 1.0 - 1e-2  # the exact solution is known to some digits only

# %% [markdown]
# ## Advice
#
# What the runs say, in words. A run is recommended only if all runs that are finer and stricter reach the
# accuracy, too: an error that passes through zero is no merit.

# %%
from fenics_contact.study.advice import advice

print("\n".join(advice(errors, targets=(0.05, 0.01))))

# %% [markdown]
# ## A study of one's own
#
# A scene is a function from settings to a `Problem`, with quantities to measure and what theory knows of
# them. Every run has a process of its own, which reads the scene from a file. Here a plate with pressure on
# its upper edge is pressed on a rigid floor; it becomes shorter by $p L (1 - \nu^2) / E$ where its sides
# are guided in plane stress, exactly, on every mesh.

# %%
SCENE = '''
from fenics_contact.geometry import rectangle
from fenics_contact.scene import (
    Body, ContactPair, PlaneStress, RigidPlane, Scene, Support, Surface, Traction,
)
from fenics_contact.study import BALANCED, Parameters, Problem, Quantity, StudyScene, Sweep

E, NU, PRESSURE = 1000.0, 0.3, 10.0  # N/mm²


def build(parameters, comm):
    mesh = rectangle((0.0, 0.0), (1.0, 1.0), (parameters.size, parameters.size), parameters.cell)
    sides = [Support("plate", side, (0.0, None)) for side in ("x0", "x1")]
    floor = ContactPair(Surface("plate", "y0"), RigidPlane((0.0, 0.0), (0.0, 1.0)))
    load = Traction("plate", "y1", (0.0, -PRESSURE))
    return Problem(Scene({"plate": Body(mesh, PlaneStress(E, NU))}, sides, [load], [floor]))


def shortening(outcome):
    return -float(outcome.state.gather_displacement("plate")[:, 1].min())


sweep = Sweep(Parameters(4, "quadrilateral"), sizes=(2, 4, 8), tolerances=(1e-2, 1e-8, BALANCED))
study = StudyScene(
    "plate", "A plate on a floor", build,
    (Quantity("shortening", "mm", shortening, PRESSURE * (1 - NU**2) / E),), sweep, sweep,
)
'''

# %%
from fenics_contact.study import Settings, run_study, write_report

output = Path("output/notebooks/plate")
output.mkdir(parents=True, exist_ok=True)
(output / "plate.py").write_text(SCENE)
plate = run_study(str(output / "plate.py"), output / "runs", settings=Settings(repeats=1))
for sentence in write_report(output, plate):
    print(sentence)

# %% [markdown]
# The mesh represents this solution exactly: only the tolerance is left to err.

# %%
worst = max(Errors(plate).of(run, "shortening") for run in plate.good if run.parameters.tolerance == 1e-8)
print(f"largest error at a tolerance of 1e-8: {worst:.1e}")
assert len(plate.good) == len(plate.runs) == 9
assert worst < 1e-6

# %% [markdown]
# ## What to try next
#
# - `python -m fenics_contact accuracy hertz --quick`, about a minute; `--ranks 2` on two ranks.
# - `--sizes 4 8 --tolerances 1e-3 1e-6 balanced` for one question only.
# - Stop a study with Ctrl-C and start it again: what was measured is not measured twice.
