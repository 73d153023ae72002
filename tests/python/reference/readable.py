"""Whether the texts of a figure can be read."""

from __future__ import annotations

from itertools import combinations

from matplotlib.figure import Figure
from matplotlib.text import Text

from quasilpv.figures.style import style


def hidden_tick_labels(figure: Figure) -> set[Text]:
    """Labels of ticks outside the view, which matplotlib keeps but does not draw."""
    hidden = set()
    for axes in figure.axes:
        for axis, (low, high) in ((axes.xaxis, sorted(axes.get_xlim())), (axes.yaxis, sorted(axes.get_ylim()))):
            for minor in (False, True):
                for location, label in zip(axis.get_ticklocs(minor=minor), axis.get_ticklabels(minor), strict=False):
                    if not low <= location <= high:
                        hidden.add(label)
    return hidden


def texts_with_boxes(figure: Figure) -> list[tuple[str, tuple[float, float, float, float]]]:
    with style():
        figure.canvas.draw()
        hidden = hidden_tick_labels(figure)
        boxes = []
        for text in figure.findobj(Text):
            assert isinstance(text, Text)
            if text not in hidden and text.get_visible() and text.get_text().strip():
                box = text.get_window_extent()
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
