//! The choice among loops by their peaks of S.

use super::{Loop, Point};
use crate::response::{Transfer, grid};
use crate::svd::ComplexSvd;
use crate::{Domain, Error, StateSpace};
use nalgebra::{Complex, DMatrix};

/// Number of frequencies per decade at which the loops are compared.
const PER_DECADE: u32 = 12;
/// The first loop is preferred unless another one is lower by more than this factor.
const ADVANTAGE: f64 = 1.1;
/// Factor by which a peak may exceed the lowest one of the references.
const ACCEPTABLE: f64 = 1.02;

/// Returns the index of the loop with the lowest peaks of S among loops with the same eigenvalues.
///
/// The measure is `p_u^2 p_y` with the largest singular values of S, `p_u` at the input and `p_y` at the output.
/// The peak at the input counts twice, because errors of actuators and delays of the computation act there.
/// The first loop is preferred unless another is lower by over 10 %.
///
/// `loops`: a first and a second list; an index counts through both. `references`: loops of other methods with
/// the same eigenvalues. A loop is acceptable if each of its peaks is at most 2 % above the lowest peak of the
/// stable references at this point; the measure alone could trade a high peak at one point for a lower one at
/// the other. The loops of the second list are considered if no loop of the first list is acceptable. If no loop
/// is acceptable, the result is the loop for which the larger ratio of its peaks to the lowest ones is least; the
/// lowest peaks at input and output may belong to different references. The result is 0 if the first list is
/// empty, its first loop is not stable, or no loop can be compared.
///
/// Method: Hessenberg form of each loop, 12 frequencies for each decade and the resonances of the
/// first loop. A resonance of S between two frequencies is possible only near an eigenvalue, and all loops have the
/// same eigenvalues. Cost for each loop of order n: about 15 n^3 multiplications and 4 n^2 (1 + m +
/// p) for each frequency. A loop that is not stable, or whose response cannot be computed, is left out. The result is
/// deterministic.
#[must_use]
pub fn least_sensitive(loops: [&[Loop]; 2], references: &[Loop]) -> usize {
    let [first, second] = loops;
    let Some(any) = first.first() else { return 0 };
    let system = any.sensitivity(Point::Input);
    let Ok(modes) = system.stable_eigenvalues() else { return 0 };
    let frequencies = frequencies(&system, &modes);
    let stable = |one: &Loop| one.sensitivity(Point::Input).stable_eigenvalues().is_ok();
    let stable_references = references.iter().filter(|one| stable(one));
    let lowest = stable_references.filter_map(|one| peaks(one, &frequencies).ok());
    let lowest = lowest.fold([f64::INFINITY; 2], |[input, output], peaks| {
        [input.min(peaks[0]), output.min(peaks[1])]
    });
    let value = |(at, one): (usize, &Loop)| {
        let [input, output] = peaks(one, &frequencies).ok()?;
        let ratio = (input / lowest[0]).max(output / lowest[1]);
        let excess = if ratio <= ACCEPTABLE { 0.0 } else { ratio };
        Some((excess, input * input * output * if at == 0 { 1.0 } else { ADVANTAGE }, at))
    };
    let mut all = vec![];
    for (from, loops) in [(0, first), (first.len(), second)] {
        all.extend((from..).zip(loops).filter_map(value));
        all.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.total_cmp(&y.1)));
        let best =
            all.iter().find(|(.., at)| stable(first.iter().chain(second).nth(*at).unwrap_or(any)));
        match best {
            Some(&(excess, _, at)) if excess <= 0.0 || from > 0 || second.is_empty() => return at,
            _ => {}
        }
    }
    0
}

/// The peaks of S at the input and at the output over the frequencies.
fn peaks(closed: &Loop, frequencies: &[f64]) -> Result<[f64; 2], Error> {
    let (p, m) = closed.plant().d.shape();
    let d = DMatrix::identity(m + p, m + p);
    let transfer = Transfer::new(&StateSpace { d, ..closed.system() });
    let mut peaks = [0.0_f64; 2];
    for frequency in frequencies {
        let gain = transfer.gain(*frequency)?;
        for (peak, (first, count)) in peaks.iter_mut().zip([(0, m), (m, p)]) {
            let s = gain.view((first, first), (count, count)).into_owned();
            *peak = peak.max(ComplexSvd::new(&s)?.values()[0]);
        }
    }
    Ok(peaks)
}

/// Zero, a grid and the resonances.
fn frequencies(system: &StateSpace, modes: &[Complex<f64>]) -> Vec<f64> {
    let resonances = modes.iter().filter(|mode| mode.im > 0.0).map(|mode| match system.domain {
        Domain::Continuous => mode.im,
        Domain::Sampled { period } => mode.arg() / period,
    });
    std::iter::once(0.0).chain(grid(system, modes, PER_DECADE)).chain(resonances).collect()
}
