//! Reads the table `[robustness]` of a plant file: tolerances, measurement noise, limits.

use files::{Entry, PlaceError, Table};

use crate::plant_file::parameters::{self, ParameterTolerance, fraction};

/// What the robustness of a design is tested with, and the limits of its verdict.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RobustnessLimits {
    /// Relative tolerances of the entries of A, B, C and D.
    pub(crate) tolerance: [f64; 4],
    /// Tolerances of parameters of the plant's FMU; if there are any, the entries are exact.
    pub(crate) parameters: Vec<ParameterTolerance>,
    /// Number of random cases.
    pub(crate) cases: u32,
    /// Seed of the random cases.
    pub(crate) seed: u32,
    /// Noise of each measurement: the root of its spectral density, or its standard deviation in a
    /// sampled design.
    pub(crate) noise: Vec<f64>,
    /// Peak of S above which a design is amber.
    pub(crate) amber: f64,
    /// Peak of S above which it is red.
    pub(crate) red: f64,
}

const KEYS: [&str; 7] = ["tolerance", "parameters", "cases", "seed", "noise", "amber", "red"];
const TOLERANCE: f64 = 0.1;
const CASES: u32 = 200;
const AMBER: f64 = 2.0;
const RED: f64 = 4.0;

impl RobustnessLimits {
    /// Reads the table, or returns the defaults for a plant with that many measurements.
    pub(crate) fn read(file: &Table<'_>, measurements: usize) -> Result<Self, PlaceError> {
        let mut found = Self {
            tolerance: [TOLERANCE; 4],
            parameters: Vec::new(),
            cases: CASES,
            seed: 1,
            noise: vec![1.0; measurements],
            amber: AMBER,
            red: RED,
        };
        let Some(entry) = file.get("robustness") else {
            return Ok(found);
        };
        let table = entry.table()?;
        table.allow(&KEYS)?;
        if let Some(entry) = table.get("tolerance") {
            found.tolerance = tolerances(&entry)?;
        }
        if let Some(entry) = table.get("parameters") {
            if file.get("plant").is_none() {
                let message = "they belong to `plant`, an FMU; with matrices, `tolerance` states \
                               how far their entries may be off";
                return Err(entry.error(message));
            }
            if table.get("tolerance").is_some() {
                let message = "expected `tolerance`, of all entries of the matrices, or \
                               `parameters`, found both";
                return Err(entry.error(message));
            }
            found.parameters = parameters::read(&entry)?;
            found.tolerance = [0.0; 4];
        }
        if let Some(entry) = table.get("cases") {
            found.cases = whole(&entry, 100_000)?;
        }
        if let Some(entry) = table.get("seed") {
            found.seed = whole(&entry, u32::MAX)?;
        }
        if let Some(entry) = table.get("noise") {
            found.noise = noise(&entry, measurements)?;
        }
        let (amber, red) = (table.get("amber"), table.get("red"));
        for (entry, limit) in [(&amber, &mut found.amber), (&red, &mut found.red)] {
            if let Some(entry) = entry {
                *limit = at_least_one(entry)?;
            }
        }
        if let Some(entry) = red.or(amber).filter(|_| found.amber > found.red) {
            let Self { amber, red, .. } = found;
            return Err(entry.error(format!("expected amber <= red, found {amber} and {red}")));
        }
        Ok(found)
    }
}

/// Reads one number for A, B, C and D, or a table with a number for some of them.
fn tolerances(entry: &Entry<'_>) -> Result<[f64; 4], PlaceError> {
    if !entry.is_table() {
        return Ok([fraction(entry)?; 4]);
    }
    let table = entry.table()?;
    table.allow(&["A", "B", "C", "D"])?;
    let mut found = [0.0; 4];
    for (key, tolerance) in ["A", "B", "C", "D"].into_iter().zip(&mut found) {
        if let Some(entry) = table.get(key) {
            *tolerance = fraction(&entry)?;
        }
    }
    Ok(found)
}

fn at_least_one(entry: &Entry<'_>) -> Result<f64, PlaceError> {
    match entry.number()? {
        number if number >= 1.0 => Ok(number),
        number => {
            let message = format!("the peak of S is never below 1: expected more, found {number}");
            Err(entry.error(message))
        }
    }
}

fn whole(entry: &Entry<'_>, largest: u32) -> Result<u32, PlaceError> {
    let number = entry.number()?;
    if number.fract() == 0.0 && (0.0..=f64::from(largest)).contains(&number) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
        return Ok(number as u32);
    }
    Err(entry.error(format!("expected a whole number from 0 to {largest}, found {number}")))
}

/// Reads one number, or one for each measurement.
fn noise(entry: &Entry<'_>, measurements: usize) -> Result<Vec<f64>, PlaceError> {
    let positive = |entry: &Entry<'_>| match entry.number()? {
        number if number >= 0.0 => Ok(number),
        number => Err(entry.error(format!("expected no less than 0, found {number}"))),
    };
    if !entry.is_list() {
        return Ok(vec![positive(entry)?; measurements]);
    }
    let members = entry.list()?;
    if members.len() != measurements {
        let found = members.len();
        let message =
            format!("expected {measurements} numbers, one per measurement, found {found}");
        return Err(entry.error(message));
    }
    members.iter().map(positive).collect()
}
