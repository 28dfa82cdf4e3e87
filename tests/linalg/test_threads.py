"""Several ranks whose BLAS may take all cores are warned of."""

from __future__ import annotations

import logging

import pytest

from fenics_contact._base.sparse import SETTINGS, warn_of_threads


@pytest.fixture(autouse=True)
def nothing_said(monkeypatch: pytest.MonkeyPatch) -> None:
    warn_of_threads.cache_clear()
    for name in SETTINGS:
        monkeypatch.delenv(name, raising=False)


def test_several_ranks_with_unlimited_threads_are_warned_once(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        warn_of_threads(2)
        warn_of_threads(2)
    (record,) = caplog.records
    assert record.getMessage().startswith("2 ranks share the cores")
    assert "export OPENBLAS_NUM_THREADS=1" in record.getMessage()


@pytest.mark.parametrize("name", SETTINGS)
def test_whoever_has_chosen_is_not_warned(
    name: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv(name, "2")
    warn_of_threads(4)
    assert caplog.records == []


def test_one_rank_is_not_warned(caplog: pytest.LogCaptureFixture) -> None:
    warn_of_threads(1)
    assert caplog.records == []
