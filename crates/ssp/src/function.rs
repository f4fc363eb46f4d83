//! Functions between FMUs: sums of connected values, evaluated at every communication point.

use fmu_description::{
    Causality, CoSimulation, Kind, ModelDescription, ModelStructure, RealType, ScalarVariable,
    Unknown, Variability,
};

use slave::{CallError, Failure, Slave, StepResult};

/// A function of connected values.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Function {
    /// `out = in[0] + in[1] + ...`, added in this order.
    Sum {
        /// Number of inputs.
        inputs: usize,
    },
    /// `out[j] = in[0][j] + in[1][j] + ...` for every component j of vectors.
    VectorSum {
        /// Number of vectors.
        inputs: usize,
        /// Number of components of each vector.
        dimension: usize,
    },
}

impl Function {
    /// Returns the number of inputs and the number of components of each.
    fn shape(&self) -> (usize, usize) {
        match self {
            Function::Sum { inputs } => (*inputs, 1),
            Function::VectorSum { inputs, dimension } => (*inputs, *dimension),
        }
    }

    /// Returns the name of the component `component` of the input `input`.
    #[must_use]
    pub fn input(&self, input: usize, component: usize) -> String {
        match self {
            Function::Sum { .. } => format!("in[{input}]"),
            Function::VectorSum { .. } => format!("in[{input}][{component}]"),
        }
    }

    /// Returns the name of the component `component` of the output.
    #[must_use]
    pub fn output(&self, component: usize) -> String {
        match self {
            Function::Sum { .. } => "out".to_owned(),
            Function::VectorSum { .. } => format!("out[{component}]"),
        }
    }

    /// Returns the names of all inputs, vector by vector.
    pub fn inputs(&self) -> impl Iterator<Item = String> {
        let (inputs, dimension) = self.shape();
        let places = (0..inputs).flat_map(move |input| (0..dimension).map(move |j| (input, j)));
        places.map(|(input, component)| self.input(input, component))
    }

    /// Returns the causality of the signal `name`; `None` if there is no such signal.
    #[must_use]
    pub fn signal(&self, name: &str) -> Option<Causality> {
        let (_, dimension) = self.shape();
        if (0..dimension).any(|component| self.output(component) == name) {
            return Some(Causality::Output);
        }
        self.inputs().any(|input| input == name).then_some(Causality::Input)
    }

    /// Returns the function as a slave.
    #[must_use]
    pub fn slave(&self) -> FunctionSlave {
        let (inputs, dimension) = self.shape();
        let count = inputs * dimension;
        FunctionSlave {
            description: self.description(),
            dimension,
            inputs: vec![Polynomial::default(); count],
            saved: Vec::new(),
        }
    }

    /// Returns the model description: the inputs, vector by vector, then the outputs; value
    /// references count from 0.
    fn description(&self) -> ModelDescription {
        let (inputs, dimension) = self.shape();
        let names = self.inputs().map(|name| (name, Causality::Input));
        let outputs = (0..dimension).map(|j| (self.output(j), Causality::Output));
        let variables = names.chain(outputs).enumerate();
        let rows = (0..dimension).map(|j| Unknown {
            index: number(inputs * dimension + j) + 1,
            dependencies: Some((0..inputs).map(|i| number(i * dimension + j) + 1).collect()),
            kinds: None,
        });
        let rows: Vec<Unknown> = rows.collect();
        let name = match self {
            Function::Sum { .. } => "Sum".to_owned(),
            Function::VectorSum { .. } => "VectorSum".to_owned(),
        };
        ModelDescription {
            fmi_version: "2.0".to_owned(),
            model_name: name.clone(),
            guid: format!("{name} of {inputs} x {dimension}"),
            co_simulation: Some(CoSimulation {
                model_identifier: name,
                can_handle_variable_communication_step_size: true,
                can_interpolate_inputs: true,
                can_get_and_set_fmu_state: true,
                can_serialize_fmu_state: true,
                provides_directional_derivative: true,
                ..CoSimulation::default()
            }),
            variables: variables
                .map(|(k, (name, causality))| variable(k, name, causality))
                .collect(),
            structure: ModelStructure {
                outputs: rows.clone(),
                initial_unknowns: rows,
                ..ModelStructure::default()
            },
            ..ModelDescription::default()
        }
    }
}

fn variable(reference: usize, name: String, causality: Causality) -> ScalarVariable {
    let start = (causality == Causality::Input).then_some(0.0);
    ScalarVariable {
        name,
        value_reference: number(reference),
        causality,
        variability: Variability::Continuous,
        kind: Kind::Real(RealType { start, ..RealType::default() }),
        ..ScalarVariable::default()
    }
}

/// Converts a position to a value reference or index.
fn number(position: usize) -> u32 {
    u32::try_from(position).unwrap_or(u32::MAX)
}

/// The value of an input at the communication point reached, and the derivatives set for the step from there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Polynomial {
    value: f64,
    slope: f64,
    curvature: f64,
}

/// A [`Function`] as a slave. It has no state: its outputs are a function of its inputs, and a step
/// extrapolates the inputs to the end of the step.
#[derive(Clone, Debug)]
pub struct FunctionSlave {
    description: ModelDescription,
    dimension: usize,
    inputs: Vec<Polynomial>,
    saved: Vec<Vec<Polynomial>>,
}

impl FunctionSlave {
    /// Returns the component `component` of the output at the communication point reached.
    fn sum(&self, component: usize) -> f64 {
        let inputs = self.inputs.iter().skip(component).step_by(self.dimension);
        // Without an initial 0, the sum of the single value -0 is -0.
        inputs.map(|input| input.value).reduce(|sum, value| sum + value).unwrap_or_default()
    }

    fn input(&mut self, reference: u32) -> Result<&mut Polynomial, CallError> {
        let input = self.inputs.get_mut(reference as usize);
        input.ok_or_else(|| unknown("fmi2SetReal", reference))
    }
}

#[cold]
fn unknown(function: &'static str, reference: u32) -> CallError {
    invalid(function, format!("got the unknown value reference {reference}"))
}

fn invalid(function: &'static str, sentence: String) -> CallError {
    CallError { function, failure: Failure::InvalidAnswer(sentence), messages: Vec::new() }
}

impl Slave for FunctionSlave {
    fn description(&self) -> &ModelDescription {
        &self.description
    }

    fn is_function(&self) -> bool {
        true
    }

    fn set_debug_logging(&mut self, _: bool) -> Result<(), CallError> {
        Ok(())
    }

    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        let count = self.inputs.len();
        for (&reference, value) in references.iter().zip(values) {
            let place = reference as usize;
            *value = match place.checked_sub(count) {
                None => self.inputs[place].value,
                Some(component) if component < self.dimension => self.sum(component),
                Some(_) => return Err(unknown("fmi2GetReal", reference)),
            };
        }
        Ok(())
    }

    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        for (&reference, &value) in references.iter().zip(values) {
            *self.input(reference)? = Polynomial { value, ..Polynomial::default() };
        }
        Ok(())
    }

    fn set_input_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        for ((&reference, order), &value) in references.iter().zip(orders).zip(values) {
            let input = self.input(reference)?;
            match order {
                1 => input.slope = value,
                _ => input.curvature = value,
            }
        }
        Ok(())
    }

    fn do_step(&mut self, _: f64, size: f64, _: bool) -> Result<StepResult, CallError> {
        for input in &mut self.inputs {
            let Polynomial { value, slope, curvature } = *input;
            if slope != 0.0 || curvature != 0.0 {
                input.value = value + size * (slope + 0.5 * size * curvature);
            }
        }
        Ok(StepResult::Whole)
    }

    fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        changes: &mut [f64],
    ) -> Result<(), CallError> {
        let count = self.inputs.len();
        for (&unknown, change) in unknowns.iter().zip(changes) {
            let component = (unknown as usize).wrapping_sub(count);
            let seeds = knowns.iter().zip(seed);
            let of_component = |&(&known, _): &(&u32, &f64)| {
                (known as usize) < count && known as usize % self.dimension == component
            };
            *change = seeds.filter(of_component).map(|(_, seed)| seed).sum();
        }
        Ok(())
    }

    fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
        if self.saved.len() <= slot {
            self.saved.resize(slot + 1, self.inputs.clone());
        }
        self.saved[slot].copy_from_slice(&self.inputs);
        Ok(())
    }

    fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
        if let Some(inputs) = self.saved.get(slot) {
            self.inputs.copy_from_slice(inputs);
        }
        Ok(())
    }

    fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        Ok(self.inputs.iter().flat_map(|input| input.value.to_le_bytes()).collect())
    }

    fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        let (values, rest) = bytes.as_chunks::<8>();
        if values.len() != self.inputs.len() || !rest.is_empty() {
            let sentence = format!("got {} bytes, expected {}", bytes.len(), 8 * self.inputs.len());
            return Err(invalid("fmi2DeSerializeFMUstate", sentence));
        }
        for (input, bytes) in self.inputs.iter_mut().zip(values) {
            let value = f64::from_le_bytes(*bytes);
            *input = Polynomial { value, ..Polynomial::default() };
        }
        Ok(())
    }
}
