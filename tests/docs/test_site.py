"""The documentation builds without a warning, and everything public is in it."""

from __future__ import annotations

import pkgutil
import sys
from pathlib import Path

import pytest
from sphinx.util.inventory import InventoryFile

import fenics_contact
from tests.docs.pages import DOCS, ROOT, snippets_of
from tests.docs.site import Page, Site, broken_links, build

sys.path.append(str(DOCS))
from _site import reference


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Site:
    base = tmp_path_factory.getbasetemp()
    return build((base if worker_id == "master" else base.parent) / "site")


def html(site: Site, page: str) -> Page:
    return site.pages[site.folder / f"{page}.html"]


def inventory(site: Site) -> dict[str, set[str]]:
    """Return what can be linked to, names by kind."""
    data = InventoryFile.loads((site.folder / "objects.inv").read_bytes(), uri="").data
    return {kind: set(names) for kind, names in data.items()}


@pytest.mark.slow
@pytest.mark.claim
def test_it_builds_without_a_warning(site: Site) -> None:
    assert site.log == ""
    assert site.returncode == 0


@pytest.mark.slow
@pytest.mark.claim
def test_every_public_name_is_in_the_reference(site: Site) -> None:
    described = {name for kind, names in inventory(site).items() if kind.startswith("py:") for name in names}
    assert len(reference.rooms()) > 10
    wanted = {place for room in reference.rooms() for place in reference.homes(room).values()}
    assert len(wanted) > 200
    assert wanted - described == set()


def test_every_public_module_has_a_page() -> None:
    modules = {info.name for info in pkgutil.iter_modules(fenics_contact.__path__) if info.name[0] != "_"}
    assert modules == set(reference.rooms()) - {"fenics_contact"}


@pytest.mark.slow
@pytest.mark.claim
def test_every_link_and_picture_leads_somewhere(site: Site) -> None:
    assert len(site.pages) > 100
    assert sum(len(page.links) for page in site.pages.values()) > 5000
    assert broken_links(site) == []


def test_a_broken_link_is_found(tmp_path: Path) -> None:
    (tmp_path / "one.html").write_text(
        '<a href="two.html#here">x</a><a href="two.html#there">x</a><img src="p.png">'
    )
    (tmp_path / "two.html").write_text('<p id="here">x</p>')
    assert broken_links(Site(tmp_path, 0, "")) == ["one.html -> two.html#there", "one.html -> p.png"]


@pytest.mark.slow
@pytest.mark.claim
def test_the_gallery_shows_every_demo_with_a_picture(site: Site) -> None:
    gallery = html(site, "docs/gallery")
    demos = sorted((ROOT / "demos").glob("demo_*.py"))
    assert len(demos) >= 10
    for demo in demos:
        assert f"../demos/{demo.stem}.html" in gallery.links
        assert any(link.endswith(f"/{demo.name}") for link in html(site, f"demos/{demo.stem}").links)
    assert gallery.classes.count("sd-card-img-top") == len(demos)


@pytest.mark.slow
@pytest.mark.claim
def test_every_notebook_is_a_page(site: Site) -> None:
    sources = list((ROOT / "notebooks").glob("[0-9]*.py"))
    assert sources
    for source in sources:
        assert f"../notebooks/{source.stem}.html" in html(site, "docs/notebooks").links


@pytest.mark.slow
@pytest.mark.claim
def test_the_glossary_explains_the_terms_of_the_field(site: Site) -> None:
    terms = {name.lower() for name in inventory(site)["std:term"]}
    wanted = {"slave", "master", "gap", "active set", "multiplier", "coarse problem", "Total FETI", "mortar"}
    wanted |= {"Tresca friction", "Coulomb friction", "Clarke subgradient", "adjoint", "bundle", "subdomain"}
    assert {term.lower() for term in wanted} - terms == set()


@pytest.mark.slow
@pytest.mark.claim
def test_equations_are_drawn_without_the_network_where_debian_has_mathjax(site: Site) -> None:
    page = html(site, "demos/demo_bolted_joint")
    scripts_of_equations = [link for link in page.links if "athjax" in link.lower()]
    assert len(scripts_of_equations) == 1
    if Path("/usr/share/javascript/mathjax/MathJax.js").exists():
        assert not scripts_of_equations[0].startswith("http")


def test_the_first_scene_of_the_first_page_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (snippet,) = (snippet for snippet in snippets_of((DOCS / "index.md").read_text()) if snippet.is_run)
    exec(compile(snippet.code, "docs/index.md", "exec"), {"__name__": "__main__"})
    assert "algebraic" in capsys.readouterr().out
