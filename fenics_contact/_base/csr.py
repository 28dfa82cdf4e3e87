"""Sparse matrices of known arrays, which SciPy does not check again.

SciPy checks index types, lengths and ends of every matrix that it makes, also of products, sums, transposes
and parts of checked ones: 11 µs each, where the product of two small matrices takes 20. In small scenes that
is a tenth of all the time.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

__all__ = ["Csc", "Csr"]

#: The index type of SciPy, where sizes allow it.
_INDEX = np.dtype(np.int32)
#: What a matrix of this SciPy consists of besides its arrays and its shape.
_OTHERS = {
    name: value
    for name, value in vars(sp.csr_matrix((1, 1))).items()
    if name not in {"data", "indices", "indptr", "_shape"}
}


class _Passing:
    """Makes what it is converted to one of the classes below."""

    @property
    def _csr_container(self) -> type[Csr]:
        return Csr

    @property
    def _csc_container(self) -> type[Csc]:
        return Csc


class _Entries(_Passing, sp.coo_matrix):
    """Entries by row and column."""


class _Known(_Passing):
    """Takes arrays as they are where their lengths fit; all else is left to SciPy.

    Indices must be those of rows and columns that exist. What is computed from such a matrix is one, too.
    """

    #: Axis along which the entries are stored one after the other.
    _major: ClassVar[int]
    _largest: ClassVar[int] = int(np.iinfo(_INDEX).max)

    def __init__(self, arg1: Any, shape: Any = None, dtype: Any = None, **options: Any) -> None:
        """Make a matrix as SciPy does."""
        known = {} if any(options.values()) else self._known(arg1, shape)
        if known and (dtype is None or dtype == known["data"].dtype):
            vars(self).update(known)
        else:
            super().__init__(arg1, shape=shape, dtype=dtype, **options)  # type: ignore[call-arg]

    @classmethod
    def _known(cls, given: Any, shape: Any) -> dict[str, Any]:
        """Return the attributes of a matrix, nothing where SciPy must look at what is given."""
        if isinstance(given, (sp.csr_matrix, sp.csc_matrix)[cls._major]):
            return vars(given)
        if type(given) is not tuple:
            return {}
        if len(given) == 3 and shape:
            return cls._of_arrays(*given, (int(shape[0]), int(shape[1])))
        if isinstance(given[0], int | np.integer):  # a shape
            shape = int(given[0]), int(given[1])
            return cls._of_arrays(
                np.zeros(0), np.zeros(0, _INDEX), np.zeros(shape[cls._major] + 1, _INDEX), shape
            )
        if type(given[1]) is not tuple or not shape:
            return {}
        entries = _Entries(given, shape=shape)
        return vars((entries.tocsr, entries.tocsc)[cls._major]())

    @classmethod
    def _of_arrays(cls, values: Any, indices: Any, starts: Any, shape: tuple[int, int]) -> dict[str, Any]:
        """Return the attributes of a matrix of values, and indices and starts along the major axis."""
        if not type(values) is type(indices) is type(starts) is np.ndarray or max(shape) > cls._largest:
            return {}
        if indices.dtype != _INDEX or starts.dtype != _INDEX:
            if indices.dtype.kind != "i" or starts.dtype.kind != "i" or len(indices) > cls._largest:
                return {}
            indices, starts = indices.astype(_INDEX, copy=False), starts.astype(_INDEX, copy=False)
        if len(starts) != shape[cls._major] + 1:
            return {}
        count = starts[-1]
        if len(values) != count or len(indices) != count:  # SciPy cuts what it made too long
            if count > min(len(values), len(indices)):
                return {}
            values, indices = _cut(values, count), _cut(indices, count)
        return {**_OTHERS, "_shape": shape, "data": values, "indices": indices, "indptr": starts}


def _cut(values: np.ndarray, count: int) -> np.ndarray:
    """Return the first values, in memory of their own where those are few."""
    return values[:count].copy() if 2 * count < len(values) else values[:count]


class Csr(_Known, sp.csr_matrix):
    """A CSR matrix.

    Example:
        >>> A = Csr((np.ones(2), np.array([1, 0]), np.array([0, 1, 2])), shape=(2, 2))
        >>> (A @ A).toarray()
        array([[1., 0.],
               [0., 1.]])
        >>> type(A.T), type(A + A)
        (<class 'fenics_contact._base.csr.Csc'>, <class 'fenics_contact._base.csr.Csr'>)
    """

    _major = 0


class Csc(_Known, sp.csc_matrix):
    """A CSC matrix: the transpose of a `Csr`."""

    _major = 1
