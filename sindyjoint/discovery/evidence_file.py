"""The factors of a campaign as bytes: what later analyses need of its samples, a few hundred kilobytes, no pickle."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from sindyjoint.discovery.evidence import Evidence, RunEvidence
from sindyjoint.discovery.factors import Factor
from sindyjoint.errors import InputError

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
