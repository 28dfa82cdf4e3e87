"""Links and pictures of the documentation lead somewhere."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.docs.pages import DOCS, ROOT, links_of

PAGES = [*ROOT.glob("*.md"), *DOCS.rglob("*.md"), *(ROOT / "benchmarks").glob("*.md")]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_and_pictures_exist(page: Path) -> None:
    missing = [target for target in links_of(page.read_text()) if not (page.parent / target).exists()]
    assert missing == []


def test_pages_have_links() -> None:
    assert sum(len(links_of(page.read_text())) for page in PAGES) > 100


def test_a_link_is_found_and_one_to_the_web_is_not() -> None:
    text = "[a](b.md#c) ![d](e/f.png) [g](https://h.org) [i](#j)\n```\n[k](l)\n```\n"
    assert links_of(text) == ["b.md", "e/f.png"]
