"""Runs of the verbs that track scenarios in this process."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from quasilpv.artifact import Artifact
from quasilpv.cli.console import Steps, print_note
from quasilpv.cli.options import designed, sensors_of
from quasilpv.experiments.result import TrackResult, Variant
from quasilpv.experiments.setup import PlantKind, RunSetup
from quasilpv.experiments.track import disturbance_beyond_limits, require_fit, start_outside_domain, track
from quasilpv.files import claim_folder
from quasilpv.scenarios import TrackingExperiment
from quasilpv.telemetry import LOG_NAME
from quasilpv.telemetry.log import point_to


@dataclass(frozen=True)
class Session:
    """What all runs of one command have in common.

    Attributes:
        given: the controller of every run; None to design one for each.
        rate_hz: sample rate of designs; None for that of the controller.
        plant: the true plant.
        out: folder of all runs.
        log: write the log of every run.
    """

    given: Artifact | None
    rate_hz: float | None
    plant: PlantKind
    out: Path
    log: bool = True

    def __post_init__(self) -> None:
        """Claim the folder for this command. InputError: another one is writing there."""
        claim_folder(self.out)

    def controller(self, experiment: TrackingExperiment, variant: Variant, steps: Steps) -> Artifact:
        """The controller of a run: the given one, or the variant's design."""
        return self.given or designed(experiment.robot, variant, self.rate_hz, progress=steps.parts)

    def folder(self, experiment: TrackingExperiment, variant: Variant) -> Path:
        """Where the files of a run are."""
        return self.out / experiment.name / variant.slug

    def run(self, experiment: TrackingExperiment, variant: Variant, steps: Steps) -> TrackResult:
        """Design, if no controller is given, and run one variant in closed loop."""
        controller = self.controller(experiment, variant, steps)
        require_fit(experiment, controller)
        for doubt in (disturbance_beyond_limits, start_outside_domain):
            if found := doubt(experiment, controller):
                print_note(f"warning: {experiment.name}, {variant.label}: {found}")
        result = track(
            RunSetup(
                experiment,
                controller,
                plant=self.plant,
                sensors=sensors_of(variant.encoder_bits),
                variant=variant,
                log=self.log,
            ),
            self.folder(experiment, variant),
        )
        if self.log:
            point_to(self.folder(experiment, variant) / LOG_NAME)
        return result
