"""Every piece of Python in the guide runs, page by page from top to bottom, and prints what the page says."""

from __future__ import annotations

import contextlib
import io
import tomllib
from pathlib import Path

import pytest
from mpi4py import MPI

from fenics_contact import read_scene_file
from tests.docs.pages import DOCS, GUIDE, ROOT, Snippet, agrees, fences_of, snippets_of

FILES = [*GUIDE.glob("*.md"), DOCS / "theory.md", ROOT / "README.md"]
PAGES = sorted(path.relative_to(ROOT) for path in FILES)
#: Pages of many seconds, which claims rest on.
LONG = ("clamp_hub", "large_deformations", "not_converging", "shape_optimisation", "valve_deck")
MARKS = {page: [pytest.mark.slow, pytest.mark.claim] for page in LONG}
MARKED = [pytest.param(page, marks=[*MARKS.get(page.stem, ())], id=page.stem) for page in PAGES]


def run(snippet: Snippet, names: dict[str, object], page: Path) -> str:
    """Run a snippet and return what it printed, with the error that it raised where the page shows one."""
    printed = io.StringIO()
    # Empty lines before the code make line numbers in a traceback those of the page.
    code = compile("\n" * (snippet.line - 1) + snippet.code, str(page), "exec")
    with contextlib.redirect_stdout(printed):
        try:
            exec(code, names)
        except Exception as error:
            if snippet.output is None or type(error).__name__ not in snippet.output:
                raise
            printed.write(f"{type(error).__name__}: {error}")
    return printed.getvalue()


@pytest.mark.parametrize("page", MARKED)
def test_a_page_does_what_it_says(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    snippets = [snippet for snippet in snippets_of((ROOT / page).read_text()) if snippet.is_run]
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "__main__"}
    for snippet in snippets:
        printed = run(snippet, names, page)
        if page.name == "README.md":
            continue  # says in comments what there is
        wanted = snippet.compared or ""
        assert agrees(printed, wanted), f"{page}:{snippet.line} printed\n{printed}\nand says\n{wanted}"


def test_the_guide_has_pages_and_they_have_code() -> None:
    stems = {page.stem for page in PAGES}
    assert {"first_scene", *LONG} < stems
    assert len(stems) > 10
    running = [s for page in PAGES for s in snippets_of((ROOT / page).read_text()) if s.is_run]
    assert len(running) > 90
    assert sum(snippet.output is not None for snippet in running) > 60


def test_output_is_that_of_the_fence_right_behind() -> None:
    shown, unrun = "```python\nprint(1)\n```\n\n```text\n1\n```\n", "```python\n# not run: no\n```\n"
    text = f"{shown}\n{unrun}words\n```text\n2\n```\n"
    first, second = snippets_of(text)
    assert (first.code, first.line, first.output) == ("print(1)\n", 2, "1\n")
    assert second.output is None
    assert first.is_run
    assert not second.is_run


@pytest.mark.parametrize(
    ("printed", "page", "same"),
    [
        ("a 1.00\nb", "a 1.02 b", True),
        ("a 1.00", "a 1.20", False),
        ("a 1.0e-07", "a 2e-7", True),
        ("a 1e-05", "a 1e-07", False),
        ("a b", "a c", False),
        ("a b c d", "a ... d", True),
        ("a b c d", "a ... c", False),
        ("x 2 of 3: y", "... 2 of ...", True),
        ("x 2 of 3: y", "... 2 if ...", False),
        ("(−1.0, 0.3)", "(−1.01, 0.3)", True),
        ("", "", True),
        ("something", "", False),
    ],
)
def test_a_page_agrees_with_what_was_printed(printed: str, page: str, same: bool) -> None:
    assert agrees(printed, page) is same


def test_what_is_compared_of_an_output_may_leave_out_what_varies() -> None:
    comment = "<!-- compared as:\ntook ... s\n-->"
    (snippet,) = snippets_of(f"```python\nprint(1)\n```\n\n{comment}\n```text\ntook 12 s\n```\n")
    assert (snippet.output, snippet.compared) == ("took 12 s\n", "took ... s\n")
    (other,) = snippets_of(f"```python\nprint(1)\n```\n\n{comment} words\n```text\ntook 12 s\n```\n")
    assert other.output is None


def test_pages_show_whole_outputs() -> None:
    for page in PAGES:
        for snippet in snippets_of((ROOT / page).read_text()):
            shown, place = snippet.output or "", f"{page}:{snippet.line}"
            assert "..." not in shown, f"{place} shows dots: put them into what is compared"
            assert agrees(shown, snippet.compared or ""), place


def test_the_scene_file_of_the_guide_is_read() -> None:
    (text,) = fences_of((GUIDE / "command_line.md").read_text(), "toml")
    file = read_scene_file(tomllib.loads(text), MPI.COMM_SELF)
    assert file.title == "Pad on a floor"
    assert len(file.steps) == 4


def test_the_design_of_the_guide_is_read() -> None:
    """Its objective and its surfaces in place of those of the example, whose bodies it names."""
    objective, surfaces, *_ = fences_of((GUIDE / "shape_optimisation.md").read_text(), "toml")
    scene, _, _ = (ROOT / "demos" / "scenes" / "chain_links.toml").read_text().partition("[design]")
    file = read_scene_file(tomllib.loads(f"{scene}\n{objective}\n{surfaces}"), MPI.COMM_SELF)
    design = file.document.design
    assert design is not None
    (moved,) = design.surfaces
    assert (moved.body, tuple(moved.net), moved.transition) == ("link 1", (7, 4), 2.0)
    assert len(design.objective) == 3
