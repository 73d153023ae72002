"""Figures: every one drawn, readable, with units, and no text over another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from quasilpv.cli.track import DEFAULT_CONTROLLERS
from quasilpv.errors import InputError
from quasilpv.experiments.result import TrackResult, Variant
from quasilpv.figures import (
    comparison_figure,
    disturbance_figure,
    error_figure,
    path_figure,
    save,
    torque_figure,
    velocity_figure,
)
from quasilpv.figures.gallery import write_comparison, write_gallery
from quasilpv.figures.style import CONTROLLER_COLOURS, FORMATS, JOINT_COLOURS, PIXELS_PER_INCH, style
from reference.readable import assert_readable
from reference.runs import synthetic_result

SINGLE = (path_figure, error_figure, torque_figure, disturbance_figure, velocity_figure)


def default_result(joints: int = 3) -> TrackResult:
    return synthetic_result(Variant("dob-acceleration"), joints)


def all_results() -> list[TrackResult]:
    variants = [Variant(name) for name in DEFAULT_CONTROLLERS]
    return [synthetic_result(variant) for variant in (*variants, Variant("dob-acceleration", 17))]


@pytest.mark.parametrize("joints", [1, 3, 7])
@pytest.mark.parametrize("draw", SINGLE)
def test_when_a_figure_is_drawn_expect_no_text_cut_or_over_another(
    draw: Callable[[TrackResult], Figure], joints: int
) -> None:
    assert_readable(draw(default_result(joints)))


def test_when_controllers_are_compared_expect_no_text_cut_or_over_another() -> None:
    assert_readable(comparison_figure(all_results()))


def test_when_the_tool_errs_along_a_third_axis_expect_the_comparison_to_count_it() -> None:
    results = all_results()
    tall = [replace(r, metrics=replace(r.metrics, rms_z_m=0.02, rms_tool_m=0.03 + k)) for k, r in enumerate(results)]
    points = comparison_figure(tall).axes[1].lines
    assert [float(p.get_xdata()[0]) for p in points] == pytest.approx([1e3 * (0.03 + k) for k in range(len(results))])


def test_when_controllers_are_compared_expect_how_many_or_which_and_the_largest_recent_distance() -> None:
    results = all_results()
    assert f"{len(results)} controllers" in comparison_figure(results).get_suptitle()
    alone = comparison_figure(results[:1])
    assert results[0].variant.label in alone.get_suptitle()
    drawn, distance = alone.axes[0].lines[0].get_ydata(), 1e3 * results[0].distance_m
    window = max(1, round(0.2 * results[0].rate_hz))
    expected = [distance[max(0, k - window + 1) : k + 1].max() for k in range(len(distance))]
    np.testing.assert_allclose(drawn[window:], np.maximum(expected, 1e-3)[window:])


@pytest.mark.parametrize("draw", SINGLE)
def test_when_a_figure_is_drawn_expect_units_on_every_labelled_axis(draw: Callable[[TrackResult], Figure]) -> None:
    for axes in draw(default_result()).axes:
        for label in (axes.get_xlabel(), axes.get_ylabel()):
            assert not label or label.endswith(")"), label
    assert any(axes.get_xlabel() for axes in draw(default_result()).axes)


def test_when_the_error_is_drawn_exaggerated_expect_the_factor_in_the_legend_to_be_the_one_drawn() -> None:
    result = default_result()
    right = path_figure(result).axes[1]
    drawn = right.lines[-1]
    label = str(drawn.get_label())
    factor = float(label.rpartition("× ")[2])
    error = result.tool_position_m - result.reference_position_m
    expected = result.reference_position_m + factor * error
    np.testing.assert_allclose(np.column_stack(drawn.get_data()), expected)
    largest = factor * np.hypot(*error.T).max()
    assert 0.03 * np.ptp(expected, axis=0).max() < largest < 0.15 * np.ptp(expected, axis=0).max()


def test_when_the_error_is_zero_expect_it_not_exaggerated() -> None:
    result = default_result()
    exact = replace(result, tool_position_m=result.reference_position_m)
    assert len(path_figure(exact).axes) == 1


def test_when_a_law_estimates_no_disturbance_expect_no_figure_of_it(tmp_path: Path) -> None:
    result = replace(synthetic_result(Variant("pid")), true_disturbance=None)
    with pytest.raises(ValueError, match="estimates no disturbance"):
        disturbance_figure(result)
    assert not [file for file in write_gallery(result, tmp_path) if file.stem == "disturbance"]


def test_when_a_gallery_is_written_expect_a_png_for_print_of_each_and_no_more(tmp_path: Path) -> None:
    files = [*write_gallery(default_result(), tmp_path), *write_comparison(all_results(), tmp_path)]
    assert {file.name for file in files} == {
        f"{name}.png" for name in ("path", "errors", "torques", "velocity", "disturbance", "comparison")
    }
    for file in files:
        with Image.open(file) as image:
            assert image.width >= 1200
            assert len(image.convert("L").getcolors(1 << 16) or []) > 2  # not blank
    assert set(tmp_path.iterdir()) == set(files)


def test_when_other_formats_are_asked_for_expect_each_once_and_what_is_none_refused(tmp_path: Path) -> None:
    files = save(error_figure(default_result()), tmp_path / "errors", ("svg", "pdf", "svg"))
    assert [file.name for file in files] == ["errors.svg", "errors.pdf"]
    assert "time (s)" in files[0].read_text(encoding="utf-8")
    assert files[1].read_bytes().startswith(b"%PDF")
    with pytest.raises(InputError, match="format: got jpeg, expected one of png, svg, pdf"):
        save(error_figure(default_result()), tmp_path / "errors", ("png", "jpeg"))
    assert set(tmp_path.iterdir()) == set(files)


def test_laid_out_once_a_figure_is_what_matplotlib_makes_of_it_laid_out_for_the_file(tmp_path: Path) -> None:
    for draw in (error_figure, path_figure):
        (file,) = save(draw(default_result()), tmp_path / "once")
        with style():
            draw(default_result()).savefig(tmp_path / "twice.png", dpi=PIXELS_PER_INCH)
        with Image.open(file) as once, Image.open(tmp_path / "twice.png") as twice:
            np.testing.assert_array_equal(np.asarray(once), np.asarray(twice))


def test_when_the_same_figure_is_written_twice_expect_the_same_bytes(tmp_path: Path) -> None:
    first, second = (
        save(path_figure(default_result()), tmp_path / name / "path", tuple(FORMATS)) for name in ("first", "second")
    )
    assert [file.suffix for file in first] == [".png", ".svg", ".pdf"]
    assert [file.read_bytes() for file in first] == [file.read_bytes() for file in second]


def test_when_the_folder_cannot_be_written_expect_one_line(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.touch()
    with pytest.raises(InputError, match="expected a writable"):
        save(path_figure(default_result()), blocked / "path")


def simulated(colour: str, matrix: list[list[float]]) -> np.ndarray:
    """A colour as seen with a dichromacy (Viénot, Brettel and Mollon 1999), linear RGB."""
    rgb = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return np.asarray(np.array(matrix) @ linear)


@pytest.mark.parametrize(
    "matrix",
    [
        [[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]],  # protanopia
        [[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]],  # deuteranopia
    ],
)
@pytest.mark.parametrize("colours", [tuple(CONTROLLER_COLOURS.values()), JOINT_COLOURS[:3]])
def test_when_seen_with_a_colour_blindness_expect_the_colours_of_one_figure_to_differ(
    matrix: list[list[float]], colours: tuple[str, ...]
) -> None:
    for a, b in combinations(colours, 2):
        assert np.abs(simulated(a, matrix) - simulated(b, matrix)).max() > 0.08, (a, b)
