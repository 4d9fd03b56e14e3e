"""Which terms the data need: the regression problem of a campaign, and how sure its coefficients are.

Rows come in runs, runs fall into groups (frequencies, usually) that are held out together, and each run is cut
into blocks whose scatter shows the noise. One :class:`Evidence` holds a factor for each; as bytes, a few hundred
kilobytes and no pickle, it is what later analyses need of the samples.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sindyjoint.discovery.factors import Factor, merge
from sindyjoint.errors import InputError
from sindyjoint.numeric import Array, scaled_least_squares


@dataclass(frozen=True, eq=False)
class RunEvidence:
    """The factors of one run.

    Parameters
    ----------
    name : str
    group : str
        What is held out together with it.
    pooled : Factor
        Of all its moving rows.
    blocks : tuple of Factor
        Of its replicate blocks, each from the state of the single block.
    """

    name: str
    group: str
    pooled: Factor
    blocks: tuple[Factor, ...]

    @cached_property
    def triangles(self) -> Array:
        """Triangles of the blocks, shape (blocks, p + 1, p + 1)."""
        return np.array([block.triangle for block in self.blocks])

    def take(self, columns: Sequence[int]) -> RunEvidence:
        """Return the same run with some of the columns."""
        return RunEvidence(
            self.name,
            self.group,
            self.pooled.take(columns),
            tuple(block.take(columns) for block in self.blocks),
        )

    def fixing(self, columns: Sequence[int], coefficients: Sequence[float]) -> RunEvidence:
        """Return the same run on the other columns, these ones' given share taken from the target."""
        blocks = tuple(block.fixing(columns, coefficients) for block in self.blocks)
        return RunEvidence(self.name, self.group, self.pooled.fixing(columns, coefficients), blocks)


@dataclass(frozen=True, eq=False)
class Evidence:
    """The factors of a campaign.

    Parameters
    ----------
    ids : tuple of str
        Ids of the columns.
    runs : tuple of RunEvidence
    within : mapping of str to tuple of str
        Id of a column to those without which it makes no sense (k1·T without k1).
    """

    ids: tuple[str, ...]
    runs: tuple[RunEvidence, ...]
    within: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @cached_property
    def parents(self) -> dict[int, tuple[int, ...]]:
        """For each column those without which it makes no sense, as far as they are among the columns."""
        place = {name: index for index, name in enumerate(self.ids)}
        found = {name: tuple(place[p] for p in self.within.get(name, ()) if p in place) for name in self.ids}
        return {place[name]: parents for name, parents in found.items() if parents}

    def needed(self, columns: Sequence[int]) -> set[int]:
        """Return the columns without which some of these make no sense."""
        return {parent for column in columns for parent in self.parents.get(column, ())}

    def complete(self, columns: Sequence[int]) -> tuple[int, ...]:
        """Return the columns less those that make no sense beside the others."""
        kept = set(columns)
        while orphans := {c for c in kept if not set(self.parents.get(c, ())) <= kept}:
            kept -= orphans
        return tuple(sorted(kept))

    @cached_property
    def pooled(self) -> Factor:
        """Factor of all rows."""
        return merge(run.pooled for run in self.runs)

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Distinct groups, in order of appearance."""
        return tuple(dict.fromkeys(run.group for run in self.runs))

    @cached_property
    def training(self) -> dict[str, Factor]:
        """For each group, the factor of all rows outside it. Empty where there is one group only."""
        if len(self.groups) < 2:
            return {}
        return {group: merge(r.pooled for r in self.runs if r.group != group) for group in self.groups}

    @cached_property
    def scattered(self) -> tuple[Array, NDArray[np.intp]]:
        """Triangles of the blocks of all runs that have several, and how many of each run there are."""
        several = [run.triangles for run in self.runs if len(run.blocks) > 1]
        size = len(self.ids) + 1
        together = np.concatenate(several) if several else np.empty((0, size, size))
        return together, np.array([len(blocks) for blocks in several], dtype=np.intp)

    @property
    def target_rms(self) -> float:
        """Root-mean-square of the target."""
        return float(np.sqrt(self.pooled.squared_target / self.pooled.rows))

    def take(self, columns: Sequence[int]) -> Evidence:
        """Return the evidence on some of the columns."""
        ids = tuple(self.ids[c] for c in columns)
        return replace(self, ids=ids, runs=tuple(run.take(columns) for run in self.runs))

    def fixing(self, coefficients: Mapping[str, float]) -> Evidence:
        """Return the evidence on the other columns, the target less what the named ones carry at these coefficients."""
        columns = [self.ids.index(name) for name in coefficients]
        values = [*coefficients.values()]
        ids = tuple(name for name in self.ids if name not in coefficients)
        return replace(self, ids=ids, runs=tuple(run.fixing(columns, values) for run in self.runs))

    def only(self, groups: Sequence[str]) -> Evidence:
        """Return the evidence of the runs of some groups."""
        return replace(self, runs=tuple(run for run in self.runs if run.group in groups))


@dataclass(frozen=True, eq=False)
class Fit:
    """A least-squares fit of some columns.

    Parameters
    ----------
    columns : tuple of int
    coefficients : ndarray, shape (k,)
    covariance : ndarray, shape (k, k)
        Robust to autocorrelation and to noise in the angle.
    unique_share : ndarray, shape (k,)
        Moment that only this term carries, as a share of the target's RMS: what the residual grows by (root of
        the difference of squares) when the term is taken out and the others are fitted again.
    residual_rms : float
    degrees : int
        Blocks that the covariance rests on, less one for each run.
    effective_degrees : ndarray, shape (k,)
        Degrees of freedom of each standard error: fewer, where a few runs make most of it.
    """

    columns: tuple[int, ...]
    coefficients: Array
    covariance: Array
    unique_share: Array
    residual_rms: float
    degrees: int
    effective_degrees: Array

    @property
    def standard_errors(self) -> Array:
        """Standard error of each coefficient, shape (k,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def t_ratios(self) -> Array:
        """|coefficient| / standard error, shape (k,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.abs(self.coefficients) / self.standard_errors
        return np.where(np.isnan(ratio), 0.0, ratio)


def fit_columns(evidence: Evidence, columns: Sequence[int]) -> Fit:
    """Return the least-squares fit of some columns of the evidence."""
    columns = tuple(columns)
    factor, norms, target_norm = evidence.pooled.take(columns).normalised()
    inverse = factor.inverse()
    scaled = factor.solve()
    coefficients = scaled * target_norm / norms
    spread = np.linalg.norm(inverse, axis=1)
    error = factor.squared_error(scaled) * target_norm**2
    covariance, degrees, effective = block_covariance(
        evidence, columns, coefficients, inverse / norms[:, None]
    )
    return Fit(
        columns=columns,
        coefficients=coefficients,
        covariance=covariance,
        unique_share=np.abs(scaled) / spread,
        residual_rms=float(np.sqrt(error / evidence.pooled.rows)),
        degrees=degrees,
        effective_degrees=effective,
    )


def block_covariance(
    evidence: Evidence, columns: Sequence[int], coefficients: Array, inverse: Array
) -> tuple[Array, int, Array]:
    """Return the covariance of coefficients from the scatter of the blocks' scores, and its degrees of freedom.

    Those are counted twice: blocks less runs; and for each coefficient by Satterthwaite's rule,
    ν = (Σ_runs v)² / Σ_runs v²/(B − 1) with the runs' parts v of its variance (Biometrics Bulletin 2, 1946).

    With the score s_b = X_bᵀ(y_b − X_b c) of each block,
    cov(c) = (XᵀX)⁻¹ [Σ_runs B/(B−1) Σ_b (s_b − s̄)(s_b − s̄)ᵀ] (XᵀX)⁻¹.
    Since X_b is computed from the motion of the block, noise of angle and rate is in the scatter, and correlation
    within a block does not matter. The cluster-robust covariance of Liang and Zeger (1986), clusters = blocks.
    ``inverse`` is the R⁻¹ of the columns, shape (k, k).
    """
    bread = inverse @ inverse.T
    scores, sizes = block_scores(evidence, columns, coefficients)
    degrees = int(np.sum(sizes - 1))
    if not degrees:
        return np.zeros_like(bread), 0, np.zeros(len(bread))
    starts = np.cumsum(sizes) - sizes
    # The product first: its square has no negative variances, whatever rounding does.
    influence = scores @ bread
    # Scaled by the norms: squares of variances of cubic stiffness and of friction differ by forty orders.
    shares = np.add.reduceat(influence**2, starts) / np.diag(bread)
    parts, squares = shares.sum(axis=0), (shares**2 / (sizes - 1)[:, None]).sum(axis=0)
    # Coefficients fitted to few blocks make them agree: the usual n/(n − p).
    effective = np.where(squares > 0, parts**2 / np.where(squares > 0, squares, 1.0), float(degrees))
    return influence.T @ influence * small_sample(degrees, len(bread)), degrees, effective


def block_scores(
    evidence: Evidence, columns: Sequence[int], coefficients: Array
) -> tuple[Array, NDArray[np.intp]]:
    """Return the scores X_bᵀ(y_b − X_b c) of every block, shape (blocks, k), and the number of blocks of each run.

    Less their mean over the run's B blocks and times √(B/(B−1)), which makes up for that mean; runs of one block, which
    has no scatter, are left out.
    """
    triangles, sizes = evidence.scattered
    part = triangles[:, :, [*columns]]
    residual = triangles[:, :, -1] - part @ coefficients
    scores = (part.transpose(0, 2, 1) @ residual[:, :, None])[:, :, 0]
    if sizes.size:
        mean = np.add.reduceat(scores, np.cumsum(sizes) - sizes) / sizes[:, None]
        scores -= np.repeat(mean, sizes, axis=0)
        scores *= np.repeat(np.sqrt(sizes / (sizes - 1)), sizes)[:, None]
    return scores, sizes


def small_sample(degrees: int, columns: int) -> float:
    """Return the factor n/(n − k) of a covariance that rests on n blocks and k fitted columns."""
    return degrees / max(degrees - columns, 1) if degrees else 1.0


def left_out_estimates(evidence: Evidence, columns: Sequence[int]) -> Array:
    """Return the coefficients of the fits to all groups but one, shape (groups, k); of no group, where there is one.

    By columns of unit norm; a fold that does not excite a column gives it no coefficient.
    """
    index = [*columns]
    triangles = [factor.triangle for factor in evidence.training.values() if index]
    found = [scaled_least_squares(each[:, index], each[:, -1], 1e-12) for each in triangles]
    return np.array(found).reshape(len(evidence.training), len(index))


def held_out_errors(evidence: Evidence, columns: Sequence[int], estimates: Array | None = None) -> Array:
    """Return the mean squared error of each run under the fit to all other groups, shape (n_runs,).

    Empty where there is one group only. ``estimates`` as :func:`left_out_estimates` gives them, if they are known.
    """
    if len(evidence.groups) < 2:
        return np.empty(0)
    index = [*columns]
    estimates = left_out_estimates(evidence, index) if estimates is None else estimates
    errors = []
    for run in evidence.runs:
        triangle = run.pooled.triangle
        residual = triangle[:, -1] - triangle[:, index] @ estimates[evidence.groups.index(run.group)]
        errors.append(float(residual @ residual) / run.pooled.rows)
    return np.array(errors)


def group_t_ratios(evidence: Evidence, columns: Sequence[int], estimates: Array | None = None) -> Array:
    """Return |coefficient| / its standard error over groups, by the jackknife, shape (k,).

    With the estimates c_g that leave one of G groups out, se² = (G−1)/G Σ (c_g − c̄)² (Efron and Stein 1981). A term
    that describes the joint has the same coefficient whichever group is held out; one that makes up for something
    else has not. Infinite with fewer than three groups, which show nothing. ``estimates`` as in
    :func:`held_out_errors`.
    """
    if len(evidence.groups) < 3:
        return np.full(len(columns), np.inf)
    estimates = left_out_estimates(evidence, columns) if estimates is None else estimates
    groups = estimates.shape[0]
    mean = estimates.mean(axis=0)
    spread = np.sqrt((groups - 1) / groups * np.sum((estimates - mean) ** 2, axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(spread > 0, np.abs(mean) / spread, np.inf)


FIELDS = ("ids", "names", "groups", "counts", "rows", "triangles")


def evidence_bytes(evidence: Evidence) -> bytes:
    """Return evidence as the bytes of an NPZ archive: of each run its pooled factor, then those of its blocks."""
    factors = [factor for run in evidence.runs for factor in (run.pooled, *run.blocks)]
    upper = np.triu_indices(len(evidence.ids) + 1)
    buffer = io.BytesIO()
    np.savez(
        buffer,
        ids=np.array(evidence.ids, dtype=str),
        names=np.array([run.name for run in evidence.runs], dtype=str),
        groups=np.array([run.group for run in evidence.runs], dtype=str),
        counts=np.array([1 + len(run.blocks) for run in evidence.runs]),
        rows=np.array([factor.rows for factor in factors]),
        triangles=np.array([factor.triangle[upper] for factor in factors]),
    )
    return buffer.getvalue()


def read_evidence(path: Path) -> Evidence:
    """Return evidence from a file that holds :func:`evidence_bytes`.

    Raises
    ------
    InputError
        For a file that holds something else.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            ids, names, groups, counts, rows, triangles = (archive[name] for name in FIELDS)
        size = ids.size + 1
        matrices = np.zeros((rows.size, size, size))
        matrices[(slice(None), *np.triu_indices(size))] = triangles
        factors = [Factor(matrix, float(count)) for matrix, count in zip(matrices, rows, strict=True)]
        ends = np.cumsum(counts)
        runs = [
            RunEvidence(str(name), str(group), factors[end - count], tuple(factors[end - count + 1 : end]))
            for name, group, count, end in zip(names, groups, counts, ends, strict=True)
        ]
    # An archive that was damaged fails in whatever way its parts do.
    except Exception as error:
        raise InputError(f"{path}: holds no factors of a campaign ({error})") from None
    return Evidence(tuple(map(str, ids)), tuple(runs))
