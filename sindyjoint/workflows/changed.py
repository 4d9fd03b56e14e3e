"""Two tests of one joint, and whether it has changed between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from sindyjoint.discovery.evidence import fit_columns
from sindyjoint.discovery.large.segments import LONGEST
from sindyjoint.equation.calibration import with_gain_uncertainty
from sindyjoint.equation.model import JointModel, model_terms
from sindyjoint.equation.model_file import read_model
from sindyjoint.errors import InputError, checks_options
from sindyjoint.judgement.changed import Change, check_margin, compare_models
from sindyjoint.judgement.discovery import Discovery
from sindyjoint.judgement.policy import POLICY
from sindyjoint.numeric import RNG
from sindyjoint.record import Campaign
from sindyjoint.workflows.discover import discover, the_campaign

Test = Campaign | JointModel | Discovery | str | Path


@checks_options()
def changed(
    before: Test,
    after: Test,
    *,
    margin: float = POLICY.change_margin,
    same_sensors: bool = False,
    accept: Sequence[str] = (),
    rng: RNG = None,
    progress: Callable[[str], None] | None = None,
) -> Change:
    """Say which coefficients of a joint moved between two tests, and by how much.

    Parameters
    ----------
    before, after : Campaign, JointModel, Discovery or path
        A path is that of a campaign.toml, of a model.json, or of a folder with one of them. Of two campaigns the same
        terms are fitted to both: those found in either.
    margin : float
        Relative change of a coefficient that would not matter.
    same_sensors : bool
        Whether the sensors and their calibration were the same in both: declared uncertainties of gains are then no
        part of the difference.
    accept : sequence of str
        Ids of findings of the check of the data that shall not stop the work.
    rng : int, Generator or None
    progress : callable, optional
        Called with the name of each stage.

    Returns
    -------
    Change

    Raises
    ------
    InputError, MissingInputError
        For what is no test, or tests of different joints.
    """
    say = progress or (lambda stage: None)
    given = ((before, "before"), (after, "after"))
    names = tuple(str(each) if isinstance(each, str | Path) else word for each, word in given)
    check_margin(margin)
    # Both are read before either is worked on.
    read = []
    for each, name in zip((before, after), names, strict=True):
        say(f"reading {name}")
        read.append(_read(each))
    found = [
        discover(each, accept=accept, rng=rng, progress=say) if isinstance(each, Campaign) else each
        for each in read
    ]
    models = [each.model if isinstance(each, Discovery) else each for each in found]
    for model, name in zip(models, names, strict=True):
        if not (model.terms or model.elements):
            raise InputError(f"{name}: no model was found there; nothing can be compared")
    warnings = [
        f"{name}: {each.trust.lights[0].sentence}"
        for each, name in zip(found, names, strict=True)
        if isinstance(each, Discovery) and each.soundness.verdict != "sound"
    ]
    if all(isinstance(each, Discovery) for each in found) and set(models[0].ids) != set(models[1].ids):
        ids = [*models[0].ids, *(name for name in models[1].ids if name not in models[0])]
        models = [_refitted(each, ids) for each in found]  # type: ignore[arg-type]
        warnings.append("the two tests find different terms: those of either were fitted to both")
    return compare_models(models[0], models[1], margin, same_sensors, (names[0], names[1]), tuple(warnings))


def _read(test: Test) -> Campaign | Discovery | JointModel:
    """Return a test as it is given, or what its file holds."""
    if not isinstance(test, str | Path):
        return test
    path = Path(test)
    is_model = path.suffix.lower() == ".json" or (path.is_dir() and (path / "model.json").is_file())
    return read_model(path) if is_model else the_campaign(path, longest=LONGEST)


def _refitted(found: Discovery, ids: Sequence[str]) -> JointModel:
    """Return some of the candidates of a discovery, fitted to its runs; those left undetermined are left out."""
    evidence = found.regressor.evidence_
    resolved = {term.id: term for term in found.regressor.terms_}
    columns = [evidence.ids.index(name) for name in ids if name in evidence.ids]
    fit = fit_columns(evidence, columns)
    terms = model_terms(
        [resolved[evidence.ids[column]] for column in columns], fit.coefficients, fit.covariance, fit.unique_share,
        fit.effective_degrees, found.model.joint.motion,
    )  # fmt: skip
    fitted = replace(found.model.fitted, gains=())
    model = replace(found.model.with_terms(terms, fit.covariance), fitted=fitted)
    return with_gain_uncertainty(model, dict(found.model.fitted.gains))
