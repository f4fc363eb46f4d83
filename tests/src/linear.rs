//! A slave for the tests of convergence: a linear system with an exact step.
#![expect(clippy::unwrap_used, reason = "for tests, which are to fail")]

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use fmu_description::ModelDescription;
use master::{CallError, Slave, StepResult};
use nalgebra::{DMatrix, DVector};

/// Value reference of the first output; those of inputs start at 0.
pub const OUTPUTS: u32 = 100;

/// A linear system `x' = A x + B u`, `y = C x + D u` with n states, m inputs and p outputs, from `x(0)`.
#[derive(Clone)]
pub struct Block {
    /// A, n x n.
    pub a: DMatrix<f64>,
    /// B, n x m.
    pub b: DMatrix<f64>,
    /// C, p x n.
    pub c: DMatrix<f64>,
    /// D, p x m.
    pub d: DMatrix<f64>,
    /// x(0).
    pub start: DVector<f64>,
}

impl Block {
    /// Creates a block from the rows of its matrices.
    #[must_use]
    pub fn new(a: &[&[f64]], b: &[&[f64]], c: &[&[f64]], d: &[&[f64]], start: &[f64]) -> Self {
        let of = |rows: &[&[f64]]| {
            DMatrix::from_fn(rows.len(), rows.first().map_or(0, |row| row.len()), |i, k| rows[i][k])
        };
        let start = DVector::from_column_slice(start);
        Self { a: of(a), b: of(b), c: of(c), d: of(d), start }
    }
}

/// The capabilities of a slave.
#[derive(Clone, Copy)]
pub struct Abilities {
    /// `canInterpolateInputs`.
    pub interpolates: bool,
    /// `maxOutputDerivativeOrder`.
    pub derivatives: u32,
    /// `providesDirectionalDerivative`.
    pub directional: bool,
}

/// All capabilities.
pub const ABLE: Abilities = Abilities { interpolates: true, derivatives: 2, directional: true };

/// State, inputs and derivatives of the inputs: x, u, u', u''.
type State = DVector<f64>;

/// A slave that simulates a [`Block`].
pub struct Linear {
    description: ModelDescription,
    block: Block,
    state: State,
    /// M in `z' = M z` for z = (x, u, u', u''). `propagator` is the last step size h and `exp(M h)`.
    matrix: DMatrix<f64>,
    propagator: (f64, DMatrix<f64>),
    slots: Vec<Option<State>>,
    steps: Arc<AtomicUsize>,
}

impl Linear {
    /// Creates a slave; `steps` counts its calls of `fmi2DoStep`.
    pub fn boxed(block: &Block, able: Abilities, steps: &Arc<AtomicUsize>) -> Box<Self> {
        let (n, m) = (block.a.nrows(), block.b.ncols());
        let mut matrix = DMatrix::zeros(n + 3 * m, n + 3 * m);
        matrix.view_mut((0, 0), (n, n)).copy_from(&block.a);
        matrix.view_mut((0, n), (n, m)).copy_from(&block.b);
        for k in 0..2 * m {
            matrix[(n + k, n + m + k)] = 1.0;
        }
        let mut state = State::zeros(n + 3 * m);
        state.rows_mut(0, n).copy_from(&block.start);
        Box::new(Self {
            description: description(block, able),
            block: block.clone(),
            state,
            matrix,
            propagator: (f64::NAN, DMatrix::zeros(0, 0)),
            slots: vec![None; 4],
            steps: Arc::clone(steps),
        })
    }

    fn split(&self) -> [DVector<f64>; 4] {
        let (n, m) = (self.block.a.nrows(), self.block.b.ncols());
        let part = |begin, count| self.state.rows(begin, count).into_owned();
        [part(0, n), part(n, m), part(n + m, m), part(n + 2 * m, m)]
    }

    fn position(&self, reference: u32, order: usize) -> usize {
        let (n, m) = (self.block.a.nrows(), self.block.b.ncols());
        n + order * m + reference as usize
    }

    /// The outputs y (order 0), y' (1) or y'' (2).
    fn output(&self, order: i32) -> DVector<f64> {
        let [x, u, slope, curvature] = self.split();
        let Block { a, b, c, d, .. } = &self.block;
        let rate = a * &x + b * &u;
        match order {
            0 => c * x + d * u,
            1 => c * rate + d * slope,
            _ => c * (a * rate + b * slope) + d * curvature,
        }
    }
}

fn description(block: &Block, able: Abilities) -> ModelDescription {
    let (m, p) = (block.b.ncols(), block.c.nrows());
    let variable = |name: String, reference: usize, role: &str, start: &str| {
        format!(
            r#"<ScalarVariable name="{name}" valueReference="{reference}" causality="{role}">
            <Real{start}/></ScalarVariable>"#
        )
    };
    let inputs = (0..m).map(|k| variable(format!("u{k}"), k, "input", r#" start="0""#));
    let first = OUTPUTS as usize;
    let outputs = (0..p).map(|k| variable(format!("y{k}"), first + k, "output", ""));
    let unknown = |row: usize| {
        let direct = (0..m).filter(|&k| block.d[(row, k)] != 0.0);
        let list: Vec<_> = direct.map(|k| (k + 1).to_string()).collect();
        format!(r#"<Unknown index="{}" dependencies="{}"/>"#, m + row + 1, list.join(" "))
    };
    let xml = format!(
        r#"<fmiModelDescription fmiVersion="2.0" modelName="Linear" guid="linear">
        <CoSimulation modelIdentifier="Linear" canInterpolateInputs="{}"
        maxOutputDerivativeOrder="{}" providesDirectionalDerivative="{}"
        canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"
        canSerializeFMUstate="true"/><ModelVariables>{}{}</ModelVariables>
        <ModelStructure><Outputs>{}</Outputs></ModelStructure></fmiModelDescription>"#,
        able.interpolates,
        able.derivatives,
        able.directional,
        inputs.collect::<String>(),
        outputs.collect::<String>(),
        (0..p).map(unknown).collect::<String>(),
    );
    ModelDescription::parse(xml).unwrap()
}

type Done = Result<(), CallError>;

impl Slave for Linear {
    fn description(&self) -> &ModelDescription {
        &self.description
    }

    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Done {
        let y = self.output(0);
        for (value, &reference) in values.iter_mut().zip(references) {
            let is_input = reference < OUTPUTS;
            *value = if is_input {
                self.state[self.position(reference, 0)]
            } else {
                y[(reference - OUTPUTS) as usize]
            };
        }
        Ok(())
    }

    /// Sets inputs; their derivatives are 0 until they are set.
    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Done {
        for (&value, &reference) in values.iter().zip(references) {
            for (order, value) in [value, 0.0, 0.0].into_iter().enumerate() {
                let position = self.position(reference, order);
                self.state[position] = value;
            }
        }
        Ok(())
    }

    fn set_input_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Done {
        assert!(self.description.co_simulation.as_ref().unwrap().can_interpolate_inputs);
        for ((&value, &reference), &order) in values.iter().zip(references).zip(orders) {
            let position = self.position(reference, usize::try_from(order).unwrap());
            self.state[position] = value;
        }
        Ok(())
    }

    fn get_output_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &mut [f64],
    ) -> Done {
        for ((value, &reference), &order) in values.iter_mut().zip(references).zip(orders) {
            *value = self.output(order)[(reference - OUTPUTS) as usize];
        }
        Ok(())
    }

    fn do_step(&mut self, _: f64, size: f64, _: bool) -> Result<StepResult, CallError> {
        if self.propagator.0.to_bits() != size.to_bits() {
            self.propagator = (size, (&self.matrix * size).exp());
        }
        self.state = &self.propagator.1 * &self.state;
        self.steps.fetch_add(1, Ordering::Relaxed);
        Ok(StepResult::Whole)
    }

    fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        changes: &mut [f64],
    ) -> Done {
        for (change, &unknown) in changes.iter_mut().zip(unknowns) {
            let row = (unknown - OUTPUTS) as usize;
            let parts = knowns.iter().zip(seed);
            *change = parts.map(|(&k, seed)| self.block.d[(row, k as usize)] * seed).sum();
        }
        Ok(())
    }

    fn save_state(&mut self, slot: usize) -> Done {
        self.slots[slot] = Some(self.state.clone());
        Ok(())
    }

    fn restore_state(&mut self, slot: usize) -> Done {
        self.state = self.slots[slot].clone().unwrap();
        Ok(())
    }

    fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        Ok(self.state.iter().flat_map(|value| value.to_le_bytes()).collect())
    }

    fn deserialize_state(&mut self, bytes: &[u8]) -> Done {
        for (value, bytes) in self.state.iter_mut().zip(bytes.chunks_exact(8)) {
            *value = f64::from_le_bytes(bytes.try_into().unwrap());
        }
        Ok(())
    }
}
