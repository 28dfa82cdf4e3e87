"""Arrays of a web page, packed as text."""

from __future__ import annotations

import base64
import gzip
import hashlib

import numpy as np


class Arrays:
    """Collects arrays; equal ones are kept once, such as the mesh of all load steps."""

    def __init__(self) -> None:
        self.index: list[dict[str, int | str]] = []
        self._numbers: dict[tuple[str, int, bytes], int] = {}
        self._parts: list[bytes] = []
        self._size = 0

    def add(self, values: np.ndarray, *, exact: bool = False) -> int:
        """Return the number of an array, added unless it is there; integers are kept as such."""
        whole = np.issubdtype(values.dtype, np.integer) and values.min(initial=0) >= 0
        kept = np.ascontiguousarray(values, dtype="<u4" if whole else "<f4")
        if not whole and not exact:
            kept = rounded(kept)
        columns = int(np.prod(values.shape[1:], dtype=int))
        content = kept.tobytes()
        key = ("u4" if whole else "f4", columns, hashlib.sha256(content).digest())
        if key not in self._numbers:
            self._numbers[key] = len(self.index)
            self.index.append({"type": key[0], "start": self._size, "length": kept.size, "columns": columns})
            self._parts.append(content)
            self._size += len(content)
        return self._numbers[key]

    def packed(self) -> str:
        """Return all arrays as text for a page."""
        return base64.b64encode(gzip.compress(b"".join(self._parts), 6, mtime=0)).decode()


def rounded(values: np.ndarray, dropped: int = 10) -> np.ndarray:
    """Round numbers of single precision to four digits, which compress better."""
    bits = np.where(np.isfinite(values), values, np.float32(np.nan)).astype("<f4").view("<u4")
    half = np.uint32(1 << (dropped - 1))
    mask = np.uint32(0xFFFFFFFF ^ ((1 << dropped) - 1))
    return np.where(np.isnan(values), bits, (bits + half) & mask).astype("<u4").view("<f4")
