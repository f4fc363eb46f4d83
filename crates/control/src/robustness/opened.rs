//! Peaks and margins at one point of a loop.

use super::channel::{self, ChannelMargins};
use super::delay::{delay_of, refine};
use super::disk::{self, DiskMargin, WIDTH};
use super::scaling::ScaledPeak;
use super::{Loop, Point};
use crate::response::{HInfinity, KnownResponse, norm_of};
use crate::{Error, StateSpace};

/// A loop opened at one point, with its eigenvalues and the responses S and T on a sweep of frequencies.
///
/// The two peaks are norms of S and T, with the errors of [`crate::response::h_infinity`]; each other method returns
/// the value of the function of the same name, with its errors and panics. All methods share one sweep of 60
/// frequencies for each decade and the resonances. It costs 4 n^2 (1 + m) multiplications for each frequency.
pub struct OpenedLoop {
    sensitivity: KnownResponse,
    complementary: KnownResponse,
    peak: HInfinity,
}

#[expect(clippy::missing_errors_doc, reason = "the type says: as the functions of the same names")]
impl OpenedLoop {
    /// Opens `closed` at `at`, with the errors of [`crate::response::h_infinity`].
    pub fn new(closed: &Loop, at: Point) -> Result<Self, Error> {
        let sensitivity = KnownResponse::new(closed.sensitivity(at))?.swept()?;
        // T = I - S: C of S with the opposite sign, and no D.
        let complementary = sensitivity.clone().negated();
        let complementary = complementary.with_direct(closed.complementary(at).d);
        let peak = norm_of(&sensitivity, WIDTH)?;
        Ok(Self { sensitivity, complementary, peak })
    }

    /// The H-infinity norm of S, with a relative width of 1e-4.
    #[must_use]
    pub fn sensitivity_peak(&self) -> HInfinity {
        self.peak
    }

    /// The H-infinity norm of T, with a relative width of 1e-4.
    pub fn complementary_peak(&self) -> Result<HInfinity, Error> {
        norm_of(&self.complementary, WIDTH)
    }

    /// [`super::scaled_peak`] of S.
    pub fn scaled_peak(&self) -> Result<ScaledPeak, Error> {
        disk::scaled_below(&self.sensitivity, &self.peak)
    }

    /// [`super::disk_margin`] of all channels, or of one.
    pub fn disk_margin(&self, channel: Option<usize>) -> Result<DiskMargin, Error> {
        disk::margin_of(match channel {
            Some(channel) => self.sensitivity.channel(channel),
            None => self.sensitivity.clone(),
        })
    }

    /// [`super::channel_margins`] of one channel.
    pub fn channel_margins(&self, channel: usize) -> Result<ChannelMargins, Error> {
        channel::margins_of(&self.complementary.channel(channel))
    }

    /// [`super::delay_margin`] of a loop opened at its input.
    pub fn delay_margin(&self) -> Result<f64, Error> {
        delay_of(&self.complementary)
    }

    /// [`super::sampled_delay_margin`] of a loop opened at its input; `plant`, continuous or sampled, and `controller`,
    /// sampled, form the loop.
    pub fn sampled_delay_margin(
        &self,
        plant: &StateSpace,
        controller: &StateSpace,
    ) -> Result<f64, Error> {
        refine(plant, controller, self.delay_margin()?)
    }
}
