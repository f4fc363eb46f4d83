//! Proofs by one Lyapunov matrix for losses that vary.

use super::LossyLoop;
use crate::Error;
use crate::lmi::{Outcome, Region, RegionCertificate, certify_common, find_common};
use crate::stability::instability;

/// Relative accuracy of the largest certified factor and of the largest certified decay rate.
const WIDTH: f64 = 1e-2;
/// The smallest decay rate that is tried, relative to the slowest decay rate of a corner.
const SLOWEST: f64 = 1e-3;

/// A box of losses for which a loop is proven stable, also if they vary.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct CertifiedLoss {
    /// The factor by which the box is scaled; zero if no factor above 1 % of the largest tried factor is proven.
    pub factor: f64,
    /// The proof, if the factor is above zero.
    pub certificate: Option<RegionCertificate>,
}

impl LossyLoop {
    /// Computes the largest factor t for which one Lyapunov matrix proves that the loop is stable for
    /// all losses in the box from 0 to t times `largest`, also for losses that vary with time.
    ///
    /// `largest`: as in [`LossyLoop::constant_limit`]; `most`: the largest t that is tried, in practice the factor of
    /// `constant_limit`. `most` itself is tried first. Method: bisection, relative accuracy 1 %; every certificate is
    /// verified by eigenvalues ([`certify_common`]). The loop may be stable for a larger factor without such a proof.
    ///
    /// # Errors
    ///
    /// Same as [`certify_common`] and [`LossyLoop::constant_limit`].
    pub fn certified(&self, largest: &[f64], most: f64) -> Result<CertifiedLoss, Error> {
        self.check(largest)?;
        let prove = |factor: f64| {
            let scaled: Vec<f64> = largest.iter().map(|loss| loss * factor).collect();
            let certificate = find_common(&self.corners(&scaled), &Region::default(), self.domain)?;
            Ok::<_, Error>(certificate.is_some().then_some(CertifiedLoss { factor, certificate }))
        };
        if let Some(whole) = prove(most)? {
            return Ok(whole);
        }
        let (mut low, mut high) = (CertifiedLoss { factor: 0.0, certificate: None }, most);
        while high - low.factor > WIDTH * high && high >= WIDTH * most {
            let middle = 0.5 * (low.factor + high);
            match prove(middle)? {
                Some(proven) => low = proven,
                None => high = middle,
            }
        }
        Ok(low)
    }

    /// Proves with one Lyapunov matrix that `region` contains the eigenvalues of the loop for all losses
    /// from 0 to `largest`, also for losses that vary with time.
    ///
    /// # Errors
    ///
    /// Same as [`certify_common`].
    pub fn certificate(
        &self,
        largest: &[f64],
        region: &Region,
    ) -> Result<Outcome<RegionCertificate, usize>, Error> {
        certify_common(&self.corners(largest), region, self.domain)
    }

    /// The largest decay rate in 1/s that one Lyapunov matrix proves for all losses from 0 to `largest`, to 1 %; None
    /// if no rate above a thousandth of the slowest decay rate of a corner is proven.
    ///
    /// # Errors
    ///
    /// Same as [`certify_common`].
    pub fn decay(&self, largest: &[f64]) -> Result<Option<f64>, Error> {
        let corners = self.corners(largest);
        let mut slowest = f64::INFINITY;
        for corner in &corners {
            let excess = instability(corner, self.domain)?;
            slowest = slowest.min(self.domain.decay_rate(excess));
        }
        if slowest <= 0.0 {
            return Ok(None);
        }
        let proves = |rate: f64| {
            let region = Region { decay: Some(rate), ..Region::default() };
            Ok::<_, Error>(find_common(&corners, &region, self.domain)?.is_some())
        };
        let (mut low, mut high) = (0.0, slowest);
        while high - low > WIDTH * high && high > SLOWEST * slowest {
            let middle = 0.5 * (low + high);
            *(if proves(middle)? { &mut low } else { &mut high }) = middle;
        }
        Ok(Some(low).filter(|rate| *rate > 0.0))
    }
}
