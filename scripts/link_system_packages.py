"""Let a virtual environment see some packages of Debian's Python with what they need, and no others.

    /usr/bin/python3 scripts/link_system_packages.py ENVIRONMENT PACKAGE...

An environment with --system-site-packages sees all that the system has: Debian's python3-matplotlib, for one,
puts its own mpl_toolkits before the one that pip installed. Here ENVIRONMENT, made without, sees a folder of
links to the modules of the PACKAGEs that are installed and of the python3-* packages that they depend on; it
comes last on the path. A package of which pip has installed a module is left out as a whole. Running it again
brings the links up to date. The folder lies beside the environment (.venv has .system-venv): of packages in
it pip would try to remove older versions.
"""

import os
import re
import shutil
import site
import subprocess
import sys

import system_packages

#: What Python reads at its start, in the environment.
MODULE = "_fenics_contact_system"


def places():
    """Return the folders of the system's Python in which Debian's packages have their modules."""
    return [place for place in site.getsitepackages() if not place.startswith("/usr/local/")]


def modules_of(environment):
    """Return the folder in which pip installs modules."""
    return os.path.join(environment, "lib", "python{}.{}".format(*sys.version_info[:2]), "site-packages")


def asked(*words):
    """Return what dpkg-query prints."""
    return subprocess.run(["dpkg-query", *words], stdout=subprocess.PIPE, check=True, text=True).stdout


def installed():
    """Return what each python3-* package that is installed depends on, and which packages provide a name."""
    needs, providers = {}, {}
    form = r"${db:Status-Status}\t${Package}\t${Depends}, ${Pre-Depends}\t${Provides}\n"
    for line in asked("-W", "-f", form, "python3-*").splitlines():
        status, package, depends, provides = line.split("\t")
        if status == "installed":
            needs[package] = names(depends)
            for name in {package} | names(provides):
                providers.setdefault(name, set()).add(package)
    return needs, providers


def names(relations):
    """Return the names in `python3-numpy (>= 1:1.21), python3-six | python3-other, python3:any`."""
    return set(re.findall(r"(?:^|[,|])\s*([a-z0-9][a-z0-9+.-]+)", relations))


def needed(packages):
    """Return the packages that are installed, and all that they depend on."""
    needs, providers = installed()
    found, waiting = set(), list(packages)
    while waiting:
        for name in providers.get(waiting.pop(), set()) - found:
            found.add(name)
            waiting.extend(needs[name])
    return sorted(found)


def modules(packages):
    """Return the entries of each package in the system's folders of modules."""
    listings = asked("-L", *packages).split("\n\n") if packages else []
    return [entries(listing.splitlines()) for listing in listings]


def entries(paths):
    """Return the paths that lie in a folder of modules, by their names; the first folder wins."""
    found = {}
    for place in places():
        for path in paths:
            if os.path.dirname(path) == place and os.path.exists(path):
                found.setdefault(os.path.basename(path), path)
    return found


def is_metadata(name):
    """Return whether an entry describes a distribution, or is what Python makes: it is no module."""
    return name.endswith((".dist-info", ".egg-info")) or name == "__pycache__"


def wanted(environment, packages):
    """Return the links that the folder is to have: names and where they point."""
    own = {name.split(".")[0] for name in os.listdir(modules_of(environment)) if not is_metadata(name)}
    found = {}
    for package in modules(needed(packages)):
        if not own & {name.split(".")[0] for name in package if not is_metadata(name)}:
            found.update(package)
    found.pop("__pycache__", None)
    return found


def link(environment, packages):
    """Bring the links of an environment up to date."""
    own, folder = modules_of(environment), system_packages.folder_of_links(environment)
    os.makedirs(folder, exist_ok=True)
    links = wanted(environment, packages)
    for name in os.listdir(folder):
        path = os.path.join(folder, name)
        if os.path.islink(path) and os.readlink(path) != links.get(name):
            os.remove(path)
    for name, target in links.items():
        if not os.path.islink(os.path.join(folder, name)):
            os.symlink(target, os.path.join(folder, name))
    shutil.copyfile(system_packages.__file__, os.path.join(own, f"{MODULE}.py"))
    with open(os.path.join(own, f"{MODULE}.pth"), "w") as file:
        file.write(f"import {MODULE}\n")


if __name__ == "__main__":
    link(sys.argv[1], sys.argv[2:])
