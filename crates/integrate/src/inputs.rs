//! Continuous floating-point inputs that follow polynomials of time within a step.

use fmu_description::{Causality, Kind, ModelDescription, Variability};
use serde::{Deserialize, Serialize};
use slave::{CallError, Failure, ModelExchange};

/// The largest order of a derivative.
pub(crate) const ORDERS: usize = 3;

/// The continuous floating-point inputs of an instance.
#[derive(Default)]
pub(crate) struct Inputs {
    /// The value references of the inputs, ascending.
    references: Vec<u32>,
    /// The start values of the inputs in the description; 0 without a start value.
    starts: Vec<f64>,
    pub(crate) tracks: Vec<Track>,
    /// The indices of the inputs with a derivative other than zero.
    moving: Vec<usize>,
    moving_references: Vec<u32>,
    moving_values: Vec<f64>,
}

/// The polynomial of one input: `value + sum(derivatives[k] (t - origin)^(k + 1) / (k + 1)!)`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Track {
    origin: f64,
    value: f64,
    derivatives: [f64; ORDERS],
}

impl Track {
    fn at(&self, time: f64) -> f64 {
        let distance = time - self.origin;
        let (mut value, mut factor) = (self.value, 1.0);
        for (derivative, order) in self.derivatives.iter().zip([1.0, 2.0, 3.0]) {
            factor *= distance / order;
            value += derivative * factor;
        }
        value
    }
}

impl Inputs {
    pub(crate) fn new(description: &ModelDescription) -> Self {
        let continuous = description.variables.iter().filter(|variable| {
            variable.causality == Causality::Input
                && variable.variability == Variability::Continuous
                && matches!(variable.kind, Kind::Real(_) | Kind::Float32(_))
        });
        let start = |kind: &Kind| match kind {
            Kind::Real(real) | Kind::Float32(real) => real.start.unwrap_or(0.0),
            _ => 0.0,
        };
        let mut all: Vec<_> =
            continuous.map(|variable| (variable.value_reference, start(&variable.kind))).collect();
        all.sort_by_key(|(reference, _)| *reference);
        all.dedup_by_key(|(reference, _)| *reference);
        let (references, starts): (Vec<u32>, Vec<f64>) = all.into_iter().unzip();
        let count = references.len();
        Self {
            references,
            starts,
            tracks: vec![Track::default(); count],
            moving: Vec::with_capacity(count),
            moving_references: Vec::with_capacity(count),
            moving_values: Vec::with_capacity(count),
        }
    }

    /// Reads the values at the start of the simulation; the derivatives are zero. An input whose value the FMU
    /// refuses to return has its start value.
    pub(crate) fn read(
        &mut self,
        instance: &mut dyn ModelExchange,
        time: f64,
    ) -> Result<(), CallError> {
        let inputs = self.references.iter().zip(&self.starts).zip(&mut self.tracks);
        for ((reference, start), track) in inputs {
            let mut value = [*start];
            match instance.get_real(&[*reference], &mut value) {
                Ok(()) => {}
                Err(error) if error.leaves_the_instance_usable() => value = [*start],
                Err(error) => return Err(error),
            }
            *track = Track { origin: time, value: value[0], derivatives: [0.0; ORDERS] };
        }
        Ok(())
    }

    fn find(&self, reference: u32) -> Option<usize> {
        self.references.binary_search(&reference).ok()
    }

    /// Whether all `references` are continuous inputs.
    pub(crate) fn contain(&self, references: &[u32]) -> bool {
        references.iter().all(|&reference| self.find(reference).is_some())
    }

    /// Records values set at `time`; their derivatives become zero. Ignores variables that are no continuous inputs.
    pub(crate) fn record(&mut self, time: f64, references: &[u32], values: &[f64]) {
        for (&reference, &value) in references.iter().zip(values) {
            if let Some(input) = self.find(reference) {
                self.tracks[input] = Track { origin: time, value, derivatives: [0.0; ORDERS] };
            }
        }
    }

    /// Records derivatives at `time`. If the polynomial has another origin, it moves to `time` and the other
    /// derivatives become zero. It is an error if a variable is no continuous input, or an order not 1 to 3.
    pub(crate) fn derive(
        &mut self,
        time: f64,
        references: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        for ((&reference, &order), &value) in references.iter().zip(orders).zip(values) {
            let place = usize::try_from(order).ok().and_then(|order| order.checked_sub(1));
            let place = place.filter(|&place| place < ORDERS);
            let (Some(input), Some(place)) = (self.find(reference), place) else {
                let what = format!(
                    "expected a continuous Real input and an order from 1 to {ORDERS}, found the \
                     value reference {reference} and the order {order}"
                );
                return Err(CallError {
                    function: "fmi2SetRealInputDerivatives",
                    failure: Failure::InvalidAnswer(what),
                    messages: Vec::new(),
                });
            };
            let track = &mut self.tracks[input];
            if track.origin.total_cmp(&time).is_ne() {
                *track = Track { origin: time, value: track.at(time), derivatives: [0.0; ORDERS] };
            }
            track.derivatives[place] = value;
        }
        Ok(())
    }

    /// Collects the inputs that change within the next communication step, for [`Inputs::apply`].
    pub(crate) fn prepare(&mut self) {
        self.moving.clear();
        self.moving_references.clear();
        self.moving_values.clear();
        for (input, track) in self.tracks.iter().enumerate() {
            if track.derivatives.iter().any(|derivative| *derivative != 0.0) {
                self.moving.push(input);
                self.moving_references.push(self.references[input]);
                self.moving_values.push(track.value);
            }
        }
    }

    /// Sets each input that varies in time to its value at `time`.
    pub(crate) fn apply(
        &mut self,
        instance: &mut dyn ModelExchange,
        time: f64,
    ) -> Result<(), CallError> {
        if self.moving.is_empty() {
            return Ok(());
        }
        for (value, &input) in self.moving_values.iter_mut().zip(&self.moving) {
            *value = self.tracks[input].at(time);
        }
        instance.set_real(&self.moving_references, &self.moving_values)
    }
}
