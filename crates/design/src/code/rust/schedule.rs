//! The place of the scheduling variable in its grid, and the numbers between two points of it.

use super::Source;
use crate::code::symbols::Matrix;
use crate::code::tables::operating_vectors;
use crate::code::tables::scheduled;

/// The names of a matrix at the points before and after the scheduling variable.
pub(super) fn ends(matrix: Matrix) -> [String; 2] {
    ["low", "high"].map(|end| format!("{}_{end}", matrix.name().to_ascii_lowercase()))
}

impl Source<'_> {
    /// The place in the grid, the operating point there, and the limits as deviations from it.
    pub(super) fn interpolation(&self, lines: &mut Vec<String>) {
        let Self { controller, recursion, .. } = self;
        let Some(schedule) = &controller.schedule else { return };
        // `theta` shadows the input in a sample.
        let pattern = match schedule.measurement {
            Some(k) => (0..k).map(|_| "_, ").chain(["theta, .."]).collect(),
            None => "theta".to_owned(),
        };
        let owner = if schedule.measurement.is_some() { "y" } else { "theta" };
        lines.extend([
            "        // The operating point at the scheduling variable.".to_owned(),
            format!("        let [{pattern}] = self.{owner};"),
            "        let (at, weights, outside) = find_place(theta);".to_owned(),
            "        status.outside = outside;".to_owned(),
        ]);
        for (vector, table) in operating_vectors(controller) {
            let table = table.to_ascii_uppercase();
            lines.push(format!("        let {} = between(&{table}, at, weights);", vector.name()));
        }
        if controller.is_limited() {
            lines.extend([("u_low", "U_MIN"), ("u_high", "U_MAX")].map(|(own, limit)| {
                format!(
                    "        let mut {own} = {limit};
        for (limit, u_op) in {own}.iter_mut().zip(&u_op) {{
            *limit -= *u_op;
        }}"
                )
            }));
        }
        for matrix in scheduled(controller, recursion) {
            let [low, high] = ends(matrix);
            let table = matrix.name().to_ascii_uppercase();
            lines.push(format!("        let [{low}, {high}] = ends(&{table}, at);"));
        }
    }

    /// The functions that a schedule needs.
    pub(super) fn schedule_helpers(&self, lines: &mut Vec<String>) {
        if self.controller.schedule.is_none() {
            return;
        }
        let real = self.real;
        lines.push(format!(
            "
/// Finds the interval of the grid that has theta, and the weights of its two points. Theta beyond the grid is held
/// at its end; the flag says so.
fn find_place(theta: {real}) -> (usize, [{real}; 2], bool) {{
    let [first, second, ..] = GRID;
    let [.., last] = GRID;
    let theta = theta + 0.0;
    let (value, outside) = if theta < first {{
        (first, true)
    }} else if theta > last {{
        (last, true)
    }} else {{
        (theta, false)
    }};
    let (mut at, mut low, mut high) = (0, first, second);
    for (i, (from, to)) in GRID.iter().zip(GRID.iter().skip(1)).enumerate().skip(1) {{
        if value >= *from {{
            (at, low, high) = (i, *from, *to);
        }}
    }}
    let part = (value - low) / (high - low);
    (at, [1.0 - part, part], outside)
}}

/// The tables of a point of the grid and of the next one.
fn ends<T>(table: &[T; POINTS], at: usize) -> [&T; 2] {{
    let [first, ..] = table;
    [at, at + 1].map(|at| table.get(at).unwrap_or(first))
}}

/// A vector between two points.
fn between<const N: usize>(table: &[[{real}; N]; POINTS], at: usize, weights: [{real}; 2]) -> [{real}; N] {{
    let ([low, high], [before, after]) = (ends(table, at), weights);
    let mut own = *low;
    for (own, high) in own.iter_mut().zip(high) {{
        *own = *own * before + high * after;
    }}
    own
}}

/// Adds a row between two points times a vector to a sum, one product after the other.
fn accumulate_between(start: {real}, [low, high]: [&[{real}]; 2], weights: [{real}; 2], vector: &[{real}]) -> {real} {{
    let [before, after] = weights;
    let row = low.iter().zip(high).map(|(low, high)| low * before + high * after);
    row.zip(vector).fold(start, |sum, (entry, element)| sum + entry * element)
}}

/// A row between two points times a vector.
fn product_between(rows: [&[{real}]; 2], weights: [{real}; 2], vector: &[{real}]) -> {real} {{
    accumulate_between(-0.0, rows, weights, vector)
}}"
        ));
    }
}
