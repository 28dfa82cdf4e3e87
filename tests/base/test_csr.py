"""Matrices of known arrays are those of SciPy, which does not check them."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from copy import copy
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from fenics_contact._base.csr import Csc, Csr

SHAPE = (5, 7)
MATRIX = sp.random(*SHAPE, density=0.4, format="csr", random_state=1)
ARRAYS = MATRIX.data, MATRIX.indices, MATRIX.indptr
ENTRIES = MATRIX.tocoo()

WAYS: dict[str, tuple[Any, dict[str, Any]]] = {
    "arrays": (ARRAYS, {"shape": SHAPE}),
    "long indices": ((ARRAYS[0], *(part.astype(np.int64) for part in ARRAYS[1:])), {"shape": SHAPE}),
    "arrays too long": (
        (*(np.concatenate([part, 9 * np.ones(40, part.dtype)]) for part in ARRAYS[:2]), ARRAYS[2]),
        {"shape": SHAPE},
    ),
    "a shape of numpy": (ARRAYS, {"shape": tuple(np.array(SHAPE))}),
    "a type": (ARRAYS, {"shape": SHAPE, "dtype": np.float64}),
    "another type": (ARRAYS, {"shape": SHAPE, "dtype": np.float32}),
    "no shape": (ARRAYS, {}),
    "lists": (tuple(map(list, ARRAYS)), {"shape": SHAPE, "dtype": np.float64}),
    "many columns": (ARRAYS, {"shape": (SHAPE[0], 2**40)}),
    "a copy": (ARRAYS, {"shape": SHAPE, "copy": True}),
    "entries": ((ENTRIES.data, (ENTRIES.row, ENTRIES.col)), {"shape": SHAPE}),
    "entries twice": (
        (np.tile(ENTRIES.data, 2), (np.tile(ENTRIES.row, 2), np.tile(ENTRIES.col, 2))),
        {"shape": SHAPE},
    ),
    "a matrix": (MATRIX, {}),
    "a transpose": (MATRIX.tocsc(), {}),
    "a dense one": (MATRIX.toarray(), {}),
    "nothing": (SHAPE, {}),
    "nothing of integers": (tuple(np.array(SHAPE)), {"dtype": np.int64}),
}

COMPUTED: dict[str, Callable[[Any], Any]] = {
    "product": lambda A: A @ A.T.tocsr(),
    "product with its transpose": lambda A: (A.T @ A).tocsr(),
    "sum": lambda A: A + A,
    "difference": lambda A: A - 2.0 * A,
    "of entries": lambda A: A.multiply(A).tocsr(),
    "size": abs,
    "transpose": lambda A: A.T.tocsr(),
    "rows": lambda A: A[np.array([3, 0, 3])],
    "columns": lambda A: A[:, np.array([6, 1])],
    "slice": lambda A: A[1:4],
    "copy": lambda A: A.copy(),
    "type": lambda A: A.astype(np.float32),
    "by columns": lambda A: A.tocsc().tocsr(),
}


def same(A: Any, B: Any) -> None:
    assert isinstance(A, sp.csr_matrix)
    assert A.shape == B.shape
    assert all(type(size) is int for size in A.shape)
    for name in ("data", "indices", "indptr"):
        assert getattr(A, name).dtype == getattr(B, name).dtype
        assert np.array_equal(getattr(A, name), getattr(B, name))
    assert A.has_sorted_indices == B.has_sorted_indices
    assert A.has_canonical_format == B.has_canonical_format
    assert {*vars(sp.csr_matrix(B))} <= {*vars(A)}


@pytest.mark.parametrize("way", WAYS)
def test_a_matrix_is_that_of_scipy_whatever_it_is_made_of(way: str) -> None:
    given, options = WAYS[way]
    same(Csr(given, **options), sp.csr_matrix(given, **options))
    if options.get("shape") is not None and len(given) == 3:  # arrays of columns
        options = options | {"shape": SHAPE[::-1]}
    by_columns, expected = Csc(given, **options), sp.csc_matrix(given, **options)
    assert type(by_columns) is Csc
    same(by_columns.T, expected.T)


@pytest.mark.parametrize("way", COMPUTED)
def test_what_is_computed_is_that_of_scipy(way: str) -> None:
    A = COMPUTED[way](Csr(ARRAYS, shape=SHAPE))
    assert A.nnz
    same(A, COMPUTED[way](MATRIX))
    assert type(A) is Csr


def test_scipy_checks_nothing_again(monkeypatch: pytest.MonkeyPatch) -> None:
    checked = []
    check = sp.csr_matrix.check_format
    for kind in (sp.csr_matrix, sp.csc_matrix):
        monkeypatch.setattr(
            kind, "check_format", lambda A, full_check=True: checked.append(A) or check(A, full_check)
        )
    counts = []
    for A in (Csr(ARRAYS, shape=SHAPE), MATRIX):
        checked.clear()
        for compute in COMPUTED.values():
            compute(A)
        counts.append(len(checked))
    assert counts[1] > 10
    assert counts[0] <= 2, "only products of entries are made by way of another class"


@pytest.mark.parametrize(
    "given",
    [
        (ARRAYS[0], ARRAYS[1], ARRAYS[2][:-1]),
        (ARRAYS[0][:-1], ARRAYS[1][:-1], ARRAYS[2]),
        (ARRAYS[0][:-1], *ARRAYS[1:]),
    ],
)
def test_arrays_whose_lengths_do_not_fit_are_left_to_scipy(given: Any) -> None:
    with pytest.raises(ValueError, match=r"index|indices|size"):
        Csr(given, shape=SHAPE)


def test_arrays_are_shared_unless_a_copy_is_wanted() -> None:
    A = Csr(ARRAYS, shape=SHAPE)
    assert A.data is ARRAYS[0]
    assert Csr(A).data is A.data
    assert not np.shares_memory(Csr(A, copy=True).data, A.data)
    few = Csr((np.ones(100), np.zeros(100, np.int32), np.array([0, 1], np.int32)), shape=(1, 1))
    assert few.data.base is None, "a few entries keep no long array"


def test_copies_and_messages_keep_the_kind() -> None:
    A = Csr(ARRAYS, shape=SHAPE)
    for other in (copy(A), pickle.loads(pickle.dumps(A))):
        assert type(other) is Csr
        same(other, MATRIX)
