"""A web page of a result: bodies to turn and cut, fields, load steps, residuals, forces, in one file."""

from fenics_contact._page.page import Page, result_page

__all__ = ["Page", "result_page"]
