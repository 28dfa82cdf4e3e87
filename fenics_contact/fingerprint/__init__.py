"""Descriptions of problems, by which a run identifies its checkpoint and ranks check that they agree."""

from fenics_contact.fingerprint.alike import require_alike
from fenics_contact.fingerprint.description import described, differences

__all__ = ["described", "differences", "require_alike"]
