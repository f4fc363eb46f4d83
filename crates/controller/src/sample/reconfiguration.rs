//! The choice of gains by the actuators that are gone, and the commands of stuck ones.

use super::{Design, Matrix, Number, Signals};

/// An actuator that may be gone.
#[derive(Clone, Copy)]
pub struct Case<'a> {
    /// Its position.
    pub actuator: usize,
    /// The samples for which its loss must be above the limit before it counts as gone.
    pub samples: u32,
    /// For each fault whether its estimate restarts at 0 when the actuator fails or comes back.
    pub restarts: &'a [bool],
}

/// The estimated loss of an actuator that may be gone, and the decision about it.
pub struct Watch<'a, N> {
    /// Its estimated loss of effectiveness in the last sample.
    pub lost: &'a N,
    /// The number of samples in a row in which the loss was above the limit.
    pub above_for: &'a mut u32,
    /// Whether the loss has decided that the actuator is gone.
    pub decided: &'a mut bool,
}

/// The inputs of a sample about an actuator.
#[derive(Clone, Copy)]
pub struct Request {
    /// Whether the actuator is reported as gone.
    pub is_reported: bool,
    /// Whether the fall-back is requested: then losses decide nothing.
    pub is_fall_back: bool,
}

impl<N: Number> Watch<'_, N> {
    /// Decides in a sample whether the actuator is gone: it is reported, or its loss has been above `limit` for
    /// `case.samples` samples now or before.
    #[inline(always)]
    pub fn decide(&mut self, case: &Case<'_>, limit: &N, request: Request) -> bool {
        if !request.is_fall_back && self.lost.is_above(limit) {
            *self.decided |= *self.above_for >= case.samples;
            *self.above_for = self.above_for.saturating_add(1);
        } else {
            *self.above_for = 0;
        }
        request.is_reported || *self.decided
    }
}

impl Case<'_> {
    /// Notes whether the actuator is gone; when this changes, the estimates of its faults restart at 0.
    #[inline(always)]
    pub fn note<N: Number>(&self, is_gone: bool, gone: &mut [bool], f_hat: &mut [N]) {
        let Some(gone) = gone.get_mut(self.actuator) else { return };
        if is_gone != *gone {
            for (f_hat, restarts) in f_hat.iter_mut().zip(self.restarts) {
                if *restarts {
                    *f_hat = N::zero();
                }
            }
        }
        *gone = is_gone;
    }
}

/// The sets of gains.
#[derive(Clone, Copy)]
pub struct Sets<'a, const ACTUATORS: usize> {
    /// For each set of gains except the fall-back, the actuators that it does without. The first set is that of the
    /// intact plant.
    pub gone: &'a [[bool; ACTUATORS]],
    /// For each actuator the set of gains without it alone, 0 if there is none; empty with a fall-back.
    pub single: &'a [u32],
    /// The set of the fall-back, if there is one.
    pub fall_back: Option<u32>,
}

/// The set of gains in force.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Choice {
    /// The position of the set.
    pub set: u32,
    /// The number from 1 of the first actuator that is gone; 0 if there is none, -1 in the fall-back.
    pub reconfiguration: i32,
}

impl<const ACTUATORS: usize> Sets<'_, ACTUATORS> {
    /// Chooses the set of gains. With `is_fall_back` it is the fall-back, if there is one; otherwise the set without
    /// exactly the actuators that are gone. If there is no such set, it is the fall-back, or without a fall-back the
    /// set without the first of them.
    #[must_use]
    #[inline(always)]
    pub fn choose(&self, gone: &[bool; ACTUATORS], is_fall_back: bool) -> Choice {
        let first = (1..).zip(gone).find(|(_, gone)| **gone);
        let reconfiguration = first.map_or(0, |(number, _)| number);
        let sets = (0..).zip(self.gone).skip(1);
        let exact = sets.filter(|(_, without)| *without == gone).last();
        let exact = exact.filter(|_| reconfiguration > 0).map(|(set, _)| set);
        match self.fall_back {
            Some(set) if is_fall_back || (reconfiguration > 0 && exact.is_none()) => {
                Choice { set, reconfiguration: -1 }
            }
            _ => {
                let mut single = self.single.iter().zip(gone).filter(|(_, gone)| **gone);
                let single = single.next().map_or(0, |(set, _)| *set);
                Choice { set: exact.unwrap_or(single), reconfiguration }
            }
        }
    }
}

/// The gains from the commands of stuck actuators.
#[derive(Clone, Copy)]
pub struct Stuck<'a, N> {
    /// `K_s`, m x m.
    pub k_s: Matrix<'a, N>,
    /// For each actuator whether the gains in force do without it.
    pub without: &'a [bool],
    /// For each actuator whether it is gone.
    pub gone: &'a [bool],
    /// The commands of stuck actuators: as deviations, as values.
    pub commands: [&'a [N]; 2],
}

impl<N: Number> Signals<'_, N> {
    /// u = u + `K_s` `u_stuck`; the command of an actuator that is gone is the command at which it is stuck.
    #[inline(always)]
    pub fn add_stuck(&mut self, design: &Design<'_, N>, stuck: &Stuck<'_, N>) {
        let [deviations, values] = stuck.commands;
        let mut gains = stuck.k_s.entries.iter();
        let commands = self.u.iter_mut().zip(self.command.iter_mut()).zip(stuck.gone);
        let points = deviations.iter().zip(values).zip(design.u_op);
        for (((u, command), gone), ((deviation, value), u_op)) in commands.zip(points) {
            let terms = deviations.iter().zip(stuck.without).zip(&mut gains);
            let terms = terms.filter(|((_, without), _)| **without);
            let sum = terms.fold(-N::zero(), |sum, ((deviation, _), gain)| {
                sum + gain.clone() * deviation.clone()
            });
            if *gone {
                (*u, *command) = (deviation.clone(), value.clone());
            } else {
                *u = u.clone() + sum;
                *command = u.clone() + u_op.clone();
            }
        }
    }
}
