"""Runs of what was measured: with an accelerometer among the sensors, or in order without time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import ArrayLike

from sindyjoint.accelerometer import fuse
from sindyjoint.errors import InputError
from sindyjoint.inputs import signals_of
from sindyjoint.quasi_static import along_path
from sindyjoint.record import MINIMUM_SAMPLES, Run, checked_signal
from sindyjoint.source import SensorNoise


def measured_run(name: str, signals: Mapping[str, ArrayLike], sample_rate: float, **options: Any) -> Run:
    """Return a run of moment, angle, rate and acceleration, as far as measured.

    With an acceleration the angle is that of all sensors of the motion.

    Parameters
    ----------
    name : str
    signals : mapping of str to array_like, shape (n,)
        ``"moment"``, N·m, and ``"angle"``, ``"rate"`` or ``"acceleration"``, rad, rad/s, rad/s².
    sample_rate : float
        Hz.
    **options
        Further fields of the run.

    Raises
    ------
    InputError
        For signals that cannot be used.
    """
    known: dict[str, Any] = {
        key: checked_signal(key, signals[key], name)
        for key in ("moment", "angle", "rate", "acceleration")
        if key in signals
    }
    if "acceleration" not in known:
        return Run(name, sample_rate=sample_rate, **known, **options)
    sizes = {key: values.size for key, values in known.items()}
    if len(set(sizes.values())) > 1 or min(sizes.values()) < MINIMUM_SAMPLES:
        listed = ", ".join(f"{key} has {size} samples" for key, size in sizes.items())
        raise InputError(
            f"run {name!r}: {listed}; expected equal lengths of at least {MINIMUM_SAMPLES} samples"
        )
    moment, angle, fusion = fuse(
        **known, sample_rate=sample_rate, frequency=options.get("frequency"), declared=options.get("noise")
    )
    return Run(name, moment, angle, sample_rate, fusion=fusion, **options)


def travelled_run(
    name: str,
    moment: ArrayLike,
    angle: ArrayLike,
    inputs: Mapping[str, Any],
    noise: SensorNoise = SensorNoise(),
    **known: Any,
) -> Run:
    """Return a run of quasi-static samples, in their order, at even steps of the path that they travel.

    Parameters
    ----------
    name : str
    moment, angle : array_like, shape (n,)
    inputs : mapping of str to array_like, shape (n,), or float
    noise : SensorNoise
        Of single samples.
    **known
        Of :class:`Run`: level, use, ...

    Raises
    ------
    InputError
        For signals that cannot be used, and a joint that does not move.
    """
    moment, angle = checked_signal("moment", moment, name), checked_signal("angle", angle, name)
    if moment.size != angle.size or angle.size < MINIMUM_SAMPLES:
        raise InputError(
            f"run {name!r}: {moment.size} moments and {angle.size} angles; expected equal lengths, at least "
            f"{MINIMUM_SAMPLES}"
        )
    try:
        path = along_path(moment, angle, signals_of(name, inputs, angle.size))
    except InputError as error:
        raise InputError(f"run {name!r}: {error}") from error
    return Run(
        name,
        path.moment,
        path.angle,
        1 / path.step,
        valid=path.valid,
        noise=noise.scaled(path.averaged**-0.5),
        inputs=path.inputs,
        quasi_static=True,
        **known,
    )
