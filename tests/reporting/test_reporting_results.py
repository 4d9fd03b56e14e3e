"""Pages, figures and saved data of verifications, diagnoses and comparisons."""

import json
import types
from dataclasses import replace

import numpy as np
import pytest
from handmade import HOSTILE, ORIGIN, model, page_html
from handmade_results import comparison, diagnosis, structure, verification
from test_reporting_figures import laid_out
from test_reporting_page import read

from sindyjoint.documents import changed_files
from sindyjoint.errors import InputError, OutputError
from sindyjoint.inputs import Source
from sindyjoint.judgement.comparison import Comparison
from sindyjoint.record import Campaign, Run
from sindyjoint.reporting import (
    KEPT_SAMPLES,
    PAGE,
    draw,
    draw_all,
    drawable,
    figure_bytes,
    kinds_of,
    load_results,
    place_of,
    provenance,
    saved_text,
    thinned,
    view_of,
    write_results,
)
from tests.doors.asked import ask
from tests.seeds import slow

HOSTILES = {
    "verification": lambda: verification(HOSTILE, (HOSTILE, "two"), subject=HOSTILE),
    "diagnosis": lambda: diagnosis(HOSTILE),
    "comparison": lambda: comparison(HOSTILE, HOSTILE),
}
MADE = {
    "verification": verification,
    "failed": lambda: verification(failed=True),
    "diagnosis": diagnosis,
    "nothing missing": lambda: diagnosis(verdict="nothing_missing"),
    "comparison": comparison,
    "structure": structure,
}


# Each with names that are long, and what has no such case.
WIDE = ["structure", *(f"hostile {case}" for case in HOSTILES)]


@pytest.mark.parametrize(
    ("case", "width"),
    [(case, 3.5) for case in (*MADE, *WIDE[1:])]
    + [(case, 7.0) for case in WIDE]
    + slow(*((case, 7.0) for case in MADE if case not in WIDE)),
)
def test_nothing_is_cut_off_and_panels_do_not_overlap(case, width, pictures):
    result = {**MADE, **{f"hostile {name}": make for name, make in HOSTILES.items()}}[case]()
    for kind in drawable(result):
        laid_out(draw(kind, result, width), f"{case} {kind} {width}")


def campaign():
    return Campaign(
        joint=types.SimpleNamespace(name="bench joint"),
        runs=(Run("a", np.zeros(40), np.arange(40.0), 100.0, source=Source("a.csv", "ab" * 32)),),
    )


def written(result, folder):
    if isinstance(result, Comparison):
        result = replace(result, discovery=types.SimpleNamespace(campaign=campaign(), model=model()))
    return write_results(result, folder, "sindyjoint made by hand", 3)


@pytest.mark.parametrize("case", MADE)
def test_figures_are_drawn_again_from_what_was_written(case, tmp_path, pictures):
    result = MADE[case]()
    folder = written(result, tmp_path / "out")
    again = load_results(folder)
    assert type(again) is type(result) and drawable(again) == drawable(result)
    for kind in drawable(again):
        assert figure_bytes(draw(kind, again), "svg").startswith(b"<?xml")
    assert saved_text(again) == (folder / "figures" / "data.json").read_text(encoding="utf-8")
    html = (folder / "report.html").read_text(encoding="utf-8")
    text = read(html).lines
    assert "bench joint" in text and "Random seed" in text and "3" in text
    ids = [attributes["id"] for _, attributes in read(html).tags if "id" in attributes]
    assert len(ids) == len(set(ids))


def page_of(case):
    return None if case == "comparison" else page_html(made := HOSTILES[case](), ORIGIN, draw_all(made))


@pytest.mark.parametrize("case", HOSTILES)
def test_what_people_wrote_is_text(case, tmp_path):
    html = page_of(case) or (written(HOSTILES[case](), tmp_path / "out") / "report.html").read_text(
        encoding="utf-8"
    )
    reader = read(html)
    tags = {tag for tag, _ in reader.tags}
    assert not tags & {"img", "link", "iframe", "object"}
    assert not any(name.startswith("on") for _, attributes in reader.tags for name in attributes)
    assert [a.get("type") for t, a in reader.tags if t == "script"] in ([None], ["application/json", None])
    assert any(" ".join(HOSTILE.split()) in line for line in reader.lines)


def test_the_verdicts_in_plain_words():
    passed, failed = (
        read(page_html(made, ORIGIN, draw_all(made))).lines
        for made in (verification(), verification(failed=True))
    )
    assert "passed The model gives the virtual test's response." in passed
    assert "failed The model misses the response." in failed
    assert "pulse at tip: the angle passed the softening limit at 0.2 s." in failed
    lines = read(page_html(diagnosis(), ORIGIN, draw_all(diagnosis()))).lines
    assert any(line.startswith("ambiguous Something is missing") for line in lines)
    # Once: a number that stands in two places is read twice.
    assert sum("2.16 % → 1.04 %" in line for line in lines) == 1
    assert "Hidden in this virtual test was: Jenkins element." in lines
    nothing = read(page_html(made := diagnosis(verdict="nothing_missing"), ORIGIN, draw_all(made))).lines
    assert "nothing missing Nothing is missing that these runs show." in nothing


def test_saved_responses_are_thinned_to_what_a_picture_shows():
    result = verification()
    long = verification()
    run = long.runs[0]
    for name in ("time", "measured", "simulated"):
        object.__setattr__(run, name, np.resize(getattr(run, name), 40_000))
    assert thinned(long).runs[0].time.size <= KEPT_SAMPLES < 40_000
    assert thinned(result).runs[0].time.size == result.runs[0].time.size


def test_provenance_hashes_what_was_read(tmp_path):
    (tmp_path / "campaign.toml").write_text('[[run]]\nfile = "r.csv"\n[[run]]\nfile = "gone.csv"\n')
    (tmp_path / "r.csv").write_bytes(b"abc")
    found = provenance(files=[tmp_path, tmp_path / "gone"]).inputs
    # SHA-256 of "abc": FIPS 180-2, appendix B.1.
    assert found[1] == ("r", "r.csv", "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad")
    assert [name for _, name, _ in found] == ["campaign.toml", "r.csv"]
    assert (
        provenance(campaign(), 7, ["sindyjoint", "discover", "a b"]).command_line
        == "sindyjoint discover 'a b'"
    )


def test_an_unknown_kind_of_saved_result_is_refused(tmp_path):
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "data.json").write_text(json.dumps({"kind": "Poem"}))
    with pytest.raises(
        InputError, match="data.json': not a saved result: 'kind' is 'Poem'; expected one of ReportData, Ver"
    ):
        load_results(tmp_path)


def test_every_kind_has_a_caption():
    for make in MADE.values():
        for name, kind in kinds_of(make()).items():
            assert kind.name == name and kind.caption.endswith(".")


def test_a_sliding_joint_is_reported_in_forces():
    turned, compared = verification(), replace(comparison(), motion="translation")
    joint = replace(turned.model.joint, motion="translation", inertia=None)
    slid = replace(turned, model=replace(turned.model, joint=joint), moment_nrmse=0.02)
    for result in (slid, compared):
        words = " ".join(str(table.columns + table.rows) for table in view_of(result).tables(result)).lower()
        assert "force" in words and "moment" not in words
    assert "Force error" in read(page_html(slid, ORIGIN, draw_all(slid))).lines


def test_a_structure_saved_by_an_earlier_version_is_still_one(tmp_path):
    written(structure(), tmp_path)
    saved = tmp_path / "figures" / "data.json"
    (tmp_path / "SHA256SUMS").unlink()  # earlier versions wrote none
    old = json.loads(saved.read_text())
    assert old["kind"] == "Diagnosis" and old.pop("source") == "structure"
    saved.write_text(json.dumps({**old, "kind": "StructureDiagnosis"}))
    again = load_results(tmp_path)
    assert again.source == "structure" and again.level_unit == "m"
    assert set(drawable(again)) == set(drawable(structure()))
    # Marked as a diagnosis of an earlier version, it would be that of a campaign.
    saved.write_text(json.dumps(old))
    assert load_results(tmp_path).source == "campaign"


def test_results_of_several_kinds_in_one_folder(tmp_path):
    folder = tmp_path / "r"
    found, missing = verification(), diagnosis()
    assert found.report(folder) == folder and missing.report(folder) == folder / "diagnosis"
    before = (folder / "diagnosis" / "diagnosis.json").read_bytes()
    (folder / "notes.md").write_text("mine")
    assert verification(name="another").report(folder) == folder
    assert load_results(folder).model.joint.name == "another"
    assert (folder / "diagnosis" / "diagnosis.json").read_bytes() == before
    for place, link in ((folder, "diagnosis/report.html"), (folder / "diagnosis", "../report.html")):
        assert changed_files(place) == [] and f'Also here: <a href="{link}">' in (place / PAGE).read_text(
            "utf-8"
        )
    # A result that leaves more figures out than the last one leaves none of its behind.
    assert (folder / "figures" / "energy.svg").is_file()
    verification(failed=True).report(folder)
    assert not (folder / "figures" / "energy.svg").exists() and (folder / "notes.md").is_file()
    listed = ask("plot", str(folder)).stdout
    assert "verification/response " in listed and "diagnosis/budget " in listed
    for kind in ("rivals", "diagnosis/gap"):
        drawn = ask("plot", str(folder), kind, "-o", str(tmp_path / "a.svg"))
        assert drawn.status == 0, drawn.stderr
    wrong = ask("plot", str(folder), "batch/joints").stderr
    assert "holds no results of a 'batch'; expected one of: verification, diagnosis" in wrong
    with pytest.raises(OutputError, match="choose another folder for a batch"):
        place_of("batch", folder)
    (folder / PAGE).write_text("mine")
    with pytest.raises(OutputError, match="report.html': it was not written by this command"):
        verification().report(folder)
    verification().report(folder, force=True)
    assert changed_files(folder) == []
