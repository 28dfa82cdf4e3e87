"""Starting processes on one rank or several, without the traces of MPI in this one's environment.

MPI_Init and mpirun describe a process in its environment, which its children inherit: a child that starts MPI
takes itself for that process, and an mpirun among them ends with status 1 without a message. Settings of
users (a component, the prefix of the installation) are kept.

Also a program, for shells: ``python -P launching.py RANKS`` prints the beginning of the command, one word per
line, by which ranks may share cores.
"""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from fenics_contact.errors import MissingRequirementError

if TYPE_CHECKING:
    from mpi4py import MPI

#: Prefixes of names that only Open MPI 4 and 5, PMIx, PMI, ORTE, PRRTE and MPICH write.
_TRACES = (
    "OMPI_APP_CTX_", "OMPI_ARGV", "OMPI_COMMAND", "OMPI_COMM_WORLD_", "OMPI_FILE_LOCATION",
    "OMPI_FIRST_RANKS", "OMPI_NUM_APP_CTX", "OMPI_UNIVERSE_SIZE", "OMPI_MCA_ess", "OMPI_MCA_initial_wdir",
    "OMPI_MCA_mpi_oversubscribe", "OMPI_MCA_orte_app_num", "OMPI_MCA_orte_ess_", "OMPI_MCA_orte_hnp_uri",
    "OMPI_MCA_orte_jobfam_session_dir", "OMPI_MCA_orte_launch", "OMPI_MCA_orte_local_daemon_uri",
    "OMPI_MCA_orte_num_nodes", "OMPI_MCA_orte_precondition_transports", "OMPI_MCA_orte_top_session_dir",
    "OMPI_MCA_pmix", "OMPI_MCA_shmem_RUNTIME_QUERY_hint", "OPAL_OUTPUT_", "ORTE_", "PMI_", "PMIX_", "PRTE_",
    "HYDI_", "MPI_LOCAL",
)  # fmt: skip
#: Open MPI's settings for a process that is alone; other MPIs do not read them.
_ALONE = {"OMPI_MCA_ess_singleton_isolated": "1", "OMPI_MCA_pml": "ob1"}
#: Settings of users among them.
_SETTINGS = ("PMIX_MCA_", "PRTE_MCA_")
#: Prefixes of all names related to starting MPI.
_FAMILIES = ("OMPI_", "OPAL_", "ORTE_", "PMI_", "PMIX_", "PRTE_", "HYDRA_", "I_MPI_", "MPICH_")


def traces(names: Iterable[str]) -> list[str]:
    """Return the names in an environment that MPI has written."""
    return [name for name in names if name.startswith(_TRACES) and not name.startswith(_SETTINGS)]


def clean_environment(given: Mapping[str, str] | None = None) -> dict[str, str]:
    """Return an environment, by default that of this process, without the traces of MPI."""
    environment = dict(os.environ if given is None else given)
    for name in traces(environment):
        del environment[name]
    return environment


@contextlib.contextmanager
def started_alone() -> Iterator[None]:
    """Let MPI start in a block without what only several processes need, unless mpirun started this one.

    Open MPI 4 starts a daemon for processes that a single one might add, and asks for fast networks: 0.4 of
    0.5 s. The environment is as before afterwards; settings of users are kept.
    """
    found = {} if traces(os.environ) else {name: _ALONE[name] for name in _ALONE.keys() - os.environ.keys()}
    os.environ.update(found)
    try:
        yield
    finally:
        for name in found:
            os.environ.pop(name, None)


class LoneProcess:
    """What is asked of a communicator of one rank, in a program that need not load MPI."""

    rank = 0
    size = 1

    def bcast(self, value: Any) -> Any:
        """Return what rank 0 has."""
        return value

    def allgather(self, value: Any) -> list[Any]:
        """Return what all ranks have."""
        return [value]

    def allreduce(self, value: Any) -> Any:
        """Return the sum over all ranks."""
        return value


def ranks_of(comm: MPI.Comm | None) -> MPI.Comm:
    """Return a communicator, or without one that of a process alone."""
    return cast("MPI.Comm", LoneProcess()) if comm is None else comm


def launcher(ranks: int) -> list[str]:
    """Return the launcher for a number of ranks: the mpirun beside this Python, or on PATH."""
    if ranks == 1:
        return []
    beside = [Path(prefix) / "bin" / "mpirun" for prefix in (sys.prefix, sys.base_prefix)]
    candidates = [str(path) for path in beside if os.access(path, os.X_OK)] or [shutil.which("mpirun") or ""]
    if not candidates[0]:
        raise MissingRequirementError(
            f"{ranks} ranks need mpirun, found none: install MPI, or use one rank",
            name="mpirun",
        )
    return [candidates[0], "-n", str(ranks)]


def sharing_launcher(ranks: int) -> list[str]:
    """Return a launcher by which ranks may outnumber the cores: with options of Open MPI, MPICH needs none.

    Names of these options in the environment differ between versions of Open MPI, some warn of others'.
    """
    start = launcher(ranks)
    # Open MPI's on Ubuntu 26.04 does not find its own name.
    if start and not re.search("HYDRA|MPICH|Intel", finished([start[0], "--version"], 60.0).output):
        start[1:1] = ["--oversubscribe", "--bind-to", "none"]
        start[:0] = ["env", "OMPI_MCA_mpi_yield_when_idle=1"]  # a process alone has nobody to yield to
    return start


@dataclass(frozen=True)
class FinishedProcess:
    """How a process ended; no status if it did not end in time."""

    status: int | None
    output: str
    errors: str


def finished(
    command: Sequence[str],
    limit: float,
    *,
    environment: Mapping[str, str] | None = None,
    folder: Path | None = None,
) -> FinishedProcess:
    """Run a command in a session of its own, free of the traces of MPI, and wait for its end."""
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        errors="replace", env=clean_environment(environment), cwd=folder, start_new_session=True,
    )  # fmt: skip
    try:
        output, errors = process.communicate(timeout=limit)
        return FinishedProcess(process.returncode, output, errors)
    except subprocess.TimeoutExpired:
        _end(process)
        return FinishedProcess(None, *process.communicate())
    except BaseException:  # an interrupt from the keyboard does not reach a session of its own
        _end(process)
        process.communicate()
        raise


def _end(process: subprocess.Popen[str]) -> None:
    """End a process with all its children; mpirun needs a moment to end its ranks."""
    process.terminate()
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(timeout=5.0)
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


def last_words(command: Sequence[str], output: str, most: int = 2000) -> str:
    """Return the end of a failed process's output, or advice if there is none."""
    words = output.strip()[-most:]
    if words:
        return words
    settings = sorted(name for name in clean_environment() if name.startswith(_FAMILIES))
    return (
        f"it printed nothing and probably could not start: run `{shlex.join(command)[:most]}` in a shell "
        f"with these variables unset: {', '.join(settings) or 'none'}"
    )


def main() -> None:
    """Print the beginning of the command for the number of ranks given as the only argument."""
    try:
        start = sharing_launcher(int(sys.argv[1]))
    except MissingRequirementError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(2)
    unset = [word for name in traces(os.environ) for word in ("-u", name)]  # `--unset` is of GNU alone
    sys.stdout.write("\n".join(["env", *unset, *start]) + "\n")


if __name__ == "__main__":
    main()
