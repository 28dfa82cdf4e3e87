"""What an environment's Python reads at its start to see the packages that `link_system_packages.py` chose.

It is copied into the environment. The folder of links comes last on the path, so that what pip has installed
comes first. Modules that are found by a link are loaded from where the link points: dolfinx of Debian 13 and
newer refuses ufl, basix and ffcx from elsewhere.
"""

import os
import site
import sys
from importlib.machinery import PathFinder


def folder_of_links(environment):
    """Return the folder of links of an environment.

    To pip all paths that begin with that of the environment lie in it, so its name begins otherwise.
    """
    parent, name = os.path.split(os.path.abspath(environment))
    return os.path.join(parent, ".system-" + name.lstrip("."))


class LinkedModules:
    """Finds modules on the path as Python does, and those behind a link where it points."""

    def __init__(self, folder):
        """Take the folder of links."""
        self.folder = folder

    def find_spec(self, name, path=None, target=None):
        """Return the specification of a module behind a link, else None."""
        if path is not None:
            return None
        spec = PathFinder.find_spec(name, None, target)
        places = [] if spec is None else [spec.origin, *(spec.submodule_search_locations or ())]
        for place in places:
            if place and place.startswith(self.folder + os.sep):
                entry = os.path.relpath(place, self.folder).split(os.sep)[0]
                behind = os.readlink(os.path.join(self.folder, entry))
                return PathFinder.find_spec(name, [os.path.dirname(behind)], target)
        return None


def see(folder):
    """Let this Python see what a folder of links has."""
    site.addsitedir(folder)
    sys.meta_path.insert(sys.meta_path.index(PathFinder), LinkedModules(folder))


if __name__ == "_fenics_contact_system":  # its name in the environment
    see(folder_of_links(sys.prefix))
