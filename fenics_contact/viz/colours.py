"""Colours that colour-blind readers can distinguish, and their assignment to neighbouring subdomains.

References:
    M. Okabe and K. Ito, Color universal design (2008), for symbols; P. Tol, Colour schemes, SRON technical
    note SRON/EPS/TN/09-002 (2021), scheme "light", for areas.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from matplotlib import colormaps
from matplotlib.colors import ListedColormap

INK = "#222222"  #: Text and axes.
GREY = "#9a9a9a"  #: Background elements.
PALE = "#e3e6e8"
BLUE = "#0072b2"  #: The first line of a diagram.
ORANGE = "#d55e00"  #: The second one.
GREEN = "#009e73"  #: The third one.

#: Cool and warm colours for areas: bodies alternate, so that those in contact are distinguishable.
FAMILIES = (
    ("#77aadd", "#44bb99", "#4466aa", "#99ddff"),
    ("#ee8866", "#eedd88", "#ffaabb", "#bbcc33"),
)
#: Any other area.
SPARE = "#dddddd"

#: Stresses, from pale to dark, but not to black, on which no line would be visible. As the maps below it has
#: monotonic lightness, so that it is readable in grey as well.
STRESS_MAP = ListedColormap(colormaps["magma_r"](np.linspace(0.04, 0.82, 256)), "stress")
ERROR_MAP = colormaps["viridis_r"]
PRESSURE_MAP = colormaps["YlGnBu"]  #: Sizes other than stresses.
SIGNED_MAP = colormaps["PuOr"]  #: Values of both signs, with zero in its middle.


def neighbours(cells: np.ndarray, partition: np.ndarray) -> np.ndarray:
    """Count the nodes that subdomains share.

    Args:
        cells: Node numbers, (n_cells, 8 | 4).
        partition: Subdomain of every cell, (n_cells,).

    Returns:
        Symmetric (S, S) int64 with zero diagonal.
    """
    owner = np.repeat(partition, cells.shape[1])
    touched = sp.csr_matrix((np.ones(owner.size, dtype=np.int64), (owner, cells.ravel())))
    touched.data[:] = 1
    shared = (touched @ touched.T).toarray()
    np.fill_diagonal(shared, 0)
    return np.asarray(shared)


def colour_subdomains(shared: np.ndarray, family: int) -> list[str]:
    """Choose a colour for each subdomain so that neighbours differ.

    Subdomains with the fewest free colours choose first (Brélaz' rule). A body uses its family of colours as
    far as possible; if a subdomain has more neighbours than there are colours, it repeats that of the
    neighbour with which it shares the fewest nodes.

    Args:
        shared: Number of nodes that subdomains share, (S, S), see `neighbours`.
        family: Preferred family of colours.

    Returns:
        S colours.

    References:
        D. Brélaz, New methods to color the vertices of a graph, Comm. ACM 22 (1979).
    """
    own, other = FAMILIES[family % 2], FAMILIES[(family + 1) % 2]
    palette = [*own, SPARE, *other]
    count = len(shared)
    chosen = np.full(count, -1)
    # Nodes shared with neighbours of each colour; where zero, the colour is free.
    taken = np.zeros((count, len(palette)), dtype=np.int64)
    degree = np.count_nonzero(shared, axis=1)
    for _ in range(count):
        urgency = np.count_nonzero(taken, axis=1) * (count + 1) + degree
        subdomain = int(np.argmax(np.where(chosen < 0, urgency, -1)))
        colour = int(np.argmin(taken[subdomain]))
        chosen[subdomain] = colour
        taken[:, colour] += shared[:, subdomain]
    return [palette[colour] for colour in chosen]
