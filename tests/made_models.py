"""Models written down by hand, so that these tests need no discovery."""

import numpy as np
from scipy.signal import chirp

from sindyjoint import JointModel
from sindyjoint.equation import Fitted, ModelTerm
from sindyjoint.mechanics import sampled
from sindyjoint.paper import INTER_PANEL, TERMS
from sindyjoint.record import Joint

FORMULAS = dict(zip(TERMS, ("theta", "theta**2", "theta**3", "omega", "sign(omega)"), strict=True))


def term(id, formula, value, error=0.0, share=0.3):
    interval = (value - 2 * error, value + 2 * error)
    return ModelTerm(id, id, id, "stiffness", formula, (), "", value, error, interval, share)


def model_of(terms, inertia=0.02, name="inter-panel joint", angle=8e-4, **joint):
    covariance = tuple(map(tuple, np.diag([one.standard_error**2 for one in terms]).tolist()))
    fitted = Fitted(3.5, 0.03, 0.03, 0.5, 10_000, 12, angle, 0.03)
    return JointModel(Joint(name=name, inertia=inertia, **joint), tuple(terms), covariance, fitted)


def paper_model(relative_error=1e-3, values=INTER_PANEL.average, **options):
    """Return the paper's law with coefficients known to a relative error."""
    return model_of(
        [
            term(id, FORMULAS[id], value, relative_error * abs(value))
            for id, value in zip(TERMS, values, strict=True)
        ],
        **options,
    )


def multisine(amplitudes, frequencies, phases, duration):
    """Return the sum of sines, amplitude_i · sin(2π f_i t + phase_i), as an excitation."""
    rate = 256 * float(np.max(frequencies))
    time = np.arange(int(np.ceil(duration * rate)) + 2) / rate
    return sampled(np.sin(2 * np.pi * np.outer(time, frequencies) + phases) @ amplitudes, rate)


def sweep(amplitude, start, stop, duration):
    """Return a sine whose frequency goes linearly from start to stop, Hz, as an excitation."""
    rate = 256 * max(start, stop)
    time = np.arange(int(np.ceil(duration * rate)) + 2) / rate
    return sampled(amplitude * chirp(time, start, duration, stop, phi=-90), rate)
