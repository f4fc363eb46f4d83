use super::*;

fn base(expression: &str) -> BaseUnit {
    Unit::parse(expression).unwrap().base.unwrap()
}

fn exponents(expression: &str) -> [i32; 8] {
    base(expression).exponents()
}

#[test]
fn exponents_are_in_the_order_of_their_names() {
    for (position, name) in BaseUnit::EXPONENTS.into_iter().enumerate() {
        let mut expected = [0; 8];
        expected[position] = 1;
        assert_eq!(exponents(name), expected, "{name}");
    }
    let BaseUnit { kg, m, s, a, k, mol, cd, rad, .. } =
        BaseUnit::from_exponents([1, 2, 3, 4, 5, 6, 7, 8], 1.0, 0.0);
    assert_eq!([kg, m, s, a, k, mol, cd, rad], [1, 2, 3, 4, 5, 6, 7, 8]);
}

#[test]
fn values_convert_between_units_of_one_quantity_only() {
    for (from, to, value, expected) in [
        ("degC", "K", 20.0, 293.15),
        ("K", "degC", 293.15, 20.0),
        ("km/h", "m/s", 36.0, 10.0),
        ("rad", "deg", 0.5, 90.0 / std::f64::consts::PI),
        ("N.m", "J", 3.0, 3.0),
    ] {
        let (factor, offset) = base(from).conversion(&base(to)).unwrap();
        let actual = factor * value + offset;
        assert!((actual - expected).abs() <= 1e-12 * expected, "{from} to {to}: {actual}");
    }
    for (from, to) in [("N", "kg"), ("rad", "1"), ("K", "mol")] {
        assert_eq!(base(from).conversion(&base(to)), None, "{from} to {to}");
    }
}

/// The literals are the exact conversions.
#[test]
fn conversions_by_short_decimals_are_exact() {
    for (from, to, expected) in [
        ("m/s", "km/h", (3.6, 0.0)),
        ("km/h", "m/s", (5.0 / 18.0, 0.0)),
        ("m/min", "km/h", (0.06, 0.0)),
        ("nm", "um", (0.001, 0.0)),
        ("ft", "in", (12.0, 0.0)),
        ("K", "degC", (1.0, -273.15)),
        ("K", "degF", (1.8, -459.67)),
        ("degC", "degF", (1.8, 32.0)),
    ] {
        let (factor, offset) = base(from).conversion(&base(to)).unwrap();
        let actual = (factor.to_bits(), offset.to_bits());
        assert_eq!(
            actual,
            (f64::to_bits(expected.0), f64::to_bits(expected.1)),
            "{from} to {to}: {factor} {offset}"
        );
    }
}

#[test]
fn all_ways_to_write_a_product_mean_the_same() {
    for expression in ["kg.m2/s2", "kg*m^2/s^2", "kg m2/s2", "kg . m^2 . s-2", "N.m", "kg.m.m/s/s"]
    {
        assert_eq!(exponents(expression), [1, 2, -2, 0, 0, 0, 0, 0], "{expression}");
        assert!((base(expression).factor - 1.0).abs() < f64::EPSILON, "{expression}");
    }
    assert_eq!(exponents("1/s"), [0, 0, -1, 0, 0, 0, 0, 0]);
    assert_eq!(exponents("J/(kg.K)"), [0, 2, -2, 0, -1, 0, 0, 0]);
    assert_eq!(exponents("N.m/rad"), [1, 2, -2, 0, 0, 0, 0, -1]);
    assert_eq!(exponents("m^-12"), [0, -12, 0, 0, 0, 0, 0, 0]);
    for expression in ["", " ", "1", "1/1", "m/m"] {
        assert_eq!(base(expression), BaseUnit::default(), "{expression:?}");
    }
}

#[test]
fn derived_units_satisfy_the_laws_that_define_them() {
    for (left, right) in [
        ("N", "kg.m/s2"),
        ("Pa", "N/m2"),
        ("J", "N.m"),
        ("W", "J/s"),
        ("C", "A.s"),
        ("V", "W/A"),
        ("F", "C/V"),
        ("Ohm", "V/A"),
        ("S", "A/V"),
        ("Wb", "V.s"),
        ("T", "Wb/m2"),
        ("H", "Wb/A"),
        ("Hz", "rev/s"),
        ("rpm", "rev/min"),
        ("l", "dm3"),
        ("t", "Mg"),
        ("bar", "kN/dm2"),
    ] {
        let (left_base, right_base) = (base(left), base(right));
        assert_eq!(exponents(left), exponents(right), "{left} = {right}");
        let (left_factor, right_factor) = (left_base.factor, right_base.factor);
        assert!(
            (left_factor - right_factor).abs() <= 4e-16 * left_factor,
            "{left} = {right}: {left_factor} {right_factor}"
        );
    }
}

/// Values from the table of section 2.2.2 of the standard and from `scipy.constants`.
#[test]
fn conversions_have_the_published_factors() {
    for (expression, factor) in [
        ("bar", 1.0e5),
        ("deg", 0.017_453_292_519_943_295),
        ("rpm", 0.104_719_755_119_659_77),
        ("Hz", std::f64::consts::TAU),
        ("%/m", 0.01),
        ("ppm", 1.0e-6),
        ("km", 1000.0),
        ("km/h", 0.277_777_777_777_777_8),
        ("min", 60.0),
        ("d", 86400.0),
        ("atm", 101_325.0),
        ("in", 0.0254),
        ("ft", 0.3048),
        ("l", 0.001),
        ("g", 0.001),
        ("ug", 1e-9),
        ("mm3", 1e-9),
        ("kN", 1e3),
        ("kW", 1e3),
        ("us", 1e-6),
        ("ms", 1e-3),
        ("kW.h", 3.6e6),
        ("g/cm3", 1000.0),
    ] {
        let actual = base(expression).factor;
        assert!((actual - factor).abs() <= 3e-16 * factor, "{expression}: {actual} {factor}");
    }
}

#[test]
fn temperatures_have_an_offset_and_cannot_be_combined() {
    let celsius = base("degC");
    assert_eq!((celsius.k, celsius.factor, celsius.offset), (1, 1.0, 273.15));
    let fahrenheit = base("degF");
    assert!((fahrenheit.factor - 0.555_555_555_555_555_6).abs() < 1e-16);
    assert!((fahrenheit.offset - 255.372_222_222_222_2).abs() < 1e-13);
    let error = Unit::parse("W/degC").unwrap_err();
    assert!(matches!(error, UnitError::Offset { column: 3, .. }), "{error}");
}

#[test]
fn angles_are_displayed_in_degrees() {
    for (expression, display) in [("rad", "deg"), ("rad/s", "deg/s"), ("rad.s-1", "deg/s")] {
        let unit = Unit::parse(expression).unwrap();
        assert_eq!(unit.display_units.len(), 1);
        assert_eq!(unit.display_units[0].name, display);
        let half_turn = unit.display_units[0].factor * std::f64::consts::PI;
        assert!((half_turn - 180.0).abs() < 1e-13);
    }
    for expression in ["m", "deg", "mrad", "rad2", "Hz"] {
        assert_eq!(Unit::parse(expression).unwrap().display_units, []);
    }
}

#[test]
fn the_name_is_kept_as_written() {
    for expression in ["kg.m2/s", "kg*m^2 / s", "", "1"] {
        assert_eq!(Unit::parse(expression).unwrap().name, expression);
    }
}

#[test]
fn a_complete_unit_name_has_priority_over_prefix_and_unit() {
    assert_eq!(exponents("min"), [0, 0, 1, 0, 0, 0, 0, 0]);
    assert_eq!(exponents("cd"), [0, 0, 0, 0, 0, 0, 1, 0]);
    assert_eq!(exponents("mol"), [0, 0, 0, 0, 0, 1, 0, 0]);
    assert_eq!(exponents("Pa"), [1, -1, -2, 0, 0, 0, 0, 0]);
    assert_eq!(exponents("mmol"), [0, 0, 0, 0, 0, 1, 0, 0]);
}

#[test]
fn an_unknown_unit_is_refused_with_its_position() {
    for (expression, column) in
        [("kg.furlong", 4), ("kmin", 1), ("kkg", 1), ("m/Q", 3), ("\u{b5}m.x", 1)]
    {
        let error = Unit::parse(expression).unwrap_err();
        assert!(
            matches!(error, UnitError::UnknownName { column: actual, .. } if actual == column),
            "{error}"
        );
    }
    for (expression, column) in [
        ("kg..m", 4),
        ("m/", 3),
        ("/s", 1),
        ("m^", 3),
        ("m^x", 3),
        ("m123", 2),
        ("m-", 3),
        ("J/kg.K", 5),
        ("J/(kg.K", 8),
        ("J/()", 4),
        ("(m)", 1),
        ("m2s", 3),
        ("10", 2),
        ("m 2", 3),
        ("m^1.5", 5),
    ] {
        let error = Unit::parse(expression).unwrap_err();
        assert!(
            matches!(error, UnitError::Syntax { column: actual, .. } if actual == column),
            "{expression}: {error}"
        );
    }
    assert!(matches!(Unit::parse("Tm99"), Err(UnitError::Magnitude { .. })));
}
