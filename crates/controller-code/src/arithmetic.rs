//! The operations of a sample, and the memory of a controller in bytes.

use std::cell::Cell;
use std::ops::{Add, Div, Mul, Neg, Sub};

use aso_controller::sample::detection::{Cumulative, Decision, Window};
use aso_controller::sample::measurements::Validity;
use aso_controller::sample::reconfiguration::Stuck;
use aso_controller::sample::{self, Number};

use super::Precision;
use super::constants::Constants;
use super::controller::Controller;
use super::detection::{Detection, Method};
use super::numbers::{Memory as Stored, Numbers, Vectors};
use super::symbols::{Kind, Vector};
use super::tables::{operating_vectors, stored, tables};

/// The most operations of one sample: while compensating, with every command at its upper limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Arithmetic {
    pub(super) multiplications: usize,
    /// Additions and subtractions.
    pub(super) additions: usize,
    pub(super) comparisons: usize,
    pub(super) divisions: usize,
}

thread_local! {
    static COUNT: Cell<Arithmetic> = const { Cell::new(Arithmetic::NONE) };
}

/// A number that counts the operations on it. Every number is finite, and no number is below or above another.
#[derive(Clone, Copy)]
struct Counted;

impl Counted {
    fn count(add: impl Fn(&mut Arithmetic)) -> Self {
        let mut count = COUNT.get();
        add(&mut count);
        COUNT.set(count);
        Self
    }
}

macro_rules! counted {
    ($($operator:ident, $function:ident, $counter:ident;)*) => {
        $(impl $operator for Counted {
            type Output = Self;

            fn $function(self, _: Self) -> Self {
                Self::count(|count| count.$counter += 1)
            }
        })*
    };
}

counted! {
    Add, add, additions;
    Sub, sub, additions;
    Mul, mul, multiplications;
    Div, div, divisions;
}

impl Neg for Counted {
    type Output = Self;

    fn neg(self) -> Self {
        self
    }
}

impl Number for Counted {
    fn zero() -> Self {
        Self
    }

    fn largest() -> Self {
        Self
    }

    fn whole(_: u32) -> Self {
        Self
    }

    fn is_finite(&self) -> bool {
        Self::count(|count| count.comparisons += 2);
        true
    }

    fn is_below(&self, _: &Self) -> bool {
        Self::count(|count| count.comparisons += 1);
        false
    }

    fn is_above(&self, _: &Self) -> bool {
        Self::count(|count| count.comparisons += 1);
        false
    }
}

impl Arithmetic {
    const NONE: Self = Self { multiplications: 0, additions: 0, comparisons: 0, divisions: 0 };

    pub(super) fn of(controller: &Controller) -> Self {
        COUNT.set(Self::NONE);
        take_inputs(controller);
        take_sample(controller);
        for _ in &controller.losses {
            sample::lost_effectiveness(&Counted, &Counted, &Counted);
        }
        let mut all = COUNT.get();
        all.add_place(controller);
        all
    }

    /// Adds the operations of a schedule outside of the equations: the search of the grid interval, the operating
    /// point, and the limits as deviations from the operating point.
    fn add_place(&mut self, controller: &Controller) {
        let Some(schedule) = &controller.schedule else { return };
        let operating = operating_vectors(controller).into_iter();
        let vectors: usize = operating.map(|(vector, _)| vector.kind().count(controller)).sum();
        self.multiplications += 2 * vectors;
        // theta + 0, two differences and their quotient, 1 - part.
        self.additions += vectors + 4;
        self.divisions += 1;
        self.comparisons += schedule.points.len();
        if controller.is_limited() {
            self.additions += 2 * Kind::Actuator.count(controller);
        }
    }
}

/// Counts the checks of measurements, references and a scheduling variable: whether each is finite and in its range.
fn take_inputs(controller: &Controller) {
    let measured = vec![Counted; Kind::Measurement.count(controller)];
    if controller.checks_measurements() {
        let validity = Validity { low: &measured, high: &measured, most_held: &[] };
        validity.take(&measured, &mut measured.clone(), &mut []);
    } else {
        sample::all_finite(&measured);
    }
    let others = Kind::Reference.count(controller) + controller.schedule_inputs().len();
    sample::all_finite(&vec![Counted; others]);
}

/// Counts the longest sample: faults are compensated, the most actuators are gone, each window ends, each test gives an
/// alarm.
fn take_sample(controller: &Controller) {
    let numbers = Numbers::of(controller, |_| Counted, |_| Counted);
    let design = numbers.design();
    let mut memory = Stored::of(|vector| vec![Counted; vector.length(controller)]);
    let mut vectors = Vectors::zero(controller);
    let (mut state, mut signals) = (memory.state(), vectors.signals());
    signals.estimate(&design, &state, true);
    signals.set_commands(&design, &state, true);
    signals.set_command_values(&design);
    if let Some(reconfiguration) = &controller.reconfiguration {
        let actuators = controller.actuators.len();
        let gains = vec![Counted; actuators * actuators];
        let commands = vec![Counted; actuators];
        let most_gone = reconfiguration.most_gone();
        let without: Vec<_> = (0..actuators).map(|actuator| actuator < most_gone).collect();
        let stuck = Stuck {
            k_s: sample::Matrix::new(&gains),
            without: &without,
            gone: &vec![false; actuators],
            commands: [&commands, &commands],
        };
        signals.add_stuck(&design, &stuck);
        for _ in &reconfiguration.cases {
            // The loss and its limit.
            Counted.is_above(&Counted);
        }
    }
    signals.transfer(&design, &state, true, &[]);
    let is_finite = signals.are_values_finite();
    signals.limit(&design, &[]);
    signals.predict(&design, &state, true);
    if let Some(detection) = &controller.detection {
        let [k, rows] = [Kind::ResidualState, Kind::Residual].map(|kind| kind.count(controller));
        let (mut next, mut residuals) = (vec![Counted; k], vec![Counted; rows]);
        let inputs: [&[_]; 3] = [&vec![Counted; k], signals.u, signals.y];
        numbers.filter_of_residuals().advance(inputs, false, &mut next, &mut residuals);
        test(detection, &residuals);
    }
    signals.keep(&mut state, is_finite);
}

/// Counts the tests of the residuals and the times of the decision.
fn test(detection: &Detection, residuals: &[Counted]) {
    match detection.method {
        Method::Cusum => {
            let sums = [Counted; 2];
            for residual in residuals {
                Cumulative { sums, since: [0; 2] }.add_sample(residual, &Counted, 0);
            }
        }
        Method::Window => {
            let mut sums = residuals.to_vec();
            let mut terms = sums.iter_mut().zip(residuals);
            for test in &detection.tests {
                let terms = terms.by_ref().take(test.residuals);
                Window { since: 0, count: 0 }.add_sample(terms, 1, 0);
            }
        }
    }
    for _ in &detection.tests {
        // The statistic and its threshold.
        Counted.is_above(&Counted);
    }
    let decision = Decision { isolated: 1, ..Decision::default() };
    for sample in [decision.detected_at, decision.onset] {
        decision.time(sample, Counted);
    }
}

/// Bytes of a controller without its program code.
pub(super) struct Memory {
    /// Bytes of one instance.
    pub(super) state: usize,
    /// Bytes of the vectors on the stack during a sample.
    pub(super) stack: usize,
    /// Bytes of the constants.
    pub(super) constants: usize,
}

impl Memory {
    pub(super) fn of(controller: &Controller, precision: Precision) -> Self {
        let size = precision.size();
        let count = |vector: Vector| vector.kind().count(controller);
        let mut stored: usize = stored(controller).into_iter().map(count).sum();
        // The commands of the sample before.
        stored += Kind::Actuator.count(controller) + controller.schedule_inputs().len();
        let mut counters = usize::from(controller.has_counter());
        let held = if controller.limits_holds() { Kind::Measurement.count(controller) } else { 0 };
        counters += held + usize::from(controller.counts_since_rest());
        let mut flags = usize::from(controller.filter.is_some());
        if let Some(detection) = &controller.detection {
            stored += detection.stored();
            counters += detection.counters();
            flags += detection.flags();
        }
        if let Some(reconfiguration) = &controller.reconfiguration {
            let cases = reconfiguration.cases.len();
            stored += cases;
            counters += cases + 2;
            flags += Kind::Actuator.count(controller) + cases;
        }
        if controller.transfer.is_some() {
            // The last law: whether it compensates, its set of gains, the actuators that are gone.
            let is_reconfigurable = controller.reconfiguration.is_some();
            counters += 1 + usize::from(is_reconfigurable);
            flags += if is_reconfigurable { Kind::Actuator.count(controller) } else { 0 };
        }
        let losses = controller.losses.len();
        let detection = [Kind::ResidualState, Kind::Residual].map(|kind| kind.count(controller));
        let mut stack = losses + detection.into_iter().sum::<usize>();
        stack += Vector::of_sample(controller).map(count).sum::<usize>();
        if controller.schedule.is_some() {
            let operating = operating_vectors(controller);
            stack += operating.into_iter().map(|(vector, _)| count(vector)).sum::<usize>() + 2;
            let limits = if controller.is_limited() { 2 } else { 0 };
            stack += limits * Kind::Actuator.count(controller);
        }
        let integers = controller.detection.as_ref().map_or(0, Detection::integer_bytes);
        let [actuators, faults] = [Kind::Actuator, Kind::Fault].map(|kind| kind.count(controller));
        let of_cases = controller.reconfiguration.as_ref();
        let of_cases = of_cases.map_or(0, |cases| cases.integer_bytes(actuators, faults));
        // Each loss has its fault, its actuator and u_e^2.
        let of_losses = losses * (8 + size);
        let tables: usize = tables(controller).iter().map(Constants::count).sum();
        Self {
            state: (stored * size + 4 * counters + flags).next_multiple_of(size),
            stack: stack * size,
            constants: tables * size + integers + of_cases + of_losses + 4 * held,
        }
    }
}
