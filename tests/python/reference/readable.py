"""Whether the texts of a figure can be read."""

from __future__ import annotations

from itertools import combinations

from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from mpl_toolkits.mplot3d import Axes3D, proj3d
from mpl_toolkits.mplot3d.art3d import Text3D

from quasilpv.figures.style import style


def hidden_tick_labels(figure: Figure) -> set[Text]:
    """Labels of ticks outside the view, which matplotlib keeps but does not draw."""
    hidden = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis, *([axes.zaxis] if isinstance(axes, Axes3D) else [])):
            low, high = sorted(axis.get_view_interval())
            for minor in (False, True):
                for location, label in zip(axis.get_ticklocs(minor=minor), axis.get_ticklabels(minor), strict=False):
                    if not low <= location <= high:
                        hidden.add(label)
    return hidden


def drawn_box(text: Text) -> Bbox:
    """Where a text is drawn: one in space is put there when it is drawn, and knows nothing of it afterwards."""
    if not isinstance(text, Text3D):
        return text.get_window_extent()
    x, y, _ = proj3d.proj_transform(*text.get_position_3d(), text.axes.get_proj())
    flat = text.get_position()
    text.set_position((x, y))
    box = text.get_window_extent()
    text.set_position(flat)
    return box


def texts_with_boxes(figure: Figure) -> list[tuple[str, tuple[float, float, float, float]]]:
    with style():
        figure.canvas.draw()
        hidden = hidden_tick_labels(figure)
        figure.canvas.draw()  # in space the question has moved the labels
        boxes = []
        for text in figure.findobj(Text):
            assert isinstance(text, Text)
            if text not in hidden and text.get_visible() and text.get_text().strip():
                box = drawn_box(text)
                boxes.append((text.get_text(), (box.x0, box.y0, box.x1, box.y1)))
    return boxes


def assert_readable(figure: Figure) -> None:
    boxes = texts_with_boxes(figure)
    width, height = figure.canvas.get_width_height()
    for text, (x0, y0, x1, y1) in boxes:
        assert x0 >= -1 and y0 >= -1 and x1 <= width + 1 and y1 <= height + 1, f"{text!r} is cut"  # noqa: PT018
    for (first, a), (second, b) in combinations(boxes, 2):
        overlap = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
        assert min(overlap) <= 1.0, f"{first!r} overlaps {second!r}"
