"""Campaigns as text files whose headers say another unit than the manifest declares, or the same."""

import numpy as np

# Faults that only a file can have: what its header says of a column, and how the manifest declares it.
FILE_FAULTS = {
    "unit_in_header": (("moment [N*m]", "angle [mrad]"), None, ("N*m", "rad"), "angle"),
    "unit_row": (("moment", "angle"), ("kN*m", "rad"), ("N*m", "rad"), "moment"),
    "unit_in_name": (("moment_Nm", "angle_mrad"), None, ("N*m", "deg"), "angle"),
    "another_quantity": (("moment (V)", "angle (rad)"), None, ("N*m", "rad"), "moment"),
    "degrees_as_radian": (("moment/Nm", "angle/deg"), None, ("N*m", "rad"), "angle"),
}
HONEST_FILES = (
    (("moment [Nm]", "angle [rad]"), None, ("N*m", "rad")),
    (("moment", "angle"), ("N*m", "rad"), ("N*m", "rad")),
    (("tau_Nm", "angle_rad_from_upright"), None, ("N*m", "rad")),
    (("force_in", "angle_raw"), None, ("N*m", "rad")),
    (("moment (measured)", "angle (filtered)"), None, ("N*m", "rad")),
)


def write_files(campaign, folder, names, row, declared):
    """Write a campaign as text files with that header and row of units, and a manifest that declares other units."""
    lines = [f'[joint]\ninertia = "{campaign.joint.inertia} kg*m^2"\n[channels]']
    lines.append(f'rate = "{campaign.runs[0].sample_rate} Hz"')
    for key, name, unit in zip(("moment", "angle"), names, declared, strict=True):
        lines.append(f'{key} = {{ column = "{name}", unit = "{unit}" }}')
    head = [",".join(names), *([",".join(row)] if row else [])]
    for i, run in enumerate(campaign.runs):
        columns = np.column_stack([run.moment, run.angle])
        np.savetxt(folder / f"{i}.csv", columns, "%.9g", ",", header="\n".join(head), comments="")
        lines.append(f'[[run]]\nfile = "{i}.csv"\nfrequency = {run.frequency}')
    (folder / "campaign.toml").write_text("\n".join(lines))
    return folder
