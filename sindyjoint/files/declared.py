"""What the channels of a manifest declare of their noise and of their gains."""

from __future__ import annotations

from sindyjoint.errors import InputError, UnitError
from sindyjoint.files.channels import KEYS
from sindyjoint.files.manifest import Channel, Channels
from sindyjoint.files.units import conversion, parse_quantity, split_quantity
from sindyjoint.record import Motion
from sindyjoint.source import SensorNoise


def declared_noise(channels: Channels, motion: Motion, where: str) -> SensorNoise:
    """Return the noise that the channels declare, in SI units.

    Raises
    ------
    UnitError
        For text that is no quantity of the channel's kind, or of its file's unit.
    InputError
        For noise that is not above zero.
    """
    values = {}
    for quantity, (key, unit) in KEYS[motion].items():
        channel: Channel | None = getattr(channels, key, None)
        if channel is not None and channel.noise is not None:
            values[quantity] = _noise(channel, unit, f"{where} {key}")
    try:
        return SensorNoise(**values)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def declared_gains(channels: Channels, motion: Motion, where: str) -> dict[str, float]:
    """Return the relative uncertainty of the gains of moment, angle and rate that channels declare.

    Raises
    ------
    InputError, UnitError
        For what is no share between 0 and 1.
    """
    values = {}
    for quantity, (key, _) in KEYS[motion].items():
        channel: Channel | None = getattr(channels, key, None)
        given = None if channel is None else channel.gain_uncertainty
        if given is not None:
            place = f"{where} {key}.gain_uncertainty"
            share = parse_quantity(given, "m/m", place) if isinstance(given, str) else float(given)
            if not 0 < share < 1:
                raise InputError(f"{place}: {given!r}; expected a share such as '1 %'")
            values[quantity] = share
    if "acceleration" in values:
        # The angle is that of the accelerometer, or of both: no more wrong than the worse of them.
        values["angle"] = max(values.pop("acceleration"), values.get("angle", 0.0))
    return values


def _noise(channel: Channel, unit: str, where: str) -> float:
    """Return declared noise in SI units: of the quantity itself or, multiplied by the gain, of what the file holds."""
    assert channel.noise is not None
    number, own = split_quantity(channel.noise, f"{where}.noise", unit)
    if channel.gain is not None:
        try:
            return number * abs(conversion(own, unit, f"{where}.noise", channel.gain))
        except UnitError:
            pass  # not in volts, then in the quantity's own unit
    return number * conversion(own, unit, f"{where}.noise")
