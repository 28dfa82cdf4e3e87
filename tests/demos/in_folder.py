"""Run a demo as a program of its own in a folder: FOLDER DEMO.py ARGUMENT..."""

from __future__ import annotations

import contextlib
import runpy
import sys

with contextlib.chdir(sys.argv[1]):
    del sys.argv[:2]
    runpy.run_path(sys.argv[0], run_name="__main__")
