//! Errors of the plant's parameters: random cases and a search for the worst one.

use super::family::{Loops, PlantFamily, ToleranceCase};
use super::worst_case::climb;
use crate::{Error, StateSpace, check};
use nalgebra::DMatrix;

/// Entries this near to 0 (relative to the largest of the matrix) or to +-1 are structural.
const STRUCTURAL: f64 = 1e-9;

/// The relative tolerances of the entries of A, B, C and D of a plant.
#[derive(Debug, Clone, PartialEq)]
pub struct Tolerances {
    /// Of A, B, C, D, in this order: each matrix as large as the plant's; zero for an exact entry.
    pub of: [DMatrix<f64>; 4],
}

impl Tolerances {
    /// The tolerances `relative` of A, B, C and D for all entries that are not structural: 0, 1 and -1
    /// are exact.
    #[must_use]
    pub fn of_values(plant: &StateSpace, relative: [f64; 4]) -> Self {
        let of = |(m, relative): (&DMatrix<f64>, f64)| {
            let negligible = STRUCTURAL * m.amax();
            m.map(|entry| {
                let fixed = entry.abs() <= negligible || (entry.abs() - 1.0).abs() <= STRUCTURAL;
                if fixed { 0.0 } else { relative }
            })
        };
        let [a, b, c, d] = relative;
        let matrices = [(&plant.a, a), (&plant.b, b), (&plant.c, c), (&plant.d, d)];
        Self { of: matrices.map(of) }
    }

    /// The number of entries that are not exact.
    #[must_use]
    pub fn count(&self) -> usize {
        self.of.iter().flat_map(DMatrix::iter).filter(|entry| **entry > 0.0).count()
    }
}

/// What a loop does while the parameters of its plant are within their tolerances.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ToleranceTest {
    /// Number of random cases.
    pub cases: u32,
    /// How many of them are stable.
    pub stable: u32,
    /// [`crate::stability::instability`] of the worst plant.
    pub worst_instability: f64,
    /// The worst plant that was found.
    pub worst: StateSpace,
    /// Its deviations, as parts of the tolerances.
    pub deviations: Vec<f64>,
    /// The multiple of the tolerances, in the direction of the worst plant, below which the loop is
    /// stable; None if it is stable at all [`PlantFamily::multiples`].
    pub first_unstable: Option<f64>,
}

/// Tests the stability of the loop of a family's plant and `controller` while the parameters of the
/// plant vary and the controller does not.
///
/// For a sampled controller each plant is discretised with its period. The deviations of the random
/// cases are uniform in -1 to 1 and independent, drawn by the generator `SplitMix64` from `seed`. The
/// worst case is searched among the vertices of the tolerances: from the nominal plant and from the
/// worst random cases, in the directions that the derivatives of the eigenvalues state. It is a lower
/// bound of what the tolerances can do: a loop that is found stable may be unstable in a case that was
/// not tried.
///
/// # Errors
///
/// Those of the family; same as [`super::Loop::new`], [`crate::hold::zero_order_hold`] and [`crate::stability::instability`].
pub fn tolerance_test<F: PlantFamily>(
    family: &F,
    controller: &StateSpace,
    cases: u32,
    seed: u64,
) -> Result<ToleranceTest, F::Error> {
    let search = ToleranceSearch { family, controller };
    let cases = search.cases(cases, seed).into_iter().map(|case| search.evaluate(case));
    let cases = cases.collect::<Result<Vec<_>, F::Error>>()?;
    let climbed = search.starts(&cases)?.into_iter().map(|start| search.climb(start));
    let climbed = climbed.collect::<Result<Vec<_>, _>>()?;
    search.result(&cases, climbed)
}

/// The parts of [`tolerance_test`], for a caller that runs cases and climbs at the same time.
pub struct ToleranceSearch<'a, F> {
    /// The plants.
    pub family: &'a F,
    /// The controller, which does not vary.
    pub controller: &'a StateSpace,
}

impl<F: PlantFamily> ToleranceSearch<'_, F> {
    /// The deviations of the random cases.
    #[must_use]
    pub fn cases(&self, cases: u32, seed: u64) -> Vec<Vec<f64>> {
        random_deviations(self.family.count(), cases, seed)
    }

    /// The plant of the family with these deviations, in the loop.
    ///
    /// # Errors
    ///
    /// Same as [`tolerance_test`].
    pub fn evaluate(&self, deviations: Vec<f64>) -> Result<ToleranceCase, F::Error> {
        let instability = self.loops().instability(&deviations)?;
        Ok(ToleranceCase { instability, deviations })
    }

    /// Returns the start points of the worst-case search: the two worst cases and the nominal plant.
    ///
    /// # Errors
    ///
    /// Same as [`tolerance_test`].
    pub fn starts(&self, cases: &[ToleranceCase]) -> Result<Vec<ToleranceCase>, F::Error> {
        let mut worst: Vec<&ToleranceCase> = cases.iter().collect();
        worst.sort_by(|x, y| y.instability.total_cmp(&x.instability));
        let mut starts: Vec<ToleranceCase> = worst.into_iter().take(2).cloned().collect();
        starts.push(self.evaluate(vec![0.0; self.family.count()])?);
        Ok(starts)
    }

    /// The worst case that the search reaches from `start`.
    ///
    /// # Errors
    ///
    /// Same as [`tolerance_test`].
    pub fn climb(&self, start: ToleranceCase) -> Result<ToleranceCase, F::Error> {
        climb(&self.loops(), start)
    }

    /// The result from all cases and the end of each climb.
    ///
    /// # Errors
    ///
    /// Same as [`tolerance_test`].
    pub fn result(
        &self,
        cases: &[ToleranceCase],
        climbed: Vec<ToleranceCase>,
    ) -> Result<ToleranceTest, F::Error> {
        let worse = |one: ToleranceCase, other: ToleranceCase| {
            if other.instability > one.instability { other } else { one }
        };
        let worst = climbed.into_iter().reduce(worse);
        let ToleranceCase { instability, deviations } =
            worst.ok_or(Error::NotConverged { what: "the worst case", iterations: 0 })?;
        let count = |number: usize| u32::try_from(number).unwrap_or(u32::MAX);
        Ok(ToleranceTest {
            cases: count(cases.len()),
            stable: count(cases.iter().filter(|case| case.instability < 0.0).count()),
            worst_instability: instability,
            worst: self.family.plant(&deviations)?,
            first_unstable: self.loops().first_unstable(&deviations)?,
            deviations,
        })
    }

    fn loops(&self) -> Loops<'_, F> {
        Loops { family: self.family, controller: self.controller }
    }
}

/// `cases` points of a box of `count` deviations from -1 to 1, uniform and independent, drawn by the generator
/// `SplitMix64` from `seed`.
#[must_use]
pub fn random_deviations(count: usize, cases: u32, seed: u64) -> Vec<Vec<f64>> {
    let mut random = seed;
    let mut case = || (0..count).map(|_| 2.0 * uniform(&mut random) - 1.0).collect();
    (0..cases).map(|_| case()).collect()
}

/// The next number of `SplitMix64` (G. L. Steele, D. Lea and C. H. Flood, OOPSLA 2014), in 0 to 1.
fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 31;
    #[expect(clippy::cast_precision_loss, reason = "53 bits")]
    let fraction = (z >> 11) as f64;
    fraction / 9_007_199_254_740_992.0
}

/// A plant entry that varies: matrix (A, B, C, D), row, column, and the product of value and tolerance.
struct Entry {
    matrix: usize,
    row: usize,
    column: usize,
    size: f64,
}

/// All plants within the tolerances of single entries: each is multiplied by 1 + t d, t its tolerance,
/// d its deviation.
pub struct EntryFamily<'a> {
    plant: &'a StateSpace,
    entries: Vec<Entry>,
}

impl<'a> EntryFamily<'a> {
    /// The plants whose entries are those of `plant` within `tolerances`.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`] for tolerances that do not fit; [`Error::OutOfRange`] for a negative one.
    pub fn new(plant: &'a StateSpace, tolerances: &Tolerances) -> Result<Self, Error> {
        let mut entries = Vec::new();
        let named = [("A", &plant.a), ("B", &plant.b), ("C", &plant.c), ("D", &plant.d)];
        for (matrix, ((name, values), of)) in named.into_iter().zip(&tolerances.of).enumerate() {
            check::shape(name, of, values.shape())?;
            for (row, column) in
                (0..of.ncols()).flat_map(|column| (0..of.nrows()).map(move |row| (row, column)))
            {
                let relative = of[(row, column)];
                if relative < 0.0 {
                    let rule = "not negative";
                    return Err(Error::OutOfRange { name: "the tolerance", value: relative, rule });
                }
                let size = relative * values[(row, column)];
                if size.abs() > 0.0 {
                    entries.push(Entry { matrix, row, column, size });
                }
            }
        }
        Ok(Self { plant, entries })
    }
}

impl PlantFamily for EntryFamily<'_> {
    type Error = Error;

    fn count(&self) -> usize {
        self.entries.len()
    }

    fn plant(&self, deviations: &[f64]) -> Result<StateSpace, Error> {
        let mut plant = self.plant.clone();
        for (entry, deviation) in self.entries.iter().zip(deviations) {
            let matrix = match entry.matrix {
                0 => &mut plant.a,
                1 => &mut plant.b,
                2 => &mut plant.c,
                _ => &mut plant.d,
            };
            matrix[(entry.row, entry.column)] += entry.size * deviation;
        }
        Ok(plant)
    }

    fn slopes(&self, entries: &[DMatrix<f64>; 4]) -> Vec<f64> {
        let of = |entry: &Entry| entries[entry.matrix][(entry.row, entry.column)] * entry.size;
        self.entries.iter().map(of).collect()
    }
}
