//! Patterns that a plant admits, and the patterns of given residuals.

use super::DisturbedPlant;
use super::decoupled::{DecoupledPart, Gap, complement, size_or_one};
use super::generator::{Requirements, Residual, gains};
use crate::blocks::{block_2x2, stacked};
use crate::check::as_number;
use crate::{Domain, Error, check};
use nalgebra::DMatrix;
use std::collections::{BTreeMap, VecDeque};

/// Largest number of patterns.
const PATTERNS: usize = 4096;

/// A pattern that some residual generator has.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct AchievablePattern {
    /// One entry per fault: whether the residual responds to it at some frequency.
    pub pattern: Vec<bool>,
    /// Whether a residual of this pattern responds to all faults of the pattern at the required frequency, too: at
    /// frequency 0, whether constant faults stay visible.
    pub strong: bool,
}

/// All patterns of residuals that are decoupled from the commands and the disturbances.
///
/// `requirements`: the frequency decides which patterns are strong, the tolerance which singular values count as zero;
/// the other fields are only checked. Starting with no fault decoupled, further faults are decoupled one by one; faults
/// to which no residual then responds are decoupled with them. Patterns with most faults come first. Cost: up to 2^q
/// decouplings of about 20 n^3 multiplications.
///
/// Source: A. Varga, Solving fault diagnosis problems (2017), section 5.4; the recursion of his genspec, on
/// unobservability subspaces in place of rational null spaces.
///
/// # Errors
///
/// Same as [`DisturbedPlant::check`]; [`Error::OutOfRange`] for `requirements`, and for more than
/// 4096 patterns; [`Error::Shape`] if the noise has not one entry per measurement; [`Error::NotConverged`],
/// [`Error::Overflow`] if an inner computation fails.
pub fn achievable_patterns(
    plant: &DisturbedPlant,
    requirements: &Requirements,
) -> Result<Vec<AchievablePattern>, Error> {
    plant.check()?;
    requirements.check(plant.c.nrows(), plant.domain)?;
    let (plant, _) = plant.reachable_part(requirements.tolerance)?;
    let faults = plant.b_f.ncols();
    let mut strength: BTreeMap<Vec<bool>, bool> = BTreeMap::new();
    let mut open = VecDeque::from([vec![false; faults]]);
    let mut queued = vec![vec![false; faults]];
    while let Some(decoupled) = open.pop_front() {
        let Some(part) = DecoupledPart::new(&plant, &decoupled, requirements.tolerance)? else {
            continue;
        };
        let visible = part.effects.iter().map(|effect| *effect > requirements.tolerance);
        let pattern: Vec<bool> =
            visible.zip(&decoupled).map(|(visible, off)| visible && !off).collect();
        if !pattern.contains(&true) || strength.contains_key(&pattern) {
            continue;
        }
        for fault in (0..faults).filter(|&fault| pattern[fault]) {
            let mut next: Vec<bool> = pattern.iter().map(|responds| !responds).collect();
            next[fault] = true;
            if !queued.contains(&next) {
                queued.push(next.clone());
                open.push_back(next);
            }
        }
        let strong = is_strong(&part, &pattern, requirements, plant.domain)?;
        strength.insert(pattern, strong);
        let (count, rule) = (strength.len(), "at most 4096: decouple fewer faults");
        check::that(count <= PATTERNS, "the number of patterns", as_number(count), rule)?;
    }
    let achievable = |(pattern, strong)| AchievablePattern { pattern, strong };
    let mut patterns: Vec<_> = strength.into_iter().map(achievable).collect();
    let count = |one: &AchievablePattern| one.pattern.iter().filter(|x| **x).count();
    patterns.sort_by(|x, y| count(y).cmp(&count(x)).then_with(|| y.pattern.cmp(&x.pattern)));
    Ok(patterns)
}

/// Whether some residual responds to each fault of the pattern at the required frequency: the column
/// [`b_f`; `d_f`] is not in the span of [A - s I; C].
fn is_strong(
    part: &DecoupledPart,
    pattern: &[bool],
    requirements: &Requirements,
    domain: Domain,
) -> Result<bool, Error> {
    let s = domain.point(requirements.frequency);
    let n = part.a.nrows();
    // Rows in units of A and of C.
    let (size, outputs) = (size_or_one(&part.a), size_or_one(&part.c));
    let shifted = (&part.a - DMatrix::identity(n, n) * s.re) / size;
    let real = stacked(&shifted, &(&part.c / outputs));
    let imaginary =
        DMatrix::from_fn(real.nrows(), n, |i, j| if i == j { -s.im / size } else { 0.0 });
    let pencil = block_2x2([&real, &-&imaginary], [&imaginary, &real]);
    let null = complement(&pencil, requirements.tolerance, &mut Gap::none())?;
    let columns = stacked(&(&part.b_f / size), &(&part.d_f / outputs));
    let twice = stacked(&columns, &DMatrix::zeros(columns.nrows(), columns.ncols()));
    let responses = null.tr_mul(&twice);
    let lengths = responses.column_iter().zip(columns.column_iter());
    let mut each = pattern.iter().zip(lengths);
    Ok(each.all(|(&responds, (response, column))| {
        !responds || response.norm() > requirements.tolerance * column.norm()
    }))
}

/// The structure matrix of several residuals: entry (i, j) is true if the gain of residual i for
/// fault j at `frequency` is above zero and at least `threshold` times the largest gain of the residual.
///
/// # Errors
///
/// [`Error::OutOfRange`] for a threshold that is not above zero.
pub fn structure(
    residuals: &[Residual],
    frequency: f64,
    threshold: f64,
) -> Result<Vec<Vec<bool>>, Error> {
    check::positive("threshold", threshold)?;
    let row = |residual: &Residual| {
        let sizes: Vec<f64> =
            gains(&residual.from_faults, frequency).iter().map(|gain| gain.norm()).collect();
        let largest = sizes.iter().copied().fold(0.0, f64::max);
        sizes.iter().map(|size| *size > 0.0 && *size >= threshold * largest).collect()
    };
    Ok(residuals.iter().map(row).collect())
}
