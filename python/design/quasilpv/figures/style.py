"""The one style of all figures, and how they are written.

Colours are those of Okabe and Ito (2008), distinguishable with any common colour blindness. No global matplotlib state
is touched: figures are built from `Figure` with the Agg canvas, which also makes them usable without a display.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from quasilpv.defaults import DEFAULT_FORMATS
from quasilpv.errors import InputError, one_of
from quasilpv.files import write_atomically

BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
)
PLUM, BROWN, NAVY, LIME, GREY = "#A0208F", "#6B4A00", "#12355B", "#A6D854", "#B3B3B3"
"""Shades of `PURPLE`, `ORANGE`, `SKY` and `GREEN`, for variants of what these stand for."""
JOINT_COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK)
CONTROLLER_COLOURS = {
    "pid": PURPLE,
    "pd-tuned": GREY,
    "pid-tuned": PLUM,
    "ctc": ORANGE,
    "ctc-tuned": BROWN,
    "ctc-dob": SKY,
    "ctc-dob-tuned": NAVY,
    "hinf-tracking": VERMILION,
    "dob-torque": GREEN,
    "dob-moving": LIME,
    "dob-acceleration": BLUE,
}
REFERENCE_COLOUR = "#8c8c8c"

WIDTH_IN = 7.0
PIXELS_PER_INCH = 200

FORMATS: Mapping[str, Mapping[str, Any]] = {
    "png": {"metadata": {"Software": None}, "pil_kwargs": {"compress_level": 3}},
    "svg": {"metadata": {"Date": None}},
    "pdf": {"metadata": {"CreationDate": None}},
}
"""Formats of files. What changes from run to run is left out of the metadata: equal figures are equal files. Of PNG the
usual compression takes twice the time, for files a tenth smaller."""

_PARAMETERS: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.useoffset": False,
    "grid.color": "#d9d9d9",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "svg.fonttype": "none",
    "svg.hashsalt": "quasilpv",
}


@contextmanager
def style() -> Iterator[None]:
    """The style as a context: figures must be built and saved inside it (matplotlib resolves some defaults late).

    It begins at the defaults of matplotlib, whatever its user has set.
    """
    defaults: dict[Any, Any] = {name: value for name, value in mpl.rcParamsDefault.items() if name != "backend"}
    with mpl.rc_context({**defaults, **_PARAMETERS}):
        yield


class Drawing(Figure):
    """A figure that a notebook shows, without pyplot and whatever its back end is."""

    def _repr_png_(self) -> bytes:
        """What a notebook asks for."""
        return image(self)


def new_figure(height_in: float, title: str) -> Figure:
    """An empty figure of the common width with a title, laid out so that no text overlaps."""
    figure = Drawing(figsize=(WIDTH_IN, height_in), dpi=PIXELS_PER_INCH, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize=10.5, x=0.01, ha="left")
    return figure


def one_plot(height_in: float, title: str, axes: Axes | None) -> tuple[Figure, Axes]:
    """A figure of one plot; or the plot of a caller, which gets the title."""
    if axes is None:
        figure = new_figure(height_in, title)
        return figure, figure.subplots()
    axes.set_title(title)
    return axes.figure.figure, axes


def legend_of_one_plot(figure: Figure, axes: Axes, columns: int, *, is_own: bool) -> None:
    """The legend below the plot of a figure of `one_plot`, or inside the plot of a caller."""
    if is_own:
        figure.legend(loc="outside lower center", ncols=columns, handlelength=2.2)
    else:
        axes.legend()


def legend_above(axes: Axes, columns: int = 4) -> None:
    """The legend of ``axes``, above the plot on its right, where it covers no data."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, borderaxespad=0.1, handlelength=2.2)


def legend_below(axes: Axes, columns: int) -> None:
    """The legend of ``axes``, which is that of every plot of its figure, below them all."""
    axes.figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=columns)


@dataclass(frozen=True)
class Unit:
    """A unit that keeps the numbers on an axis readable: ``shown = si_value * factor``."""

    name: str
    factor: float


def length_unit(largest_m: float) -> Unit:
    """Millimetres, or micrometres where the largest value is below a fifth of a millimetre."""
    return Unit("µm", 1e6) if largest_m < 2e-4 else Unit("mm", 1e3)


def save(figure: Figure, stem: Path, formats: Sequence[str] = DEFAULT_FORMATS) -> list[Path]:
    """Write ``stem.png``, or the figure in other formats, each file complete or not at all.

    Args:
        figure: a figure of this package; it is laid out, and keeps this layout.
        stem: path without suffix; missing folders are made.
        formats: of `FORMATS`.

    Returns:
        The paths, one per format.

    Raises:
        InputError: a format is none of `FORMATS`, or the folder or a file cannot be written.
    """
    images = {stem.with_name(f"{stem.name}.{name}"): image(figure, name) for name in require_formats(formats)}
    write_atomically(images)
    return list(images)


def image(figure: Figure, name: str = "png") -> bytes:
    """A figure of this package as a file of one format, the same bytes for the same figure.

    Args:
        figure: it is laid out, and keeps this layout: matplotlib would lay it out for every format again, and draw all
            of it once more to do so.
        name: of `FORMATS`.
    """
    data = io.BytesIO()
    with style():
        layout = figure.get_layout_engine()
        if layout is not None:
            layout.execute(figure)
            figure.set_layout_engine("none")
        figure.savefig(data, format=name, dpi=PIXELS_PER_INCH, **FORMATS[name])
    return data.getvalue()


def require_formats(names: Sequence[str]) -> tuple[str, ...]:
    """Formats by name, each once.

    Raises:
        InputError: one is none of `FORMATS`.
    """
    for name in names:
        if name not in FORMATS:
            raise InputError("figures", "format", name, one_of(FORMATS, name))
    return tuple(dict.fromkeys(names))
