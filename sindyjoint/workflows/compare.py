"""What is held beside each other: the answers of methods, frequencies and libraries; two tests of one joint."""

import inspect
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from sindyjoint.clock import single_threaded
from sindyjoint.discovery import fit_columns
from sindyjoint.discovery.methods import METHODS
from sindyjoint.discovery.uncertainty import inclusion
from sindyjoint.equation.calibration import with_gain_uncertainty
from sindyjoint.equation.catalogue_file import as_model, read_model
from sindyjoint.equation.model import JointModel, model_terms
from sindyjoint.errors import InputError, UnknownNameError, checks_options, refuse
from sindyjoint.files.campaign import LONGEST
from sindyjoint.judgement.changed import Change, check_margin, compare_models
from sindyjoint.judgement.comparison import Choice, ChosenTerm, Comparison
from sindyjoint.judgement.discovery import Discovery, frequency_tests, undetermined
from sindyjoint.judgement.headlines import judge_comparison
from sindyjoint.judgement.question import (
    WEAK,
    Question,
    add_responses,
    against_paper,
    by_friction_law,
    by_group,
    by_level,
    by_library,
    by_method,
    hold_out_groups,
    parts_of,
)
from sindyjoint.limits import DISCOVERY, JUDGEMENT
from sindyjoint.numeric import RNG, seed_of
from sindyjoint.parallel import spread
from sindyjoint.record import Campaign
from sindyjoint.response.verify_campaign import GIVEN, beyond_tested
from sindyjoint.soundness.check import require_sound
from sindyjoint.states import campaign_states, moment_floor
from sindyjoint.workflows.check import the_campaign
from sindyjoint.workflows.discover import discover, regressor_options
from sindyjoint.workflows.verify import given_model

# Each name may join several catalogues: without the terms of the paper, special ones stand in for those.
LIBRARIES = ("paper", "polynomial", "paper + stiffness", "paper + damping", "paper + friction", "extended")


@checks_options(lambda: (*inspect.signature(discover).parameters, *regressor_options()))
@single_threaded()
def compare(
    campaign: Campaign | str | Path | Any = None,
    library: Any = "extended",
    *,
    model: JointModel | str | Path | None = None,
    accept: Sequence[str] = (),
    methods: Sequence[str] | None = None,
    libraries: Sequence[str] = LIBRARIES,
    replicates: int = 500,
    margin: float = DISCOVERY.margin,
    rng: RNG = 0,
    progress: Callable[[str], None] | None = None,
    jobs: int = 1,
    workers: int | None = None,
    cluster: str | None = None,
    **options: Any,
) -> Comparison:
    """Compare what methods, frequencies and libraries say about a joint's terms.

    Parameters
    ----------
    campaign : Campaign, path of a campaign.toml, or None
        ``None``: the built-in virtual test of the inter-panel joint, which is simulated.
    library : str, Path, Catalogue, or sequence of these
        Candidates for the comparison of methods and of frequencies.
    model : JointModel or path of a model.json, optional
        A model that is held against the same runs, elements and errors of their channels included; as
        :func:`~sindyjoint.verify` does.
    accept : sequence of str
        Ids of findings of the check of the data that shall not stop the work; see :func:`~sindyjoint.check`.
    methods : sequence of str, optional
        Of :data:`~sindyjoint.discovery.methods.METHODS`, default: all; and ``"weak"``, after another one: its way of
        choosing, on the weak form of the rows by pysindy's test functions.
    libraries : sequence of str
        Names of catalogues, several joined by "+", for the first method.
    replicates : int
        Of the bootstrap behind the inclusion probabilities.
    margin : float
        Relative change of a coefficient over the tested band that would not matter.
    rng : int, Generator or None
    progress : callable, optional
        Called with the name of each stage.
    jobs, workers, cluster
        Where methods and replicates are worked on, to the same digits; see :func:`~sindyjoint.parallel.executor`.
    **options
        Of :func:`~sindyjoint.workflows.discover.discover`: states, bandwidth, align, forbidden, ...

    Raises
    ------
    InputError, UnknownNameError
        For data or options that cannot be used.
    UnsoundError
        Where the check of the data finds what stops the work.

    Examples
    --------
    >>> import sindyjoint
    >>> test = sindyjoint.simulate(frequencies=[3, 5], levels=[0.9, 0.5], duration=3.0, rng=0)
    >>> found = sindyjoint.compare(test, "paper", methods=["stlsq", "frols"], libraries=["paper"], replicates=20)
    >>> [choice.name for choice in found.methods]
    ['stlsq', 'frols']
    """
    options["accept"] = accept
    names = _checked(tuple(methods or METHODS))
    if replicates < 10 or not margin > 0:
        raise InputError(
            f"replicates is {replicates} and margin {margin!r}; expected 10 or more, and a positive number"
        )
    if isinstance(model, str | Path):
        read_model(model)  # what cannot be read is refused before anything is worked on
    # Each method has the same seed, whichever is done first.
    rng = seed_of(rng)
    seconds: dict[str, float] = {}
    run = _timed(progress or (lambda stage: None), seconds)
    with spread(jobs, workers, cluster):
        found = run(
            "discovering", discover, campaign, library, rng=rng, method=names[0],
            progress=progress, **options,
        )  # fmt: skip
        if found.stopped is not None:
            require_sound(found.stopped)
        question = Question.of(found, names, rng)
        compared = _compared(
            question, libraries, replicates, margin, options.get("forbidden", ()), run, seconds
        )
    if model is None:
        return compared
    measured = found.measured or found.campaign
    beyond = beyond_tested(as_model(model), *campaign_states(measured), whose=GIVEN)
    return replace(
        compared,
        warnings=(*compared.warnings, *beyond),
        given=run("simulating the given model", given_model, model, measured, accept),
    )


def _checked(names: tuple[str, ...]) -> tuple[str, ...]:
    unknown = [name for name in names if name not in (*METHODS, WEAK)]
    if unknown:
        raise UnknownNameError(f"method is {unknown[0]!r}; expected one of {', '.join((*METHODS, WEAK))}")
    if names[0] == WEAK:
        raise InputError(f"{WEAK!r} cannot lead the comparison: name another method before it")
    return names


def _compared(
    question: Question,
    libraries: Sequence[str],
    replicates: int,
    margin: float,
    forbidden: Sequence[str],
    run: Callable[..., Any],
    seconds: dict[str, float],
) -> Comparison:
    found, evidence = question.found, question.evidence
    methods = run("methods", by_method, question)
    parts = parts_of(found)
    frequencies = run(f"one {parts} at a time", by_group, question)
    levels = run("one level at a time", by_level, question)
    fitted = run("libraries", by_library, question, libraries, forbidden)
    friction, friction_units = run("laws of friction", by_friction_law, question)
    left_out = run("holding out frequencies and levels", hold_out_groups, question)
    methods = run("simulating held-out runs", add_responses, found, evidence, methods)
    probability, sets = run(
        "resampling blocks and runs", inclusion, evidence, replicates, random_state=question.random_state,
        **question.rule,
    )  # fmt: skip
    against = partial(against_paper, found)
    tests = run("frequency dependence", frequency_tests, found, margin)
    compared = Comparison(
        joint=found.campaign.joint.name,
        motion=found.campaign.joint.motion,
        simulated=found.campaign.simulated,
        ids=evidence.ids,
        units={t.id: t.term.unit_for(found.campaign.joint.motion) for t in found.regressor.terms_}
        | {term: unit for _, units in fitted for term, unit in units.items()}
        | friction_units,
        methods=tuple(map(against, methods)),
        frequencies=tuple(map(against, frequencies)),
        levels=tuple(map(against, levels)),
        libraries=tuple(against(choice) for choice, _ in fitted),
        friction=friction,
        inclusion=tuple(float(p) for p in probability),
        sets=sets,
        left_out=left_out,
        tests=tests,
        model=against(_model(found)),
        undetermined=undetermined(found),
        warnings=found.warnings
        + tuple(f"weak form: {c.reason}" for c in methods if c.name == WEAK and not c.terms),
        seconds=seconds,
        discovery=found,
        soundness=found.soundness,
        noise_floor=moment_floor(found.states, found.model.joint.inertia).relative,
        parts=parts,
        trust=found.trust,
    )
    return replace(compared, trust=judge_comparison(compared))


def _timed(say: Callable[[str], None], seconds: dict[str, float]) -> Callable[..., Any]:
    """Return what does the work of a stage, says its name, and keeps how long it took."""

    def run(stage: str, work: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        say(stage)
        started = time.perf_counter()
        result = work(*arguments, **options)
        seconds[stage] = time.perf_counter() - started
        return result

    return run


def _model(found: Discovery) -> Choice:
    """Return the main model."""
    fitted = found.model.fitted
    left = fitted.residual_rms / (fitted.moment_rms or 1.0)
    return Choice(
        "model", ChosenTerm.of(found.model), found.reason, len(found.regressor.terms_), residual=left
    )


Test = Campaign | JointModel | Discovery | str | Path


@checks_options()
def changed(
    before: Test,
    after: Test,
    *,
    margin: float = JUDGEMENT.margin,
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

    Examples
    --------
    >>> import sindyjoint
    >>> runs = {"frequencies": [3, 5], "levels": [0.9, 0.5], "duration": 3.0}
    >>> before, after = (sindyjoint.simulate(rng=seed, **runs) for seed in (0, 1))
    >>> sindyjoint.changed(before, after)
    <Change: inter-panel joint: before and after>
    """
    say = progress or (lambda stage: None)
    given = ((before, "before"), (after, "after"))
    names = tuple(str(each) if isinstance(each, str | Path) else word for each, word in given)
    check_margin(margin)
    # Both are read before either is worked on.
    read = [_read(each, name, say) for each, name in zip((before, after), names, strict=True)]
    found = [
        discover(each, accept=accept, rng=rng, progress=say) if isinstance(each, Campaign) else each
        for each in read
    ]
    models = [each.model if isinstance(each, Discovery) else each for each in found]
    refuse(
        (not (model.terms or model.elements), f"{name}: no model was found there; nothing can be compared")
        for model, name in zip(models, names, strict=True)
    )
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


def _read(test: Test, name: str, say: Callable[[str], None]) -> Campaign | Discovery | JointModel:
    """Return a test as it is given, or what its file holds."""
    say(f"reading {name}")
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
    model = found.model.with_terms(terms, fit.covariance)
    model = replace(model, fitted=replace(found.model.fitted, gains={}))
    return with_gain_uncertainty(model, found.model.fitted.gains)
