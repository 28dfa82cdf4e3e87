"""How bodies deform: in space, in the plane, around an axis, with torsion; and finite elements."""
