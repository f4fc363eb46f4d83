//! Connected Reals: values and derivatives of outputs over their last steps, and what inputs get.

use super::call;
use super::extrapolation::{Known, Polynomial};
use super::layout::{Layout, Refusal};
use super::pass::Pass;
use super::trace::Span;
pub(crate) use super::trace::Trace;
use crate::algorithm::{Algorithm, Coupling, Extrapolation, Method, StepControl};
use crate::error::SystemError;
use crate::fault::FaultChain;
use crate::system::{Port, System};
use slave::{Advance, CallError, Slave, StepResult};

/// Part of a step by which times may miss each other: their rounding.
const ROUNDING: f64 = 1e-9;

/// The connected Reals of a system.
#[derive(Debug)]
pub(crate) struct Reals {
    pub(super) layout: Layout,
    /// Faults by input; empty where there are none at all.
    pub(super) faults: Vec<Option<FaultChain>>,
    pub(super) extrapolation: Extrapolation,
    pub(super) sweep: Method,
    /// Every input is held and all slaves step together: the latest values are all it takes.
    pub(super) simple: bool,
    /// Some slaves make several steps at once.
    pub(super) several: bool,
    pub(crate) trace: Trace,
    /// Values of the outputs at the end of the step, assumed by an iteration.
    pub(super) assumed: Vec<f64>,
    pub(super) assumes: bool,
    /// What the inputs get.
    pub(super) values: Vec<f64>,
    pub(super) input_derivatives: Vec<f64>,
    /// For each output, whether its derivative has been reported as not finite.
    reported: Vec<bool>,
    pass: Pass,
}

impl Reals {
    pub(crate) fn new(system: &System, algorithm: &Algorithm, refusing: &[Refusal]) -> Self {
        let layout = Layout::new(system, algorithm, refusing);
        let (outputs, derivatives) = (layout.output_ports.len(), layout.output_derivatives);
        let trace = Trace {
            latest: vec![0.0; outputs],
            begin: vec![0.0; outputs],
            before: vec![0.0; outputs],
            earlier: vec![0.0; outputs],
            derivatives: vec![0.0; derivatives],
            begin_derivatives: vec![0.0; derivatives],
            spans: vec![Span::default(); system.slaves.len()],
        };
        let mut pass = Pass::default();
        for lane in &layout.port_maps {
            let sources = &layout.sources[lane.input_range.clone()];
            pass.add(&lane.inputs, sources, &lane.outputs);
        }
        Self {
            faults: Vec::new(),
            assumed: vec![0.0; outputs],
            assumes: false,
            pass,
            values: vec![0.0; layout.sources.len()],
            input_derivatives: vec![0.0; layout.input_derivatives],
            reported: vec![false; outputs],
            extrapolation: algorithm.extrapolation,
            sweep: algorithm.sweep,
            simple: algorithm.extrapolation == Extrapolation::Hold
                && algorithm.coupling == Coupling::Once
                && algorithm.control == StepControl::Fixed
                && algorithm.multiples.iter().all(|&multiple| multiple == 1),
            several: algorithm.multiples.iter().any(|&multiple| multiple != 1),
            layout,
            trace,
        }
    }

    /// The index of an output among [`Reals::outputs`], where it is connected.
    pub(crate) fn output(&self, port: Port) -> Option<usize> {
        self.layout.output(port)
    }

    /// The connected outputs.
    pub(crate) fn ports(&self) -> &[Port] {
        &self.layout.output_ports
    }

    /// Their values.
    pub(crate) fn outputs(&self) -> &[f64] {
        &self.trace.latest
    }

    /// As [`Reals::outputs`], to be changed by an iteration.
    pub(crate) fn outputs_mut(&mut self) -> &mut [f64] {
        &mut self.trace.latest
    }

    /// The outputs of type Integer that go to Reals: port, and index among the outputs.
    pub(crate) fn integer_sources(&self) -> &[(Port, usize)] {
        &self.layout.from_integers
    }

    /// The slave will step from `time` over `size`: what was its end is its begin.
    pub(crate) fn shift(&mut self, slave: usize, time: f64, size: f64) {
        if self.simple {
            return;
        }
        let trace = &mut self.trace;
        let lane = &self.layout.port_maps[slave];
        let (range, derived) = (lane.output_range.clone(), lane.output_derivative_range.clone());
        let span = &mut trace.spans[slave];
        (span.earlier_size, span.last_size) = (span.last_size, span.size);
        (span.begin, span.size, span.stepped) = (time, size, false);
        trace.earlier[range.clone()].copy_from_slice(&trace.before[range.clone()]);
        trace.before[range.clone()].copy_from_slice(&trace.begin[range.clone()]);
        trace.begin[range.clone()].copy_from_slice(&trace.latest[range]);
        let derivatives = &trace.derivatives[derived.clone()];
        trace.begin_derivatives[derived].copy_from_slice(derivatives);
        for &(port, output) in &self.layout.from_integers {
            if port.slave == slave {
                trace.begin[output] = trace.latest[output];
            }
        }
    }

    /// Values of now have no past: the extrapolation of inputs begins anew.
    pub(crate) fn forget(&mut self) {
        let trace = &mut self.trace;
        for past in [&mut trace.begin, &mut trace.before, &mut trace.earlier] {
            past.copy_from_slice(&trace.latest);
        }
        for span in &mut trace.spans {
            span.forget();
        }
    }

    /// The inputs of `slave` for a step from `time` over `size`.
    pub(crate) fn gather(&mut self, slave: usize, time: f64, size: f64) {
        let range = self.layout.port_maps[slave].input_range.clone();
        if self.simple {
            let sources = &self.layout.sources[range.clone()];
            for (value, &source) in self.values[range.clone()].iter_mut().zip(sources) {
                *value = self.trace.latest[source as usize];
            }
            if !self.layout.plain[slave] {
                for k in range {
                    self.values[k] =
                        self.layout.factors[k] * self.values[k] + self.layout.offsets[k];
                }
            }
            return;
        }
        let begin = range.start;
        for k in range {
            self.place(slave, k, k - begin, time, size);
        }
    }

    /// Value and derivatives of the input at index `k`, the slave's input number `position`.
    fn place(&mut self, slave: usize, k: usize, position: usize, time: f64, size: f64) {
        let (layout, lane) = (&self.layout, &self.layout.port_maps[slave]);
        let source = layout.sources[k] as usize;
        let known = self.is_known(slave, source, time + size);
        let seen_at = self.seen_at(slave, layout.owners[source] as usize, time, size);
        let ahead = self.several && known && self.extrapolation == Extrapolation::Hold;
        let extrapolation = if layout.held[k] || ahead {
            Polynomial::held(self.value_at(source, seen_at))
        } else {
            self.polynomial(slave, source, (time, size))
        };
        let value = match (lane.input_order, self.extrapolation) {
            (0, Extrapolation::Limited) if known => extrapolation.end(size),
            (0, Extrapolation::Linear | Extrapolation::Quadratic) => extrapolation.mean(size),
            _ => extrapolation.value,
        };
        let factor = layout.factors[k];
        let value = if layout.plain[slave] { value } else { factor * value + layout.offsets[k] };
        let mut given = Polynomial {
            value,
            slope: factor * extrapolation.slope,
            curvature: factor * extrapolation.curvature,
        };
        if let Some(Some(fault)) = self.faults.get(k) {
            given = if lane.input_order > 0 {
                let [value, slope, curvature] =
                    fault.apply_derivatives(time, [value, given.slope, given.curvature]);
                Polynomial { value, slope, curvature }
            } else {
                let at_end = known
                    && matches!(self.extrapolation, Extrapolation::Hold | Extrapolation::Limited);
                Polynomial::held(fault.apply(if at_end { time + size } else { time }, value))
            };
        }
        let (count, first) = (lane.inputs.len(), lane.input_derivative_range.start + position);
        let order = lane.input_order;
        self.values[k] = given.value;
        if order > 0 {
            self.input_derivatives[first] = given.slope;
        }
        if order > 1 {
            self.input_derivatives[first + count] = given.curvature;
        }
    }

    /// Whether `slave` gets what the slave `source` reached in the current step, once that has stepped:
    /// in Jacobi's method a function does, at the `end` of its step, where the source's ends by then.
    pub(super) fn sees_end(&self, slave: usize, source: usize, end: f64) -> bool {
        let span = &self.trace.spans[source];
        let is_there = || span.begin + span.size <= end + ROUNDING * span.size;
        self.sweep == Method::GaussSeidel || (self.layout.functions[slave] && is_there())
    }

    /// Whether the source of that output has stepped beyond the begin of the current step, for a
    /// `slave` that steps to `end`.
    fn is_known(&self, slave: usize, output: usize, end: f64) -> bool {
        let source = self.layout.owners[output] as usize;
        self.assumes || (self.trace.spans[source].stepped && self.sees_end(slave, source, end))
    }

    /// What is known of an output over the last step of its slave.
    pub(super) fn known(&self, output: usize, span: &Span) -> Known {
        let (layout, trace) = (&self.layout, &self.trace);
        let derivative = |place: Option<u32>| place.map(|k| trace.begin_derivatives[k as usize]);
        Known {
            earlier: trace.earlier[output],
            before: trace.before[output],
            begin: trace.begin[output],
            end: if self.assumes && !(span.stepped && self.sweep == Method::GaussSeidel) {
                self.assumed[output]
            } else {
                trace.latest[output]
            },
            slope: derivative(layout.slopes[output]),
            curvature: derivative(layout.curvatures[output]),
            earlier_size: span.earlier_size,
            last_size: span.last_size,
            size: span.size,
        }
    }

    /// The extrapolation of an output from `time` on.
    fn polynomial(&self, slave: usize, output: usize, (time, size): (f64, f64)) -> Polynomial {
        let (layout, trace) = (&self.layout, &self.trace);
        let span = &trace.spans[layout.owners[output] as usize];
        let known = self.known(output, span);
        let extrapolation = if self.is_known(slave, output, time + size) {
            known.interpolated(self.extrapolation)
        } else {
            known.extrapolated(self.extrapolation)
        };
        extrapolation.later(time - span.begin)
    }

    /// Sets the gathered inputs of `slave`, steps it, reads its outputs.
    #[inline]
    pub(crate) fn advance(
        &mut self,
        slave: usize,
        instance: &mut dyn Slave,
        span: (f64, f64),
        never_back: bool,
    ) -> Result<StepResult, CallError> {
        let done = instance.advance(&mut self.step(slave, span, never_back))?;
        self.trace.spans[slave].stepped = true;
        Ok(done)
    }

    /// The step of `slave` with its gathered inputs.
    #[inline]
    pub(super) fn step(&mut self, slave: usize, span: (f64, f64), never_back: bool) -> Advance<'_> {
        let lane = &self.layout.port_maps[slave];
        let trace = &mut self.trace;
        let inputs =
            (&self.values[..], &self.input_derivatives[lane.input_derivative_range.clone()]);
        let outputs = (
            &mut trace.latest[lane.output_range.clone()],
            &mut trace.derivatives[lane.output_derivative_range.clone()],
        );
        lane.step(inputs, span, never_back, outputs)
    }

    /// Whether [`Reals::pass`] does all that a sweep of Jacobi's method takes.
    pub(crate) fn passes(&self) -> bool {
        self.simple
            && self.sweep == Method::Jacobi
            && self.layout.plain.iter().all(|plain| *plain)
            && !self.layout.functions.contains(&true)
            && self.layout.from_integers.is_empty()
    }

    /// A sweep of all slaves, see [`Pass::run`]; those that stopped on the way.
    #[inline]
    pub(crate) fn pass(
        &mut self,
        system: &mut System,
        (time, size): (f64, f64),
        never_back: bool,
    ) -> Result<&mut Vec<(usize, StepResult)>, SystemError> {
        let latest = &mut self.trace.latest;
        let done = self.pass.run(&mut system.slaves, latest, (time, size), never_back);
        done.map_err(|(slave, source)| call(&system.slaves[slave].0, time, source))
    }

    /// Whether all outputs are finite numbers.
    #[inline]
    pub(crate) fn is_finite(&self) -> bool {
        all_finite(&self.trace.latest)
    }

    /// Reads the connected outputs of a slave and their derivatives.
    pub(crate) fn read(&mut self, slave: usize, instance: &mut dyn Slave) -> Result<(), CallError> {
        let (lane, trace) = (&self.layout.port_maps[slave], &mut self.trace);
        if !lane.outputs.is_empty() {
            instance.get_real(&lane.outputs, &mut trace.latest[lane.output_range.clone()])?;
        }
        if lane.derived_outputs.is_empty() {
            return Ok(());
        }
        let derivatives = &mut trace.derivatives[lane.output_derivative_range.clone()];
        instance.get_output_derivatives(&lane.derived_outputs, &lane.output_orders, derivatives)
    }

    /// The input of a slave that a transformation or a fault gives a value that is not finite.
    #[inline]
    pub(crate) fn input_not_finite(&self, slave: usize) -> Option<(Port, f64)> {
        if self.layout.plain[slave] && self.faults.is_empty() {
            return None;
        }
        let range = self.layout.port_maps[slave].input_range.clone();
        let found = range.into_iter().find(|&k| !self.values[k].is_finite())?;
        Some((self.layout.input_ports[found], self.values[found]))
    }

    /// The output of a slave whose value is not finite.
    #[inline]
    pub(crate) fn not_finite(&self, slave: usize) -> Option<(Port, f64)> {
        let range = self.layout.port_maps[slave].output_range.clone();
        let values = &self.trace.latest[range.clone()];
        if all_finite(values) {
            return None;
        }
        let position = values.iter().position(|value| !value.is_finite())?;
        Some((self.layout.output_ports[range.start + position], values[position]))
    }

    /// Whether all derivatives of a slave's outputs are finite. Connections whose derivatives are
    /// not are held: see [`Known::extrapolated`].
    #[inline]
    pub(crate) fn derivatives_are_finite(&self, slave: usize) -> bool {
        let range = self.layout.port_maps[slave].output_derivative_range.clone();
        all_finite(&self.trace.derivatives[range])
    }

    /// An output of a slave whose derivative is not finite and has not been reported before.
    #[cold]
    pub(crate) fn report_derivative(&mut self, slave: usize) -> Option<(Port, f64)> {
        for output in self.layout.port_maps[slave].output_range.clone() {
            let places = [self.layout.slopes[output], self.layout.curvatures[output]];
            let derivatives = places.into_iter().flatten();
            let mut derivatives = derivatives.map(|place| self.trace.derivatives[place as usize]);
            let Some(value) = derivatives.find(|value| !value.is_finite()) else { continue };
            if !std::mem::replace(&mut self.reported[output], true) {
                return Some((self.layout.output_ports[output], value));
            }
        }
        None
    }
}

/// Whether all values are numbers and finite: zero times any other is not zero.
#[inline]
fn all_finite(values: &[f64]) -> bool {
    let mut sums = [0.0; 4];
    let chunks = values.chunks_exact(4);
    let rest: f64 = chunks.remainder().iter().map(|value| 0.0 * value).sum();
    for chunk in chunks {
        for (sum, value) in sums.iter_mut().zip(chunk) {
            *sum += 0.0 * value;
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest == 0.0
}
