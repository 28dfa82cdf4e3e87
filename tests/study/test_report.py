"""Files of a study: they appear whole, can be read again, and show what was found."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.studies_page import studies_page
from fenics_contact.errors import InvalidInputError
from fenics_contact.study import Errors, read_study, write_report
from fenics_contact.study.report import table_page
from tests.conftest import ROOT
from tests.study.samples import results, run
from tests.viz.states import contains, pixels


def test_results_survive_their_file(tmp_path: Path) -> None:
    known = results()
    words = write_report(tmp_path, known, figures=False)
    assert read_study(tmp_path) == known
    assert read_study(tmp_path / "study.json") == known
    assert write_report(tmp_path, read_study(tmp_path), figures=False) == words
    assert sorted(path.name for path in tmp_path.iterdir()) == ["study.json", "table.md"]


def test_the_table_has_answers_rates_certificates_runs_and_failures(tmp_path: Path) -> None:
    write_report(tmp_path, results(), figures=False)
    text = (tmp_path / "table.md").read_text()
    assert "(size: cells on the radius; on 2 ranks)" in text
    assert "| peak pressure | 2 %, 1 % | 4 | hexahedron |" in text
    assert "| 1e-08 | balanced | 8 | 9.6 | 1.50 |" in text
    assert "| peak pressure | theory |  | 2.00 | 1.00 |" in text
    assert "| energy | extrapolated | -10 N mm | 2.00 | 2.00 |" in text
    assert "finest mesh: several numbers are not extrapolated" in text
    assert "between 2.00 and 2.00 times the true error in 6 runs" in text
    assert "- size 8, tetrahedron, node, balanced: ConvergenceError: it did not converge" in text
    (row,) = [line for line in text.splitlines() if line.startswith("| 4 | hexahedron | mortar | 1e-08 ")]
    assert "| newton | 4 | 6400 | 80 | 2.40 | 100 | 1.0e-02 |" in row


def test_figures_show_every_way_to_spend_time(tmp_path: Path) -> None:
    known = results()
    more = replace(run(4), parameters=replace(run(4).parameters, cell="tetrahedron"))
    write_report(tmp_path, replace(known, runs=(*known.runs, more)))
    pictures = {path.stem: pixels(path) for path in tmp_path.glob("*.png")}
    assert pictures.keys() == {"accuracy", "convergence", "parts", "phases"}
    for colour in ("#0072b2", "#d55e00", "#009e73", "#222222"):  # balanced, strict, tetrahedra, Pareto front
        assert contains(pictures["accuracy"], colour)
    assert contains(pictures["convergence"], "#d55e00")
    assert contains(pictures["parts"], "#0072b2")
    assert contains(pictures["phases"], "#4466aa")


def test_results_that_are_not_there_or_not_whole_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"study\.json, which does not exist: run the study first"):
        read_study(tmp_path)
    (tmp_path / "study.json").write_text('{"scene": {}}')
    with pytest.raises(
        InvalidInputError, match=r"must hold the results of a study, got .* run the study again"
    ):
        read_study(tmp_path)


def test_the_page_of_all_studies_takes_its_numbers_from_them(tmp_path: Path) -> None:
    for name in ("first", "second"):
        write_report(tmp_path / name, results(), figures=False)
    text = studies_page(tmp_path)
    assert text.count("## A sample") == 2
    assert "![accuracy](second/accuracy.png)" in text
    assert "| peak pressure | 2 %, 1 % | 4 | hexahedron |" in text
    assert "[All 7 runs](second/table.md)" in text
    assert "| energy | extrapolated | -10 N mm | 2.00 | 2.00 |" in text
    assert "| error of the displacement | its own estimate |  | 1.00 | 1.00 |" in text
    assert text.count("lies between 2.00 and 2.00 times the true error in 6 runs") == 2


def test_the_stored_pages_are_those_of_the_stored_results() -> None:
    folder = ROOT / "docs" / "studies"
    found = sorted(folder.glob("*/study.json"))
    assert len(found) == 3
    for file in found:
        assert file.with_name("table.md").read_text() == table_page(Errors(read_study(file)))
    assert (folder / "README.md").read_text() == studies_page(folder)


def test_a_page_of_no_studies_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"a page of studies needs some, .* holds none: run a study"):
        studies_page(tmp_path)


def test_figures_need_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from fenics_contact.study import figures

    monkeypatch.chdir(tmp_path)
    known = Errors(results())
    for draw in (figures.plot_accuracy, figures.plot_convergence, figures.plot_parts, figures.plot_phases):
        picture = draw(known)
        assert picture.png is not None
        assert picture.path is None
        assert len(picture.png) > 10_000
    assert not list(tmp_path.iterdir())
