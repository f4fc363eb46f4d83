//! The table of known units and prefixes.

use std::f64::consts::PI;

/// A unit without offset, with its conversion `base = factor * 10^ten * unit`.
#[derive(Clone, Copy)]
pub(super) struct Named {
    name: &'static str,
    /// Exponents of kg, m, s, A, K, mol, cd, rad.
    pub(super) exponents: [i32; 8],
    pub(super) factor: f64,
    pub(super) ten: i32,
    /// Whether SI prefixes are allowed.
    prefixes: bool,
}

/// A unit with an offset, `base = factor * unit + offset`.
pub(super) struct Scale {
    name: &'static str,
    pub(super) exponents: [i32; 8],
    pub(super) factor: f64,
    pub(super) offset: f64,
}

/// A unit that allows SI prefixes, `10^ten` SI base units.
const fn metric(name: &'static str, exponents: [i32; 8], ten: i32) -> Named {
    Named { name, exponents, factor: 1.0, ten, prefixes: true }
}

/// A unit without SI prefixes.
const fn plain(name: &'static str, exponents: [i32; 8], factor: f64, ten: i32) -> Named {
    Named { name, exponents, factor, ten, prefixes: false }
}

/// SI units (SI brochure, 9th edition, tables 2, 4, 8) and some others in common use.
const UNITS: [Named; 37] = [
    plain("kg", [1, 0, 0, 0, 0, 0, 0, 0], 1.0, 0),
    metric("g", [1, 0, 0, 0, 0, 0, 0, 0], -3),
    metric("m", [0, 1, 0, 0, 0, 0, 0, 0], 0),
    metric("s", [0, 0, 1, 0, 0, 0, 0, 0], 0),
    metric("A", [0, 0, 0, 1, 0, 0, 0, 0], 0),
    metric("K", [0, 0, 0, 0, 1, 0, 0, 0], 0),
    metric("mol", [0, 0, 0, 0, 0, 1, 0, 0], 0),
    metric("cd", [0, 0, 0, 0, 0, 0, 1, 0], 0),
    metric("rad", [0, 0, 0, 0, 0, 0, 0, 1], 0),
    metric("N", [1, 1, -2, 0, 0, 0, 0, 0], 0),
    metric("Pa", [1, -1, -2, 0, 0, 0, 0, 0], 0),
    metric("J", [1, 2, -2, 0, 0, 0, 0, 0], 0),
    metric("W", [1, 2, -3, 0, 0, 0, 0, 0], 0),
    metric("C", [0, 0, 1, 1, 0, 0, 0, 0], 0),
    metric("V", [1, 2, -3, -1, 0, 0, 0, 0], 0),
    metric("F", [-1, -2, 4, 2, 0, 0, 0, 0], 0),
    metric("Ohm", [1, 2, -3, -2, 0, 0, 0, 0], 0),
    metric("S", [-1, -2, 3, 2, 0, 0, 0, 0], 0),
    metric("Wb", [1, 2, -2, -1, 0, 0, 0, 0], 0),
    metric("T", [1, 0, -2, -1, 0, 0, 0, 0], 0),
    metric("H", [1, 2, -2, -2, 0, 0, 0, 0], 0),
    metric("bar", [1, -1, -2, 0, 0, 0, 0, 0], 5),
    metric("l", [0, 3, 0, 0, 0, 0, 0, 0], -3),
    metric("L", [0, 3, 0, 0, 0, 0, 0, 0], -3),
    Named { prefixes: true, ..plain("Hz", [0, 0, -1, 0, 0, 0, 0, 1], 2.0 * PI, 0) },
    plain("t", [1, 0, 0, 0, 0, 0, 0, 0], 1.0, 3),
    plain("min", [0, 0, 1, 0, 0, 0, 0, 0], 60.0, 0),
    plain("h", [0, 0, 1, 0, 0, 0, 0, 0], 3600.0, 0),
    plain("d", [0, 0, 1, 0, 0, 0, 0, 0], 86400.0, 0),
    plain("deg", [0, 0, 0, 0, 0, 0, 0, 1], PI / 180.0, 0),
    plain("rev", [0, 0, 0, 0, 0, 0, 0, 1], 2.0 * PI, 0),
    plain("rpm", [0, 0, -1, 0, 0, 0, 0, 1], 2.0 * PI / 60.0, 0),
    plain("atm", [1, -1, -2, 0, 0, 0, 0, 0], 101_325.0, 0),
    plain("in", [0, 1, 0, 0, 0, 0, 0, 0], 254.0, -4),
    plain("ft", [0, 1, 0, 0, 0, 0, 0, 0], 3048.0, -4),
    plain("%", [0; 8], 1.0, -2),
    plain("ppm", [0; 8], 1.0, -6),
];

const SCALES: [Scale; 2] = [
    Scale { name: "degC", exponents: [0, 0, 0, 0, 1, 0, 0, 0], factor: 1.0, offset: 273.15 },
    Scale {
        name: "degF",
        exponents: [0, 0, 0, 0, 1, 0, 0, 0],
        factor: 5.0 / 9.0,
        offset: 45_967.0 / 180.0,
    },
];

const PREFIXES: [(&str, i32); 11] = [
    ("T", 12),
    ("G", 9),
    ("M", 6),
    ("k", 3),
    ("h", 2),
    ("d", -1),
    ("c", -2),
    ("m", -3),
    ("u", -6),
    ("n", -9),
    ("p", -12),
];

/// Finds the unit called `name`, also with an SI prefix. A whole name (`min`, `cd`) has priority over prefix and unit.
pub(super) fn find(name: &str) -> Option<Named> {
    let named = UNITS.iter().find(|unit| unit.name == name).copied();
    named.or_else(|| {
        PREFIXES.iter().find_map(|(prefix, ten)| {
            let rest = name.strip_prefix(prefix)?;
            let unit = UNITS.iter().find(|unit| unit.prefixes && unit.name == rest)?;
            Some(Named { ten: unit.ten + ten, ..*unit })
        })
    })
}

/// Finds the unit with an offset called `name`.
pub(super) fn scale(name: &str) -> Option<&'static Scale> {
    SCALES.iter().find(|scale| scale.name == name)
}
