from __future__ import annotations

import numpy as np
import pytest

from fenics_contact.errors import InvalidInputError
from fenics_contact.qp.layout import ContactLayout


def test_all_entries_are_equality_contact_or_friction():
    layout = ContactLayout.build(9, normal=[1, 4], tangential=[[5, 6]], friction_of=[1])
    assert layout.equality.tolist() == [0, 2, 3, 7, 8]
    assert layout.contact.tolist() == [1, 4, 5, 6]
    assert layout.tangential_frictional.tolist() == [4]


def test_layout_without_contact_has_equality_rows_only():
    layout = ContactLayout.build(3)
    assert layout.equality.tolist() == [0, 1, 2]
    assert layout.tangential.shape == (0, 2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"normal": [0, 3]}, "must be distinct and lie in 0..2"),
        ({"normal": [1, 1]}, "must be distinct"),
        ({"normal": [0], "tangential": [[0, 1]]}, "must be distinct"),
        (
            {"normal": [0], "tangential": [[1, 2]], "friction_of": [1]},
            "friction_of must name distinct contacts",
        ),
        (
            {"normal": [0], "tangential": [[1, 2]], "friction_of": [0, 0]},
            r"friction_of must have shape \(1,\)",
        ),
        ({"normal": [[0]]}, r"give normal \(n,\)"),
    ],
)
def test_inconsistent_layout_is_refused(arguments, message):
    with pytest.raises(InvalidInputError, match=message):
        ContactLayout.build(3, **arguments)


def test_layout_positions_are_integers():
    assert ContactLayout.build(2, normal=[1]).normal.dtype == np.int64
