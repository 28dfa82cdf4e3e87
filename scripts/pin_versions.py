"""Write constraints/: what pip installs, with hashes, for every Python that Debian or Ubuntu has.

    python3 -m venv /tmp/uv && /tmp/uv/bin/pip install uv
    PATH=/tmp/uv/bin:$PATH .venv/bin/python scripts/pin_versions.py [--upgrade]

Versions that the files have are kept, so raise one there first; `--upgrade` takes the newest of all. uv
resolves for a Python that need not be installed, on x86-64 and on aarch64.

Every Python has four lists: `build.txt` is only for building, `demo.txt` is the package with its commands
and pictures; `wheel.txt` (FEniCSx and gmsh from pip) and `dev.txt` (the tools of developers) come on top.
"""

from __future__ import annotations

import re
import sys
import tempfile
import tomllib
from pathlib import Path

from fenics_contact._base.launching import finished

ROOT = Path(__file__).resolve().parents[1]
#: NumPy and SciPy of the oldest Debian or Ubuntu with a Python. pip must not put others over them, nor over
#: the setuptools with which FEniCSx compiles.
SYSTEM = {
    "3.11": ["numpy==1.24.2", "scipy==1.10.1"],
    "3.12": ["numpy==1.26.4", "scipy==1.11.4"],
    "3.13": ["numpy==2.2.4", "scipy==1.15.3"],
    "3.14": ["numpy==2.4.6", "scipy==1.17.1"],
}
PLATFORMS = {"x86_64": "x86_64-manylinux_2_34", "aarch64": "aarch64-manylinux_2_34"}
HEADS = {
    "build": "Only to build the package.",
    "demo": "The package with its command line and pictures; NumPy and SciPy come with FEniCSx.",
    "wheel": "FEniCSx and gmsh from pip, where the system has none: a third party's wheel, alpha.",
    "dev": "What developers need on top: tests, types, style, notebooks, pages.",
}
Pins = dict[str, tuple[str, set[str]]]


def resolved(python: str, machine: str, extras: list[str], bounds: list[str]) -> Pins:
    """Return the version and the hashes of everything that some extras and the build need, by name."""
    build = tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"]
    with tempfile.TemporaryDirectory() as folder:
        needed, limits = Path(folder, "build.in"), Path(folder, "limits.txt")
        needed.write_text("\n".join(build))
        limits.write_text("\n".join(bounds))
        command = ["uv", "pip", "compile", "--quiet", "--format", "pylock.toml", "--python-version", python]
        command += ["--python-platform", PLATFORMS[machine], "--constraint", str(limits)]
        command += [f"--extra={extra}" for extra in extras] + [str(ROOT / "pyproject.toml"), str(needed)]
        uv = finished(command, 600.0)
        if uv.status != 0:
            raise SystemExit(uv.errors)
        lock = tomllib.loads(uv.output)
    pins = {}
    for package in lock["packages"]:
        files = package.get("wheels") or [package["sdist"]]
        pins[package["name"]] = package["version"], {file["hashes"]["sha256"] for file in files}
    return pins


def resolved_everywhere(python: str, extras: list[str], bounds: list[str]) -> Pins:
    """Return what is needed on any machine, with the hashes for all of them."""
    pins: Pins = {}
    for machine in PLATFORMS:
        for name, (version, hashes) in resolved(python, machine, extras, bounds).items():
            if pins.setdefault(name, (version, set()))[0] != version:
                raise SystemExit(f"{name} would be {version} and {pins[name][0]} on two machines: pin it")
            pins[name][1].update(hashes)
    return pins


def kept(folder: Path) -> list[str]:
    """Return the versions that the lists of a Python have."""
    text = "\n".join(path.read_text() for path in folder.glob("*.txt"))
    return re.findall(r"^[\w.-]+==[\w.]+", text, re.MULTILINE)


def write(path: Path, python: str, pins: Pins) -> None:
    """Write one list."""
    lines = [f"# Python {python}. {HEADS[path.stem]}", "# Written by scripts/pin_versions.py.", ""]
    for name, (version, hashes) in sorted(pins.items()):
        words = [f"{name}=={version}", *(f"--hash=sha256:{each}" for each in sorted(hashes))]
        lines.append(" \\\n    ".join(words))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n")


def main() -> None:
    """Write the lists of all Pythons."""
    for python, system in SYSTEM.items():
        folder = ROOT / "constraints" / f"python{python}"
        bounds = [] if "--upgrade" in sys.argv else kept(folder)
        shared = [pin for pin in bounds if not pin.startswith(("numpy==", "scipy=="))]
        theirs = {"numpy", "scipy", "setuptools"}
        demo = resolved_everywhere(python, ["cli", "viz"], shared + system)
        both = resolved_everywhere(python, ["cli", "viz", "dev"], shared + system + fixed(demo, set()))
        lists = {
            "build": {"setuptools": demo["setuptools"]},
            "demo": {name: pin for name, pin in demo.items() if name not in theirs},
            "dev": {name: pin for name, pin in both.items() if name not in {*demo, *theirs}},
        }
        if python != "3.11":  # too old for the wheel
            ours = bounds + fixed(both, {"numpy", "scipy"})
            wheel = resolved(python, "x86_64", ["cli", "viz", "dev", "wheel"], ours)
            lists["wheel"] = {name: pin for name, pin in wheel.items() if name in theirs or name not in both}
        for stem, pins in lists.items():
            write(folder / f"{stem}.txt", python, pins)
        print(f"Python {python}: " + ", ".join(f"{len(pins)} in {stem}" for stem, pins in lists.items()))


def fixed(pins: Pins, free: set[str]) -> list[str]:
    """Return pins as bounds of another resolution, without some names."""
    return [f"{name}=={version}" for name, (version, _) in pins.items() if name not in free]


if __name__ == "__main__":
    main()
