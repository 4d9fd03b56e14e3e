"""All campaigns of a batch held against each other: one common set of terms, the scatter, the outliers, the trends."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from sindyjoint.described import Maybe, Shown, same
from sindyjoint.discovery import Evidence, fit_columns, read_evidence
from sindyjoint.errors import InputError
from sindyjoint.numeric import Array
from sindyjoint.policy import SHARED as POLICY
from sindyjoint.text import spelled
from sindyjoint.workflows.joints import FACTORS_FILE, CampaignRecord
from sindyjoint.workflows.joints.population import CoefficientScatter, Population, population

TEMPERATURE, SERIAL = "temperature", "serial number"


@dataclass(frozen=True)
class Difference:
    """Why a campaign stands out.

    Parameters
    ----------
    id : str
        Of the campaign.
    kind : {"outlier", "terms", "none", "broken"}
    text : str
        One sentence.
    """

    id: str
    kind: str
    text: str


@dataclass(frozen=True)
class CommonCoefficient:
    """A coefficient that joints have in common, SI; the error without calibration."""

    value: Maybe
    standard_error: Maybe


@dataclass(frozen=True)
class CampaignInBatch:
    """What became of a campaign.

    Parameters
    ----------
    id, manifest : str
    status : {"found", "none", "broken"}
    reason : str
    joint : dict
        As it is declared; empty for a campaign that could not be read.
    terms : tuple of str
    common_coefficients : dict of str to CommonCoefficient
    """

    id: str
    manifest: str
    status: str
    reason: str
    joint: dict[str, Any]
    terms: tuple[str, ...]
    common_coefficients: dict[str, CommonCoefficient]


@dataclass(frozen=True)
class CommonTerm:
    """A term that joints have in common."""

    id: str
    unit: str


@dataclass(frozen=True, eq=False, repr=False)
class Batch(Shown):
    """The result of :func:`~sindyjoint.workflows.batch.batch`.

    Parameters
    ----------
    records : tuple of CampaignRecord
        In the order of their names.
    kept : int
        How many of them were done before and unchanged.
    common : tuple of str
        Terms that more than half of the models have: what coefficients are compared on.
    units : dict of str to str
        Of the common terms.
    values, errors : dict of str to ndarray, shape (campaigns,)
        Coefficients of the common terms, fitted with all of them and no other; NaN where that cannot be. The errors
        are those of each joint alone, without what calibration makes.
    covariates : dict of str to ndarray, shape (campaigns,)
        Temperature (K), serial number, and labels that are numbers, as far as they differ; NaN where not declared.
    population : Population
    differences : tuple of Difference
    notes : tuple of str
        What to know before believing it.
    covariate_units : dict of str to str
        SI unit of each covariate that has one.
    calibration : dict of str to dict
        By how much of itself one standard uncertainty of a channel's gain moves a coefficient, by term and channel. It
        moves all joints alike, so it is no part of their scatter, but of what is known of their mean.
    """

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar = {
        **same("campaigns", "found", "none", "broken"),
        "calibration?": "calibration",
        "common_terms": "common_terms",
        "scatter": "population.scatters",
        "trends": "population.trends",
        **same("differences", "notes"),
    }
    records: tuple[CampaignRecord, ...]
    kept: int
    common: tuple[str, ...]
    units: dict[str, str]
    values: dict[str, Array]
    errors: dict[str, Array]
    covariates: dict[str, Array]
    population: Population
    differences: tuple[Difference, ...]
    notes: tuple[str, ...]
    covariate_units: dict[str, str] = field(default_factory=dict)
    calibration: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def motion(self) -> str:
        """Kind of motion of the joints that are compared."""
        found = [record.joint["motion"] for record in self.records if record.status == "found"]
        return _find_majority(found) if found else "rotation"

    @property
    def complete(self) -> bool:
        """Whether a model was found in every campaign."""
        return self.found == len(self.records)

    @property
    def campaigns(self) -> tuple[CampaignInBatch, ...]:
        """What became of each campaign."""
        return tuple(
            CampaignInBatch(
                record.id, record.manifest, record.status, record.reason, record.joint, tuple(record.terms),
                {term: CommonCoefficient(self.values[term][i], self.errors[term][i]) for term in self.common},
            )
            for i, record in enumerate(self.records)
        )  # fmt: skip

    @property
    def common_terms(self) -> tuple[CommonTerm, ...]:
        """Terms that the joints have in common."""
        return tuple(CommonTerm(term, self.units[term]) for term in self.common)

    @property
    def found(self) -> int:
        """Campaigns in which a model was found."""
        return [record.status for record in self.records].count("found")

    @property
    def none(self) -> int:
        """Campaigns in which none was."""
        return [record.status for record in self.records].count("none")

    @property
    def broken(self) -> int:
        """Campaigns that could not be read or used."""
        return [record.status for record in self.records].count("broken")


def summarised(records: tuple[CampaignRecord, ...], folder: Path, kept: int = 0) -> Batch:
    """Compare campaigns with each other.

    Parameters
    ----------
    records : tuple of CampaignRecord
    folder : Path
        Parent of the folders with the factors of each.
    kept : int
    """
    found = [record for record in records if record.status == "found"]
    motion = _find_majority([record.joint["motion"] for record in found])
    compared = [record for record in found if record.joint["motion"] == motion]
    # The terms of more than half of the models, in the order of a model.
    has = Counter(term for record in compared for term in record.terms)
    leader = _find_majority([tuple(record.terms) for record in compared]) or ()
    kept_terms = [term for term, count in has.items() if 2 * count > len(compared)]
    common = tuple(sorted(kept_terms, key=lambda term: leader.index(term) if term in leader else len(leader)))
    units = {id: term["unit"] for record in compared for id, term in record.terms.items() if id in common}
    values = {term: np.full(len(records), np.nan) for term in common}
    errors = {term: np.full(len(records), np.nan) for term in common}
    for record in compared:
        for term, (value, error) in _get_coefficients(record, common, folder).items():
            values[term][records.index(record)], errors[term][records.index(record)] = value, error
    covariates = covariates_of(records)
    calibration = _calibration(compared, common)
    alone = population(values, errors, covariates)
    ids = tuple(record.id for record in records)
    scatters = tuple(_with_calibration(scatter, calibration, ids) for scatter in alone.scatters)
    result = replace(alone, scatters=scatters)
    return Batch(
        records=records,
        kept=kept,
        common=common,
        units=units,
        values=values,
        errors=errors,
        covariates=covariates,
        population=result,
        differences=tuple(_list_differences(records, common, values, units, result)),
        notes=tuple(_list_notes(found, compared)),
        covariate_units=units_of_covariates(records),
        calibration=calibration,
    )


def _calibration(records: Sequence[CampaignRecord], common: Sequence[str]) -> dict[str, dict[str, float]]:
    """Return relative moves of coefficients by uncertain gains, in the mean over the joints that declare some."""
    found: dict[str, dict[str, list[float]]] = {}
    for term in (record.terms.get(id, {}) | {"id": id} for record in records for id in common):
        for channel, move in term.get("calibration", {}).items():
            if term["coefficient"]:
                found.setdefault(term["id"], {}).setdefault(channel, []).append(move / term["coefficient"])
    return {id: {name: float(np.mean(m)) for name, m in moves.items()} for id, moves in found.items()}


def _with_calibration(
    scatter: CoefficientScatter, calibration: dict[str, dict[str, float]], ids: tuple[str, ...]
) -> CoefficientScatter:
    """Return a scatter whose mean has the errors of gains that all joints share."""
    moves = [scatter.mean * share for share in calibration.get(scatter.coefficient, {}).values()]
    return replace(scatter, mean_error=float(np.hypot(scatter.mean_error, np.linalg.norm(moves))), ids=ids)


def _find_majority(items: Sequence[Any]) -> Any:
    """Return the most frequent item, of equals the first."""
    return max(dict.fromkeys(items), key=items.count, default=None)


def _get_coefficients(
    record: CampaignRecord, common: tuple[str, ...], folder: Path
) -> dict[str, tuple[float, float]]:
    """Return value and error of the common terms: the model's where it has just these, else of a fit of them.

    What was done to the model's coefficients after its fit (the errors that it does not know of are added) is done to
    those of the other fit as well, for the terms that are in both.
    """
    found = record.terms
    if set(found) == set(common):
        return {term: (found[term]["coefficient"], _own_error(found[term])) for term in common}
    try:
        evidence = read_evidence(folder / record.id / FACTORS_FILE)
    except InputError:
        return {}
    # A term that these runs cannot distinguish from others is no candidate here: the others then mean something else.
    if not common or not set(common) <= set(evidence.ids):
        return {}
    here = _fit_terms(evidence, common)
    fitted = _fit_terms(evidence, [term for term in found if term in evidence.ids])
    for term in set(common) & set(fitted):
        (value, error), (before, before_error) = here[term], fitted[term]
        shift = found[term]["coefficient"] - before
        grown = _own_error(found[term]) / before_error if before_error > 0 else 1.0
        here[term] = (value + shift, error * grown)
    return here


def _own_error(term: dict[str, Any]) -> float:
    """Return the standard error of a coefficient without what errors of gains make of it."""
    shared = np.linalg.norm(list(term.get("calibration", {}).values()))
    return float(np.sqrt(max(term["standard_error"] ** 2 - shared**2, 0.0)))


def _fit_terms(evidence: Evidence, terms: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return value and error of some terms, fitted with no others."""
    fit = fit_columns(evidence, [evidence.ids.index(term) for term in terms])
    pairs = zip(fit.coefficients.tolist(), fit.standard_errors.tolist(), strict=True)
    return dict(zip(terms, pairs, strict=True))


def covariates_of(records: Sequence[CampaignRecord]) -> dict[str, Array]:
    """Return what the manifests declare as numbers, where at least three of them differ."""
    joints = [record.joint for record in records]
    columns: dict[str, list[Any]] = {TEMPERATURE: [joint.get("temperature") for joint in joints]}
    for kind in ("inputs", "labels"):
        for name in dict.fromkeys(key for joint in joints for key in joint.get(kind, {})):
            columns[name.replace("_", " ") if kind == "inputs" else name] = [
                _parse_number(joint.get(kind, {}).get(name)) for joint in joints
            ]
    # Of two that mean the same, what is declared is the reason, not the order of the joints.
    columns[SERIAL] = _parse_serials([joint.get("serial") for joint in joints])
    arrays = {name: np.array(column, dtype=float) for name, column in columns.items()}
    return {name: x for name, x in arrays.items() if np.unique(x[np.isfinite(x)]).size >= 3}


def units_of_covariates(records: Sequence[CampaignRecord]) -> dict[str, str]:
    """Return the SI units of covariates that have one."""
    units = {TEMPERATURE: "K"}
    for record in records:
        units |= {name.replace("_", " "): unit for name, unit in record.joint.get("input_units", {}).items()}
    return {name: unit for name, unit in units.items() if unit != "1"}


def _parse_serials(serials: Sequence[str | None]) -> list[float | None]:
    """Return the running numbers of serials such as SN-0012; nothing where they do not share what stands before."""
    parts = [re.fullmatch(r"(.*?)(\d+)", serial) if serial else None for serial in serials]
    heads = {part[1] for part in parts if part}
    if len(heads) != 1 or any(serial and not part for serial, part in zip(serials, parts, strict=True)):
        return [None] * len(serials)
    return [float(part[2]) if part else None for part in parts]


def _parse_number(given: str | float | None) -> float | None:
    try:
        value = float("nan" if given is None else given)
    except ValueError:
        return None
    return value if np.isfinite(value) else None


def _list_differences(
    records: Sequence[CampaignRecord],
    common: tuple[str, ...],
    values: dict[str, Array],
    units: dict[str, str],
    result: Population,
) -> Iterator[Difference]:
    """Say of each campaign that stands out why."""
    for i, record in enumerate(records):
        without = {"broken": record.reason, "none": f"no model: {record.reason}"}
        kind = record.status if record.status in without else "terms"
        if text := without.get(kind) or _terms_apart(record, common):
            yield Difference(record.id, kind, text)
        for scatter in (each for each in result.scatters if i in each.outliers):
            term, score = scatter.coefficient, scatter.scores[i]
            about = f", the trend with {scatter.covariate} taken out" if scatter.covariate else ""
            text = (
                f"{spelled(term, record.joint['motion'])} of {values[term][i]:.4g} {units[term].replace('*', '·')} is "
                f"{abs(score):.1f} standard deviations {'above' if score > 0 else 'below'} the other joints{about}"
            )
            yield Difference(record.id, "outlier", text)


def _terms_apart(record: CampaignRecord, common: tuple[str, ...]) -> str:
    """Return which terms a model has not or has that most have; empty where it has just these."""
    missing = [term for term in common if term not in record.terms]
    extra = [term for term in record.terms if term not in common]
    pairs = [(word, terms) for word, terms in (("without", missing), ("with", extra)) if terms]
    return "terms " * bool(pairs) + " and ".join(f"{word} {_spell_terms(t, record)}" for word, t in pairs)


def _list_notes(found: Sequence[CampaignRecord], compared: Sequence[CampaignRecord]) -> list[str]:
    """Return what to know before believing a comparison."""
    names = {record.joint["name"] for record in found}
    alike = len(found) > 1 and len(names) == 1 and all(r.joint["serial"] is None for r in found)
    first = [warning for r in found for warning in (r.result or {}).get("warnings", [])[:1]]
    notes = (
        (
            any("simulated" in warning for warning in first),
            "some of the campaigns are simulated (virtual tests), not measured",
        ),
        (
            len(compared) < len(found),
            f"{len(found) - len(compared)} joint(s) of the other kind of motion are listed, not compared: their "
            "coefficients have other units",
        ),
        (
            len(compared) < POLICY.scatter,
            f"{len(compared)} joint(s) with a model: outliers are looked for among {POLICY.scatter} or more",
        ),
        (
            alike,
            f"all joints are called {min(names, default='')!r} and none has a serial: give each [joint] one",
        ),
    )
    return [note for holds, note in notes if holds]


def _spell_terms(terms: Sequence[str], record: CampaignRecord) -> str:
    return ", ".join(spelled(term, record.joint["motion"]) for term in terms)
