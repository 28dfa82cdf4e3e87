"""What a problem is, in words: by them another run finds its checkpoint, and ranks see that they agree."""

from fenics_contact.fingerprint.alike import require_alike
from fenics_contact.fingerprint.description import described, differences

__all__ = ["described", "differences", "require_alike"]
