"""The pulse test of a rig: a measured response, or a virtual one of a truth richer than a joint law in a rig."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sindyjoint.errors import InputError, checks_options
from sindyjoint.mechanics.beam import Beam
from sindyjoint.mechanics.laws import FunctionLaw, Law, PaperLaw
from sindyjoint.mechanics.rigs import MeasuredResponse, Rig
from sindyjoint.mechanics.sensors import Channel
from sindyjoint.mechanics.structure import Hinge
from sindyjoint.mechanics.transient import Response
from sindyjoint.numeric import RNG, Array


@dataclass(frozen=True, eq=False)
class PulseTest(MeasuredResponse):
    """A response of a rig to its pulse, measured or virtual.

    Parameters
    ----------
    point, displacement, sample_rate
        As in :class:`~sindyjoint.mechanics.rigs.MeasuredResponse`.
    simulated : bool
        Whether it comes from a virtual test.
    truth : str
        What a virtual test holds beyond the rig as written; empty for nothing.
    response : Response or None
        The whole response of a virtual test, free of errors.
    """

    simulated: bool = False
    truth: str = ""
    response: Response | None = None

    @property
    def time(self) -> Array:
        """Sample instants, s."""
        return np.arange(self.displacement.size) / self.sample_rate


def hinges(rig: Rig) -> tuple[Hinge, ...]:
    """Return the joints of a rig, from the base on.

    Examples
    --------
    >>> import sindyjoint
    >>> [hinge.name for hinge in sindyjoint.hinges(sindyjoint.load_rig("pulse-rig"))]
    ['joint']
    """
    return tuple(item for item in rig.items if isinstance(item, Hinge))


def with_laws(rig: Rig, choose: Callable[[Hinge], Law]) -> Rig:
    """Return the same rig with the law that `choose` gives for each joint.

    Examples
    --------
    >>> import sindyjoint
    >>> rig = sindyjoint.load_rig("pulse-rig")
    >>> other = sindyjoint.with_laws(rig, lambda hinge: sindyjoint.PANEL_ROOT)
    >>> sindyjoint.hinges(other)[0].law.name
    'panel root joint'
    """
    return replace(
        rig,
        items=tuple(
            replace(item, law=choose(item)) if isinstance(item, Hinge) else item for item in rig.items
        ),
    )


def with_loss_factor(rig: Rig, loss_factor: float) -> Rig:
    """Return the same rig with another material loss factor of every beam."""
    return replace(
        rig,
        items=tuple(
            replace(item, loss_factor=loss_factor) if isinstance(item, Beam) else item for item in rig.items
        ),
    )


def _presliding(theta, omega, direction, state, parameters, out):
    elastic = theta * (parameters[0] + theta * (parameters[1] + theta * parameters[2]))
    z = state[0]
    out[0] = elastic + parameters[3] * omega + parameters[4] * z
    out[1] = (omega - abs(omega) * z) / parameters[5]


def presliding_law(law: PaperLaw, angle: float) -> FunctionLaw:
    """Return a joint whose Coulomb friction has elastic presliding.

    The friction moment is M_F·z with dz/dt = (θ̇ − |θ̇| z)/θ_p (Dahl, Aerospace Corporation TOR-158, 1968, with
    exponent one): a spring of stiffness M_F/θ_p at every reversal that yields to M_F over a few θ_p.

    Parameters
    ----------
    law : PaperLaw
    angle : float
        θ_p, rad.

    Raises
    ------
    InputError
        For an angle that is not above zero, or a law that is not the paper's.
    """
    if not (np.isfinite(angle) and angle > 0):
        raise InputError(f"presliding angle is {angle!r} rad; expected a finite number above zero")
    if not isinstance(law, PaperLaw):
        raise InputError("presliding is known of the paper's law only; the rig's joint has another one")
    return FunctionLaw(
        _presliding, (*law.parameters, float(angle)), n_states=1, inertia=law.inertia,
        softening_limit=law.softening_limit,
    )  # fmt: skip


@checks_options()
def virtual_pulse_test(
    rig: Rig,
    *,
    noise: float = 0.01,
    presliding: float | None = None,
    loss_factor: float | None = None,
    rng: RNG = 0,
) -> PulseTest:
    """Simulate the pulse test of a rig as a sensor sees it.

    Parameters
    ----------
    rig : Rig
        Its joints' laws are the truth.
    noise : float
        White noise of the sensor as a fraction of the response's RMS.
    presliding : float, optional
        Angle of the elastic presliding of every joint, rad.
    loss_factor : float, optional
        Material loss factor of the beams, instead of the rig's.
    rng : int, Generator or None
        Source of the noise.

    Returns
    -------
    PulseTest
        At the rig's first output point.
    """
    truth = []
    if presliding is not None:
        angle = presliding
        rig = with_laws(rig, lambda hinge: presliding_law(hinge.law, angle))  # type: ignore[arg-type]
        truth.append(f"presliding over {1e6 * presliding:g} µrad")
    if loss_factor is not None:
        rig = with_loss_factor(rig, loss_factor)
        truth.append(f"beam loss factor {loss_factor:g}")
    response = rig.respond()
    point = rig.points[0]
    shown = Channel(noise=noise).read(response.displacement[point], np.random.default_rng(rng))
    return PulseTest(point, shown, rig.sample_rate, True, " and ".join(truth), response)
