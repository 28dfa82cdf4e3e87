"""Pages of the reference: one for each room of the house, with every public name."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from enum import Enum
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import GenericAlias, ModuleType
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.docutils import SphinxDirective

import fenics_contact
from _site import docstrings, signatures

PACKAGE = fenics_contact.__name__
#: The front and the public modules, as a user meets them.
ORDER = (
    "fenics_contact materials heat gallery readers decks mesh shapes results design fatigue pictures output "
    "study theory errors qp feti"
).split()
#: Names that the reference uses and does not describe: other libraries', and the standard library's.
OUTSIDE = [
    (
        "py:.*",
        r"(numpy|np|scipy|sp|mpi4py|MPI|PETSc|petsc4py|dolfinx|ufl|pyvista|pv|matplotlib|npt|rich|typer|pydantic|tomlkit)\b.*",
    ),
    ("py:.*", r"(abc|collections|enum|pathlib|typing)\..*|Path"),
    (
        "py:.*",
        "ArrayLike|Console|Expr|Figure|Table|FilePath|NDArray|ndarray|dtype|generic|bool_|float64|int64",
    ),
    ("py:.*", "ModuleType|cKDTree"),
]


@cache
def rooms() -> list[str]:
    """Return the package itself, the front, and its public modules, in `ORDER`."""
    names = (name for name in fenics_contact.__all__ if inspect.ismodule(getattr(fenics_contact, name)))
    return sorted([PACKAGE, *names], key=ORDER.index)


def module_of(room: str) -> ModuleType:
    """Import a room."""
    return fenics_contact if room == PACKAGE else importlib.import_module(f"{PACKAGE}.{room}")


def public_names(module: ModuleType) -> list[str]:
    """Return the names of ``__all__``; of a module without one, what it defines itself."""
    if hasattr(module, "__all__"):
        names = (name for name in module.__all__ if name[0] != "_")
        return sorted(name for name in names if not inspect.ismodule(getattr(module, name)))
    own = [
        name for name, value in vars(module).items() if getattr(value, "__module__", "") == module.__name__
    ]
    return sorted(name for name in own if not name.startswith("_"))


def kind_of(value: Any) -> str:
    """Return autodoc's name of what ``value`` is."""
    if inspect.isclass(value) and not isinstance(value, GenericAlias):  # tuple[int] passes for a class
        return "exception" if issubclass(value, BaseException) else "class"
    return "function" if inspect.isroutine(value) else "data"


def source_of(_: Any, module: str, name: str) -> str | None:
    """Return the module with the source of a type such as ``tuple[int]``, which passes for Python's own."""
    value = getattr(importlib.import_module(module), name, None)
    return module if isinstance(value, GenericAlias) else None


#: A constant's value is shown if it is not longer, in characters.
LONGEST_VALUE = 100
HEADINGS = {"class": "Classes", "function": "Functions", "data": "Constants and types", "exception": "Errors"}


def page(room: str) -> str:
    """Write the page of a room: what it is, its names at a glance, then each in full."""
    module = module_of(room)
    names = public_names(module)
    blocks = [
        f"---\ntocdepth: 3\n---\n\n# {module.__name__}\n",
        eval_rst(f".. automodule:: {module.__name__}\n   :no-members:\n"),
    ]
    for kind, heading in HEADINGS.items():
        chosen = [name for name in names if kind_of(getattr(module, name)) == kind]
        if chosen:
            blocks.append(f"**{heading}**\n\n" + eval_rst(at_a_glance(module, chosen, kind)))
    for kind, heading in HEADINGS.items():
        chosen = [name for name in names if kind_of(getattr(module, name)) == kind]
        if chosen:
            lines = "".join(described(module, name, kind) for name in chosen)
            blocks.append(f"## {heading}\n\n" + eval_rst(lines))
    return "\n".join(blocks)


def first_line(module: ModuleType, name: str) -> str:
    """Return the first sentence of what is written above a constant."""
    return " ".join(constant(module, name)[0]).strip().split(". ")[0].rstrip(".") + "."


def homes(room: str) -> dict[str, str]:
    """Map the public names of a room to the full name under which each is described: each has one place."""
    module = module_of(room)
    return {name: f"{module.__name__}.{name}" for name in public_names(module)}


def described(module: ModuleType, name: str, kind: str) -> str:
    """Write the directive that describes a name.

    Autodoc finds the comment above a constant only in the module that defines it, not where a room offers it.
    """
    if kind != "data":
        value = getattr(module, name)
        return f".. auto{kind}:: {module.__name__}.{name}\n{extra_members(value)}\n"
    text, value = constant(module, name)
    lines = [f".. py:data:: {name}", f"   :module: {module.__name__}"]
    lines += [f"   :value: {value}"] if value else []
    return "\n".join([*lines, "", *(f"   {line}" for line in text), "", ""])


def extra_members(value: Any) -> str:
    """Return autodoc's options for members that it would leave out: of enumerations, and of private bases."""
    if not inspect.isclass(value):
        return ""
    if issubclass(value, Enum):
        return "   :undoc-members:\n"
    private = [
        base for base in value.__mro__[1:] if base.__module__.startswith(PACKAGE) and base.__name__[0] == "_"
    ]
    return "   :inherited-members:\n" if private else ""


def constant(module: ModuleType, name: str) -> tuple[list[str], str]:
    """Return the lines of the comment above a constant, and its value if that is short."""
    defined = defining_module(module, name)
    analyzer = ModuleAnalyzer.for_module(defined)
    analyzer.analyze()
    text = analyzer.attr_docs.get(("", name))
    if text is None:
        raise ValueError(f"{defined}.{name} is public and needs a comment '#: what it is' above it")
    values = [
        ast.unparse(node.value)
        for node in ast.parse(analyzer.code).body
        if isinstance(node, ast.Assign | ast.AnnAssign)
        and name in ast.unparse(node).partition("=")[0]
        and node.value
    ]
    return text, values[0] if values and len(values[0]) <= LONGEST_VALUE else ""


def defining_module(module: ModuleType, name: str) -> str:
    """Return the name of the module from which a room takes ``name``."""
    for node in ast.walk(ast.parse(inspect.getsource(module))):  # the front names them for type checkers
        if isinstance(node, ast.ImportFrom) and node.module and name in [alias.name for alias in node.names]:
            taken_from = importlib.import_module(node.module)
            return defining_module(taken_from, name)
    return module.__name__


def at_a_glance(module: ModuleType, names: list[str], kind: str) -> str:
    """Write a table of names with the first line of each one's docstring."""
    if kind == "data":
        rows = "".join(
            f"   * - :py:obj:`{name} <{module.__name__}.{name}>`\n     - {first_line(module, name)}\n"
            for name in names
        )
        return f".. list-table::\n   :class: autosummary\n   :widths: auto\n\n{rows}"
    rows = "".join(f"   {name}\n" for name in names)
    return f".. autosummary::\n   :nosignatures:\n\n{rows}"


def eval_rst(text: str) -> str:
    """Wrap reStructuredText for a Markdown page."""
    return f"```{{eval-rst}}\n{text}```\n"


class Rooms(SphinxDirective):
    """``{rooms}``: a table of the rooms with what each is for, and their places in the sidebar."""

    def run(self) -> list[nodes.Node]:
        """Make the nodes."""
        self.env.note_reread()  # a room may be new
        rows = [f"* - [{room}](/docs/reference/{room}.md)\n  - {purpose(room)}" for room in rooms()]
        contents = [f"{room} </docs/reference/{room}>" for room in rooms()]
        table = ["```{list-table}", ":class: autosummary", ":widths: auto", "", *rows, "```", ""]
        tree = ["```{toctree}", ":hidden:", ":maxdepth: 1", "", *contents, "```", ""]
        return self.parse_text_to_nodes("\n".join(table + tree))


def purpose(room: str) -> str:
    """Return the first line of a room's docstring."""
    return (inspect.getdoc(module_of(room)) or "").partition("\n")[0]


def write_pages(folder: Path) -> None:
    """Write a page a room into ``folder``, where it differs from what is there; remove others."""
    folder.mkdir(exist_ok=True)
    pages = {folder / f"{room}.md": page(room) for room in rooms()}
    for old in set(folder.glob("*.md")) - set(pages):
        old.unlink()
    for path, text in pages.items():
        if not path.exists() or path.read_text() != text:
            path.write_text(text)


@cache
def public_place() -> dict[str, str]:
    """Map the full name under which a thing is defined to the one under which users know it."""
    places = {}
    for room in rooms():
        for name, place in homes(room).items():
            value = getattr(module_of(room), name)
            defined = getattr(value, "__module__", None), getattr(value, "__qualname__", None)
            if all(defined):
                places[".".join(defined)] = place
    return places


def candidates(target: str) -> Iterator[str]:
    """Yield the names that ``target`` may have in the reference."""
    places = public_place()
    parts = target.split(".")
    for length in range(len(parts), 0, -1):
        home, rest = ".".join(parts[:length]), parts[length:]
        if home in places:
            yield ".".join([places[home], *rest])
    for room in rooms():
        if parts[0] in public_names(module_of(room)):
            yield ".".join([homes(room)[parts[0]], *parts[1:]])


def resolve(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, contnode: nodes.Element
) -> nodes.Element | None:
    """Find what a reference means that names a thing where it is defined, or by its bare name."""
    if node.get("refdomain") != "py" or node["reftarget"].startswith("dolfinx."):
        return None
    domain = env.domains.python_domain
    for name in candidates(node["reftarget"]):
        if name in domain.objects:
            return domain.resolve_xref(env, node["refdoc"], app.builder, "obj", name, node, contnode)
    return contnode if node["reftarget"].rpartition(".")[2] in private_names() else None


@cache
def private_names() -> frozenset[str]:
    """Return what the package's modules and their classes define: such names may stand without a link."""
    names: set[str] = set()
    for info in pkgutil.walk_packages(fenics_contact.__path__, f"{PACKAGE}."):
        names.add(info.name.rpartition(".")[2])
        specification = find_spec(info.name)
        assert specification
        assert specification.origin
        tree = ast.parse(Path(specification.origin).read_text())
        classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
        for node in [*tree.body, *(member for owner in classes for member in owner.body)]:
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            names.update(target.id for target in targets if isinstance(target, ast.Name))
            names.add(getattr(node, "name", ""))
    return frozenset(names - {""})


def correct_backlinks(
    app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Let pages of sources point to where each of their names is described.

    Names of one module may be offered by the front and by a public module; viewcode takes one for all.
    """
    if pagename.startswith("_modules/"):
        public = "|".join(room for room in rooms() if room != PACKAGE)
        link = rf"(docs/reference/(\w+)\.html)#{PACKAGE}\.(?:(?:{public})\.)?"
        context["body"] = re.sub(
            link,
            lambda found: f"{found[1]}#{PACKAGE}." + ("" if found[2] == PACKAGE else f"{found[2]}."),
            context["body"],
        )


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect to Sphinx."""
    app.add_directive("rooms", Rooms)
    app.connect("missing-reference", resolve)
    app.connect("html-page-context", correct_backlinks)
    docstrings.connect(app)
    signatures.connect(app)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
