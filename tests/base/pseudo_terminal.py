"""Programs run at a terminal that is none, and what its screen shows."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from pathlib import Path

from tests.conftest import LAUNCH

COLUMNS = 100
CONTROL = re.compile(r"\x1b\[[0-9;?]*[a-zA-Z]")


def at_a_terminal(script: Path, ranks: int, *arguments: str, timeout: float = 60.0) -> str:
    """Run a script with stdin, stdout and stderr at a terminal; return everything that was written to it."""
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 30, COLUMNS, 0, 0))
    process = subprocess.Popen(
        [str(LAUNCH), str(ranks), sys.executable, str(script), *arguments],
        stdin=slave,
        stdout=slave,
        stderr=slave,
        env={**os.environ, "TERM": "xterm"},
        start_new_session=True,
    )
    os.close(slave)
    written = b""
    try:
        while True:
            try:
                part = os.read(master, 65536)
            except OSError:  # how Linux says that nobody has the terminal open any more
                break
            if not part:
                break
            written += part
        assert process.wait(timeout) == 0, written.decode(errors="replace")
    finally:
        process.kill()
        os.close(master)
    return written.decode()


def screen(written: str) -> list[str]:
    """Return the lines that a terminal shows after all of it was written."""
    lines, row, column = [""], 0, 0
    for token in re.findall(rf"{CONTROL.pattern}|[\s\S]", written):
        if token == "\n":
            row += 1
        elif token == "\r":
            column = 0
        elif token.endswith("A") and len(token) > 1:
            row -= int(token[2:-1] or 1)
        elif token == "\x1b[2K":
            lines[row] = ""
        elif not token.startswith("\x1b"):
            lines[row] = lines[row][:column].ljust(column) + token + lines[row][column + 1 :]
            column += 1
        while len(lines) <= row:
            lines.append("")
    return [line.rstrip() for line in lines]


def plain(written: str) -> str:
    """Return what was written without colours and movements of the cursor."""
    return CONTROL.sub("", written)
