"""Disturbances of runs of general systems as a person types them: ``--disturbance NAME=FORM``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from quasilpv.cli.usage import number
from quasilpv.errors import InputError

if TYPE_CHECKING:
    from quasilpv.scenarios.system_schema import SystemDisturbance

OPTION = "--disturbance"
EXPECTED = "NAME=VALUE, NAME=step:VALUE,FROM[,TO], NAME=sine:AMPLITUDE,RAD/S[,RAD] or NAME=noise:DEVIATION"
COUNTS = {"constant": (1, 1), "step": (2, 3), "sine": (2, 3), "noise": (1, 1)}
"""Least and most numbers of each form."""


def disturbances_of(texts: Sequence[str] | None, seed: int | None) -> tuple[SystemDisturbance, ...]:
    """The terms that are asked for; noise of the k-th one is of the seed k + 1 above that of the sensors.

    Raises:
        InputError: not of one of the forms.
    """
    from quasilpv.scenarios import NOISE_SEED
    from quasilpv.scenarios.system_schema import ConstantDisturbance, NoiseDisturbance, SineDisturbance

    terms: list[SystemDisturbance] = []
    for place, text in enumerate(texts or ()):
        signal, form, values = _parts(text)
        if form == "sine":
            amplitude, frequency, phase = (*values, 0.0)[:3]
            terms.append(
                SineDisturbance(signal=signal, amplitude=amplitude, frequency_rad_s=frequency, phase_rad=phase)
            )
        elif form == "noise":
            if values[0] < 0.0:
                raise InputError("command line", OPTION, text, "a standard deviation that is not negative")
            own = (NOISE_SEED if seed is None else seed) + place + 1
            terms.append(NoiseDisturbance(signal=signal, deviation=values[0], seed=own))
        else:
            begin, end = values[1] if form == "step" else 0.0, values[2] if len(values) > 2 else None
            if begin < 0.0 or (end is not None and end <= begin):
                raise InputError("command line", OPTION, text, "times 0 <= FROM < TO, s")
            times: dict[str, Any] = {"begin_s": begin, "end_s": end}
            terms.append(ConstantDisturbance(signal=signal, value=values[0], **times))
    return tuple(terms)


def _parts(text: str) -> tuple[str, str, list[float]]:
    """Signal, form and numbers."""
    signal, _, typed = text.partition("=")
    form, separator, listed = typed.partition(":")
    if not separator:
        form, listed = "constant", typed
    values = [number(value) for value in listed.split(",")]
    known = [value for value in values if value is not None]
    least, most = COUNTS.get(form, (1, 0))
    if not signal or len(known) < len(values) or not least <= len(known) <= most:
        raise InputError("command line", OPTION, text, EXPECTED)
    return signal, form, known
