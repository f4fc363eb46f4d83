//! Connected Reals: values and derivatives of outputs over their last steps, and the resulting
//! inputs.

use super::extrapolation::{OutputHistory, Polynomial};
use super::layout::{Layout, Refusal};
use super::pass::Pass;
use super::trace::Span;
pub(crate) use super::trace::Trace;
use crate::algorithm::{Algorithm, Coupling, Extrapolation, Method, StepControl};
use crate::error::{SystemError, call};
use crate::fault::FaultChain;
use crate::system::{Port, System};
use slave::{CallError, CommunicationStep, Slave, StepRequest, StepResult, time_rounding};

/// The connected Reals of a system.
#[derive(Debug)]
pub(crate) struct Reals {
    pub(super) layout: Layout,
    /// The fault of each input; empty if there are no faults.
    pub(super) faults: Vec<Option<FaultChain>>,
    pub(super) extrapolation: Extrapolation,
    pub(super) method: Method,
    /// Whether inputs follow from the latest values only: all inputs are held, all slaves make equal
    /// steps, and there are no faults.
    pub(super) copies_latest: bool,
    /// Whether some slaves make steps of several communication steps.
    pub(super) multirate: bool,
    pub(crate) trace: Trace,
    /// Values of the outputs that an iteration assumes at the end of the step.
    pub(super) assumed: Vec<f64>,
    /// Whether the inputs interpolate to `assumed`.
    pub(super) assumes: bool,
    /// Values for the inputs.
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
            start: vec![0.0; outputs],
            before: vec![0.0; outputs],
            earlier: vec![0.0; outputs],
            derivatives: vec![0.0; derivatives],
            start_derivatives: vec![0.0; derivatives],
            spans: vec![Span::default(); system.slaves.len()],
        };
        let mut pass = Pass::default();
        for port_map in &layout.port_maps {
            let sources = &layout.sources[port_map.input_range.clone()];
            pass.add(&port_map.inputs, sources, &port_map.outputs);
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
            method: algorithm.method,
            copies_latest: algorithm.extrapolation == Extrapolation::Hold
                && algorithm.coupling == Coupling::Once
                && algorithm.control == StepControl::Fixed
                && algorithm.multiples.iter().all(|&multiple| multiple == 1),
            multirate: algorithm.multiples.iter().any(|&multiple| multiple != 1),
            layout,
            trace,
        }
    }

    /// Returns the index of an output in [`Reals::outputs`], if the output is connected.
    pub(crate) fn output(&self, port: Port) -> Option<usize> {
        self.layout.output(port)
    }

    /// Returns the ports of the connected outputs.
    pub(crate) fn ports(&self) -> &[Port] {
        &self.layout.output_ports
    }

    /// Returns the values of the connected outputs.
    pub(crate) fn outputs(&self) -> &[f64] {
        &self.trace.latest
    }

    /// Returns the values of the connected outputs, mutable for an iteration.
    pub(crate) fn outputs_mut(&mut self) -> &mut [f64] {
        &mut self.trace.latest
    }

    /// Prepares a step of `slave` from `time` over `size`: end values of the last step become start
    /// values.
    pub(crate) fn shift(&mut self, slave: usize, time: f64, size: f64) {
        if self.copies_latest {
            return;
        }
        let trace = &mut self.trace;
        let port_map = &self.layout.port_maps[slave];
        let (range, derived) =
            (port_map.output_range.clone(), port_map.output_derivative_range.clone());
        let span = &mut trace.spans[slave];
        (span.earlier_size, span.last_size) = (span.last_size, span.size);
        (span.start, span.size, span.stepped) = (time, size, false);
        for output in range {
            trace.earlier[output] = trace.before[output];
            trace.before[output] = trace.start[output];
            trace.start[output] = trace.latest[output];
        }
        for k in derived {
            trace.start_derivatives[k] = trace.derivatives[k];
        }
        for &(port, output) in &self.layout.from_integers {
            if port.slave == slave {
                trace.start[output] = trace.latest[output];
            }
        }
    }

    /// Clears the extrapolation history.
    pub(crate) fn clear_history(&mut self) {
        let trace = &mut self.trace;
        for past in [&mut trace.start, &mut trace.before, &mut trace.earlier] {
            past.copy_from_slice(&trace.latest);
        }
        for span in &mut trace.spans {
            span.clear_history();
        }
    }

    /// Computes the inputs of `slave` for a step from `time` over `size`.
    pub(crate) fn gather(&mut self, slave: usize, time: f64, size: f64) {
        let range = self.layout.port_maps[slave].input_range.clone();
        if self.copies_latest {
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
        let start = range.start;
        for k in range {
            self.gather_input(slave, k, k - start, time, size);
        }
    }

    /// Computes the value of one input of `slave` for a step from `time` over `size`, both in s, and its derivatives at
    /// `time` up to the order that the slave takes. `k` is the index of the input among the inputs of all slaves,
    /// `position` among the inputs of `slave`. Without derivatives, the value is the mean of a linear or quadratic
    /// polynomial over the step, or, for `Limited` with a known end value, this value.
    fn gather_input(&mut self, slave: usize, k: usize, position: usize, time: f64, size: f64) {
        let (layout, port_map) = (&self.layout, &self.layout.port_maps[slave]);
        let source = layout.sources[k] as usize;
        let end_known = self.is_known(slave, source, time + size);
        let source_time = self.source_time(slave, layout.owners[source] as usize, time, size);
        // With Hold, a source that has stepped further gives its value at `source_time`, not at its end.
        let may_be_ahead = self.multirate && end_known && self.extrapolation == Extrapolation::Hold;
        let extrapolation = if layout.held[k] || may_be_ahead {
            Polynomial::held(self.value_at(source, source_time))
        } else {
            self.polynomial(slave, source, time, size)
        };
        let value = match (port_map.input_order, self.extrapolation) {
            (0, Extrapolation::Limited) if end_known => extrapolation.end(size),
            (0, Extrapolation::Linear | Extrapolation::Quadratic) => extrapolation.mean(size),
            _ => extrapolation.value,
        };
        let factor = layout.factors[k];
        let value = if layout.plain[slave] { value } else { factor * value + layout.offsets[k] };
        let mut input = Polynomial {
            value,
            slope: factor * extrapolation.slope,
            curvature: factor * extrapolation.curvature,
        };
        if let Some(Some(fault)) = self.faults.get(k) {
            input = if port_map.input_order > 0 {
                let [value, slope, curvature] =
                    fault.apply_derivatives(time, [value, input.slope, input.curvature]);
                Polynomial { value, slope, curvature }
            } else {
                let at_end = end_known
                    && matches!(self.extrapolation, Extrapolation::Hold | Extrapolation::Limited);
                Polynomial::held(fault.apply(if at_end { time + size } else { time }, value))
            };
        }
        let (count, first) =
            (port_map.inputs.len(), port_map.input_derivative_range.start + position);
        let order = port_map.input_order;
        self.values[k] = input.value;
        if order > 0 {
            self.input_derivatives[first] = input.slope;
        }
        if order > 1 {
            self.input_derivatives[first + count] = input.curvature;
        }
    }

    /// Whether `slave` uses the value that `source` has reached in the current step. In Jacobi's method
    /// only a slave without states does so, if the step of the source ends by `end`.
    pub(super) fn uses_end_value(&self, slave: usize, source: usize, end: f64) -> bool {
        let span = &self.trace.spans[source];
        let is_there = || span.start + span.size <= end + time_rounding(end, span.size);
        self.method == Method::GaussSeidel || (self.layout.functions[slave] && is_there())
    }

    /// Whether a `slave` that steps to `end` knows the value of `output` at the end of the step of its source: the
    /// source has already stepped, or an iteration assumes the value.
    fn is_known(&self, slave: usize, output: usize, end: f64) -> bool {
        let source = self.layout.owners[output] as usize;
        self.assumes
            || (self.trace.spans[source].stepped && self.uses_end_value(slave, source, end))
    }

    /// Returns the known values of an output over the last step of its slave, `span`. During an iteration the value at
    /// the end is the assumed value, unless the slave has stepped in a Gauss-Seidel sweep.
    pub(super) fn history(&self, output: usize, span: &Span) -> OutputHistory {
        let (layout, trace) = (&self.layout, &self.trace);
        let derivative = |place: Option<u32>| place.map(|k| trace.start_derivatives[k as usize]);
        OutputHistory {
            earlier: trace.earlier[output],
            before: trace.before[output],
            start: trace.start[output],
            end: if self.assumes && !(span.stepped && self.method == Method::GaussSeidel) {
                self.assumed[output]
            } else {
                trace.latest[output]
            },
            slope: derivative(layout.slopes[output]),
            curvature: derivative(layout.curvatures[output]),
            jumps: layout.jumping[output],
            earlier_size: span.earlier_size,
            last_size: span.last_size,
            size: span.size,
        }
    }

    /// Returns the polynomial of an output from `time` on, for a step of `slave` over `size`.
    fn polynomial(&self, slave: usize, output: usize, time: f64, size: f64) -> Polynomial {
        let (layout, trace) = (&self.layout, &self.trace);
        let span = &trace.spans[layout.owners[output] as usize];
        let history = self.history(output, span);
        let extrapolation = if self.is_known(slave, output, time + size) {
            history.interpolated(self.extrapolation)
        } else {
            history.extrapolated(self.extrapolation)
        };
        extrapolation.later(time - span.start)
    }

    /// Builds the request of the step of `slave` with its gathered inputs.
    #[inline]
    pub(super) fn request(&mut self, slave: usize, step: CommunicationStep) -> StepRequest<'_> {
        let port_map = &self.layout.port_maps[slave];
        let trace = &mut self.trace;
        port_map.request(
            &self.values,
            &self.input_derivatives[port_map.input_derivative_range.clone()],
            step,
            &mut trace.latest[port_map.output_range.clone()],
            &mut trace.derivatives[port_map.output_derivative_range.clone()],
        )
    }

    /// Whether [`Reals::pass`] can make a complete sweep of Jacobi's method.
    pub(crate) fn passes(&self) -> bool {
        self.copies_latest
            && self.method == Method::Jacobi
            && self.layout.plain.iter().all(|plain| *plain)
            && !self.layout.functions.contains(&true)
            && self.layout.from_integers.is_empty()
    }

    /// Makes a sweep with [`Pass::run`] and returns its result.
    #[inline]
    pub(crate) fn pass(
        &mut self,
        system: &mut System,
        step: CommunicationStep,
    ) -> Result<&mut Vec<(usize, StepResult)>, SystemError> {
        let latest = &mut self.trace.latest;
        let done = self.pass.run(&mut system.slaves, latest, step);
        done.map_err(|(slave, source)| call(&system.slaves[slave].0, step.time, source))
    }

    /// Whether all outputs are finite numbers.
    #[inline]
    pub(crate) fn is_finite(&self) -> bool {
        all_finite(&self.trace.latest)
    }

    /// Reads the connected outputs of a slave and their derivatives.
    pub(crate) fn read(&mut self, slave: usize, instance: &mut dyn Slave) -> Result<(), CallError> {
        self.read_values(slave, instance)?;
        let port_map = &self.layout.port_maps[slave];
        if port_map.derived_outputs.is_empty() {
            return Ok(());
        }
        let derivatives = &mut self.trace.derivatives[port_map.output_derivative_range.clone()];
        instance.get_output_derivatives(
            &port_map.derived_outputs,
            &port_map.output_orders,
            derivatives,
        )
    }

    /// Returns an input of the slave that is not finite after transformation and fault, with its value; `None` if all
    /// are finite. Does not check the inputs if no connection to the slave has a transformation and no connected Real
    /// has a fault, because outputs are checked; an extrapolation that overflows is then not detected.
    #[inline]
    pub(crate) fn input_not_finite(&self, slave: usize) -> Option<(Port, f64)> {
        if self.layout.plain[slave] && self.faults.is_empty() {
            return None;
        }
        let range = self.layout.port_maps[slave].input_range.clone();
        let index = range.into_iter().find(|&k| !self.values[k].is_finite())?;
        Some((self.layout.input_ports[index], self.values[index]))
    }

    /// Returns an output of the slave whose value is not finite, with its value.
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

    /// Whether all output derivatives of a slave are finite. A connection whose derivative is not
    /// finite is held; see [`OutputHistory::extrapolated`].
    #[inline]
    pub(crate) fn derivatives_are_finite(&self, slave: usize) -> bool {
        let range = self.layout.port_maps[slave].output_derivative_range.clone();
        all_finite(&self.trace.derivatives[range])
    }

    /// Returns an output of the slave whose derivative is not finite, with the derivative, and marks it as
    /// reported; `None` if all such outputs have been reported.
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

/// Largest number of values that [`all_finite`] checks one after the other. A vector load would wait
/// for the values that an FMU has just stored one by one.
const FEW: usize = 16;

/// Whether all values are finite. Of many values, sums up the products with zero: only NaN and
/// infinity give a nonzero result.
#[inline]
fn all_finite(values: &[f64]) -> bool {
    if values.len() <= FEW {
        return values.iter().all(|value| value.is_finite());
    }
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
