"""Tables name units of their dimension, and what the solver left as zero."""

from __future__ import annotations

from fenics_contact._base.display import DerivedUnits
from fenics_contact._cli.console import forces_table, state_facts
from fenics_contact._scene_file.document import UnitNames
from fenics_contact.output.result import forces_record
from fenics_contact.output.tables import step_row
from tests.pictures.plane_states import flat_pad
from tests.pictures.states import touching_blocks


def test_forces_and_energies_have_the_units_of_their_dimension() -> None:
    for state, force, moment in (
        (flat_pad(), "N/mm", "N mm/mm"),
        (flat_pad(thickness=2.0), "N", "N mm"),
        (touching_blocks(), "N", "N mm"),
    ):
        units = DerivedUnits.of("N", "mm", state.scene.dimension_record)
        assert forces_table(forces_record(state), units).title == f"forces ({force}) and moments ({moment})"
        facts = state_facts(state, UnitNames())
        assert facts["strain energy"].endswith(f"{state.energies.strain:.6g} {moment}")
        assert f" {force}, friction " in facts["contact 0"]


def test_friction_below_what_the_solver_left_is_zero_in_the_table_of_load_steps() -> None:
    """A pad that is pressed alone spreads alike to both sides."""
    assert step_row(0, "pressed", flat_pad(push=0.0))["friction_force"] == 0.0
    assert step_row(1, "pushed", flat_pad())["friction_force"] > 0.01
