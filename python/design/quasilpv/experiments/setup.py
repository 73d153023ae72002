"""What a run is a run of: an experiment, a controller, a true plant, and how they talk."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from quasilpv.artifact import Artifact
from quasilpv.experiments.result import Variant
from quasilpv.scenarios import Sensors, TrackingExperiment

PlantKind: TypeAlias = Literal["nominal", "perturbed", "mujoco"]


@dataclass(frozen=True, eq=False)
class RunSetup:
    """One closed-loop run, before it is made.

    Attributes:
        experiment: what is tracked.
        artifact: the controller.
        plant: the true plant, the nominal robot or that with its full payload; the latter also moved by MuJoCo.
        sensors: encoders and speed noise.
        transport_delay_s: from a sample to the moment its torque acts.
        variant: what to call the controller; by default its law kind, which several controllers share.
        log: write the log of the run.
    """

    experiment: TrackingExperiment
    artifact: Artifact
    plant: PlantKind = "perturbed"
    sensors: Sensors = field(default_factory=Sensors)
    transport_delay_s: float = 0.0
    variant: Variant | None = None
    log: bool = True

    @property
    def row(self) -> Variant:
        """What the run is called among those of its experiment."""
        return self.variant or variant_of(self.artifact, self.sensors)


def variant_of(artifact: Artifact, sensors: Sensors) -> Variant:
    """All there is to say of an artifact of unknown origin."""
    compensated = getattr(artifact.law, "disturbance_compensation", True)
    return Variant(artifact.law.kind, sensors.encoder_bits, compensated)
