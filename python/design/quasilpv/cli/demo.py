"""``design demo``: the main job, from the model of a robot to the table of its controllers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from quasilpv.cli.console import JsonOption, print_json, print_note
from quasilpv.cli.options import FormatOption, formats_of, requested, robot_named
from quasilpv.files import claim_folder
from quasilpv.synthesis import DEFAULT_CONTROLLER

ROBOT = "arm3"
SCENARIOS = ("serial-square", "serial-circle")
SCENARIOS_IN_SPACE = ("ur5-square", "ur5-circle")


def demo_command(
    *,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="Folder of everything that is made.")] = Path(
        "out/demo"
    ),
    figure_formats: FormatOption = None,
    json: JsonOption = False,
) -> None:
    """Design the default controller of the 3-DoF arm, then track the square and the circle with every controller.

    The same for a UR5 in space with an unknown load of 5 kg. Writes the artifact, a log and the figures of every run,
    and prints the tables.

    \b
    The same, step by step:
      design synth arm3 -o out/demo/arm3
      design track serial-square serial-circle ur5-square ur5-circle -o out/demo

    \b
    Example:
      design demo
    """
    from quasilpv.cli.gallery import Gallery
    from quasilpv.cli.results import print_results
    from quasilpv.cli.session import Session
    from quasilpv.cli.synth import write_released
    from quasilpv.cli.track import default_variants, run_all
    from quasilpv.scenarios import tracking_experiment

    formats = formats_of(figure_formats)
    claim_folder(out)
    if not json:
        every = ", ".join((*SCENARIOS, *SCENARIOS_IN_SPACE))
        print_note(f"a design for {ROBOT}, then every controller on {every}: a few minutes")
    released = write_released(requested(robot_named(ROBOT), DEFAULT_CONTROLLER, None, None), out / ROBOT)
    session = Session(None, None, "perturbed", out)
    experiments = [tracking_experiment(name) for name in (*SCENARIOS, *SCENARIOS_IN_SPACE)]
    planned = [(e, default_variants(in_space=e.robot.in_space)) for e in experiments]
    with Gallery(out, formats, sum(len(variants) for _, variants in planned)) as gallery:
        results = run_all(session, planned, gallery)
        gallery.finish()
    if json:
        print_json({**released, "runs": [result.row() for result in results]})
    else:
        print_results(results)
