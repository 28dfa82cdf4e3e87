"""Files with mistakes are planned or refused in words: no traceback, no warning of numpy, no hang.

Thousands of them: ``python -m tools.mutated --count 2000``.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.mutated.judging import judged, run
from tools.mutated.subjects import SUBJECTS


@pytest.mark.parametrize("subject", SUBJECTS)
def test_files_without_a_mistake_are_planned(subject: str, tmp_path: Path) -> None:
    path, _ = SUBJECTS[subject](tmp_path)
    verdict = run(subject, path)
    assert (verdict.code, verdict.trouble) == (0, ""), verdict.words


@pytest.mark.parametrize("subject", SUBJECTS)
def test_files_with_mistakes_end_in_words(subject: str, tmp_path: Path) -> None:
    verdicts = [judged(subject, seed, tmp_path) for seed in range(4)]
    assert not [f"{each.seed}: {each.trouble}" for each in verdicts if each.trouble]
    assert {each.code for each in verdicts} <= {0, 2}
