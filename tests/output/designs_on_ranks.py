"""Write a designed body on all ranks together; the argument is the folder."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from fenics_contact.output import CadError, write_design_table, write_step, write_stl
from tests.output.designed_block import lid, variables

folder, problem, alpha = Path(sys.argv[1]), lid(on_all_ranks=True), variables()
write_design_table(problem, alpha, folder / "lid.csv")
write_stl(problem, alpha, folder / "pad.stl")
written = write_step(problem, alpha, folder / "pad.step")
assert written.volume is not None
with pytest.raises(CadError):  # on all ranks
    write_step(problem, alpha, folder / "lid.step", scale=1e-10)
