//! Reads the table `[robustness]` of a plant file: tolerances, measurement noise, limits.

use control::robustness::PlantEntry;
use files::{Entry, Table};

use crate::Model;
use crate::parameters::{self, ParameterTolerance, fraction};
use crate::read::{Result, each, not_negative, optional, whole, within};

/// The tolerances and the noise for which the robustness of a design is computed, and the limits of its verdict.
#[derive(Clone, Debug, PartialEq)]
pub struct RobustnessLimits {
    /// Relative tolerances of the entries of A, B, C and D.
    pub tolerance: [f64; 4],
    /// Tolerances of single entries, in place of the tolerances of their matrices.
    pub entries: Vec<EntryTolerance>,
    /// Tolerances of parameters of the plant's FMU; if there are any, the entries are exact.
    pub parameters: Vec<ParameterTolerance>,
    /// Number of random cases.
    pub cases: u32,
    /// Seed of the random cases.
    pub seed: u32,
    /// Noise of each measurement: the root of its spectral density, or its standard deviation in a sampled design; 1 if
    /// not stated.
    pub noise: Vec<f64>,
    /// Whether the file states the noise.
    pub noise_is_stated: bool,
    /// Peak of S above which a design is amber.
    pub amber: f64,
    /// Peak of S above which a design is red.
    pub red: f64,
}

/// A tolerance of entries that change by the same factor.
#[derive(Clone, Debug, PartialEq)]
pub struct EntryTolerance {
    /// The entries that vary.
    pub entries: Vec<PlantEntry>,
    /// Tolerance as a fraction of the values of the entries; 0 for exact entries.
    pub relative: f64,
}

/// The names of the matrices that vary.
pub const MATRICES: [&str; 4] = ["A", "B", "C", "D"];

const KEYS: [&str; 7] = ["tolerance", "parameters", "cases", "seed", "noise", "amber", "red"];
const TOLERANCE: f64 = 0.1;
const CASES: u32 = 200;
const AMBER: f64 = 2.0;
const RED: f64 = 4.0;

impl RobustnessLimits {
    /// Reads the table, or returns the defaults for a plant with this number of `measurements`.
    pub(crate) fn read(file: &Table<'_>, model: &Model, measurements: usize) -> Result<Self> {
        // A single entry of a sampled A has no physical meaning, and hence no relative tolerance.
        let of_a = if model.only_samples().is_some() { 0.0 } else { TOLERANCE };
        let mut limits = Self {
            tolerance: [of_a, TOLERANCE, TOLERANCE, TOLERANCE],
            entries: Vec::new(),
            parameters: Vec::new(),
            cases: CASES,
            seed: 1,
            noise: vec![1.0; measurements],
            noise_is_stated: false,
            amber: AMBER,
            red: RED,
        };
        let Some(entry) = file.get("robustness") else { return Ok(limits) };
        let table = entry.table()?;
        table.allow(&KEYS)?;
        if let Some(entry) = table.get("tolerance") {
            limits.tolerance = tolerances(&entry)?;
            if entry.is_table()
                && let Some(entry) = entry.table()?.get("entries")
            {
                limits.entries = entries(&entry, model)?;
            }
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
            limits.parameters = parameters::read(&entry)?;
            limits.tolerance = [0.0; 4];
        }
        let number = |key: &str, most| optional(&table, key, |entry| whole(entry, 0..=most));
        limits.cases = number("cases", 100_000)?.unwrap_or(limits.cases);
        limits.seed = number("seed", u32::MAX)?.unwrap_or(limits.seed);
        if let Some(entry) = table.get("noise") {
            limits.noise =
                each(&entry, measurements, "numbers, one per measurement", not_negative)?;
            limits.noise_is_stated = true;
        }
        let (amber, red) = (table.get("amber"), table.get("red"));
        for (entry, limit) in [(&amber, &mut limits.amber), (&red, &mut limits.red)] {
            if let Some(entry) = entry {
                let rule = "the peak of S is never below 1: expected more";
                *limit = within(entry, 1.0.., rule)?;
            }
        }
        if let Some(entry) = red.or(amber).filter(|_| limits.amber > limits.red) {
            let Self { amber, red, .. } = limits;
            return Err(entry.error(format!("expected amber <= red, found {amber} and {red}")));
        }
        Ok(limits)
    }
}

/// Reads tolerances of single entries: `"A[2][1]" = 0.5`, `"A[2][1], B[2][1]" = 0.5` for entries that change by
/// the same factor.
fn entries(entry: &Entry<'_>, model: &Model) -> Result<Vec<EntryTolerance>> {
    let Model::Matrices { a, b, c, d, .. } = model else {
        return Err(
            entry.error("an FMU is the plant: expected `parameters`, its parameters that vary")
        );
    };
    let mut all: Vec<EntryTolerance> = Vec::new();
    for (text, entry) in entry.table()?.entries() {
        let mut places = Vec::new();
        for name in text.split(',').map(str::trim) {
            let place = plant_entry(name).ok_or_else(|| {
                entry.error(format!(
                    "expected an entry of A, B, C or D such as \"A[2][1]\", or several with commas, which \
                     change by the same factor; found {name:?}"
                ))
            })?;
            let matrix = [a, b, c, d][place.matrix];
            let value = matrix.get((place.row, place.column)).ok_or_else(|| {
                let (rows, columns) = matrix.shape();
                entry.error(format!("{name}: the matrix has {rows} rows and {columns} columns"))
            })?;
            if *value == 0.0 {
                return Err(entry.error(format!("{name} is 0, of which a fraction is nothing")));
            }
            let mut stated = all.iter().flat_map(|tolerance| &tolerance.entries).chain(&places);
            if stated.any(|other| *other == place) {
                return Err(entry.error(format!("{name} is stated twice")));
            }
            places.push(place);
        }
        all.push(EntryTolerance { entries: places, relative: fraction(&entry)? });
    }
    Ok(all)
}

/// Reads `A[2][1]`, row and column counted from 1; `None` if `text` is no such entry.
fn plant_entry(text: &str) -> Option<PlantEntry> {
    let (name, rest) = text.split_once('[')?;
    let matrix = MATRICES.iter().position(|symbol| *symbol == name)?;
    let (row, column) = rest.strip_suffix(']')?.split_once("][")?;
    let index = |text: &str| text.parse::<usize>().ok()?.checked_sub(1);
    Some(PlantEntry { matrix, row: index(row)?, column: index(column)? })
}

/// Reads one number for A, B, C and D, or a table with a number for some matrices; 0 for the remaining ones.
fn tolerances(entry: &Entry<'_>) -> Result<[f64; 4]> {
    if !entry.is_table() {
        return Ok([fraction(entry)?; 4]);
    }
    let table = entry.table()?;
    table.allow(&["A", "B", "C", "D", "entries"])?;
    let mut all = [0.0; 4];
    for (key, tolerance) in MATRICES.into_iter().zip(&mut all) {
        if let Some(entry) = table.get(key) {
            *tolerance = fraction(&entry)?;
        }
    }
    Ok(all)
}
