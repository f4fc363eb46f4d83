//! Disk margins, and peaks that do not depend on the units of the channels.

use super::scaling::{ScaledPeak, balanced_norm, scaled_norm_above};
use super::sweep::Sweep;
use super::{Loop, Point};
use crate::blocks::to_complex;
use crate::response::{HInfinity, KnownResponse, norm_of};
use crate::{Domain, Error, StateSpace, check};
use nalgebra::{Complex, DMatrix, DVector};

pub(super) const WIDTH: f64 = 1e-4;
const REFINEMENTS: usize = 30;
/// Relative distance from the largest value at which the refinement ends.
const FLAT: f64 = 1e-5;

/// The symmetric disk margin: the loop stays stable while each channel, all at the same time and
/// independently of each other, is multiplied by a complex factor of the disk.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct DiskMargin {
    /// The size alpha of the disk of factors (1 + delta alpha / 2) / (1 - delta alpha / 2), |delta|
    /// < 1. At 2 and above the disk contains the right half plane.
    pub alpha: f64,
    /// A size for which stability is certain, at most `alpha`.
    pub certified: f64,
    /// The frequency that determines `alpha`, in rad per unit of time; infinite for the D of a continuous system.
    pub frequency: f64,
}

impl DiskMargin {
    /// The lowest and the highest real factor of the disk. For `alpha` of 2 and above 0 and infinity, although a disk
    /// above 2 also contains negative factors.
    #[must_use]
    pub fn gains(&self) -> [f64; 2] {
        let half = 0.5 * self.alpha;
        if half >= 1.0 {
            [0.0, f64::INFINITY]
        } else {
            [(1.0 - half) / (1.0 + half), (1.0 + half) / (1.0 - half)]
        }
    }

    /// The phase margin in rad: the largest angle of a factor of modulus one.
    #[must_use]
    pub fn phase(&self) -> f64 {
        2.0 * (0.5 * self.alpha).atan()
    }
}

/// Computes the disk margin for simultaneous, independent changes in all channels at `at`; `channel` is the index of a
/// single channel, or None for all.
///
/// ```text
/// alpha = 1 / max over frequency of mu((S - T) / 2)
/// ```
///
/// mu is the structured singular value for a diagonal of complex numbers. In its place the upper bound
/// by diagonal scaling is used, which does not depend on the units of the channels and is exact for up
/// to three of them. For one channel the maximum is an H-infinity norm. With several it is searched on
/// 60 frequencies for each decade and at the resonances, and refined; the gap between
/// [`DiskMargin::alpha`] and [`DiskMargin::certified`] bounds what the search can have missed.
///
/// Source: P. Seiler, A. Packard and P. Gahinet, An introduction to disk margins, IEEE Control
/// Systems 40 (2020), (10) to (17).
///
/// # Example
///
/// L = 2 / (s + 1), with u = -y: S - T = (s - 1) / (s + 3) has the peak 1 at high frequencies.
///
/// ```
/// use control::robustness::{Loop, Point, disk_margin};
/// use control::{Domain, StateSpace};
/// use nalgebra::DMatrix;
/// let one = |value| DMatrix::from_element(1, 1, value);
/// let domain = Domain::Continuous;
/// let plant = StateSpace { a: one(-1.0), b: one(1.0), c: one(2.0), d: one(0.0), domain };
/// let feedback = StateSpace { a: one(-1.0), b: one(0.0), c: one(0.0), d: one(-1.0), domain };
/// let margin = disk_margin(&Loop::new(plant, feedback)?, Point::Input, None)?;
/// assert!((margin.alpha - 2.0).abs() < 1e-3);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// Same as [`crate::response::h_infinity`]; [`Error::NotHurwitz`], [`Error::NotSchur`] for a loop that is not stable.
///
/// # Panics
///
/// If there is no such channel.
pub fn disk_margin(closed: &Loop, at: Point, channel: Option<usize>) -> Result<DiskMargin, Error> {
    let mut system = closed.sensitivity(at);
    if let Some(channel) = channel {
        system = system.path(channel, channel);
    }
    margin_of(KnownResponse::new(system)?)
}

/// The disk margin of the channels whose S is `sensitivity`: (S - T) / 2 = S - I / 2, and D of S is I.
pub(super) fn margin_of(sensitivity: KnownResponse) -> Result<DiskMargin, Error> {
    let half = &sensitivity.system.d * 0.5;
    let peak = peak_of(&sensitivity.with_direct(half))?;
    Ok(DiskMargin {
        alpha: 1.0 / peak.value,
        certified: 1.0 / peak.certified,
        frequency: peak.frequency,
    })
}

/// Computes the peak over frequency of the structured singular value for a diagonal of complex numbers.
///
/// For [`Loop::sensitivity`] it is the peak of S in the units of the channels that make it least.
/// Method and gap: see [`disk_margin`].
///
/// # Errors
///
/// Same as [`crate::response::h_infinity`]; [`Error::Shape`] for a system that is not square.
pub fn scaled_peak(system: &StateSpace) -> Result<ScaledPeak, Error> {
    check::square("D", &system.d)?;
    peak_of(&KnownResponse::new(system.clone())?)
}

/// Same as [`scaled_peak`], for a system whose response is known at some frequencies.
pub(super) fn peak_of(response: &KnownResponse) -> Result<ScaledPeak, Error> {
    scaled_below(response, &norm_of(response, WIDTH)?)
}

/// The scaled peak of a response with the H-infinity norm `norm`.
pub(super) fn scaled_below(
    response: &KnownResponse,
    norm: &HInfinity,
) -> Result<ScaledPeak, Error> {
    if response.system.d.nrows() == 1 {
        let (value, frequency) = (norm.lower, norm.frequency);
        return Ok(ScaledPeak { value, frequency, certified: norm.upper });
    }
    let Largest { value, frequency, scaling } = Largest::search(response)?;
    let scaled = response.scaled(&scaling.map(f64::exp));
    let certified = norm.upper.min(norm_of(&scaled, WIDTH)?.upper).max(value);
    Ok(ScaledPeak { value, frequency, certified })
}

/// The largest structured singular value that was found so far.
struct Largest {
    value: f64,
    frequency: f64,
    /// Logarithms of the scaling at this value.
    scaling: DVector<f64>,
}

impl Largest {
    /// Searches the frequencies of a [`Sweep`], then between the neighbours of the best one.
    fn search(response: &KnownResponse) -> Result<Self, Error> {
        let (sweep, system) = (Sweep::new(response)?, &response.system);
        let scaling = DVector::zeros(system.d.nrows());
        let mut best = Self { value: 0.0, frequency: 0.0, scaling };
        if system.domain == Domain::Continuous {
            best.evaluate(&to_complex(&system.d), f64::INFINITY, 0.0)?;
        }
        let bounds = sweep.values.iter().map(balanced_norm).collect::<Result<Vec<_>, _>>()?;
        let mut order: Vec<usize> = (0..bounds.len()).collect();
        order.sort_by(|i, j| bounds[*j].total_cmp(&bounds[*i]));
        let mut place = None;
        for at in order {
            if bounds[at] <= best.value {
                break;
            }
            let before = best.value;
            if best.evaluate(&sweep.values[at], sweep.frequencies[at], before)? > before {
                place = Some(at);
            }
        }
        if let Some(at) = place {
            best.refine(&sweep, at)?;
        }
        Ok(best)
    }

    /// Searches by thirds between the neighbours of a frequency of the sweep.
    fn refine(&mut self, sweep: &Sweep<'_>, at: usize) -> Result<(), Error> {
        let last = sweep.frequencies.len() - 1;
        let mut low = sweep.frequencies[at.saturating_sub(1)];
        let mut high = sweep.frequencies[(at + 1).min(last)];
        for _ in 0..REFINEMENTS {
            let third = (high - low) / 3.0;
            let (first, second) = (low + third, high - third);
            let left = self.evaluate(&sweep.response.gain(first)?, first, 0.0)?;
            let right = self.evaluate(&sweep.response.gain(second)?, second, 0.0)?;
            // The values differ by no more than their precision.
            if left.min(right) >= (1.0 - FLAT) * self.value {
                break;
            }
            if left < right {
                low = first;
            } else {
                high = second;
            }
        }
        Ok(())
    }

    /// Returns the bound at a frequency, and stores it if it is the largest so far. The search for the scaling ends as
    /// soon as the bound is at most `enough`, as in [`scaled_norm_above`].
    fn evaluate(
        &mut self,
        gain: &DMatrix<Complex<f64>>,
        frequency: f64,
        enough: f64,
    ) -> Result<f64, Error> {
        let (value, scaling) = scaled_norm_above(gain, enough)?;
        if value > self.value {
            *self = Self { value, frequency, scaling };
        }
        Ok(value)
    }
}
