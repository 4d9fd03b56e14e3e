"""The fidelity table: closed forms of what tables and sliders do, and nothing dropped without a word."""

import numpy as np
import pytest

from sindyjoint.equation import list_catalogues, load_catalogue
from sindyjoint.errors import InputError, UnknownNameError
from sindyjoint.export import (
    ALL_TERMS,
    TARGETS,
    Cycles,
    Parts,
    Represented,
    export_model,
    fidelity_table,
    softening_limits,
)
from sindyjoint.mechanics import INTER_PANEL

ANGLE, RATE, RMS = 7.7e-4, 4.4e-2, 3.55
TERMS = sorted({t.id for found in list_catalogues() for t in load_catalogue(found.name) if not t.inputs})
DECKS = ("ansys", "abaqus", "nastran", "simscape", "opensees", "mujoco")
CODE = ("python", "c", "latex", "json")


def row(export, term):
    (found,) = (r for r in export.fidelity if r.term == term)
    return found


@pytest.mark.parametrize(
    ("target", "intervals"),
    [("ansys", 18), ("abaqus", 40), ("nastran", 40), ("simscape", 40), ("opensees", 200)],
)
def test_a_table_of_a_cubic_errs_by_the_interpolation_formula(paper_model, target, intervals):
    # Straight lines between nodes h apart err by h² |f''| / 8 at most, f'' = 6 k3 θ (any textbook of interpolation).
    # In the last piece |θ| is within h of the largest; the cycles pass the worst point within a step of phase.
    h = 2 * ANGLE / intervals
    largest = h**2 / 8 * 6 * 2.684e9 * (ANGLE - h / 2) / RMS
    assert row(export_model(paper_model, target), "cubic_stiffness").largest_error == pytest.approx(
        largest, rel=0.02
    )


def test_a_slider_dissipates_the_jenkins_loop(paper_model):
    # 4·F·(A − F/k) per cycle for a Jenkins element of limit F and stiffness k; trapezoid over 720 phases: 1e-3.
    cycles = Cycles.of(paper_model)
    limit, stiffness = 1.867, 1.867 / (0.02 * ANGLE)
    moment = cycles.slider(np.full(cycles.angle.shape, limit), stiffness)
    step = (np.roll(cycles.angle, -1, axis=1) - np.roll(cycles.angle, 1, axis=1)) / 2
    area = np.sum(moment * step, axis=1)
    amplitude = np.abs(cycles.angle).max(axis=1)
    expected = 4 * limit * (amplitude - limit / stiffness)
    np.testing.assert_allclose(area[1:], expected[1:], rtol=2e-3)


def test_a_wrong_representation_shows(paper_model):
    # Negative control: a table that says 90 % of k1 is k1 has an error of 10 % of that term's RMS over moving states.
    cycles = Cycles.of(paper_model)
    represented = {t.id: Represented("as it is", cycles.term(t)) for t in paper_model.terms}
    exact = cycles.term(paper_model["linear_stiffness"])
    represented["linear_stiffness"] = Represented("ten per cent short", 0.9 * exact)
    rows = {r.term: r for r in fidelity_table(paper_model, cycles, represented)}
    expected = 0.1 * np.sqrt(np.mean(exact[cycles.moving] ** 2)) / RMS
    assert rows["linear_stiffness"].error == pytest.approx(expected, rel=1e-12)
    assert rows[ALL_TERMS].error == pytest.approx(expected, rel=1e-12)
    assert rows["cubic_stiffness"].error == 0


@pytest.mark.parametrize("target", [*DECKS, *CODE])
@pytest.mark.parametrize("motion", ["rotation", "translation"])
def test_every_term_is_carried_well_or_named_as_left_out(make_model, target, motion):
    # Each shipped term with spring and friction of the paper, of such a size that it carries a tenth of the moment.
    for term_id in TERMS:
        base = {"linear_stiffness": 6066.0, "coulomb_friction": 1.867}
        if term_id in base:
            continue
        unit = make_model({**base, term_id: 1.0}, motion=motion)
        size = np.sqrt(np.mean(Cycles.of(unit).term(unit[term_id]) ** 2))
        inertial = term_id == "inertia"
        coefficient = 0.02 if inertial else 0.1 * RMS / size
        model = make_model({**base, term_id: coefficient}, motion=motion, inertia=None if inertial else 0.02)
        export = export_model(model, target)
        found = row(export, term_id)
        assert [r.term for r in export.fidelity] == [*model.ids, ALL_TERMS]
        if found.carried:
            # A polynomial fitted by MuJoCo's joint may miss half of the term, which is a tenth of the moment.
            allowed = 0.05 if "polynomial fitted" in found.representation else 0.01
            assert found.error < allowed, (term_id, found)
        else:
            assert target in DECKS
            assert any(text.startswith(f"{term_id} (") for text in export.not_carried)
            # Left out, it costs what it carries: a tenth, up to the difference between moving and all states.
            assert inertial or found.error == pytest.approx(0.1, rel=0.2)
            assert "not carried" in found.representation
        text = next(c for c in export.files.values() if isinstance(c, str))
        assert term_id in text
        assert row(export, ALL_TERMS).error < 0.06 or not found.carried


def test_code_and_latex_carry_everything_exactly(make_model):
    every = {term_id: 1.0 for term_id in TERMS if term_id != "inertia"}
    for target in CODE:
        export = export_model(make_model(every), target)
        assert export.not_carried == ()
        assert max(r.largest_error for r in export.fidelity) == 0


def test_softening_limit_of_the_paper_joint(paper_model):
    # Closed form: the roots of k1 + 2 k2 θ + 3 k3 θ², which PaperLaw has.
    np.testing.assert_allclose(softening_limits(paper_model), INTER_PANEL.softening_limit, rtol=1e-5)


def test_parts_sort_by_what_a_term_depends_on(make_model):
    parts = Parts.of(
        make_model(
            {
                "constant_moment": 0.1,
                "quadratic_damping": 1.0,
                "position_dependent_damping": 1.0,
                "inertia": 0.02,
            }
        )
    )
    groups = (parts.elastic, parts.rate, parts.coupled, parts.inertial)
    assert [[t.id for t in group] for group in groups] == [
        ["constant_moment"], ["quadratic_damping"], ["position_dependent_damping"], ["inertia"],
    ]  # fmt: skip


def test_unknown_target_names_the_nearest(paper_model):
    with pytest.raises(
        UnknownNameError, match=r"target 'abacus' is not known; did you mean 'abaqus'\? Known are ansys"
    ):
        export_model(paper_model, "abacus")


def test_a_model_without_terms_is_refused(make_model):
    with pytest.raises(InputError, match="the model has no terms: nothing was found"):
        export_model(make_model({}), "c")


def test_a_number_that_is_not_finite_is_refused(make_model):
    with pytest.raises(InputError, match="coefficient of term 'linear_stiffness' of the model is nan"):
        export_model(make_model({"linear_stiffness": float("nan")}), "python")


def test_a_model_without_a_tested_range_is_refused(make_model):
    with pytest.raises(InputError, match="moment_rms = 0.0; expected a positive number"):
        export_model(make_model(moment_rms=0.0), "json")


def test_every_target_of_the_list_has_a_module():
    from importlib.util import find_spec

    from sindyjoint.export import HOMES

    assert all(find_spec(f"sindyjoint.export.{HOMES.get(target, (target,))[0]}") for target in TARGETS)


@pytest.mark.parametrize(
    "value", [0.0, -2.684e9, 6066.0, 1 / 3, -1 / 3e5, 1.2345678901234567e-100, -9.99999999999999e15]
)
def test_nastran_numbers_keep_nine_digits_in_sixteen_characters(value):
    from sindyjoint.export import field, read_field

    text = field(value)
    assert len(text) <= 16 and "." in text
    assert read_field(text) == pytest.approx(value, rel=1e-8)
