"""The BLAS of this process, and its speed."""

from __future__ import annotations

import ctypes
import os
import re
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

#: Size and number of the measured products: a tenth of a second with the reference BLAS.
SIZE, REPEATS = 400, 5
#: Speed in GFLOP/s on one core below which a BLAS is slow: the reference one reaches 1 to 3, tuned ones 10
#: and more.
SLOW = 5.0
_LIBRARY = re.compile(r"(libopenblas|libmkl_rt|libblis|libatlas|libsatlas|libtatlas|libblas)[^/]*\.so[^/]*$")
_REFERENCE = re.compile(r"(^|/)blas/libblas|libblas\.so\.3\.\d")


@dataclass(frozen=True)
class Blas:
    """A loaded BLAS library.

    Attributes:
        path: Its file.
        speed: Rate of a product of matrices, [GFLOP/s], None where it could not be called.
        reference: Whether it is the reference implementation.
    """

    path: str
    speed: float | None
    reference: bool

    @property
    def slow(self) -> bool:
        """Whether it is much slower than necessary."""
        return self.reference or (self.speed is not None and self.speed < SLOW)

    def __str__(self) -> str:
        """Return file and speed."""
        speed = "not measured" if self.speed is None else f"{self.speed:.1f} GFLOP/s"
        return f"{self.path} ({speed})"


def loaded_blas() -> list[Blas]:
    """Return the BLAS libraries loaded into this process, as far as the system reports them."""
    try:
        maps = Path("/proc/self/maps").read_text()
    except OSError:
        return []
    files = {line.split(maxsplit=5)[-1] for line in maps.splitlines() if line.count(" /")}
    libraries: dict[str, str] = {}
    for file in sorted(files):
        if _LIBRARY.search(file):
            libraries.setdefault(os.path.realpath(file), file)
    return [Blas(file, _measured(file), bool(_REFERENCE.search(file))) for file in libraries]


def numpy_speed() -> float:
    """Return the rate of NumPy's product of matrices, [GFLOP/s]."""
    a = np.ones((SIZE, SIZE))
    return _rate(lambda: a @ a)


def _measured(file: str) -> float | None:
    try:
        product = ctypes.CDLL(file).dgemm_
    except (OSError, AttributeError):
        return None
    a, result = np.ones((SIZE, SIZE)), np.empty((SIZE, SIZE))
    n, one, zero = ctypes.c_int(SIZE), ctypes.c_double(1.0), ctypes.c_double(0.0)
    sizes = [ctypes.byref(n)] * 3

    def multiply() -> None:
        matrix, answer = (ctypes.c_void_p(array.ctypes.data) for array in (a, result))
        product(
            ctypes.c_char_p(b"N"), ctypes.c_char_p(b"N"), *sizes, ctypes.byref(one), matrix, ctypes.byref(n),
            matrix, ctypes.byref(n), ctypes.byref(zero), answer, ctypes.byref(n),
        )  # fmt: skip

    speed = _rate(multiply)
    return speed if np.all(result == SIZE) else None  # for instance another integer type


def _rate(work) -> float:  # type: ignore[no-untyped-def]
    """Return the best of several rates, [GFLOP/s]."""
    seconds = []
    for _ in range(REPEATS):
        start = perf_counter()
        work()
        seconds.append(perf_counter() - start)
    return float(2 * SIZE**3 / min(seconds) / 1e9)
