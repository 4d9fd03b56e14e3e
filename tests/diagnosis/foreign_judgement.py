"""What an answer about a foreign joint is worth, alike in the tests and in the benchmark."""

from tests.diagnosis.foreign_joints import foreign_campaign
from tests.diagnosis.foreign_laws import CATALOGUE, CHANNELS, FOREIGN, SAME
from tests.diagnosis.foreign_mujoco import BODIES, PREFIX, mujoco_campaign

KINDS = {"foreign": tuple(FOREIGN), "catalogue": (*CATALOGUE, *CHANNELS), "nothing": ("nothing",)}
for _kind in tuple(KINDS):
    KINDS[f"{_kind}-mujoco"] = tuple(PREFIX + name for name, kind in BODIES.items() if kind == _kind)
# A gap of more floors than this is not explained.
UNEXPLAINED = 2.0
SURE = 0.8
# What sensors do to any campaign: a zero is no law of the joint.
ZEROS = {"angle_offset", "constant_moment"}


def campaign_of(name, seed):
    """Return the campaign of a name, made by SciPy or by MuJoCo."""
    if name.startswith(PREFIX):
        return mujoco_campaign(name.removeprefix(PREFIX), seed)
    return foreign_campaign(name, seed)


def told(result):
    """Return a diagnosis as plain figures."""
    return dict(
        verdict=result.verdict,
        reason=result.reason,
        steps=[
            dict(effect=s.effect, members=list(s.members), probability=s.probability, parameters=s.parameters)
            for s in result.steps
        ],
        rivals=[list(r) for s in result.steps[:1] for r in s.rivals],
        initial=[result.initial.moment, result.initial.response],
        final=[result.final.moment, result.final.response],
        floor=[result.noise_floor.moment, result.noise_floor.response],
        uncertainty=[result.uncertainty.moment, result.uncertainty.response],
        soundness=[[f.id, f.severity] for f in result.soundness.findings if f.severity != "note"]
        if result.soundness
        else [],
    )


def judge(record):
    """Return ``right``, ``mimicked`` or in a word what is wrong.

    Of a law of no catalogue *unknown*, *partly named* and *undecided* are right, unless what the effects leave is
    within two floors: then the catalogue explains the campaign. A name above 0.8 is wrong whatever the verdict.
    """
    if "error" in record:
        return "error"
    verdict, steps, kind = record["verdict"], record["steps"], record["kind"].removesuffix("-mujoco")
    laws = [s for s in steps if not set(s["members"]) & ZEROS]
    if kind == "foreign":
        if record["final"][0] <= UNEXPLAINED * record["floor"][0]:
            return "mimicked"
        if any(s["probability"] > SURE for s in laws):
            return "sure"
        return "right" if verdict in ("unknown", "partly_named", "undecided") else "named"
    if kind == "nothing":
        named = verdict in ("nothing_missing", "named", "ambiguous") and not laws
        return "right" if named else "invented"
    wanted = SAME.get(record["name"], {record["name"]})
    found = {m for s in steps for m in s["members"]}
    if verdict in ("named", "ambiguous") and wanted & found:
        return "right"
    if verdict in ("named", "ambiguous"):
        return "wrong"
    return f"{verdict}+" if wanted & found else verdict
