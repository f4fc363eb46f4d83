//! Clocks (FMI 3.0.2, section 2.2.8). The slave ticks the input clocks that are based on time; the master triggers the
//! triggered clocks. The ticks of a step are kept for the results until the next step.

use std::collections::HashMap;

use fmu_description::number::seconds as rounded;
use fmu_description::{Causality, ClockType, IntervalVariability, Kind, ModelDescription};
use serde::{Deserialize, Serialize};

use super::Instance;
use super::modes::Mode;
use super::plan::Run;
use crate::error::refused;
use crate::library::v3::Component;
use slave::CallError;

/// Tolerance for the next tick, relative to the interval or the time: a clock whose tick is nearer is already due.
const ROUNDING: f64 = 1e-9;
/// Upper limit of this tolerance in s, besides half of the interval; the tolerance is never below four units in the
/// last place of the time.
const MOST: f64 = 1e-6;
/// Largest number of ticks of an aperiodic clock in one event; further ticks occur in the next step.
const TICKS: usize = 100;
/// `fmi3IntervalChanged`.
const CHANGED: i32 = 2;

/// An input clock that ticks at known times. A serialised state has only the fields that change with time.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct TimedClock {
    #[serde(skip)]
    reference: u32,
    #[serde(skip)]
    attributes: ClockType,
    /// Interval in s; for an aperiodic clock the last interval.
    interval: f64,
    /// The interval as numerator and denominator, so that many ticks do not drift.
    #[serde(skip)]
    fraction: Option<(u64, u64)>,
    /// Time of the first tick in s, if the clock is periodic.
    first: f64,
    /// Number of ticks since `first`.
    ticks: u64,
    /// Time of the next tick in s; `None` if unknown.
    next: Option<f64>,
    /// Whether a warning about a forbidden interval was logged.
    #[serde(skip)]
    warned: bool,
}

/// The clocks of an instance. A serialised state has only the timed clocks and the ticks of the last step.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Clocks {
    timed: Vec<TimedClock>,
    /// Value references of the triggered input clocks.
    #[serde(skip)]
    triggered: Vec<u32>,
    #[serde(skip)]
    outputs: Vec<u32>,
    /// The clocks that tick now: from their activation to the next update of the discrete states.
    #[serde(skip)]
    active: Vec<u32>,
    /// The input clocks whose model partitions have to run.
    #[serde(skip)]
    partitions: Vec<u32>,
    /// The priorities of all clocks; the smallest number is the highest priority.
    #[serde(skip)]
    priorities: HashMap<u32, i64>,
    /// The input clocks that ticked in the present event.
    #[serde(skip)]
    event_ticks: Vec<u32>,
    /// The clocks that ticked in the last step, sorted.
    ticked: Vec<u32>,
    /// Triggered input clocks that tick at the start of the next step.
    #[serde(skip)]
    requested: Vec<u32>,
    /// Buffer for the values of the output clocks.
    #[serde(skip)]
    flags: Vec<u8>,
}

/// Returns a time that is stated in s or as a counter with its resolution; `None` if it is not stated.
fn seconds(decimal: Option<f64>, counter: Option<u64>, resolution: Option<u64>) -> Option<f64> {
    #[expect(clippy::cast_precision_loss, reason = "the nearest number")]
    let fraction = |(counter, resolution): (u64, u64)| counter as f64 / resolution as f64;
    decimal.or(counter.zip(resolution).map(fraction))
}

/// Returns a positive decimal number as numerator and denominator; `None` if it has too many digits.
fn fraction(decimal: f64) -> Option<(u64, u64)> {
    let text = decimal.to_string();
    let (whole, part) = text.split_once('.').unwrap_or((&text, ""));
    let denominator = 10_u64.checked_pow(u32::try_from(part.len()).ok()?)?;
    Some((format!("{whole}{part}").parse().ok()?, denominator))
}

impl TimedClock {
    /// Returns the time in s of the tick number `ticks`, from 0. The rounding error does not grow with `ticks`.
    #[expect(clippy::cast_precision_loss, reason = "the nearest number")]
    fn tick(&self, ticks: u64) -> f64 {
        let elapsed = match self.fraction {
            Some((numerator, denominator)) => {
                let (total, denominator) =
                    (u128::from(ticks) * u128::from(numerator), u128::from(denominator));
                (total / denominator) as f64 + (total % denominator) as f64 / denominator as f64
            }
            None => ticks as f64 * self.interval,
        };
        self.first + elapsed
    }

    fn set_interval(&mut self, interval: f64) {
        if interval.to_bits() != self.interval.to_bits() {
            (self.interval, self.fraction) = (interval, fraction(interval));
        }
    }

    fn is_periodic(&self) -> bool {
        use IntervalVariability::{Constant, Fixed, Tunable};
        matches!(self.attributes.interval_variability, Constant | Fixed | Tunable)
    }

    /// Returns the interval in s that the description states; `None` without a stated interval.
    fn stated_interval(&self) -> Option<f64> {
        let attributes = &self.attributes;
        seconds(attributes.interval_decimal, attributes.interval_counter, attributes.resolution)
    }

    /// Returns whether to ask the FMU for the interval in an event; `has_ticked`: whether the clock ticked in this
    /// event. Only the importer changes an interval that the description states.
    fn is_asked(&self, has_ticked: bool) -> bool {
        match self.attributes.interval_variability {
            IntervalVariability::Countdown => true,
            IntervalVariability::Changing => has_ticked,
            IntervalVariability::Tunable => has_ticked && self.stated_interval().is_none(),
            _ => false,
        }
    }

    /// Returns whether the clock has to tick at `time`. `ticks` are the clocks that ticked in the present event, in
    /// which a periodic clock ticks once, an aperiodic one at most [`TICKS`] times.
    fn is_due(&self, time: f64, ticks: &[u32]) -> bool {
        let largest = if self.interval > 0.0 { MOST.min(0.5 * self.interval) } else { MOST };
        let rounding = (ROUNDING * self.interval.max(time.abs())).min(largest);
        let rounding = rounding.max(4.0 * f64::EPSILON * time.abs());
        let most = if self.is_periodic() { 1 } else { TICKS };
        self.next.is_some_and(|next| next <= time + rounding) && self.count_in(ticks) < most
    }

    /// Returns how often the clock is among `ticks`.
    fn count_in(&self, ticks: &[u32]) -> usize {
        ticks.iter().filter(|tick| **tick == self.reference).count()
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
            clocks.priorities.insert(reference, attributes.priority.map_or(i64::MAX, i64::from));
            match (variable.causality, attributes.interval_variability) {
                (Causality::Input, IntervalVariability::Triggered) => {
                    clocks.triggered.push(reference);
                }
                (Causality::Input, _) => clocks.timed.push(TimedClock {
                    reference,
                    attributes: attributes.clone(),
                    ..TimedClock::default()
                }),
                _ => clocks.outputs.push(reference),
            }
        }
        clocks
    }

    /// Determines the first ticks, in Initialization Mode: asks the FMU for intervals that its description does not
    /// state, and for the shifts of these clocks that the description does not state. An interval that is not positive
    /// or a negative shift of a periodic clock is an error.
    pub(super) fn start(&mut self, component: &mut Component, start: f64) -> Result<(), CallError> {
        for clock in &mut self.timed {
            let (attributes, stated) = (&clock.attributes, clock.stated_interval());
            let shift =
                seconds(attributes.shift_decimal, attributes.shift_counter, attributes.resolution);
            if !clock.is_periodic() {
                let (interval, qualifier) = component.get_interval(clock.reference)?;
                clock.next = (qualifier == CHANGED).then_some(start + interval);
                clock.interval = interval;
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
                let source = stated.map_or("fmi3GetIntervalDecimal", |_| "modelDescription.xml");
                return Err(refused(source, what));
            }
            let counted = attributes
                .interval_counter
                .zip(attributes.resolution.filter(|resolution| *resolution > 0));
            clock.fraction = counted
                .filter(|_| attributes.interval_decimal.is_none())
                .or_else(|| fraction(interval));
            (clock.interval, clock.first, clock.ticks) = (interval, start + shift, 0);
            clock.next = Some(clock.first);
        }
        Ok(())
    }

    /// Forgets the ticks of the last step.
    pub(super) fn begin_step(&mut self) {
        self.ticked.clear();
    }

    /// Returns the time of the next tick in s, if one is known.
    pub(super) fn next(&self) -> Option<f64> {
        self.timed.iter().filter_map(|clock| clock.next).reduce(f64::min)
    }

    /// Returns whether a clock has to tick at `time`, or is requested to tick.
    pub(super) fn is_due(&self, time: f64) -> bool {
        let ticks = &self.event_ticks;
        !self.requested.is_empty() || self.timed.iter().any(|clock| clock.is_due(time, ticks))
    }

    /// Moves the clocks that are due at `time` to their next ticks. Returns the value references of the requested
    /// clocks, then of the moved ones.
    fn take_due(&mut self, time: f64) -> Vec<u32> {
        let (mut due, ticks) = (std::mem::take(&mut self.requested), &self.event_ticks);
        for clock in self.timed.iter_mut().filter(|clock| clock.is_due(time, ticks)) {
            due.push(clock.reference);
            clock.ticks += 1;
            // Computed from the number of ticks, so that rounding errors do not add up.
            clock.next = clock.is_periodic().then(|| clock.tick(clock.ticks));
        }
        due
    }

    fn begin_tick(&mut self, reference: u32) {
        if let Err(place) = self.ticked.binary_search(&reference) {
            self.ticked.insert(place, reference);
        }
        if !self.active.contains(&reference) {
            self.active.push(reference);
        }
    }

    /// Ends all ticks, after an update of the discrete states.
    pub(super) fn end_ticks(&mut self) {
        self.active.clear();
    }

    /// Ends the present event.
    pub(super) fn end_event(&mut self) {
        self.event_ticks.clear();
    }

    /// Returns and removes the clocks whose model partitions have to run, the highest priority first.
    pub(super) fn take_partitions(&mut self) -> Vec<u32> {
        let mut due = std::mem::take(&mut self.partitions);
        due.sort_by_key(|clock| self.priorities.get(clock).copied());
        due
    }

    /// Whether one of `clocks` ticks now.
    pub(super) fn is_active(&self, clocks: &[u32]) -> bool {
        self.active.iter().any(|active| clocks.contains(active))
    }

    /// Whether a clock ticks now.
    pub(super) fn any_active(&self) -> bool {
        !self.active.is_empty()
    }

    /// Asks which output clocks tick, in Event Mode before the discrete states are updated.
    pub(super) fn read_outputs(&mut self, component: &mut Component) -> Result<(), CallError> {
        if self.outputs.is_empty() {
            return Ok(());
        }
        self.flags.resize(self.outputs.len(), 0);
        component.get_clock(&self.outputs, &mut self.flags)?;
        for place in 0..self.outputs.len() {
            if self.flags[place] != 0 {
                self.begin_tick(self.outputs[place]);
            }
        }
        Ok(())
    }

    /// Asks for the intervals that an event at `time`, in s, may have changed, and moves the next ticks. Warns of the
    /// first forbidden interval of each clock.
    pub(super) fn ask_intervals(
        &mut self,
        component: &mut Component,
        time: f64,
    ) -> Result<(), CallError> {
        for clock in &mut self.timed {
            if clock.is_asked(self.event_ticks.contains(&clock.reference)) {
                let (interval, qualifier) = component.get_interval(clock.reference)?;
                if qualifier != CHANGED {
                    continue;
                }
                // A countdown of 0 s ends at once, at most `TICKS` times in an event.
                let periodic = clock.is_periodic();
                let positive = periodic || clock.count_in(&self.event_ticks) >= TICKS;
                let is_allowed = if positive { interval > 0.0 } else { interval >= 0.0 };
                if !is_allowed && !std::mem::replace(&mut clock.warned, true) {
                    let expected = if positive { "a positive one" } else { "at least 0 s" };
                    component.base.warn(&format!(
                        "fmi3GetIntervalDecimal gives the clock with the value reference {} the interval {interval} s \
                         at t = {} s, expected {expected}; its ticks are wrong",
                        clock.reference,
                        rounded(time)
                    ));
                }
                clock.next = Some(time + interval);
                if !periodic {
                    clock.interval = interval;
                } else if interval.to_bits() != clock.interval.to_bits() {
                    // A parameter has changed the interval: the present tick is the first of the new ones.
                    clock.set_interval(interval);
                    (clock.first, clock.ticks) = (time, 1);
                } else {
                    clock.next = Some(clock.tick(clock.ticks));
                }
            }
        }
        Ok(())
    }

    /// Stores in the buffer of a run which clocks tick at present (`now`), or have ticked in the last step.
    fn read(&self, run: &mut Run, now: bool) {
        for (place, reference) in run.references.iter().enumerate() {
            let ticks = if now { &self.active } else { &self.ticked };
            run.buffer.put_integer(place, ticks.contains(reference).into());
        }
    }

    /// Returns the clocks of a run whose value is true; an error if a variable of the run is no triggered input clock.
    fn triggered(&self, function: &'static str, run: &Run) -> Result<Vec<u32>, CallError> {
        let all = run.references.iter().enumerate();
        let set = all.filter(|(place, _)| run.buffer.integer(*place) != Some(0));
        let clocks: Vec<u32> = set.map(|(_, reference)| *reference).collect();
        match clocks.iter().find(|reference| !self.triggered.contains(reference)) {
            None => Ok(clocks),
            Some(reference) => {
                let what = format!(
                    "cannot make the clock with the value reference {reference} tick, expected a \
                     triggered input clock"
                );
                Err(refused(function, what))
            }
        }
    }

    /// Returns whether a serialised state fits the number and the references of these clocks.
    pub(super) fn fits(&self, saved: &Self) -> bool {
        saved.timed.len() == self.timed.len()
            && saved.ticked.iter().all(|reference| self.priorities.contains_key(reference))
    }

    /// Restores a serialised state; nothing ticks now.
    pub(super) fn restore(&mut self, saved: &Self) {
        for (clock, saved) in self.timed.iter_mut().zip(&saved.timed) {
            clock.set_interval(saved.interval);
            (clock.first, clock.ticks, clock.next) = (saved.first, saved.ticks, saved.next);
        }
        self.active.clear();
        self.partitions.clear();
        self.event_ticks.clear();
        self.requested.clear();
        self.ticked.clone_from(&saved.ticked);
    }
}

impl Instance {
    /// Makes the input clocks that are due tick.
    pub(super) fn tick(&mut self) -> Result<(), CallError> {
        if !self.state.clocks.is_due(self.state.time) {
            return Ok(());
        }
        let due = self.state.clocks.take_due(self.state.time);
        self.activate(&due)
    }

    /// Makes `clocks` tick: in Event Mode, with the values of their clocked inputs passed to the FMU; in scheduled
    /// execution, with their model partitions recorded to run.
    fn activate(&mut self, clocks: &[u32]) -> Result<(), CallError> {
        if self.is_scheduled() {
            self.state.clocks.partitions.extend(clocks);
        } else {
            self.component.activate_clocks(clocks)?;
        }
        for &reference in clocks {
            self.state.clocks.begin_tick(reference);
            self.state.clocks.event_ticks.push(reference);
        }
        if self.is_scheduled() { Ok(()) } else { self.set_clocked(clocks) }
    }

    /// Makes those triggered input clocks of a run tick whose value is true: now if the master handles the events and
    /// the initialization has ended, otherwise at the start of the next step.
    pub(super) fn let_tick(&mut self, function: &'static str, run: &Run) -> Result<(), CallError> {
        let mut clocks = self.state.clocks.triggered(function, run)?;
        if clocks.is_empty() {
            return Ok(());
        }
        if self.hands_over_events && self.state.mode.is_initialized() {
            self.enter_event()?;
            return self.activate(&clocks);
        }
        clocks.retain(|clock| !self.state.clocks.requested.contains(clock));
        self.state.clocks.requested.extend(clocks);
        Ok(())
    }

    /// Stores in the buffer of a run which clocks tick: now in Event Mode if the master handles the events, otherwise
    /// in the last step.
    pub(super) fn read_clocks(&mut self, run: &mut Run) -> Result<(), CallError> {
        let now = self.hands_over_events && self.state.mode == Mode::Event;
        if now {
            self.state.clocks.read_outputs(&mut self.component)?;
        }
        self.state.clocks.read(run, now);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clock(interval: f64, fraction: Option<(u64, u64)>) -> TimedClock {
        let attributes = ClockType::default();
        TimedClock { reference: 1, attributes, interval, fraction, ..TimedClock::default() }
    }

    /// With intervals rounded to `f64`, the times would be 333333.3333333333 s and 700000.0000000001 s.
    #[test]
    fn ten_million_ticks_do_not_drift() {
        let third = clock(1.0 / 30.0, Some((1, 30)));
        assert_eq!(third.tick(10_000_000).to_bits(), (1e7 / 30.0_f64).to_bits());
        let decimal = clock(0.07, fraction(0.07));
        assert_eq!(decimal.tick(10_000_000).to_bits(), 700_000.0_f64.to_bits());
        assert_eq!(decimal.tick(10_000_001).to_bits(), 700_000.07_f64.to_bits());
        assert_eq!(fraction(2.5), Some((25, 10)));
        assert_eq!(fraction(1e-30), None);
        assert_eq!(clock(1e-30, None).tick(4).to_bits(), 4e-30_f64.to_bits());
    }

    /// One unit in the last place of these times is 2.4e-7 s.
    #[test]
    fn in_seconds_since_1970_a_clock_is_due_at_its_tick_only() {
        let tick = 1.7e9 + 0.1;
        let clock = TimedClock { next: Some(tick), ..clock(0.1, Some((1, 10))) };
        assert!(clock.is_due(tick, &[]) && clock.is_due(tick - 2.4e-7, &[]));
        assert!(!clock.is_due(tick - 1e-4, &[]) && !clock.is_due(1.7e9, &[]));
    }

    /// The intervals are 1 us, which is 1e-9 of the time, and 0 s.
    #[test]
    fn an_event_ends_although_intervals_are_tiny_or_zero() {
        use IntervalVariability::{Constant, Countdown, Tunable};
        for (interval_variability, interval, expected) in
            [(Constant, 1e-6, 1), (Tunable, 0.0, 1), (Countdown, 1e-6, 1), (Countdown, 0.0, TICKS)]
        {
            let attributes = ClockType { interval_variability, ..ClockType::default() };
            let (first, next) = (1e3, Some(1e3));
            let clock = TimedClock { attributes, first, next, ..clock(interval, None) };
            let mut clocks = Clocks { timed: vec![clock], ..Clocks::default() };
            for _ in 0..2 * TICKS {
                let due = clocks.take_due(1e3);
                clocks.event_ticks.extend(due);
                clocks.timed[0].next.get_or_insert(1e3 + interval);
            }
            let ticks = clocks.event_ticks.len();
            assert_eq!(ticks, expected, "{interval_variability:?} {interval}");
            // The next event is a new one.
            clocks.end_event();
            assert_eq!(clocks.take_due(1e3 + interval), [1]);
        }
    }

    /// The table of clock types in section 2.2.8.2 of FMI 3.0.2.
    #[test]
    fn the_fmu_is_asked_in_events_for_intervals_that_it_may_change() {
        use IntervalVariability::{Changing, Constant, Countdown, Fixed, Tunable};
        let is_asked = |interval_variability, interval_decimal| {
            let attributes =
                ClockType { interval_variability, interval_decimal, ..ClockType::default() };
            let clock = TimedClock { attributes, ..TimedClock::default() };
            [false, true].map(|has_ticked| clock.is_asked(has_ticked))
        };
        assert_eq!(is_asked(Countdown, None), [true, true]);
        assert_eq!(is_asked(Changing, None), [false, true]);
        assert_eq!(is_asked(Tunable, None), [false, true]);
        assert_eq!(is_asked(Tunable, Some(0.1)), [false, false]);
        assert_eq!(is_asked(Fixed, None), [false, false]);
        assert_eq!(is_asked(Constant, Some(0.1)), [false, false]);
    }
}
