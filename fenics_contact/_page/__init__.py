"""A web page of a result: bodies to turn and cut, fields, load steps, residuals, forces, in one file."""

from typing import TYPE_CHECKING

from fenics_contact._base.late_names import late_names

if TYPE_CHECKING:
    from fenics_contact._page.entry import result_page
    from fenics_contact._page.page import Page

__all__ = ["Page", "result_page"]

__getattr__, __dir__ = late_names(__name__)
