"""Units: exact factors, refusals that name field and wish, and no spelling that hangs or escapes."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sindyjoint.errors import UnitError
from sindyjoint.files import conversion, parse_quantity

# Factors by definition: BIPM SI brochure for the degree and minute; NIST SP 811 (2008) B.8 for the inch
# (0.0254 m exactly), the pound-force (4.4482216152605 N exactly) and the kip (1000 lbf).
FACTORS = [
    ("N*m", "N*m", 1.0),
    ("N·m", "N*m", 1.0),
    ("Nm", "N*m", 1.0),
    ("kNm", "N*m", 1000.0),
    ("Nmm", "N*m", 1e-3),
    ("lbf*inch", "N*m", 4.4482216152605 * 0.0254),
    *[(unit, "N*m", 4.4482216152605 * 0.0254) for unit in ("lbf-in", "in-lb", "lbin", "lb*in")],
    ("ozf-in", "N*m", 4.4482216152605 / 16 * 0.0254),
    ("N-m", "N*m", 1.0),
    ("kip", "N", 4448.2216152605),
    ("inch", "m", 0.0254),
    ("mil", "m", 2.54e-5),
    ("rad", "rad", 1.0),
    ("mrad", "rad", 1e-3),
    ("µrad", "rad", 1e-6),
    ("urad", "rad", 1e-6),
    ("deg", "rad", math.pi / 180),
    ("°", "rad", math.pi / 180),
    ("Grad", "rad", math.pi / 180),
    ("arcmin", "rad", math.pi / 10800),
    ("mm/m", "rad", 1e-3),
    ("um/m", "m/m", 1e-6),
    ("µε", "m/m", 1e-6),
    ("rpm", "rad/s", 2 * math.pi / 60),
    ("kg*m^2", "kg*m**2", 1.0),
    ("g*mm**2", "kg*m**2", 1e-9),
    ("ms", "s", 1e-3),
    ("kHz", "Hz", 1000.0),
    ("1/s", "Hz", 1.0),
]


@pytest.mark.parametrize(("unit", "wanted", "factor"), FACTORS)
def test_factor_to_si(unit, wanted, factor):
    assert conversion(unit, wanted, "x") == pytest.approx(factor, rel=1e-14)


def test_si_units_change_no_bit():
    for unit in ("N*m", "N", "rad", "m", "s", "Hz", "kg", "rad/s", "m/s"):
        assert conversion(unit, unit, "x") == 1.0


def test_gain_carries_its_own_unit():
    assert conversion("V", "N", "x", gain="35.15065 N/V") == pytest.approx(35.15065)
    assert conversion("mV", "rad", "x", gain="2 deg/V") == pytest.approx(2e-3 * math.pi / 180)


@pytest.mark.parametrize(
    ("unit", "wanted", "message"),
    [
        ("mm", "N*m", r"f: unit 'mm' is not a moment; expected a moment, such as 'N\*m'"),
        ("N*m/rad", "N*m", r"f: unit 'N\*m/rad' is not a moment"),
        ("N", "N*m", "is not a moment"),
        ("N*m", "N", "is not a force; expected a force, such as 'N' or 'kip'"),
        ("m", "rad", "is not an angle; expected an angle, such as 'rad', 'mrad' or 'deg'"),
        ("rad", "m", "is not a length"),
        ("rad", "m/m", "is not a strain"),
        ("Hz", "rad/s", "is not an angular rate"),
        ("furlongs_per", "m", "f: unit 'furlongs_per' is unknown; write it as"),
        ("", "m", "unit '' is unknown"),
        ("2 m", "m", "unit '2 m' is unknown"),
        ("__import__('os')", "m", "is unknown"),
        ("10**10**10**10", "m", "is unknown"),
        ("m**9**9**9**9", "m", "is unknown"),
        ("m**1000000000", "m", "is unknown"),
        ("m" * 1000, "m", "is unknown"),
    ],
)
def test_wrong_unit_is_refused(unit, wanted, message):
    with pytest.raises(UnitError, match=message):
        conversion(unit, wanted, "f")


def test_gain_of_the_wrong_unit_names_both():
    with pytest.raises(UnitError, match="unit 'V' times gain '3 N/A' is not a force"):
        conversion("V", "N", "f", gain="3 N/A")
    with pytest.raises(UnitError, match="f gain: '3' has no unit"):
        conversion("V", "N", "f", gain="3")


@pytest.mark.parametrize(
    ("text", "wanted", "value"),
    [
        ("0.02 kg*m^2", "kg*m**2", 0.02),
        ("1kHz", "Hz", 1000.0),
        ("-3.5e-1 deg", "rad", -0.35 * math.pi / 180),
        ("23 degC", "K", 296.15),
        ("296 K", "K", 296.0),
        ("+.5 ms", "s", 5e-4),
    ],
)
def test_quantity(text, wanted, value):
    assert parse_quantity(text, wanted, "x") == pytest.approx(value, rel=1e-13)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0.02", "f: '0.02' has no unit; expected a moment of inertia, such as '0.02 kg"),
        ("kg*m^2", "f: 'kg\\*m\\^2' is not a number with a unit"),
        ("nan kg", "is not a number with a unit"),
        ("1e999 kg", "is not a number with a unit"),
        ("1 kg", "unit 'kg' is not a moment of inertia"),
        ("", "'' is not a number with a unit"),
    ],
)
def test_bad_quantity_is_refused(text, message):
    with pytest.raises(UnitError, match=message):
        parse_quantity(text, "kg*m**2", "f")


@settings(deadline=None)  # the first example imports pint
@given(st.text(max_size=40) | st.from_regex(r"[a-zA-Z0-9*^/() .+-]{0,40}", fullmatch=True))
def test_any_text_is_a_unit_or_a_unit_error(text):
    try:
        factor = conversion(text, "N*m", "f")
    except UnitError as error:
        assert str(error).startswith("f: unit ")
    else:
        assert math.isfinite(factor)


@settings(deadline=None)
@given(st.floats(allow_nan=False, allow_infinity=False))
def test_printed_quantity_reads_back_to_the_bit(value):
    assert parse_quantity(f"{value!r} N*m", "N*m", "x") == value


def test_an_unknown_unit_of_an_input_is_told_with_its_place_once():
    from sindyjoint import Campaign

    motion = [math.sin(i / 10) for i in range(200)]
    with pytest.raises(UnitError) as caught:
        Campaign.from_arrays(
            angle=[motion], moment=[motion], rate=100.0, inputs={"load": ["3 Nn"]}, name="gear"
        )
    assert str(caught.value).count("load") == 1
