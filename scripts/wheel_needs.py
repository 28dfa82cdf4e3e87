"""Print what this Python and this machine need for FEniCSx from pip, one line each; nothing if all is there.

`wheel_needs.py` prints what prevents the installation or compiling; `wheel_needs.py libraries` the Debian
packages of shared libraries without which pictures or gmsh cannot be loaded. It runs on any Python 3.
"""

import ctypes
import os
import platform
import shlex
import shutil
import sys
import sysconfig
from importlib.util import find_spec

LISTS = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "constraints")
#: What pyvista's VTK draws with, and what gmsh's wheel links to.
LIBRARIES = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libGLU.so.1": "libglu1-mesa",
    "libXcursor.so.1": "libxcursor1",
    "libXft.so.2": "libxft2",
    "libXinerama.so.1": "libxinerama1",
}


def pythons():
    """Return the versions of Python that the wheel is pinned for."""
    folders = [name for name in os.listdir(LISTS) if os.path.exists(os.path.join(LISTS, name, "wheel.txt"))]
    return sorted(name[len("python") :] for name in folders)


def machine():
    """Return the version of Python, the system, the processor and the C library."""
    library = os.confstr("CS_GNU_LIBC_VERSION") if sys.platform == "linux" else ""
    return "{}.{}".format(*sys.version_info[:2]), sys.platform, platform.machine(), library or "another"


def obstacles():
    """Return what is missing to install FEniCSx from pip and to compile its forms."""
    found = []
    version, system, processor, library = machine()
    if version not in pythons():
        found.append("Python {}, found {}".format(" or ".join(pythons()), version))
    if (system, processor) != ("linux", "x86_64"):
        found.append(f"Linux on x86-64, found {system} on {processor}")
    elif not _new_glibc(library):
        found.append(f"glibc 2.34 or newer, found {library}")
    if find_spec("ensurepip") is None:
        found.append("Python's modules venv and ensurepip (Debian: python3-venv)")
    if not os.path.exists(os.path.join(headers(), "Python.h")):
        found.append("Python.h of this Python (Debian: python3-dev)")
    compiler = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc")[0]
    if shutil.which(compiler) is None:
        found.append(f"the C compiler {compiler}, which the environment variable CC can name (Debian: gcc)")
    return found


def headers():
    """Return the folder of Python's header files."""
    return sysconfig.get_path("include")


def _new_glibc(name):
    """Return whether "glibc 2.41" is one that the wheel was built for."""
    numbers = name.split()[-1].split(".")
    return name.startswith("glibc") and [int(number) for number in numbers[:2]] >= [2, 34]


def missing_libraries():
    """Return the Debian packages of the shared libraries that cannot be loaded."""
    found = []
    for name, package in LIBRARIES.items():
        try:
            ctypes.CDLL(name)
        except OSError:
            found.append(package)
    return found


if __name__ == "__main__":
    lines = missing_libraries() if sys.argv[1:] == ["libraries"] else obstacles()
    print("\n".join(lines), end="\n" if lines else "")
