"""The shipped catalogues: a registry in which every member keeps the same promises."""

import copy
import pickle
import re
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint.equation import (
    Catalogue,
    Reference,
    as_catalogue,
    library_folder,
    list_catalogues,
    load_catalogue,
    parse_formula,
    term_columns,
)
from sindyjoint.errors import InputError, UnknownNameError

NAMES = (
    "damping",
    "extended",
    "friction",
    "inertia",
    "inputs",
    "loads",
    "measurement",
    "paper",
    "polynomial",
    "stiffness",
)
TERMS = {term.id: term for name in NAMES for term in load_catalogue(name) if not term.inputs}
REFERENCE = Reference(angle=8e-4, rate=0.03, moment=5.0)

# Declared by hand: what a term does when angle, rate and acceleration change sign.
EVEN = {
    "quadratic_stiffness",
    "quartic_stiffness",
    "constant_moment",
    "asymmetric_damping",
    "direction_dependent_damping",
    "rate_squared",
    "asymmetric_friction",
}
NEITHER = {"bilinear_stiffness"}


def states(n=400, seed=11):
    generator = np.random.default_rng(seed)
    theta, omega, alpha = generator.uniform(-1, 1, size=(3, n)) * [[8e-4], [0.03], [1.0]]
    theta[:3], omega[1:4] = 0.0, 0.0
    return theta, omega, alpha


def column(term, theta, omega, alpha, reference=REFERENCE):
    return term_columns([term.resolve(reference)], theta, omega, alpha, inputs={"input": 0.7})[:, 0]


def test_these_catalogues_ship():
    summaries = list_catalogues()
    assert tuple(summary.name for summary in summaries) == NAMES
    for summary in summaries:
        assert (library_folder() / f"{summary.name}.toml").is_file()
        assert len(summary.terms) == len(load_catalogue(summary.name))
        assert summary.description == load_catalogue(summary.name).description


def test_the_paper_has_its_five_terms():
    paper = load_catalogue("paper")
    assert [(term.id, term.symbol, term.formula, term.unit) for term in paper] == [
        ("linear_stiffness", "k1", "theta", "N*m/rad"),
        ("quadratic_stiffness", "k2", "theta**2", "N*m/rad^2"),
        ("cubic_stiffness", "k3", "theta**3", "N*m/rad^3"),
        ("linear_damping", "c1", "omega", "N*m*s/rad"),
        ("coulomb_friction", "M_F", "sign(omega)", "N*m"),
    ]
    inertia = load_catalogue("inertia")["inertia"]
    assert (inertia.symbol, inertia.formula, inertia.unit, inertia.unit_for("translation")) == (
        "I",
        "alpha",
        "kg*m^2",
        "kg",
    )


def test_the_polynomial_library_is_complete_to_the_third_degree():
    wanted = {parse_formula(f"theta**{i}*omega**{j}") for i in range(4) for j in range(4 - i)}
    assert {term.expression for term in load_catalogue("polynomial")} == wanted | {parse_formula("theta**5")}


def test_extended_is_a_fair_question():
    extended = load_catalogue("extended")
    assert 20 <= len(extended) <= 26
    assert set(load_catalogue("paper").ids) < set(extended.ids)
    assert "constant_moment" in extended
    assert not any(term.needs_acceleration for term in extended)
    # Not distinguishable from k1 and k3 by any test of a joint.
    assert not {"odd_quadratic_stiffness", "gravity_moment", "smoothed_friction"} & set(extended.ids)


def test_no_two_candidates_of_extended_are_nearly_the_same():
    """Over four frequencies and three amplitudes no column is a multiple of another, and none is lost in the others."""
    t = np.arange(2000) / 1000
    runs = [(amplitude, 2 * np.pi * f) for f in (3, 4, 5, 6) for amplitude in (8e-4, 5.5e-4, 3e-4)]
    theta = np.concatenate([a * np.sin(w * t + 0.1) for a, w in runs])
    omega = np.concatenate([a * w * np.cos(w * t + 0.1) for a, w in runs])
    columns = term_columns(load_catalogue("extended").resolve(Reference.of(theta, omega)), theta, omega)
    columns /= np.sqrt((columns**2).mean(axis=0))
    cosines = np.abs(columns.T @ columns) / len(columns) - np.eye(columns.shape[1])
    assert cosines.max() < 0.98
    assert np.linalg.cond(columns) < 1e3


@pytest.mark.parametrize("term_id", TERMS)
def test_every_term_is_finite_on_a_grid(term_id):
    grid = np.array([-1.0, -0.5, -1e-9, 0.0, 1e-12, 0.3, 1.0])
    theta, omega = (axis.ravel() for axis in np.meshgrid(8e-4 * grid, 0.03 * grid))
    values = column(TERMS[term_id], theta, omega, np.linspace(-1, 1, theta.size))
    assert np.all(np.isfinite(values)) and np.any(values)


@pytest.mark.parametrize("term_id", TERMS)
def test_every_term_has_the_symmetry_declared_here(term_id):
    theta, omega, alpha = states()
    term = TERMS[term_id]
    declared = "even" if term_id in EVEN else "neither" if term_id in NEITHER else "odd"
    assert term.symmetry == declared
    here, mirrored = column(term, theta, omega, alpha), column(term, -theta, -omega, -alpha)
    if declared == "neither":
        assert not np.allclose(mirrored, here) and not np.allclose(mirrored, -here)
    else:
        np.testing.assert_allclose(mirrored, here if declared == "even" else -here, rtol=1e-13, atol=0)


# sin(theta) has this value for an angle in radians only.
@pytest.mark.parametrize("term_id", [term_id for term_id in TERMS if term_id != "gravity_moment"])
def test_units_say_how_a_term_scales(term_id):
    """With units of angle and time p and q times as large, the formula falls by its unit's factor."""
    term = TERMS[term_id]
    p, q = 3.0, 0.5
    theta, omega, alpha = states()
    before = column(term, theta, omega, alpha)
    scaled = Reference(angle=REFERENCE.angle / p, rate=REFERENCE.rate / p * q, moment=REFERENCE.moment)
    after = column(term, theta / p, omega / p * q, alpha / p * q**2, scaled)
    unit = "N*m*s^2/rad" if term.unit == "kg*m^2" else term.unit
    above, _, below = unit.partition("/")

    def power(name, text):
        found = re.search(rf"(?<![a-z]){name}(?:\^(\d+))?(?![a-z])", text)
        return int(found[1] or 1) if found else 0

    rad, s = power("rad", above) - power("rad", below), power("s", above) - power("s", below)
    # formula = N*m / unit, so it holds rad^-rad s^-s.
    np.testing.assert_allclose(after, before * p**rad * q**s, rtol=1e-12, atol=0)


@pytest.mark.parametrize("term_id", TERMS)
def test_every_term_is_described(term_id):
    term = TERMS[term_id]
    assert term.name and len(term.meaning) > 20 and term.family
    assert set(term.confused_with) <= set(TERMS) - {term_id}
    assert term.latex() and term.pretty("translation")
    assert "theta" not in term.text("translation") and "omega" not in term.text("translation")
    assert parse_formula(term.text("translation"), [p.name for p in term.parameters]) == term.expression


def test_families_match_their_files():
    for name in ("stiffness", "damping", "friction", "measurement", "inertia"):
        assert {term.family for term in load_catalogue(name)} == {name}


def test_every_file_begins_with_the_same_explanation():
    heads = set()
    for summary in list_catalogues():
        text = (library_folder() / f"{summary.name}.toml").read_text(encoding="utf-8")
        assert text.startswith("# How to read and write a catalogue of candidate terms\n")
        heads.add(text.partition("\n\n")[0])
    assert len(heads) == 1
    head = heads.pop()
    for key in ("include", "id", "symbol", "formula", "unit", "name", "meaning", "family", "source"):
        assert re.search(rf"\b{key}\b", head)
    for key in ("confused_with", "parameters", "relative_to", "lower", "upper"):
        assert re.search(rf"\b{key}\b", head)


def test_permuting_the_catalogue_permutes_the_columns():
    extended = load_catalogue("extended")
    theta, omega, _ = states()
    order = np.random.default_rng(2).permutation(len(extended))
    shuffled = extended.select([extended.ids[i] for i in order])
    columns = term_columns(extended.resolve(REFERENCE), theta, omega)
    np.testing.assert_array_equal(term_columns(shuffled.resolve(REFERENCE), theta, omega), columns[:, order])


# --- the objects --------------------------------------------------------------------------------------------


def test_a_catalogue_is_a_small_collection():
    paper = load_catalogue("paper")
    assert len(paper) == 5 and [term.id for term in paper] == list(paper.ids)
    assert "k1" not in paper and "linear_stiffness" in paper
    assert paper["coulomb_friction"].symbol == "M_F"
    assert paper.select(["linear_damping", "linear_stiffness"]).ids == ("linear_damping", "linear_stiffness")
    assert paper.without(["linear_damping"]).ids == (*paper.ids[:3], "coulomb_friction")
    assert repr(paper) == "Catalogue('paper', 5 terms)"


def test_an_unknown_term_is_named_with_its_neighbour():
    paper = load_catalogue("paper")
    with pytest.raises(
        UnknownNameError, match="library 'paper' has no term 'linear_damper'; did you mean 'linear_damping'?"
    ):
        paper["linear_damper"]
    with pytest.raises(UnknownNameError, match="has no term 'zzz'; it has linear_stiffness, quadratic_"):
        paper.select(["zzz"])
    with pytest.raises(UnknownNameError, match="has no term 'zzz'"):
        paper.without(["zzz"])


def test_union_keeps_each_term_once():
    union = load_catalogue("paper").union(load_catalogue("polynomial"), load_catalogue("paper"))
    assert union.name == "paper + polynomial"
    assert len(union) == len(set(union.ids)) == 5 + 11 - 4
    assert load_catalogue("paper").union(load_catalogue("paper")) == load_catalogue("paper")


def test_union_refuses_two_meanings_of_one_id():
    paper = load_catalogue("paper")
    changed = Catalogue("mine", "x", (replace(paper["linear_damping"], meaning="something else"),))
    with pytest.raises(
        InputError, match="term 'linear_damping' of library 'mine' differs from the one already"
    ):
        paper.union(changed)


def test_symbols_are_unique_across_a_union():
    other = Catalogue("mine", "x", (replace(load_catalogue("paper")["linear_damping"], id="my_damping"),))
    with pytest.raises(InputError, match="'linear_damping' and 'my_damping' both have the symbol 'c1'"):
        load_catalogue("paper").union(other)


def test_ids_are_unique_in_a_catalogue():
    term = load_catalogue("paper")["linear_damping"]
    with pytest.raises(InputError, match=r"the id\(s\) linear_damping are used twice"):
        Catalogue("mine", "x", (term, term))


def test_as_catalogue_takes_what_a_person_would_give(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_bytes((library_folder() / "measurement.toml").read_bytes())
    assert as_catalogue("paper") is load_catalogue("paper")
    assert as_catalogue(load_catalogue("paper")) is load_catalogue("paper")
    assert as_catalogue(["paper", path]).ids == (*load_catalogue("paper").ids, "constant_moment")
    assert as_catalogue(str(path)).ids == ("constant_moment",)
    with pytest.raises(InputError, match="an empty list of libraries given"):
        as_catalogue([])


def test_an_unknown_library_is_named_with_its_neighbour():
    with pytest.raises(UnknownNameError, match="library 'polinomial' is unknown; did you mean 'polynomial'?"):
        load_catalogue("polinomial")
    with pytest.raises(
        UnknownNameError, match="library 'zzz' is unknown; expected one of damping, extended, friction"
    ):
        load_catalogue("zzz")


def test_catalogues_survive_pickling_and_copying():
    extended = load_catalogue("extended")
    for again in (pickle.loads(pickle.dumps(extended)), copy.deepcopy(extended)):
        assert again == extended and again.resolve(REFERENCE) == extended.resolve(REFERENCE)


# --- nonlinear parameters -----------------------------------------------------------------------------------


def test_inner_parameters_follow_the_data():
    stribeck = TERMS["stribeck_friction"]
    assert stribeck.resolve(REFERENCE).values == (("v_s", pytest.approx(0.003)),)
    reference = Reference.of([1.0, -2.0], [[0.5], [-4.0]], [3.0])
    assert reference == Reference(2.0, 4.0, 3.0)
    theta, omega = np.zeros(5), np.linspace(-1, 1, 5)
    wanted = np.exp(-np.abs(omega) / 0.4) * np.sign(omega)
    np.testing.assert_allclose(
        term_columns([stribeck.resolve(reference)], theta, omega)[:, 0], wanted, rtol=1e-15
    )


@pytest.mark.parametrize("reference", [None, Reference(), Reference(rate=0.0), Reference(rate=float("nan"))])
def test_a_missing_scale_is_named(reference):
    with pytest.raises(
        InputError,
        match="term 'stribeck_friction': parameter 'v_s' is 0.1 times the largest rate of the data, which is",
    ):
        load_catalogue("friction").resolve(reference)


def test_parameters_can_be_given():
    stop = TERMS["hard_stop"].with_parameters({"g": 2.0})
    np.testing.assert_array_equal(term_columns([stop], [-5.0, 1.0, 3.0], [0.0] * 3)[:, 0], [-3.0, 0.0, 1.0])
    with pytest.raises(InputError, match="term 'hard_stop': values for h given; expected g"):
        TERMS["hard_stop"].with_parameters({"h": 2.0})
    with pytest.raises(InputError, match="term 'linear_damping': values for h given; expected nothing"):
        TERMS["linear_damping"].with_parameters({"h": 2.0})


def test_free_play_is_a_dead_zone_with_its_own_stiffness():
    """k1 θ with k_d = k1 is zero inside the clearance and k1 (θ ∓ delta) outside."""
    terms = [TERMS["linear_stiffness"].resolve(), TERMS["dead_zone"].with_parameters({"delta": 0.25})]
    theta = np.array([-1.0, -0.2, 0.0, 0.1, 0.75])
    moment = term_columns(terms, theta, 0 * theta) @ [100.0, 100.0]
    np.testing.assert_allclose(moment, [-75.0, 0.0, 0.0, 0.0, 50.0], atol=1e-12)


def test_the_acceleration_is_asked_for():
    inertia = load_catalogue("inertia").resolve()
    with pytest.raises(
        InputError, match=r"term\(s\) inertia need the acceleration; give it as the third signal"
    ):
        term_columns(inertia, [1.0], [1.0])
    np.testing.assert_array_equal(term_columns(inertia, [1.0], [1.0], [7.0]), [[7.0]])


def test_a_value_that_is_not_finite_is_named(tmp_path):
    path = tmp_path / "steep.toml"
    path.write_text(
        'name = "steep"\ndescription = "x"\n[[term]]\nid = "steep"\nsymbol = "s"\nformula = "exp(theta/g)"\n'
        'unit = "N*m"\nname = "x"\nmeaning = "x"\nfamily = "x"\n'
        'parameters = [{ name = "g", unit = "rad", value = 1e-6 }]\n'
    )
    with pytest.raises(
        InputError, match=r"'steep' \(exp\(theta/g\)\) has no finite value at sample 1 \(theta 0.5"
    ):
        term_columns(load_catalogue(path).resolve(), [0.0, 0.5], [0.0, 0.0])
