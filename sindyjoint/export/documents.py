"""Documents that hold the model itself: LaTeX (packages ``booktabs`` and ``amsmath``), JSON, drawn coefficients."""

import csv
import io
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from decimal import Decimal
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from sindyjoint.documents import LARGEST, parse_json
from sindyjoint.equation.equation_text import latex_symbol, latex_text
from sindyjoint.equation.formula import formula_latex, formula_text, parameter_symbol
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError
from sindyjoint.export import Export
from sindyjoint.export.fidelity import (
    Fidelity,
    comment,
    exact_table,
    preamble,
    words_of,
)
from sindyjoint.files.units import parse_quantity
from sindyjoint.numeric import Array, root_of
from sindyjoint.workflows.joints import CampaignRecord
from sindyjoint.workflows.joints.population import population
from sindyjoint.workflows.joints.summary import covariates_of, units_of_covariates


def export_json(model: JointModel) -> Export:
    """Write ``model.json``: the model as discover writes it, with its fidelity table; every command reads it back."""
    rows = exact_table(model, "formula, coefficient, covariance", "formulas, numbers, covariance", {})
    record = {**model.to_dict(), "fidelity": [asdict(row) for row in rows]}
    return Export("json", {"model.json": json.dumps(record, indent=1) + "\n"}, rows)


def export_latex(model: JointModel) -> Export:
    """Write ``joint.tex``, to be input into a document: the equation and a table of the terms."""
    rows = exact_table(model, "formula and coefficient", "formulas and numbers", {})
    notes = ("needs the packages booktabs and amsmath; coefficients are rounded to their standard errors",)
    rotation, words = model.joint.motion == "rotation", words_of(model)
    inertia = (
        rf" The moving inertia is $ {'I' if rotation else 'm'} = {_scientific(model.joint.inertia, 4)} $ "
        rf"{_unit(words.inertia_unit)}."
        if model.joint.inertia is not None
        else ""
    )
    fitted = model.fitted
    text = comment(preamble(model, "LaTeX", rows, notes), "%", ascii_only=False)
    text += "\n".join(
        [
            r"\begin{equation}",
            f"  {model.latex()}",
            r"\end{equation}",
            r"\begin{table}",
            r"  \centering",
            rf"  \caption{{Terms of the transfer {words.moment} of {latex_text(model.joint.name)}, with standard "
            rf"errors, identified up to $ {_scientific(fitted.angle, 3)} $ {_unit(words.angle_unit)} and "
            rf"$ {_scientific(fitted.rate, 3)} $ {_unit(words.angle_unit + '/s')}.{inertia}}}",
            r"  \begin{tabular}{llll}",
            r"    \toprule",
            r"    Term & Symbol & Coefficient & Unit \\",
            r"    \midrule",
            *(
                rf"    {name} & $ {symbol} $ & $ {number} $ & {unit} \\"
                for name, symbol, number, unit in _entries(model)
            ),
            r"    \bottomrule",
            r"  \end{tabular}",
            r"\end{table}",
            "",
        ]
    )
    return Export("latex", {"joint.tex": text}, rows, notes)


def _entries(model: JointModel) -> list[tuple[str, str, str, str]]:
    """Return name, symbol, number and unit of each term, and of each number of an element."""
    entries = [
        (
            latex_text(t.name)
            + "".join(
                rf", $ {latex_symbol(name)} = {_scientific(value, 4)} $" for name, value in t.parameters
            ),
            latex_symbol(t.symbol),
            with_error(t.coefficient, t.standard_error),
            _unit(t.unit),
        )
        for t in model.terms
    ]
    entries += [
        (latex_text(e.name), symbol, with_error(number.value, number.standard_error), _unit(number.unit))
        for e in model.elements
        for symbol, number in zip(
            [
                *(latex_symbol(column.name) for column in e.columns),
                *(formula_latex(parameter_symbol(each.name)) for each in e.parameters),
            ],
            e.numbers,
            strict=True,
        )
    ]
    return entries


def with_error(value: float, error: float) -> str:
    r"""Return value and standard error with two digits of the error.

    Examples
    --------
    >>> with_error(-2.684e9, 1.234e7)
    '(-2.684 \\pm 0.012) \\cdot 10^{9}'
    >>> with_error(48.13, 0.0)
    '48.13'
    """
    if not error > 0:
        return _scientific(value, 6)
    exponent = Decimal(value).adjusted() if value else Decimal(error).adjusted()
    if -3 < exponent < 4:
        exponent = 0
    digits = max(exponent - Decimal(error).adjusted() + 1, 0)
    body = f"{value / 10.0**exponent:.{digits}f} \\pm {error / 10.0**exponent:.{digits}f}"
    return rf"({body}) \cdot 10^{{{exponent}}}" if exponent else body


def _scientific(value: float, digits: int) -> str:
    mantissa, _, exponent = f"{value:.{digits}g}".partition("e")
    return rf"{mantissa} \cdot 10^{{{int(exponent)}}}" if exponent else mantissa


def _unit(unit: str) -> str:
    text = latex_text(unit).replace(r"\textasciicircum{}", "^").replace("*", r"\,")
    return re.sub(r"\^(-?\d+)", r"\\textsuperscript{\1}", text)


FILE = "samples.csv"
COUNT = 1000
BATCH_FILE = "batch.json"


def export_samples(model: JointModel, count: int = COUNT, random_state: int = 0) -> Export:
    """Draw coefficients from the normal distribution of a model's numbers, their covariance respected.

    Negative friction is drawn as zero; the positive numbers of elements stay positive.
    """
    from sindyjoint.response.laws import draw_models

    _check(count)
    drawn = draw_models(model, count, np.random.default_rng(random_state))

    names = [(term.id, term.symbol, term.unit) for term in model.terms]
    names += [(e.id, f"{e.symbol}_{n.name}", n.unit) for e in model.elements for n in e.numbers]
    how = f"{count} draws of the normal distribution of its estimate, with the covariance of all"
    motion = model.joint.motion
    of = {term.id: f"; times {formula_text(term.expression, motion)}" for term in model.terms if term.inputs}
    return _export_sets(names, np.array([each.numbers for each in drawn]), how, of)


def batch_samples(
    folder: Path, count: int = COUNT, random_state: int = 0, at: Mapping[str, str] = MappingProxyType({})
) -> Export:
    """Draw coefficients of joints that were not tested, from the joints of a batch.

    Mean and spread are those of the batch without its outliers, correlations those of its joints; Student's
    distribution on one degree of freedom less than there are joints knows how well the spread is known. Declared
    uncertainties of gains move all joints alike. A coefficient with a trend is drawn about it, at the value of the
    covariate that ``at`` gives (SI, or with its unit), else at the mean of the joints tested.

    Raises
    ------
    InputError
        For a folder without a batch, one of too few joints, or a value of what no coefficient has a trend with.
    """
    _check(count)
    file = folder / BATCH_FILE
    record: Any = parse_json(file.read_bytes()[: LARGEST["JSON"]].decode("utf-8"), str(file))
    try:
        units = {each["id"]: each["unit"] for each in record["common_terms"]}
        values, errors = (
            {
                term: np.array(
                    [c["common_coefficients"][term][key] for c in record["campaigns"]], dtype=float
                )
                for term in units
            }
            for key in ("value", "standard_error")
        )
        joints = [CampaignRecord(each["id"], "", "", "", each["joint"]) for each in record["campaigns"]]
    except (KeyError, TypeError):
        raise InputError(f"{file}: is no record of a batch; run the batch again") from None
    covariates = covariates_of(joints)
    found = population(values, errors, covariates)
    scatters, lines = found.scatters, {(t.coefficient, t.covariate): t for t in found.trends}
    given = _given(
        at, {s.covariate for s in scatters if s.covariate is not None}, units_of_covariates(joints)
    )
    means, scales, deviations = [], [], []
    kept, degrees = np.ones(len(joints), dtype=bool), np.inf
    for scatter in scatters:
        scale = scatter.next_scale
        if scale is None:
            raise InputError(f"{file}: too few joints for a distribution of {scatter.coefficient}; test more")
        mean, own = scatter.mean, values[scatter.coefficient]
        if scatter.covariate is not None:
            line, x = lines[scatter.coefficient, scatter.covariate], covariates[scatter.covariate]
            away = float(given.get(scatter.covariate, np.nanmean(x)) - np.nanmean(x))
            mean, scale = mean + line.slope * away, float(np.hypot(scale, line.slope_error * away))
            own = own - line.slope * (x - np.nanmean(x))
        means.append(mean)
        scales.append(scale)
        deviations.append(own - scatter.mean)
        degrees = min(degrees, scatter.joints - 1.0)
        kept &= np.isfinite(own)
        kept[list(scatter.outliers)] = False
    correlation = np.corrcoef([each[kept] for each in deviations]) if len(scatters) > 1 else np.eye(1)
    covariance = np.nan_to_num(correlation) * np.outer(scales, scales)
    for move in _shared_moves(record, [s.coefficient for s in scatters], np.array(means)):
        covariance += np.outer(move, move)
    drawn = _student(np.array(means), covariance, degrees, count, random_state)
    how = f"{count} draws of Student's distribution of a next joint, {int(kept.sum())} joints tested"
    return _export_sets([(s.coefficient, s.coefficient, units[s.coefficient]) for s in scatters], drawn, how)


def _given(at: Mapping[str, str], known: set[str], units: Mapping[str, str]) -> dict[str, float]:
    """Return values of covariates, SI."""
    values = {}
    for name, text in at.items():
        label = name.replace("_", " ")
        if label not in known:
            raise InputError(
                f"at {name!r}: no coefficient has a trend with it; there are trends with "
                f"{', '.join(sorted(known)) or 'nothing'}"
            )
        try:
            values[label] = float(text)
        except ValueError:
            values[label] = parse_quantity(text, units.get(label, "1"), f"at {name!r}")
    return values


def _shared_moves(record: Any, terms: Sequence[str], means: Array) -> Array:
    """Return by how much an uncertain gain of each channel moves the means, a row each: all joints alike."""
    known = record.get("calibration", {})
    channels = sorted({channel for moves in known.values() for channel in moves})
    shares = [[known.get(term, {}).get(channel, 0.0) for term in terms] for channel in channels]
    return np.array(shares, dtype=float).reshape(-1, means.size) * means


def _student(means: Array, covariance: Array, degrees: float, count: int, seed: int) -> Array:
    generator = np.random.default_rng(seed)
    normal = generator.standard_normal((count, means.size)) @ root_of(covariance).T
    return np.asarray(means + normal / np.sqrt(generator.chisquare(degrees, count) / degrees)[:, None])


def _check(count: int) -> None:
    if not 1 <= count <= 1_000_000:
        raise InputError(f"count is {count}; expected from 1 to 1000000 sets")


def _export_sets(
    names: Sequence[tuple[str, str, str]],
    drawn: Array,
    how: str,
    of: Mapping[str, str] = MappingProxyType({}),
) -> Export:
    """Return the sets as CSV, a row each; a column is headed by symbol and unit; ``of`` adds to how it is made."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([f"{symbol} [{unit}]" for _, symbol, unit in names])
    writer.writerows([[repr(float(value)) for value in row] for row in drawn])
    rows = tuple(Fidelity(id, symbol, how + of.get(id, ""), True, 0.0, 0.0) for id, symbol, _ in names)
    return Export("samples", {FILE: text.getvalue()}, rows)
