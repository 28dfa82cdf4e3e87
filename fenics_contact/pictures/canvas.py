"""What pictures are drawn on: colours, directions of view, rendering, figures, and the finished picture.

References:
    M. Okabe and K. Ito, Color universal design (2008), for symbols; P. Tol, Colour schemes, SRON technical
    note SRON/EPS/TN/09-002 (2021), scheme "light", for areas; distinguishable with colour deficiencies, too.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeAlias

import matplotlib as mpl
import numpy as np
import pyvista as pv
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from fenics_contact._base.files import write_atomically
from fenics_contact._base.launching import clean_environment, ranks_of
from fenics_contact.errors import InvalidInputError, MissingRequirementError, together
from fenics_contact.results.contact import Status

if TYPE_CHECKING:
    from mpi4py import MPI


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
#: Levels without a zero, such as temperatures: cold is dark, hot is bright.
LEVEL_MAP = ListedColormap(colormaps["inferno"](np.linspace(0.25, 0.97, 256)), "level")
#: Colours of a field by their kind in `field_entries`.
MAPS = {"size": STRESS_MAP, "signed": SIGNED_MAP, "level": LEVEL_MAP, "status": STRESS_MAP}


#: Largest width on the screen, in its own units.
SHOWN_WIDTH = 900


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture that Jupyter shows as the value of a cell, and its file, if any.

    It can be used like a path to its file, as in ``open(picture)`` or ``Path(picture)``. On ranks that did
    not draw it has its path and shows nothing.

    Attributes:
        png: The PNG file's content on the rank that drew, None on the others.
        path: The file it was written to, None if it was not.
    """

    png: bytes | None = field(repr=False)
    path: Path | None = None

    @property
    def size(self) -> tuple[int, int] | None:
        """Width and height in pixels, None on ranks that did not draw."""
        if self.png is None:
            return None
        # A PNG file begins with 16 fixed bytes; then come width and height, four bytes each.
        return int.from_bytes(self.png[16:20], "big"), int.from_bytes(self.png[20:24], "big")

    def __fspath__(self) -> str:
        """Return the path of the file.

        Raises:
            InvalidInputError: If the picture was written to no file.
        """
        if self.path is None:
            raise InvalidInputError("the picture was not written to a file: give plot_ a path, 'a.png'")
        return str(self.path)

    def __str__(self) -> str:
        """Return the path of the file, or a text if there is none."""
        return "picture without a file" if self.path is None else str(self.path)

    def _repr_png_(self) -> bytes | None:
        return self.png

    def _repr_mimebundle_(self, **_: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        """Show many pixels on a limited width: sharp on fine screens, and no wider than a notebook."""
        size = self.size
        if size is None:
            return {"text/plain": ""}, {}
        width = min(size[0], SHOWN_WIDTH)
        return {"image/png": self.png, "text/plain": str(self)}, {"image/png": {"width": width}}


def png_path(path: str | Path | None) -> Path | None:
    """Return the path if it names a PNG file, else raise."""
    if path is None:
        return None
    target = Path(path)
    if target.suffix != ".png":
        raise InvalidInputError(f"pictures are PNG files, got the name {target.name!r}: let it end in '.png'")
    return target


def draw_picture(comm: MPI.Comm | None, path: Path | None, draw: Callable[[BinaryIO], None]) -> Picture:
    """Let rank 0 draw and write; if it fails, all ranks raise. Collective on ``comm`` if given."""
    png = None
    ranks = ranks_of(comm)
    with together(ranks):
        if ranks.rank == 0:
            paper = BytesIO()
            draw(paper)
            png = paper.getvalue()
            if path is not None:
                write_atomically(path, png)
    return Picture(png, path)


#: Renders a window of four pixels. The result depends only on environment and shared libraries.
_PROBE = """
from vtkmodules.vtkRenderingCore import vtkRenderWindow
import vtkmodules.vtkRenderingOpenGL2
window = vtkRenderWindow()
window.SetOffScreenRendering(1)
window.SetSize(2, 2)
window.Render()
"""

#: Environment variables that decide where VTK looks for OpenGL.
_CHOICE = "VTK_DEFAULT_OPENGL_WINDOW"
_DECIDING = (_CHOICE, "VTK_DEFAULT_EGL_DEVICE_INDEX", "DISPLAY", "LD_LIBRARY_PATH")
_EGL = "vtkEGLRenderWindow"


@contextmanager
def rendering() -> Iterator[None]:
    """Let VTK use EGL within the block if there is no display and no other choice is set.

    VTK itself tries X first and warns if there is none. The environment is restored afterwards.
    """
    check_renderer()
    if not _chooses_egl():
        yield
        return
    os.environ[_CHOICE] = _EGL
    try:
        yield
    finally:
        del os.environ[_CHOICE]


def _chooses_egl() -> bool:
    if any(os.environ.get(name) for name in (_CHOICE, "DISPLAY", "WAYLAND_DISPLAY")):
        return False
    return not _probe((_EGL, *_deciding()[1:]))


def _deciding() -> tuple[str | None, ...]:
    return tuple(os.environ.get(name) for name in _DECIDING)


def check_renderer() -> None:
    """Make sure that pyvista can draw, with or without a display; takes half a second, once."""
    if _chooses_egl():
        return
    ending = _probe(_deciding())
    if ending:
        window = os.environ.get(_CHOICE, "not set")
        raise MissingRequirementError(
            f"pictures need EGL, OSMesa or X, a trial rendering {ending} ({_CHOICE} is {window}): "
            "apt-get install libegl1 and set VTK_DEFAULT_OPENGL_WINDOW=vtkEGLRenderWindow",
            name="libegl1",
        )


@lru_cache(maxsize=4)
def _probe(environment: tuple[str | None, ...]) -> str:
    """Return how a trial rendering failed, empty if it succeeded; the other entries are keys of the cache."""
    variables = {name: value for name, value in clean_environment().items() if name != _CHOICE}
    if environment[0]:
        variables[_CHOICE] = environment[0]
    try:
        ending = subprocess.run(
            [sys.executable, "-c", _PROBE], env=variables, capture_output=True, timeout=120.0, check=False
        )
    except subprocess.TimeoutExpired:
        return "did not end within two minutes"
    if ending.returncode < 0:
        return f"died by signal {-ending.returncode}"
    return f"ended with exit status {ending.returncode}" if ending.returncode else ""


@dataclass(frozen=True)
class View:
    """A direction of view.

    `towards`: unit vector from the scene to the viewer; `up`: unit vector that points up in the picture,
    perpendicular to it.
    """

    towards: np.ndarray
    up: np.ndarray

    @property
    def right(self) -> np.ndarray:
        """Unit vector that points right in the picture, (3,)."""
        return np.cross(self.up, self.towards)

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return picture coordinates, (n, 2): right and up."""
        return points @ np.column_stack([self.right, self.up])


#: View of the plane of plane bodies.
IN_PLANE = View(np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]))


@dataclass(frozen=True)
class Frame:
    """The visible rectangle of a view, from its lower left to its upper right corner."""

    low: np.ndarray
    high: np.ndarray

    @property
    def centre(self) -> np.ndarray:
        """Middle, (2,)."""
        return (self.low + self.high) / 2

    @property
    def size(self) -> np.ndarray:
        """Width and height, (2,)."""
        return self.high - self.low

    def holds(self, places: np.ndarray) -> np.ndarray:
        """Return which points, (..., 2), are visible."""
        return np.asarray(np.all((places > self.low) & (places < self.high), axis=-1))

    def fit(self, axes: Axes) -> None:
        """Let axes show the rectangle with equal scales."""
        axes.set(aspect="equal", xlim=(self.low[0], self.high[0]), ylim=(self.low[1], self.high[1]))

    @property
    def proportion(self) -> float:
        """Width by height."""
        return float(self.size[0] / self.size[1])


def frame_around(view: View, points: np.ndarray, margin: float = 0.02) -> Frame:
    """Return the frame that contains all points, with a margin as a fraction of its larger side."""
    places = view.project(points)
    low, high = places.min(axis=0), places.max(axis=0)
    border = margin * float(np.max(high - low))
    return Frame(low - border, high + border)


def looking_along(towards: np.ndarray, horizontal: np.ndarray) -> View:
    """Return the view towards a side in which the direction `horizontal` points right."""
    towards = towards / np.linalg.norm(towards)
    right = horizontal - (horizontal @ towards) * towards
    right /= np.linalg.norm(right)
    return View(towards, np.cross(towards, right))


def oblique_view(points: np.ndarray) -> View:
    """View from the front, slightly from above and from the left, with the longer of x and y horizontal.

    The rotation about the vertical axis is small: a lying as well as a standing ring shows its opening.
    """
    extent = np.ptp(points, axis=0)
    front = np.array([-0.30, -1.0, 0.72])
    if extent[1] > 1.01 * extent[0]:  # what is as long as wide is seen alike, however its points are rounded
        return looking_along(np.array([1.0, -0.30, 0.72]), np.array([0.0, 1.0, 0.0]))
    return looking_along(front, np.array([1.0, 0.0, 0.0]))


def face_on(normal: np.ndarray) -> View:
    """View a plane at right angles, from where its normal points: z up if it is upright, else y."""
    towards = normal / np.linalg.norm(normal)
    reference = np.array([0.0, 0.0, 1.0]) if abs(towards[2]) < 0.8 else np.array([0.0, 1.0, 0.0])
    return looking_along(towards, np.cross(reference, towards))


def axis_label(direction: np.ndarray) -> str:
    """Name a direction: "x", "−z", or "" if it runs along no axis."""
    axis = int(np.argmax(np.abs(direction)))
    if abs(direction[axis]) < 0.999:
        return ""
    return ("" if direction[axis] > 0 else "−") + "xyz"[axis]


#: Width of every sheet in inches: fonts and lines scale with the number of pixels.
INCHES = 16.0
#: Size of the title, in points.
HEADLINE = 18
#: Largest width of the title relative to the sheet.
WIDEST = 0.97


_STYLE = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 15,
    "axes.titlesize": 16,
    "axes.labelsize": 15,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}


@contextmanager
def sheet(paper: BinaryIO, size: tuple[int, int], title: str) -> Iterator[Figure]:
    """Open an empty figure with automatic layout, and save it at the end."""
    dpi = size[0] / INCHES
    with mpl.rc_context({**mpl.rcParamsDefault, **_STYLE}):
        figure = Figure(figsize=(INCHES, size[1] / dpi), dpi=dpi, layout="constrained")
        FigureCanvasAgg(figure)
        figure.get_layout_engine().set(w_pad=0.12, h_pad=0.12)
        head = figure.suptitle(title, fontsize=HEADLINE, fontweight="bold")
        wide = float(head.get_window_extent().width) / (WIDEST * size[0])
        head.set_fontsize(HEADLINE / max(wide, 1.0))
        yield figure
        figure.savefig(paper, dpi=dpi, format="png")


def show_image(axes: Axes, image: np.ndarray, frame: Frame, title: str = "") -> None:
    """Show an image of a frame's content, in the frame's coordinates."""
    axes.imshow(image, extent=(frame.low[0], frame.high[0], frame.low[1], frame.high[1]))
    axes.set_title(title)


def show_view(axes: Axes, image: np.ndarray, frame: Frame, title: str = "") -> None:
    """Show an image without coordinates."""
    show_image(axes, image, frame, title)
    axes.set_axis_off()


def add_colour_bar(
    figure: Figure,
    panels: Iterable[Axes],
    key: ScalarMappable,
    label: str,
    *,
    beyond: tuple[float, float] | None = None,
) -> None:
    """Draw a colour bar to the right of panels; its ends are pointed where ``beyond`` exceeds the colours.

    ``beyond`` is the smallest and largest value drawn.
    """
    low, high = beyond or key.get_clim()
    out = low < key.norm.vmin, high > key.norm.vmax
    extend = {(False, False): "neither", (True, False): "min", (False, True): "max"}.get(out, "both")
    figure.colorbar(key, ax=panels, extend=extend, label=label, aspect=30, shrink=0.95, panchor=False)


#: Images are rendered at this multiple of the resolution: matplotlib then smooths edges alike on all
#: machines.
SUPERSAMPLING = 2
#: Side of the corner with the directions of the axes, relative to the side of a square as large as the image.
AXES = 0.2


@dataclass(frozen=True)
class Layer:
    """A mesh and how to draw it."""

    mesh: pv.DataSet
    options: Mapping[str, Any] = field(default_factory=dict)


def balls(points: np.ndarray, radius: float) -> pv.PolyData:
    """Return points (n, 3) as spheres."""
    return pv.PolyData(np.asarray(points)).glyph(geom=pv.Sphere(radius=radius), scale=False, orient=False)


def render(
    layers: Iterable[Layer], view: View, frame: Frame, width: int, *, axes: bool = False
) -> np.ndarray:
    """Render one image of ``width`` pixels, with the directions of the axes in its corner if requested.

    The proportions of the frame are those of the image, which has `SUPERSAMPLING` times the resolution.
    """
    size = [SUPERSAMPLING * width, max(2, round(SUPERSAMPLING * width / frame.proportion))]
    with rendering():
        theme = pv.themes.DocumentTheme()
        plotter = pv.Plotter(off_screen=True, window_size=size, theme=theme, lighting="none")
        try:
            plotter.background_color = "white"
            # One lamp above the viewer's left shoulder: colours keep their brightness on all visible faces.
            plotter.add_light(pv.Light(position=(-0.3, 0.35, 1.0), light_type="camera light"))
            middle = np.zeros(3)
            for layer in layers:
                plotter.add_mesh(
                    layer.mesh, **{"show_scalar_bar": False, "reset_camera": False, **layer.options}
                )
                middle = np.asarray(layer.mesh.center)
            _aim(plotter, view, frame, middle)
            if axes:
                side = AXES * np.sqrt(size[0] * size[1]) / np.array(size)
                ink = dict.fromkeys(("x_color", "y_color", "z_color", "color"), INK)
                names = {"xlabel": "x", "ylabel": "y", "zlabel": "z", "label_size": (0.35, 0.14)}
                plotter.add_axes(viewport=(0.0, 0.0, *side), line_width=3 * SUPERSAMPLING, **ink, **names)
            return np.asarray(plotter.screenshot(None, return_img=True))[..., :3]
        finally:
            plotter.close()


def _aim(plotter: pv.Plotter, view: View, frame: Frame, middle: np.ndarray) -> None:
    target = frame.centre[0] * view.right + frame.centre[1] * view.up + (middle @ view.towards) * view.towards
    camera = plotter.camera
    camera.parallel_projection = True
    camera.focal_point = target
    camera.position = target + float(np.max(frame.size)) * view.towards
    camera.up = view.up
    camera.parallel_scale = float(frame.size[1]) / 2
    plotter.reset_camera_clipping_range()


#: Keywords of ``Axes.scatter``.
SYMBOLS: dict[Status, dict[str, Any]] = {
    Status.OPEN: {"marker": "o", "facecolors": "none", "edgecolors": GREY, "s": 30},
    Status.STICK: {"marker": "s", "facecolors": BLUE, "edgecolors": "white", "s": 90},
    Status.SLIP: {"marker": "^", "facecolors": ORANGE, "edgecolors": "white", "s": 110},
}


#: Without friction a closed point neither sticks nor slips.
CLOSED = {**SYMBOLS[Status.STICK], "marker": "D", "s": 70}


def symbols_of(rubs: bool) -> dict[Status, tuple[str, dict[str, Any]]]:
    """Return name and keywords of ``Axes.scatter`` of the statuses that points of a pair can have."""
    if rubs:
        return {status: (status.name.lower(), look) for status, look in SYMBOLS.items()}
    return {Status.OPEN: ("open", SYMBOLS[Status.OPEN]), Status.SLIP: ("closed", CLOSED)}


@dataclass(frozen=True)
class Units:
    """Names of the scene's units in titles and colour bars.

    Attributes:
        length: Unit of coordinates and displacements.
        force: Unit of forces.
        stress: Unit of stresses and pressures, force / length².
        temperature: Unit of temperatures.
        power: Unit of heat that flows; of states with mechanics "mW" by default, which is N mm/s.
    """

    length: str = "mm"
    force: str = "N"
    stress: str = "MPa"
    temperature: str = "K"
    power: str = "W"

    @property
    def flux(self) -> str:
        """Unit of heat flux, power / length²."""
        return f"{self.power}/{self.length}²"

    @property
    def conductance(self) -> str:
        """Unit of conductances, power / (length² · degree)."""
        return f"{self.power}/({self.length}² {self.temperature})"


#: Of colours; () for one to be chosen.
Range: TypeAlias = tuple[float, float] | tuple[()]


def checked_range(clim: tuple[float, float] | None) -> Range:
    """Return a colour range if it is finite and not empty, () if it is to be chosen, else raise."""
    if clim is None:
        return ()
    low, high = (float(value) for value in clim)
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise InvalidInputError(f"clim must be finite (low, high) with low < high, got {clim}: widen it")
    return low, high


def checked_factor(name: str, factor: float) -> float:
    """Return the factor of a movement if it is finite, else raise."""
    if not np.isfinite(factor):
        raise InvalidInputError(f"{name} must be finite, got {factor}: give a factor, such as 10")
    return float(factor)


def written(value: float, digits: int = 4) -> str:
    """Format a number: 79 713, −0.138, 1.2e−05, with separated thousands and a true minus sign."""
    size = abs(value)
    if isinstance(value, int | np.integer):
        text = f"{value:,}"
    elif size == 0 or 1e-3 <= size < 1e7:
        decimals = digits - 1 - int(np.floor(np.log10(size))) if size else 0
        text = f"{round(value, decimals):,.{max(0, decimals)}f}"
    else:
        text = f"{value:.{digits - 1}e}"
    return text.replace(",", "\u202f").replace("-", "\u2212")


def checked_reach(reach: float | None) -> float:
    """Return the extent of a picture if it is positive, 0 if it is to be chosen, else raise."""
    if reach is None:
        return 0.0
    if not 0 < reach < np.inf:
        raise InvalidInputError(f"reach must be positive, got {reach}: leave it out to have it chosen")
    return reach


def nice_number(value: float) -> float:
    """Round down to 1, 2 or 5 times a power of ten; 1 for non-positive values."""
    if not value > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= value * (1 + 1e-9)))


def change(first: float, last: float) -> str:
    """Return "first → last" with the relative change."""
    words = f"{written(first, 6)} → {written(last, 6)}"
    if first == 0:
        return words
    return words + f", {100 * abs((last - first) / first):.2f} % {'lower' if last <= first else 'higher'}"


def headline(title: str, facts: str) -> str:
    """Return "title: facts", or without a title the facts, a word at their start capitalised."""
    first = facts[:1].upper() if facts[:2].isascii() else facts[:1]  # a symbol is another one in capitals
    return f"{title}: {facts}" if title else first + facts[1:]
