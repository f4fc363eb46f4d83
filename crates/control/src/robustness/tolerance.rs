//! Errors of the plant's parameters: random cases and a search for the worst one.

use super::family::{PlantFamily, ToleranceCase, ToleranceSearch};
use super::worst_case::climb;
use crate::{Error, StateSpace, check};
use nalgebra::DMatrix;

/// An entry this near to 1 counts as the 1 of a structural row, because linearisations round.
const ROUNDING: f64 = 1e-9;

/// An entry of A, B, C or D.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlantEntry {
    /// The matrix: 0 to 3 for A, B, C, D.
    pub matrix: usize,
    /// The row, from 0.
    pub row: usize,
    /// The column, from 0.
    pub column: usize,
}

/// The relative tolerances of the entries of A, B, C and D of a plant.
#[derive(Debug, Clone, PartialEq)]
pub struct Tolerances {
    /// The tolerances of A, B, C and D: four matrices of the shapes of the plant's; zero for an exact entry.
    pub of: [DMatrix<f64>; 4],
    /// Groups of entries that change by a common factor. An entry in no group changes independently.
    pub common: Vec<Vec<PlantEntry>>,
}

impl Tolerances {
    /// The tolerances `relative` of A, B, C and D for all entries except zeros and entries of structural rows.
    ///
    /// A row is structural if its only entry other than 0 is 1 and the equation is a definition:
    ///
    /// ```text
    /// x_i' = x_j (j other than i): a state is the derivative of another; row i of B is zero
    /// y_i = x_j: a measurement is a state; row i of D is zero
    /// ```
    ///
    /// Every other entry may be a parameter of the plant, including 1 and -1.
    #[must_use]
    pub fn unless_structural(plant: &StateSpace, relative: [f64; 4]) -> Self {
        let [in_a, in_b, in_c, in_d] = relative;
        let varying = |m: &DMatrix<f64>, relative: f64, structural: &dyn Fn(usize) -> bool| {
            DMatrix::from_fn(m.nrows(), m.ncols(), |row, column| {
                if m[(row, column)] == 0.0 || structural(row) { 0.0 } else { relative }
            })
        };
        let kinematic = |row: usize| is_signal(&plant.a, &plant.b, row, Some(row));
        let selector = |row: usize| is_signal(&plant.c, &plant.d, row, None);
        let of = [
            varying(&plant.a, in_a, &kinematic),
            varying(&plant.b, in_b, &|_| false),
            varying(&plant.c, in_c, &selector),
            varying(&plant.d, in_d, &|_| false),
        ];
        Self { of, common: Vec::new() }
    }

    /// The entries that are not exact, matrix by matrix and row by row.
    pub fn entries(&self) -> impl Iterator<Item = PlantEntry> + '_ {
        self.of.iter().enumerate().flat_map(|(matrix, of)| {
            let all = (0..of.nrows()).flat_map(|row| (0..of.ncols()).map(move |col| (row, col)));
            all.filter(|place| of[*place] > 0.0).map(move |(row, column)| PlantEntry {
                matrix,
                row,
                column,
            })
        })
    }
}

/// Whether the equation of row `row` equates its left side to a single state other than `excluded`: the row of `states`
/// (A or C) has a single 1 and zeros, the row of `commands` (B or D) only zeros.
fn is_signal(
    states: &DMatrix<f64>,
    commands: &DMatrix<f64>,
    row: usize,
    excluded: Option<usize>,
) -> bool {
    let entries = states.row(row);
    let mut entries = entries.iter().enumerate().filter(|(_, entry)| **entry != 0.0);
    let is_one = match (entries.next(), entries.next()) {
        (Some((column, entry)), None) => {
            Some(column) != excluded && (entry - 1.0).abs() <= ROUNDING
        }
        _ => false,
    };
    is_one && commands.row(row).iter().all(|entry| *entry == 0.0)
}

/// The stability of a loop while the parameters of its plant are within their tolerances.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ToleranceTest {
    /// Number of tested random cases.
    pub cases: u32,
    /// Number of stable random cases.
    pub stable: u32,
    /// [`crate::stability::instability`] of the worst plant.
    pub worst_instability: f64,
    /// The worst plant that was found.
    pub worst: StateSpace,
    /// The deviations of the worst plant, as fractions of the tolerances.
    pub deviations: Vec<f64>,
    /// The multiple of the tolerances, in the direction of the worst plant, below which the loop is stable; None if the
    /// loop is stable at all [`PlantFamily::multiples`].
    pub first_unstable: Option<f64>,
}

/// Tests the stability of the loop of a family's plant and `controller` while the parameters of the
/// plant vary and the controller does not.
///
/// For a sampled controller each plant is discretised with its period. The deviations of the random
/// cases are uniform in -1 to 1 and independent, drawn by the generator `SplitMix64` from `seed`. The
/// worst case is searched among the vertices of the tolerances: from the nominal plant and from the
/// worst random cases, along the derivatives of the eigenvalues. This is a test, not a proof: a stable
/// loop may be unstable in a case that was not tried.
///
/// # Errors
///
/// The errors of the family, of [`super::Loop::new`], [`super::held_plant`], [`crate::stability::instability`].
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

#[expect(clippy::missing_errors_doc, reason = "the type says: as the whole test")]
impl<F: PlantFamily> ToleranceSearch<'_, F> {
    /// The deviations of the random cases.
    #[must_use]
    pub fn cases(&self, cases: u32, seed: u64) -> Vec<Vec<f64>> {
        random_deviations(self.family.count(), cases, seed)
    }

    /// Computes the instability of the loop with the plant of `deviations`.
    pub fn evaluate(&self, deviations: Vec<f64>) -> Result<ToleranceCase, F::Error> {
        let instability = self.instability(&deviations)?;
        Ok(ToleranceCase { instability, deviations })
    }

    /// Returns the start points of the worst-case search: the two worst cases and the nominal plant.
    pub fn starts(&self, cases: &[ToleranceCase]) -> Result<Vec<ToleranceCase>, F::Error> {
        let mut worst: Vec<&ToleranceCase> = cases.iter().collect();
        worst.sort_by(|x, y| y.instability.total_cmp(&x.instability));
        let mut starts: Vec<ToleranceCase> = worst.into_iter().take(2).cloned().collect();
        starts.push(self.evaluate(vec![0.0; self.family.count()])?);
        Ok(starts)
    }

    /// The worst case that the search reaches from `start`.
    pub fn climb(&self, start: ToleranceCase) -> Result<ToleranceCase, F::Error> {
        climb(self, start)
    }

    /// The result from all cases and the end of each climb; [`Error::NotConverged`] if `climbed` is empty.
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
            first_unstable: self.first_unstable(&deviations)?,
            deviations,
        })
    }
}

/// `cases` independent points, uniform in -1 to 1 in each of `count` deviations, by `SplitMix64` from `seed`.
#[must_use]
pub fn random_deviations(count: usize, cases: u32, seed: u64) -> Vec<Vec<f64>> {
    let mut random = seed;
    let mut case = || (0..count).map(|_| 2.0 * uniform(&mut random) - 1.0).collect();
    (0..cases).map(|_| case()).collect()
}

/// The next number of `SplitMix64` (G. L. Steele, D. Lea and C. H. Flood, OOPSLA 2014), from 0 to below 1.
pub(crate) fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 31;
    #[expect(clippy::cast_precision_loss, reason = "53 bits")]
    let fraction = (z >> 11) as f64;
    fraction / 9_007_199_254_740_992.0
}

/// A plant entry that varies, and the product of its value and its tolerance.
struct Entry {
    place: PlantEntry,
    size: f64,
}

/// All plants within the tolerances of single entries: each entry is multiplied by 1 + t d with its tolerance t and its
/// deviation d. Entries that change together have one deviation.
pub struct EntryFamily<'a> {
    pub(super) plant: &'a StateSpace,
    deviations: Vec<Vec<Entry>>,
}

impl<'a> EntryFamily<'a> {
    /// The plants whose entries differ from the entries of `plant` by at most `tolerances`.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`]; [`Error::OutOfRange`] for a negative tolerance.
    pub fn new(plant: &'a StateSpace, tolerances: &Tolerances) -> Result<Self, Error> {
        let named = [("A", &plant.a), ("B", &plant.b), ("C", &plant.c), ("D", &plant.d)];
        for ((name, values), of) in named.into_iter().zip(&tolerances.of) {
            check::shape(name, of, values.shape())?;
            let not_negative =
                |&value: &f64| check::that(value >= 0.0, "the tolerance", value, "not negative");
            of.iter().try_for_each(not_negative)?;
        }
        let mut groups: Vec<Vec<Entry>> = tolerances.common.iter().map(|_| Vec::new()).collect();
        for place in tolerances.entries() {
            let PlantEntry { matrix, row, column } = place;
            let size = tolerances.of[matrix][(row, column)] * named[matrix].1[(row, column)];
            if size == 0.0 {
                continue;
            }
            match tolerances.common.iter().position(|group| group.contains(&place)) {
                Some(at) => groups[at].push(Entry { place, size }),
                None => groups.push(vec![Entry { place, size }]),
            }
        }
        groups.retain(|group| !group.is_empty());
        Ok(Self { plant, deviations: groups })
    }

    /// The change of [A, B; C, D] by each deviation of 1.
    pub(super) fn changes(&self) -> Vec<DMatrix<f64>> {
        let (n, m) = self.plant.b.shape();
        let p = self.plant.c.nrows();
        let change = |entries: &Vec<Entry>| {
            let mut change = DMatrix::zeros(n + p, n + m);
            for Entry { place: PlantEntry { matrix, row, column }, size } in entries {
                let (first_row, first_column) = [(0, 0), (0, n), (n, 0), (n, n)][*matrix];
                change[(first_row + row, first_column + column)] = *size;
            }
            change
        };
        self.deviations.iter().map(change).collect()
    }
}

impl PlantFamily for EntryFamily<'_> {
    type Error = Error;

    fn count(&self) -> usize {
        self.deviations.len()
    }

    fn plant(&self, deviations: &[f64]) -> Result<StateSpace, Error> {
        let mut plant = self.plant.clone();
        for (entries, deviation) in self.deviations.iter().zip(deviations) {
            for Entry { place: PlantEntry { matrix, row, column }, size } in entries {
                let StateSpace { a, b, c, d, .. } = &mut plant;
                [a, b, c, d][*matrix][(*row, *column)] += size * deviation;
            }
        }
        Ok(plant)
    }

    fn slopes(&self, entries: &[DMatrix<f64>; 4]) -> Vec<f64> {
        let slope =
            |Entry { place, size }: &Entry| entries[place.matrix][(place.row, place.column)] * size;
        self.deviations.iter().map(|entries| entries.iter().map(slope).sum()).collect()
    }
}
