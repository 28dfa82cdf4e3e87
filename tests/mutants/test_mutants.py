"""Do the quick tests find mistakes? Each is made in a copy of the package, and named tests must fail.

``make mutants`` runs all, ``pytest tests/mutants -m slow -k "words of a mistake"`` a single one.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.mutants.copy_of_package import FAILED, PASSED, ROOT, Copy, Mutation, replaced
from tools.mutants.mutations import MUTATIONS


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Copy:
    """Return a copy of the project that is used and not the one around it."""
    made = Copy(tmp_path_factory.mktemp("mutants"))
    assert made.folder in made.place_of_package().parents
    return made


def test_every_mutation_finds_its_text_and_changes_it() -> None:
    assert len(MUTATIONS) >= 21
    assert len({mutation.mistake for mutation in MUTATIONS}) == len(MUTATIONS)
    for mutation in MUTATIONS:
        right = (ROOT / "fenics_contact" / mutation.file).read_text(encoding="utf-8")
        assert replaced(mutation, right) != right


def test_a_text_that_is_gone_is_told() -> None:
    gone = Mutation("no more", "_base/progress.py", "a text that is nowhere", "", ())
    with pytest.raises(LookupError, match=r"'no more' needs its text once in _base/progress.py, found it 0"):
        replaced(gone, "some text")


def test_the_tests_that_shall_find_a_mistake_are_quick_ones_that_exist() -> None:
    for mutation in MUTATIONS:
        assert mutation.killers
        for killer in mutation.killers:
            path, _, name = killer.partition("::")
            text = (ROOT / path).read_text(encoding="utf-8")
            assert f"def {name.partition('[')[0]}(" in text, killer
            assert "hard" not in Path(path).parts


@pytest.mark.slow
@pytest.mark.claim
def test_the_tests_pass_without_a_mistake(copy: Copy) -> None:
    killers = sorted({killer for mutation in MUTATIONS for killer in mutation.killers})
    found = copy.run(["-m", "not slow and not hard", *killers])
    assert found.status == PASSED, found.output


@pytest.mark.slow
@pytest.mark.claim
def test_a_mistake_that_is_none_survives(copy: Copy) -> None:
    harmless = Mutation(
        "none", "errors/kinds.py", "Base of every error", "The base of every error", MUTATIONS[0].killers
    )
    with copy.mutated(harmless):
        assert copy.run(harmless.killers).status == PASSED


@pytest.mark.slow
@pytest.mark.claim
@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda mutation: mutation.mistake)
def test_the_quick_tests_find(mutation: Mutation, copy: Copy) -> None:
    with copy.mutated(mutation):
        found = copy.run(["-m", "not slow and not hard", *mutation.killers])
    assert found.status == FAILED, found.output
