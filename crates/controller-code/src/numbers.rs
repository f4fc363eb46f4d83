//! A controller in numbers of any kind, for `aso_controller::sample`.

use aso_controller::design::Estimator;
use aso_controller::sample::{self, Number, Signals, State};

use super::controller::Controller;
use super::symbols::{Kind, Matrix, Vector};

/// The numbers of a controller, for the count of operations and the bound of rounding errors.
pub(super) struct Numbers<N> {
    is_current: bool,
    sample_time: N,
    /// The matrices that the controller states.
    matrices: Vec<Entries<N>>,
    filter: Vec<N>,
    /// The decay w of `u_t`; empty without a transfer.
    transfer: Vec<N>,
    /// rho and delta of a sliding-mode law; empty without one.
    bounds: [Vec<N>; 2],
    /// The operating point: states, commands, measurements, references.
    point: [Vec<N>; 4],
    /// A zero for each limit of the commands, because only the number of limits matters; empty without limits.
    limits: Vec<N>,
    /// The weights of two points of a schedule; none without one.
    weights: Option<[N; 2]>,
}

/// The entries of a matrix, row by row.
struct Entries<N> {
    matrix: Matrix,
    values: Vec<N>,
    is_scheduled: bool,
}

impl<N: Number> Numbers<N> {
    /// Converts the constants of a controller by `constant`, its operating point by `point`.
    pub(super) fn of(
        controller: &Controller,
        constant: impl Fn(f64) -> N,
        point: impl Fn(f64) -> N,
    ) -> Self {
        let entries = |matrix: Matrix| {
            let dense = matrix.of(controller)?;
            let rows = dense.row_iter().flat_map(|row| row.iter().copied().collect::<Vec<_>>());
            Some(Entries {
                matrix,
                values: rows.map(&constant).collect(),
                is_scheduled: controller.scheduled(matrix).is_some(),
            })
        };
        let list = |values: &[f64]| values.iter().copied().map(&constant).collect();
        let bounds = controller.sliding_mode.as_ref();
        let signals = [
            &controller.states,
            &controller.actuators,
            &controller.measurements,
            &controller.references,
        ];
        let limits = if controller.is_limited() { controller.actuators.len() } else { 0 };
        Self {
            is_current: controller.estimator == Estimator::Current,
            sample_time: constant(controller.sample_time),
            matrices: Matrix::ALL.into_iter().filter_map(entries).collect(),
            filter: list(controller.filter.as_deref().unwrap_or_default()),
            transfer: list(controller.transfer.as_slice()),
            bounds: [bounds.map(|law| &law.rho), bounds.map(|law| &law.delta)]
                .map(|values| values.map_or_else(Vec::new, |values| list(values))),
            point: signals
                .map(|signals| signals.iter().map(|signal| point(signal.operating)).collect()),
            limits: (0..limits).map(|_| constant(0.0)).collect(),
            weights: controller.schedule.as_ref().map(|_| [0.5, 0.5].map(constant)),
        }
    }

    /// A matrix; [`sample::Matrix::NONE`] if the controller does not state the matrix.
    pub(super) fn matrix(&self, matrix: Matrix) -> sample::Matrix<'_, N> {
        let entries = self.matrices.iter().find(|entries| entries.matrix == matrix);
        let Some(Entries { values, is_scheduled, .. }) = entries else {
            return sample::Matrix::NONE;
        };
        let matrix = sample::Matrix::new(values);
        match &self.weights {
            Some(weights) if *is_scheduled => matrix.towards(values, weights),
            _ => matrix,
        }
    }

    pub(super) fn design(&self) -> sample::Design<'_, N> {
        let [x_op, u_op, y_op, r_op] = &self.point;
        let [rho, delta] = &self.bounds;
        sample::Design {
            sample_time: &self.sample_time,
            is_current: self.is_current,
            a: self.matrix(Matrix::A),
            b: self.matrix(Matrix::B),
            c: self.matrix(Matrix::C),
            d: self.matrix(Matrix::D),
            f_a: self.matrix(Matrix::FA),
            a_f: self.matrix(Matrix::AF),
            p_f: self.matrix(Matrix::PF),
            k_x: self.matrix(Matrix::KX),
            k_f: self.matrix(Matrix::KF),
            l_x: self.matrix(Matrix::LX),
            l_f: self.matrix(Matrix::LF),
            h: self.matrix(Matrix::H),
            k_i: self.matrix(Matrix::KI),
            f_i: self.matrix(Matrix::FI),
            l_w: self.matrix(Matrix::LW),
            n_r: self.matrix(Matrix::NR),
            filter: &self.filter,
            transfer: &self.transfer,
            rho,
            delta,
            x_op,
            u_op,
            y_op,
            r_op,
            low: [&self.limits, &self.limits],
            high: [&self.limits, &self.limits],
        }
    }

    /// The filter of the residuals.
    pub(super) fn filter_of_residuals(&self) -> sample::detection::Filter<'_, N> {
        use Matrix::{ResidualA, ResidualBu, ResidualBy, ResidualC, ResidualDu, ResidualDy};
        sample::detection::Filter {
            state: [ResidualA, ResidualBu, ResidualBy].map(|matrix| self.matrix(matrix)),
            residual: [ResidualC, ResidualDu, ResidualDy].map(|matrix| self.matrix(matrix)),
        }
    }
}

macro_rules! signals {
    ($($name:ident $vector:ident,)*) => {
        /// The vectors of `sample::Signals` in their order.
        pub(super) const SIGNALS: [Vector; 17] = [$(Vector::$vector),*];

        impl<N: Number> Vectors<N> {
            pub(super) fn signals(&mut self) -> Signals<'_, N> {
                let [$($name),*] = &mut self.0;
                Signals { $($name),* }
            }
        }
    };
}

signals! {
    y Y,
    y_f YF,
    r R,
    e E,
    x_hat XHat,
    f_hat_i FHatI,
    f_hat FHat,
    u U,
    excess Excess,
    command Command,
    x_value XValue,
    f_value FValue,
    next_x_hat NextXHat,
    next_f_hat NextFHat,
    next_y_f NextYF,
    next_x_i NextXI,
    next_u_t NextUT,
}

/// The vectors of a sample.
pub(super) struct Vectors<N>([Vec<N>; 17]);

impl<N: Number> Vectors<N> {
    /// The vectors with all elements zero.
    pub(super) fn zero(controller: &Controller) -> Self {
        Self(SIGNALS.map(|vector| vec![N::zero(); vector.length(controller)]))
    }

    /// The elements of `vector`; empty if the vector is not part of `sample::Signals` or not part of the design.
    pub(super) fn get_mut(&mut self, vector: Vector) -> &mut [N] {
        let place = SIGNALS.iter().position(|signal| *signal == vector);
        place.and_then(|place| self.0.get_mut(place)).map_or(&mut [], |values| values)
    }
}

/// The state of a controller before a sample, and the inputs of the sample.
pub(super) struct Memory<N> {
    /// The stored vectors `x_hat`, `f_hat`, `y_f`, `x_i`, `u_t`, `u_before`, u.
    stored: [Vec<N>; 7],
    /// The measurements y and the references r.
    inputs: [Vec<N>; 2],
}

impl<N: Number> Memory<N> {
    /// Builds the memory from the numbers of each vector.
    pub(super) fn of(mut numbers: impl FnMut(Vector) -> Vec<N>) -> Self {
        use Vector::{
            Command, Measured, Referred, StoredFHat, StoredU, StoredUT, StoredXHat, StoredXI,
            StoredYF,
        };
        let stored = [StoredXHat, StoredFHat, StoredYF, StoredXI, StoredUT, StoredU, Command];
        Self { stored: stored.map(&mut numbers), inputs: [Measured, Referred].map(numbers) }
    }

    pub(super) fn state(&mut self) -> State<'_, N> {
        let [x_hat, f_hat, y_f, x_i, u_t, u_before, u] = &mut self.stored;
        let [y, r] = &self.inputs;
        State { x_hat, f_hat, y_f, x_i, u_t, u_before, u, y, r }
    }
}

impl Vector {
    /// The number of elements of the vector; 0 if the design does not have the vector.
    pub(super) fn length(self, controller: &Controller) -> usize {
        let is_stated = match self {
            Self::YF | Self::NextYF | Self::StoredYF => controller.filter.is_some(),
            Self::Excess => controller.has(Matrix::LW),
            Self::StoredU => controller.has(Matrix::D),
            Self::StoredUT | Self::NextUT => controller.transfer.is_some(),
            _ => true,
        };
        if is_stated { self.kind().count(controller) } else { 0 }
    }

    /// The vectors of `sample::Signals` that a design has.
    pub(super) fn of_sample(controller: &Controller) -> impl Iterator<Item = Self> {
        SIGNALS.into_iter().filter(|vector| vector.length(controller) > 0)
    }
}

impl Matrix {
    /// The matrices that a controller states.
    pub(super) fn all_stated(controller: &Controller) -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|matrix| controller.has(*matrix))
    }

    /// The matrices of `aso_controller::sample::Design`, without the filter of the residuals.
    pub(super) fn of_sample() -> impl Iterator<Item = Self> {
        let is_of_filter =
            |matrix: &Self| matches!(matrix.kinds()[0], Kind::ResidualState | Kind::Residual);
        Self::ALL.into_iter().filter(move |matrix| !is_of_filter(matrix))
    }
}
