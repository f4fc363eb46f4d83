//! Values on their way from outputs to inputs, in arrays laid out once: stepping allocates nothing.

use fmi2::description::Kind;

use crate::error::SystemError;
use crate::slave::CallError;
use crate::system::{Port, System};

/// The Real outputs of one slave that are connected, and their values over the current step.
#[derive(Default)]
struct Outputs {
    ports: Vec<Port>,
    references: Vec<u32>,
    ones: Vec<i32>,
    /// Values at the begin of the last step, of the current one, and at the last time read.
    before: Vec<f64>,
    begin: Vec<f64>,
    latest: Vec<f64>,
    /// Slopes at the last time read; zero where the slave gives none.
    slopes: Vec<f64>,
    gives_slopes: bool,
}

/// The Real inputs of one slave that are connected.
#[derive(Default)]
struct Inputs {
    /// Slave and position in its [`Outputs`].
    sources: Vec<(usize, usize)>,
    references: Vec<u32>,
    ones: Vec<i32>,
    values: Vec<f64>,
    slopes: Vec<f64>,
    takes_slopes: bool,
}

/// A connection of an Integer, Enumeration or Boolean variable.
struct Discrete {
    from: (usize, u32),
    to: (usize, u32),
    boolean: bool,
}

/// What a step takes for the course of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Course {
    /// The value at the begin of the step, held.
    Held,
    /// Value and slope at the begin of the step: the line through the source's values at begin and
    /// end where the source has been stepped, else the source's limited extrapolation.
    Sloped,
}

/// The connections of a system, ready to be carried out.
pub(crate) struct Exchange {
    outputs: Vec<Outputs>,
    inputs: Vec<Inputs>,
    discrete: Vec<Discrete>,
    /// Sizes of the last step and of the current one, in s.
    last_size: f64,
    size: f64,
}

impl Exchange {
    pub(crate) fn new(system: &System) -> Self {
        let mut exchange = Self {
            outputs: system.slaves.iter().map(|_| Outputs::default()).collect(),
            inputs: system.slaves.iter().map(|_| Inputs::default()).collect(),
            discrete: Vec::new(),
            last_size: 1.0,
            size: 1.0,
        };
        for (slave, (_, instance)) in system.slaves.iter().enumerate() {
            if let Some(flags) = &instance.description().co_simulation {
                exchange.outputs[slave].gives_slopes = flags.max_output_derivative_order > 0;
                exchange.inputs[slave].takes_slopes = flags.can_interpolate_inputs;
            }
        }
        for connection in &system.connections {
            let (from, to) = (system.variable(connection.from), system.variable(connection.to));
            let (source, target) = (connection.from.slave, connection.to.slave);
            if matches!(from.kind, Kind::Real(_)) {
                let position = exchange.outputs[source].add(connection.from, from.value_reference);
                exchange.inputs[target].add((source, position), to.value_reference);
            } else {
                exchange.discrete.push(Discrete {
                    from: (source, from.value_reference),
                    to: (target, to.value_reference),
                    boolean: matches!(from.kind, Kind::Boolean(_)),
                });
            }
        }
        exchange
    }

    /// Makes the values last read those of the begin of a step of `size` s.
    pub(crate) fn begin_step(&mut self, size: f64) {
        (self.last_size, self.size) = (self.size, size);
        for outputs in &mut self.outputs {
            outputs.before.copy_from_slice(&outputs.begin);
            outputs.begin.copy_from_slice(&outputs.latest);
        }
    }

    /// Reads the connected outputs of `slave`, slopes too where `course` can use them.
    pub(crate) fn read(
        &mut self,
        system: &mut System,
        slave: usize,
        course: Course,
        time: f64,
    ) -> Result<(), SystemError> {
        let outputs = &mut self.outputs[slave];
        if outputs.references.is_empty() {
            return Ok(());
        }
        let (name, instance) = &mut system.slaves[slave];
        instance
            .get_real(&outputs.references, &mut outputs.latest)
            .map_err(|source| call(name, time, source))?;
        if course == Course::Sloped && outputs.gives_slopes {
            instance
                .get_output_derivatives(&outputs.references, &outputs.ones, &mut outputs.slopes)
                .map_err(|source| call(name, time, source))?;
        }
        let both = outputs.latest.iter().chain(&outputs.slopes);
        if let Some(position) = both.clone().position(|value| !value.is_finite()) {
            let value = both.copied().nth(position).unwrap_or(f64::NAN);
            let name = system.name(outputs.ports[position % outputs.ports.len()]);
            return Err(SystemError::NotFinite { name, value, time });
        }
        Ok(())
    }

    /// Sets the connected inputs of `slave` for a step of `size` s. `stepped` says which slaves
    /// have made that step already.
    pub(crate) fn write(
        &mut self,
        system: &mut System,
        slave: usize,
        course: Course,
        (time, size): (f64, f64),
        stepped: &[bool],
    ) -> Result<(), SystemError> {
        let inputs = &mut self.inputs[slave];
        let sloped = course == Course::Sloped && inputs.takes_slopes;
        for (k, &(source, position)) in inputs.sources.iter().enumerate() {
            let outputs = &self.outputs[source];
            let (begin, latest) = (outputs.begin[position], outputs.latest[position]);
            (inputs.values[k], inputs.slopes[k]) = match (stepped[source], sloped) {
                (true, true) => (begin, (latest - begin) / size),
                (false, true) => (begin, outputs.extrapolation(position, self.last_size)),
                (_, false) => (latest, 0.0),
            };
        }
        let (name, instance) = &mut system.slaves[slave];
        if !inputs.references.is_empty() {
            instance
                .set_real(&inputs.references, &inputs.values)
                .map_err(|source| call(name, time, source))?;
            if sloped {
                instance
                    .set_input_derivatives(&inputs.references, &inputs.ones, &inputs.slopes)
                    .map_err(|source| call(name, time, source))?;
            }
        }
        self.write_discrete(system, slave, time)
    }

    /// In initialization mode: reads the outputs of all sources of `slave` and sets its inputs.
    pub(crate) fn write_initial(
        &mut self,
        system: &mut System,
        slave: usize,
        time: f64,
    ) -> Result<(), SystemError> {
        for position in 0..self.inputs[slave].sources.len() {
            let (source, _) = self.inputs[slave].sources[position];
            self.read(system, source, Course::Held, time)?;
        }
        let stepped = vec![false; system.slaves.len()];
        self.write(system, slave, Course::Held, (time, 0.0), &stepped)
    }

    fn write_discrete(
        &self,
        system: &mut System,
        slave: usize,
        time: f64,
    ) -> Result<(), SystemError> {
        for each in self.discrete.iter().filter(|each| each.to.0 == slave) {
            let mut value = [0];
            let (name, source) = &mut system.slaves[each.from.0];
            let from = [each.from.1];
            if each.boolean {
                source.get_boolean(&from, &mut value)
            } else {
                source.get_integer(&from, &mut value)
            }
            .map_err(|source| call(name, time, source))?;
            let (name, target) = &mut system.slaves[slave];
            let to = [each.to.1];
            if each.boolean {
                target.set_boolean(&to, &value)
            } else {
                target.set_integer(&to, &value)
            }
            .map_err(|source| call(name, time, source))?;
        }
        Ok(())
    }
}

impl Outputs {
    /// The slope with which an output is continued after a step of `last_size` s: of its derivative
    /// and its last difference quotient the smaller one, zero where their signs differ.
    fn extrapolation(&self, position: usize, last_size: f64) -> f64 {
        let quotient = (self.begin[position] - self.before[position]) / last_size;
        if !self.gives_slopes {
            return quotient;
        }
        let slope = self.slopes[position];
        if slope * quotient <= 0.0 {
            0.0
        } else if slope.abs() < quotient.abs() {
            slope
        } else {
            quotient
        }
    }

    /// Position of the output, added when it is new.
    fn add(&mut self, port: Port, reference: u32) -> usize {
        if let Some(position) = self.ports.iter().position(|known| *known == port) {
            return position;
        }
        self.ports.push(port);
        self.references.push(reference);
        self.ones.push(1);
        for values in [&mut self.before, &mut self.begin, &mut self.latest, &mut self.slopes] {
            values.push(0.0);
        }
        self.ports.len() - 1
    }
}

impl Inputs {
    fn add(&mut self, source: (usize, usize), reference: u32) {
        self.sources.push(source);
        self.references.push(reference);
        self.ones.push(1);
        self.values.push(0.0);
        self.slopes.push(0.0);
    }
}

/// The error of a call of `slave` at `time`.
pub(crate) fn call(slave: &str, time: f64, source: CallError) -> SystemError {
    SystemError::Call { slave: slave.to_owned(), time, source }
}
