"""The paper's own estimates of its two joints, for comparison in figures and tables.

Source: the paper, Tables 1 and 2 (one row per excitation frequency).
"""

from __future__ import annotations

FREQUENCIES = ("3 Hz", "4 Hz", "5 Hz", "6 Hz")

_TABLES: dict[str, dict[str, tuple[float, ...]]] = {
    "inter-panel joint": {
        "linear_stiffness": (6.153e3, 6.134e3, 5.912e3, 6.063e3),
        "quadratic_stiffness": (-2.209e5, -1.625e5, -1.901e5, -1.972e5),
        "cubic_stiffness": (-2.761e9, -2.733e9, -2.739e9, -2.501e9),
        "linear_damping": (46.68, 49.00, 48.51, 48.32),
        "coulomb_friction": (1.892, 1.821, 1.840, 1.916),
    },
    "panel root joint": {
        "linear_stiffness": (1.060e4, 1.231e4, 1.279e4, 1.115e4),
        "quadratic_stiffness": (-6.601e5, -5.988e5, -6.304e5, -6.200e5),
        "cubic_stiffness": (-7.741e9, -7.366e9, -7.310e9, -7.282e9),
        "linear_damping": (54.68, 54.01, 54.32, 53.29),
        "coulomb_friction": (2.110, 2.145, 2.128, 2.379),
    },
}


def paper_values(joint: str) -> dict[str, dict[str, float]]:
    """Return the paper's coefficient of each term at each frequency; empty for a joint that is not the paper's.

    Examples
    --------
    >>> paper_values("inter-panel joint")["linear_damping"]["4 Hz"]
    49.0
    >>> paper_values("hinge of my own")
    {}
    """
    name = joint.strip().lower().replace("panel-root", "panel root")
    table = _TABLES.get(name, {})
    return {term: dict(zip(FREQUENCIES, values, strict=True)) for term, values in table.items()}
