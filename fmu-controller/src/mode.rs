//! The mode: which of the linear systems is in force.

use serde::{Deserialize, Serialize};

use aso_controller::design::{Design, GainSet};

/// The switches of the equations: while the mode stays, all equations are linear.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Mode {
    /// Whether the commands compensate the faults: K_f f_hat is part of them.
    pub(crate) compensating: bool,
    /// Whether the faults are estimated; otherwise f_hat is held.
    pub(crate) estimating: bool,
    /// Bit j: channel j is at its lower limit.
    pub(crate) lower: u64,
    /// Bit j: channel j is at its upper limit.
    pub(crate) upper: u64,
    /// Bit j: the actuator of channel j is gone.
    pub(crate) gone: u64,
    /// Whether the gains of the fall-back are in force.
    fallen_back: bool,
}

/// Which law the commands follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Law {
    compensating: bool,
    gone: u64,
    fallen_back: bool,
}

impl Mode {
    /// The law of the commands that are not at a limit.
    pub(crate) fn law(self, design: &Design) -> Law {
        let Self { compensating, gone, fallen_back, .. } = self;
        let compensates = design.fallback.as_ref().is_none_or(|fallback| fallback.k_f.is_some());
        Law { compensating: compensating && (compensates || !fallen_back), gone, fallen_back }
    }

    /// The mode with no channel at a limit, without the actuators whose bits are set in `gone`. In the fall-back the
    /// faults are always estimated.
    pub(crate) fn free(compensating: bool, estimating: bool, gone: u64, fallen_back: bool) -> Self {
        let estimating = estimating || fallen_back;
        Self { compensating, estimating, lower: 0, upper: 0, gone, fallen_back }
    }

    /// Whether the actuator of channel `j` is gone.
    pub(crate) fn is_gone(self, j: usize) -> bool {
        self.gone & (1 << j) != 0
    }

    /// The channels whose actuators are gone, in their order.
    pub(crate) fn gone_channels(self) -> impl Iterator<Item = usize> {
        (0..64).filter(move |j| self.is_gone(*j))
    }

    /// The gains that replace the gains of the intact plant: of the fall-back, otherwise the gains without all
    /// actuators that are gone or, if the design states none, without the first of these actuators. `None` if the gains
    /// of the intact plant are in force.
    pub(crate) fn gains(self, design: &Design) -> Option<GainSet<'_>> {
        if self.fallen_back {
            return design.fallback.as_ref().map(GainSet::Fallback);
        }
        if self.gone == 0 {
            return None;
        }
        let first = 1 << self.gone.trailing_zeros();
        design.gains_without(self.gone).or_else(|| design.gains_without(first))
    }

    /// The part of the free command of channel `j` that stuck actuators cause, in deviations.
    pub(crate) fn stuck_part(self, design: &Design, j: usize) -> f64 {
        self.gains(design).map_or(0.0, |gains| {
            let stuck = gains.k_s(j).iter().zip(self.gone_channels());
            stuck.map(|(k_s, gone)| k_s * self.held_deviation(design, gone).unwrap_or(0.0)).sum()
        })
    }

    /// Whether channel `j` is at its lower (0) or upper (1) limit.
    pub(crate) fn is_at(self, side: usize, j: usize) -> bool {
        [self.lower, self.upper][side] & (1 << j) != 0
    }

    /// Whether channel `j` is at a limit or stuck, so that its command does not follow from z.
    pub(crate) fn is_limited(self, j: usize) -> bool {
        self.is_at(0, j) || self.is_at(1, j) || self.is_gone(j)
    }

    /// Whether the equations of both modes have the same matrices: the same channels are at a limit, lower or upper.
    pub(crate) fn has_the_matrices_of(self, other: Self) -> bool {
        let free = |mode: Self| Self { lower: mode.lower | mode.upper, upper: 0, ..mode };
        free(self) == free(other)
    }

    /// The command of channel `j` if it is at a limit or stuck; `None` for a free channel.
    pub(crate) fn held_command(self, design: &Design, j: usize) -> Option<f64> {
        if self.is_gone(j) {
            return design.without(j).map(|reconfiguration| reconfiguration.stuck_at);
        }
        let [low, high] = design.actuators[j].limits.filter(|_| self.is_limited(j))?;
        Some(if self.is_at(0, j) { low } else { high })
    }

    /// The command of [`Mode::held_command`] as a deviation from the operating point.
    pub(crate) fn held_deviation(self, design: &Design, j: usize) -> Option<f64> {
        Some(self.held_command(design, j)? - design.actuators[j].operating.unwrap_or(0.0))
    }

    /// Sets the deviations `u` of the channels that are at a limit or stuck; other channels are not changed.
    pub(crate) fn set_limited(self, design: &Design, u: &mut [f64]) {
        for (j, u) in u.iter_mut().enumerate() {
            if self.is_limited(j) {
                *u = self.held_deviation(design, j).unwrap_or(*u);
            }
        }
    }
}
