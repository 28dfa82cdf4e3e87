"""One scene in several systems of units, and sizes from a nanometre to a thousand kilometres."""

from __future__ import annotations

from functools import partial

from fenics_contact import Coulomb
from tests.scenes import two_blocks
from tools.hard_cases.transform import in_units
from tools.hard_cases.trial import Answer, Trial, cut_trial, trial

GROUP = "units"
#: What is one of the gallery's lengths and forces: blocks of metres, moduli of 100 and 300 GPa.
SYSTEMS = {
    "MPa and mm": (1e3, 1e9),
    "Pa and m": (1.0, 1e9),
    "GPa and km": (1e-3, 1e-6),
    "psi and inch": (39.3700787, 224808943.0),
}


def in_system(length: float, force: float) -> Trial:
    """The two blocks in one system, and as twins in all others; its own figures are not scaled."""
    scene = two_blocks(Coulomb(0.38))

    def twin(other_length: float, other_force: float) -> Answer:
        found = Answer.of(cut_trial(in_units(scene, other_length, other_force)).solve())
        return found.in_units(length / other_length, force / other_force)

    twins = {name: partial(twin, *system) for name, system in SYSTEMS.items() if system != (length, force)}
    return cut_trial(in_units(scene, length, force), twins=twins, other=None, agreement=1e-8, ranks=())


for _name, (_length, _force) in SYSTEMS.items():
    trial(GROUP, f"two blocks in {_name}, the same as in the other three")(
        partial(in_system, _length, _force)
    )

for _length, _words in ((1e-9, "nanometres in metres"), (1e6, "a thousand kilometres in metres")):
    trial(GROUP, f"blocks of {_words} and Pa")(partial(in_system, _length, _length**2 * 1e9))
