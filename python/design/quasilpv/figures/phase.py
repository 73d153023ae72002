"""A run of a general system in motion: its phase portraits with the region, the domain, and the point that moves."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image, ImageDraw, ImageFont

from quasilpv.experiments.system_run import SystemRun
from quasilpv.figures.animation import FRAMES_PER_SECOND, write_gif
from quasilpv.figures.style import BLACK, VERMILION
from quasilpv.figures.systems import planes_of, region_figure
from quasilpv.progress import Progress, no_progress

SHORTEST_S, LONGEST_S = 4.0, 12.0
"""Of an animation: runs that are shorter or longer play slower or faster than real time."""
DOTS_PER_INCH = 110


class PhasePortrait:
    """The planes of a run as a picture, drawn once; a frame adds what has passed and the point where the run is.

    Args:
        run: it.
        dots_per_inch: of the picture.
    """

    def __init__(self, run: SystemRun, dots_per_inch: int = DOTS_PER_INCH) -> None:
        """Draw what does not move."""
        self._scale = dots_per_inch / DOTS_PER_INCH
        figure = region_figure(run, faint=True)
        figure.set_dpi(dots_per_inch)
        canvas: Any = FigureCanvasAgg(figure)
        canvas.draw()
        self._still = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
        # Of every plane, its two states and the way to pixels.
        self._planes: list[tuple[tuple[int, int], Any]] = [
            (pair, axes.transData.frozen()) for pair, axes in zip(planes_of(run), figure.axes, strict=False)
        ]
        self.follow(run)
        self._font = ImageFont.truetype(
            str(Path(mpl.get_data_path()) / "fonts/ttf/DejaVuSans.ttf"), round(12 * self._scale)
        )

    def follow(self, run: SystemRun) -> None:
        """Go on with another run of the same controller, in the same picture."""
        self._run, self._paths = run, []
        for pair, to_pixels in self._planes:
            points = to_pixels.transform(run.state[:, list(pair)])
            self._paths.append(np.column_stack([points[:, 0], self._still.height - points[:, 1]]))

    def frame(self, sample: int) -> Image.Image:
        """The picture at a sample."""
        image = self._still.copy()
        draw = ImageDraw.Draw(image)
        radius = 4.0 * self._scale
        for path in self._paths:
            passed = [(float(x), float(y)) for x, y in path[: sample + 1]]
            if len(passed) > 1:
                draw.line(passed, fill=VERMILION, width=round(3 * self._scale))
            x, y = passed[-1]
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=VERMILION, outline=BLACK)
        said = f"t = {self._run.time_s[sample]:.4g} s,  V = {self._run.level[sample]:.3g}"
        draw.text((image.width - 10 * self._scale, 8 * self._scale), said, fill=BLACK, font=self._font, anchor="ra")
        return image


def write_phase_animation(run: SystemRun, path: Path, progress: Progress = no_progress) -> tuple[int, float]:
    """Write the phase portraits of a run as a GIF.

    Args:
        run: what is shown.
        path: of the file; missing folders are made.
        progress: called with (frames drawn, frames in all).

    Returns:
        Number of frames, and seconds of the run per second of the animation.

    Raises:
        InputError: the file cannot be written.
    """
    portrait = PhasePortrait(run)
    duration = float(run.time_s[-1])
    shown_s = min(max(duration, SHORTEST_S), LONGEST_S)
    count = min(math.ceil(shown_s * FRAMES_PER_SECOND), len(run.time_s))
    images = []
    for frame, sample in enumerate(np.linspace(0, len(run.time_s) - 1, count).astype(np.int64)):
        images.append(portrait.frame(int(sample)))
        progress(frame + 1, count)
    write_gif(images, path)
    return count, duration * FRAMES_PER_SECOND / count
