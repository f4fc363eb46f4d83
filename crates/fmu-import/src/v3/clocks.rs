//! Clocks: input clocks based on time tick in the slave, triggered ones when the master says so; ticks of
//! output clocks are kept until the next step (FMI 3.0.2, section 2.2.8).

use std::collections::HashMap;

use fmu_description::{Causality, ClockType, IntervalVariability, Kind, ModelDescription};

use super::access::refused;
use super::plan::Run;
use crate::library::v3::Component;
use slave::CallError;

/// Part of an interval below which a difference of times is rounding.
const ROUNDING: f64 = 1e-9;
/// `fmi3IntervalChanged`.
const CHANGED: i32 = 2;

/// An input clock that ticks at times.
#[derive(Clone, Debug)]
struct TimedClock {
    reference: u32,
    attributes: ClockType,
    /// Interval and time of the first tick in s, and number of ticks so far, if it is periodic.
    interval: f64,
    first: f64,
    ticks: u64,
    /// Time of the next tick in s, if it is known.
    next: Option<f64>,
}

/// The clocks of an instance.
#[derive(Clone, Debug, Default)]
pub(super) struct Clocks {
    timed: Vec<TimedClock>,
    /// Triggered input clocks.
    triggered: Vec<u32>,
    outputs: Vec<u32>,
    /// The clocks that ticked in the last step.
    ticked: HashMap<u32, bool>,
    /// Triggered input clocks that tick at the start of the next step.
    requested: Vec<u32>,
    flags: Vec<u8>,
}

/// Returns the value of a time stated in s or as a counter.
fn seconds(decimal: Option<f64>, counter: Option<u64>, resolution: Option<u64>) -> Option<f64> {
    #[expect(clippy::cast_precision_loss, reason = "the nearest number")]
    let fraction = |(counter, resolution): (u64, u64)| counter as f64 / resolution as f64;
    decimal.or(counter.zip(resolution).map(fraction))
}

impl TimedClock {
    fn is_periodic(&self) -> bool {
        use IntervalVariability::{Constant, Fixed, Tunable};
        matches!(self.attributes.interval_variability, Constant | Fixed | Tunable)
    }

    fn is_due(&self, time: f64) -> bool {
        self.next.is_some_and(|next| next <= time + ROUNDING * self.interval.max(time.abs()))
    }
}

impl Clocks {
    pub(super) fn new(description: &ModelDescription) -> Self {
        let mut clocks = Self::default();
        for variable in &description.variables {
            let (Kind::Clock(attributes), None) = (&variable.kind, &variable.alias_of) else {
                continue;
            };
            let reference = variable.value_reference;
            clocks.ticked.insert(reference, false);
            match (variable.causality, attributes.interval_variability) {
                (Causality::Input, IntervalVariability::Triggered) => {
                    clocks.triggered.push(reference);
                }
                (Causality::Input, _) => clocks.timed.push(TimedClock {
                    reference,
                    attributes: attributes.clone(),
                    interval: 0.0,
                    first: 0.0,
                    ticks: 0,
                    next: None,
                }),
                _ => clocks.outputs.push(reference),
            }
        }
        clocks
    }

    /// Determines the first ticks, in Initialization Mode.
    pub(super) fn start(&mut self, component: &mut Component, start: f64) -> Result<(), CallError> {
        for clock in &mut self.timed {
            let own = &clock.attributes;
            let stated = seconds(own.interval_decimal, own.interval_counter, own.resolution);
            let shift = seconds(own.shift_decimal, own.shift_counter, own.resolution);
            if !clock.is_periodic() {
                let (interval, qualifier) = component.get_interval(clock.reference)?;
                clock.next = (qualifier == CHANGED).then_some(start + interval);
                continue;
            }
            let shift = match (stated, shift) {
                (Some(_), shift) => shift.unwrap_or(0.0),
                (None, Some(shift)) => shift,
                (None, None) => match component.get_shift(clock.reference) {
                    Err(error) if !error.leaves_the_instance_usable() => return Err(error),
                    shift => shift.unwrap_or(0.0),
                },
            };
            let interval = match stated {
                Some(interval) => interval,
                None => component.get_interval(clock.reference)?.0,
            };
            if !(interval > 0.0 && interval.is_finite() && shift >= 0.0 && shift.is_finite()) {
                let what = format!(
                    "gives the clock with the value reference {} the interval {interval} s and the \
                     shift {shift} s, expected a positive interval and a shift of at least 0",
                    clock.reference
                );
                return Err(refused("fmi3GetIntervalDecimal", what));
            }
            (clock.interval, clock.first, clock.ticks) = (interval, start + shift, 0);
            clock.next = Some(clock.first);
        }
        Ok(())
    }

    /// Forgets the ticks of the last step.
    pub(super) fn begin_step(&mut self) {
        for ticked in self.ticked.values_mut() {
            *ticked = false;
        }
    }

    /// Returns the time of the next tick in s.
    pub(super) fn next(&self) -> Option<f64> {
        self.timed.iter().filter_map(|clock| clock.next).reduce(f64::min)
    }

    /// Whether a clock ticks at `time`, or is requested to tick.
    pub(super) fn is_due(&self, time: f64) -> bool {
        !self.requested.is_empty() || self.timed.iter().any(|clock| clock.is_due(time))
    }

    /// Moves the clocks that tick at `time` to their next ticks; returns their value references.
    pub(super) fn tick(&mut self, time: f64) -> Vec<u32> {
        let mut active = std::mem::take(&mut self.requested);
        for clock in self.timed.iter_mut().filter(|clock| clock.is_due(time)) {
            active.push(clock.reference);
            clock.ticks += 1;
            clock.next = clock.is_periodic().then(|| {
                // From the count, so that rounding does not add up.
                #[expect(clippy::cast_precision_loss, reason = "fewer than 2^53 ticks")]
                let ticks = clock.ticks as f64;
                clock.first + ticks * clock.interval
            });
        }
        for reference in &active {
            self.ticked.insert(*reference, true);
        }
        active
    }

    /// Asks which output clocks are active, in Event Mode before the discrete states are updated.
    pub(super) fn read_outputs(&mut self, component: &mut Component) -> Result<(), CallError> {
        if self.outputs.is_empty() {
            return Ok(());
        }
        self.flags.resize(self.outputs.len(), 0);
        component.get_clock(&self.outputs, &mut self.flags)?;
        for (reference, flag) in self.outputs.iter().zip(&self.flags) {
            if *flag != 0 {
                self.ticked.insert(*reference, true);
            }
        }
        Ok(())
    }

    /// Asks for the intervals that an event at `time` may have changed; `active` ticked in it.
    pub(super) fn ask_intervals(
        &mut self,
        component: &mut Component,
        time: f64,
        active: &[u32],
    ) -> Result<(), CallError> {
        for clock in &mut self.timed {
            let ask = match clock.attributes.interval_variability {
                IntervalVariability::Countdown => true,
                IntervalVariability::Changing => active.contains(&clock.reference),
                _ => false,
            };
            if ask {
                let (interval, qualifier) = component.get_interval(clock.reference)?;
                if qualifier == CHANGED {
                    clock.next = Some(time + interval);
                }
            }
        }
        Ok(())
    }

    /// Stores in the buffer of a run which clocks ticked in the last step.
    pub(super) fn read(&self, run: &mut Run) {
        for (place, reference) in run.references.iter().enumerate() {
            let ticked = self.ticked.get(reference).copied().unwrap_or(false);
            run.buffer.put_integer(place, ticked.into());
        }
    }

    /// Makes the triggered input clocks of a run tick whose value is true.
    pub(super) fn request(&mut self, function: &'static str, run: &Run) -> Result<(), CallError> {
        for (place, reference) in run.references.iter().enumerate() {
            if run.buffer.integer(place) == Some(0) || self.requested.contains(reference) {
                continue;
            }
            if !self.triggered.contains(reference) {
                let what = format!(
                    "cannot make the clock with the value reference {reference} tick, expected a \
                     triggered input clock"
                );
                return Err(refused(function, what));
            }
            self.requested.push(*reference);
        }
        Ok(())
    }

    /// Returns the counters and times for a serialised state.
    pub(super) fn state(&self) -> Vec<(u64, f64)> {
        let state = |clock: &TimedClock| (clock.ticks, clock.next.unwrap_or(f64::NAN));
        self.timed.iter().map(state).collect()
    }

    /// Restores the counters and times of a serialised state.
    pub(super) fn restore(&mut self, state: &[(u64, f64)]) {
        for (clock, (ticks, next)) in self.timed.iter_mut().zip(state) {
            (clock.ticks, clock.next) = (*ticks, Some(*next).filter(|next| !next.is_nan()));
        }
    }

    /// Returns the number of clocks that tick at times.
    pub(super) fn timed(&self) -> usize {
        self.timed.len()
    }
}
