"""Links and pictures of the documentation lead somewhere."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.docs.pages import DOCS, ROOT, anchors_of, links_of

PAGES = [*ROOT.glob("*.md"), *DOCS.rglob("*.md"), *(ROOT / "benchmarks").glob("*.md")]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_and_pictures_exist(page: Path) -> None:
    missing = []
    for link in links_of(page.read_text()):
        target, _, anchor = link.partition("#")
        there = page.parent / target if target else page
        if not there.exists() or (anchor and anchor not in anchors_of(there.read_text())):
            missing.append(link)
    assert missing == []


def test_pages_have_links() -> None:
    assert sum(len(links_of(page.read_text())) for page in PAGES) > 100


def test_a_link_is_found_and_one_to_the_web_is_not() -> None:
    text = "[a](b.md#c) ![d](e/f.png) [g](https://h.org) [i](#j)\n```\n[k](l)\n```\n"
    assert links_of(text) == ["b.md#c", "e/f.png", "#j"]


def test_headings_have_the_names_that_links_use() -> None:
    text = "# How to choose\n```\n# no heading\n```\n## Stiff beside soft, thin\n"
    assert anchors_of(text) == {"how-to-choose", "stiff-beside-soft-thin"}
