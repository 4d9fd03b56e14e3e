"""Two masses with a joint between them, the first on a spring to the ground: signals by formula or by SciPy."""

import numpy as np

from sindyjoint.mechanics import Hinge, PaperLaw, RigRun, RigTest, Sensor, Structure

M1, M2, K0, C0 = 3.0, 2.0, 4000.0, 40.0
RATE = 200.0


def structure(stiffness: float = K0) -> Structure:
    """Coordinates: elongation of the joint, then the first mass; the second moves by both."""
    back = np.array([[0.0, 1.0], [1.0, 1.0]])  # x1, x2 of (joint, x1)
    mass = back.T @ np.diag([M1, M2]) @ back
    return Structure(
        mass, back.T @ np.diag([stiffness, 0.0]) @ back, np.zeros((2, 2)), (Hinge("joint", PaperLaw(k1=1.0)),),
        {"x1": back[0], "x2": back[1]}, viscous=back.T @ np.diag([C0, 0.0]) @ back, base=np.array([0.0, 1.0]),
    )  # fmt: skip


def rig_test(runs, sensors=("x1", "x2"), quantity="acceleration", **options) -> RigTest:
    """Accelerometers on both masses, the force on the second."""
    named = tuple(Sensor(name, name, quantity) for name in sensors)
    return RigTest(
        "two masses", options.pop("structure", structure()), ("joint",), "x2", named, tuple(runs), motion="translation",
        **options,
    )  # fmt: skip


def series(frequency, amplitudes, time, order=0):
    """Return the derivative of Σ Re a·exp(2πi·k·f·t)."""
    k = np.arange(1, len(amplitudes) + 1)
    spin = 2j * np.pi * frequency * k
    return (np.exp(np.outer(time, spin)) @ (np.asarray(amplitudes) * spin**order)).real


def prescribed_run(frequency=3.0, periods=12):
    """A run of prescribed motions: the joint's force follows from the first mass, the drive from the second."""
    time = np.arange(int(periods * RATE / frequency)) / RATE
    first, second = [1e-3, 2e-4j, 3e-5 - 1e-5j], [-2e-3 + 1e-3j, 1e-4, 5e-5j]

    def x(amplitudes, order):
        return series(frequency, amplitudes, time, order)

    force = M1 * x(first, 2) + C0 * x(first, 1) + K0 * x(first, 0)
    drive = M2 * x(second, 2) + force
    elongation = x(second, 0) - x(first, 0)
    run = RigRun("prescribed", drive, np.array([x(first, 2), x(second, 2)]), RATE, frequency)
    return run, elongation, force


def passing_run(seconds=12.0):
    """A run that neither repeats nor rests at its ends: motions of tones without a common period, forces by formula."""
    time = np.arange(int(seconds * RATE)) / RATE
    tones = 2 * np.pi * np.array([1.37, 2.91, 5.17])

    def x(sizes, order):
        return (np.exp(1j * np.outer(time, tones)) @ (np.array(sizes) * (1j * tones) ** order)).real

    first, second = [1e-3, 2e-4j, 3e-5 - 1e-5j], [-2e-3 + 1e-3j, 1e-4, 5e-5j]
    force = M1 * x(first, 2) + C0 * x(first, 1) + K0 * x(first, 0)
    drive = M2 * x(second, 2) + force
    run = RigRun("passing", drive, np.array([x(first, 2), x(second, 2)]), RATE)
    return run, x(second, 0) - x(first, 0), force


def integrated_run(name, frequency, amplitude, law, periods=10, noise=0.0, seed=0, settled=6.0):
    """A run by SciPy's integrator, written here: law(d, v) is the joint's force at an elongation and its rate."""
    time = settled + np.arange(int(periods * RATE / frequency)) / RATE

    def drive(t):
        return amplitude * np.sin(2 * np.pi * frequency * t)

    return recorded_run(name, drive, law, time, noise, seed, frequency)


def swept_run(name, amplitude, law, seconds=12.0, noise=0.0, seed=0):
    """The same of a sine whose frequency goes from 1 to 7 Hz, from standstill."""

    def drive(t):
        return amplitude * np.sin(2 * np.pi * (t + 3.0 * t**2 / seconds))

    return recorded_run(name, drive, law, np.arange(int(seconds * RATE)) / RATE, noise, seed)


def recorded_run(name, drive, law, time, noise, seed, frequency=None):
    """What accelerometers and a force cell with noise show of a motion by SciPy's integrator."""
    from scipy.integrate import solve_ivp

    def slope(t, y):
        x1, v1, x2, v2 = y
        joint = law(x2 - x1, v2 - v1)
        return [v1, (joint - K0 * x1 - C0 * v1) / M1, v2, (drive(t) - joint) / M2]

    solved = solve_ivp(slope, (0, time[-1]), np.zeros(4), t_eval=time, rtol=1e-8, atol=1e-11, method="LSODA")
    accelerations = np.array([slope(t, y) for t, y in zip(time, solved.y.T, strict=True)])[:, [1, 3]].T
    generator = np.random.default_rng(seed)
    signals = np.vstack([drive(time), accelerations])
    signals = signals + noise * signals.std(axis=1, keepdims=True) * generator.normal(size=signals.shape)
    return RigRun(name, signals[0], signals[1:], RATE, frequency)
