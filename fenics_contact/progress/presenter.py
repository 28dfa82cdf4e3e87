"""What every way of showing progress can do."""

from __future__ import annotations

from abc import ABC, abstractmethod

from fenics_contact.progress.tracker import Work


class Presenter(ABC):
    """Shows what a tracker knows."""

    def start(self) -> None:
        """Begin to show."""

    def stop(self) -> None:
        """Leave everything as it was."""

    @abstractmethod
    def changed(self, moment: float) -> None:
        """Hear that something is different from that moment on, [s]."""

    @abstractmethod
    def finished(self, work: Work) -> None:
        """Show what remains of outermost work that is over."""
