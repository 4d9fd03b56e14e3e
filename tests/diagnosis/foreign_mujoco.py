"""Campaigns that MuJoCo integrates: bodies, contacts and fluid of another program; it is no part of the package."""

from dataclasses import dataclass

import numpy as np

from sindyjoint.record import Campaign, Joint, Run

STEP = 2.5e-4
EVERY = 8  # steps per sample: 500 Hz
STIFFNESS, DAMPING, FRICTION, INERTIA = 40.0, 0.15, 0.25, 0.01
PREFIX = "mujoco:"
#: What is beside the hinge, and of which kind that is. The force of a MuJoCo limit is d/(1 − d)·I·(aref − θ̈) with its
#: impedance d: at the usual 0.9 to 0.95 nine to nineteen times the body's inertia moves with it, and a spring alone
#: leaves 73 % of its moment. No catalogue holds that; at d = 0.02 it is a spring.
BODIES = {
    "plain": "nothing",
    "joint_limit": "foreign",
    "viscous_fluid": "catalogue",
    "hanging_body": "foreign",
    "loose_body": "foreign",
    "spring_limit": "catalogue",
}
IMPEDANCE = 0.02

MODEL = """
<mujoco>
  <option timestep="{step}" integrator="implicit" gravity="0 0 0" {fluid} cone="elliptic"/>
  <worldbody>
    <body>
      <joint name="joint" axis="0 0 1" stiffness="{stiffness}" damping="{damping}" frictionloss="{friction}" {limit}
             solreffriction="0.0006 1" solimpfriction="0.99 0.999 0.001"/>
      <geom type="box" size="{half} 0.1 0.1" density="0" mass="{mass}" contype="{touches}" conaffinity="{touches}"/>
      {child}
    </body>
    {beside}
  </worldbody>
  <actuator><motor joint="joint"/></actuator>
</mujoco>
"""


@dataclass(frozen=True)
class MuJoCoCampaign:
    """A campaign and what it was made with."""

    campaign: Campaign
    noise: float
    share: float
    drives: tuple


def mujoco_campaign(name, seed):
    """Return the campaign of a hinge under moments that do not repeat, with a body, a limit or a fluid beside it."""
    import mujoco

    rng = np.random.default_rng((80_000, seed, list(BODIES).index(name)))
    noise = float(np.exp(rng.uniform(np.log(0.003), np.log(0.015))))
    model = mujoco.MjModel.from_xml_string(_model(name, rng))
    drives = rng.choice(["multisine", "bursts", "sweep"], 3)
    runs = []
    for index, (drive, level) in enumerate(zip(drives, (1.0, 0.65, 0.95), strict=True)):
        time = np.arange(0, rng.uniform(3.0, 5.0), STEP)
        moment = level * _shape(drive, time, rng)
        data = mujoco.MjData(model)
        angle = np.empty(time.size)
        for place, each in enumerate(moment):
            angle[place] = data.qpos[0]
            data.ctrl[0] = each
            mujoco.mj_step(model, data)
        channels = [
            x + noise * np.std(x) * rng.standard_normal(x.size) for x in (moment[::EVERY], angle[::EVERY])
        ]
        runs.append(Run(f"{drive}-{index}", *channels, 1 / (STEP * EVERY), level=f"{level:g}"))
    # The geometry's inertia is that of the body; a body on it is what is hidden.
    inertia = float(model.dof_M0[0]) if name not in ("hanging_body", "loose_body") else INERTIA
    campaign = Campaign(Joint(name="hinge", inertia=inertia), tuple(runs))
    return MuJoCoCampaign(campaign, noise, 0.0, tuple(map(str, drives)))


def _model(name, rng):
    half, mass = 0.1, 3 * INERTIA / (0.1**2 + 0.1**2)
    fluid = limit = child = ""
    if name == "joint_limit":
        reach = rng.uniform(0.05, 0.07)
        limit = f'limited="true" range="{-np.degrees(reach)} {np.degrees(reach)}" solreflimit="-1500 -2"'
    elif name == "spring_limit":
        reach, spring = rng.uniform(0.05, 0.07), rng.uniform(1.5, 4.0) * STIFFNESS
        reference = spring * (1 - IMPEDANCE) / INERTIA
        limit = (
            f'limited="true" range="{-np.degrees(reach)} {np.degrees(reach)}" solreflimit="{-reference} -1" '
        )
        limit += f'solimplimit="{IMPEDANCE} {IMPEDANCE} 0.001"'
    elif name == "viscous_fluid":
        fluid = f'density="{rng.uniform(2.5e4, 6e4)}"'
    elif name == "hanging_body":
        pulse, loss = 2 * np.pi * rng.uniform(2.0, 5.0), rng.uniform(0.02, 0.08)
        own = rng.uniform(0.3, 1.0) * INERTIA
        child = (
            f'<body><joint axis="0 0 1" stiffness="{own * pulse**2}" damping="{2 * loss * own * pulse}"/>'
            f'<geom type="box" size="0.1 0.1 0.1" mass="{3 * own / 0.02}" contype="0" conaffinity="0"/></body>'
        )
    elif name == "loose_body":
        own, play = rng.uniform(0.5, 1.5) * INERTIA, np.degrees(rng.uniform(0.02, 0.05))
        child = (
            f'<body><joint axis="0 0 1" damping="{0.1 * DAMPING}" limited="true" range="{-play} {play}"/>'
            f'<geom type="box" size="0.1 0.1 0.1" mass="{3 * own / 0.02}" contype="0" conaffinity="0"/></body>'
        )
    return MODEL.format(
        step=STEP, fluid=fluid, limit=limit, child=child, beside="", touches=0, half=half, mass=mass,
        stiffness=STIFFNESS, damping=DAMPING, friction=FRICTION,
    )  # fmt: skip


def _shape(drive, time, rng):
    """A moment that moves the hinge by about 0.1 rad."""
    size = 0.1 * STIFFNESS + FRICTION
    if drive == "multisine":
        lines = rng.uniform(0.6, 5.0, 6)
        shape = sum(np.sin(2 * np.pi * f * time + rng.uniform(0, 6)) for f in lines)
    elif drive == "sweep":
        low, high = rng.uniform([0.5, 3.5], [1.2, 6.0])
        shape = np.sin(2 * np.pi * (low + (high - low) * time / (2 * time[-1])) * time)
    else:
        shape = sum(
            rng.uniform(-1, 1)
            * np.exp(-(((time - c) / 0.3) ** 2))
            * np.sin(2 * np.pi * rng.uniform(0.8, 5) * time)
            for c in rng.uniform(0.2, time[-1], 8)
        )
    return size * shape / np.abs(shape).max() * np.minimum(1.0, 2 * time)
