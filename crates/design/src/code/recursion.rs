//! The recursion of a sampled controller as data: what both renderers write, what the arithmetic
//! counts, and what the analysis of rounding follows.
//!
//! The statements have the operations of the controller FMU in its order, zeros with a sign
//! included, so that double precision gives the bits of the FMU. `fmu-controller/src/sampled.rs` has the
//! equations.

use nalgebra::DMatrix;

use super::controller::{Controller, Estimator};

/// A vector of the recursion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Vector {
    /// The estimate for this sample from the measurements before it, as values.
    StoredXHat,
    StoredFHat,
    StoredYF,
    /// The measurements as values; the last finite ones.
    Measured,
    /// The operating point.
    XOp,
    UOp,
    YOp,
    /// Deviations from the operating point.
    Y,
    E,
    XHat,
    FHat,
    YF,
    U,
    /// The commands and estimates as values.
    Command,
    XValue,
    FValue,
    /// The estimate for the next sample, as values.
    NextXHat,
    NextFHat,
    NextYF,
}

/// A matrix of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Matrix {
    A,
    B,
    C,
    FA,
    AF,
    KX,
    KF,
    LX,
    LF,
}

/// What a statement adds, for element i.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Term {
    /// 0.0, which turns -0.0 into 0.0.
    Zero,
    /// Element i of a vector.
    Element(Vector),
    /// Row i of a matrix times a vector: the sum of the products, from -0.0 on.
    Product(Matrix, Vector),
    /// `W[i]` (`y[i]` - `y_f[i]`).
    FilterStep,
}

/// What follows the first term of a statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operation {
    Add(Term),
    Subtract(Term),
    /// Adds row i of a matrix times a vector, one product after the other.
    Accumulate(Matrix, Vector),
}

/// When a statement is carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum When {
    Always,
    Compensating,
    NotCompensating,
}

/// `target[i]` = `start`, then the operations in order, for all i.
pub(super) struct Statement {
    pub(super) when: When,
    /// The equation, for a reader.
    pub(super) equation: &'static str,
    pub(super) target: Vector,
    pub(super) start: Term,
    pub(super) operations: Vec<Operation>,
}

/// The statements up to the commands, and those after the limits.
pub(super) struct Recursion {
    pub(super) before_limits: Vec<Statement>,
    pub(super) after_limits: Vec<Statement>,
}

impl Recursion {
    pub(super) fn of(controller: &Controller) -> Self {
        let mut before_limits = deviations(controller);
        before_limits.extend(estimates(controller));
        before_limits.extend(commands());
        Self { before_limits, after_limits: predictions(controller) }
    }

    /// All statements in order.
    pub(super) fn statements(&self) -> impl Iterator<Item = &Statement> {
        self.before_limits.iter().chain(&self.after_limits)
    }
}

fn statement<const N: usize>(
    equation: &'static str,
    target: Vector,
    start: Term,
    operations: [Operation; N],
) -> Statement {
    Statement { when: When::Always, equation, target, start, operations: operations.to_vec() }
}

/// Signals as deviations from the operating point.
fn deviations(controller: &Controller) -> Vec<Statement> {
    use Operation::{Add, Subtract};
    use Term::{Element, Zero};
    let mut all = vec![
        statement(
            "deviations from the operating point",
            Vector::Y,
            Element(Vector::Measured),
            [Subtract(Element(Vector::YOp)), Add(Zero)],
        ),
        statement("", Vector::XHat, Element(Vector::StoredXHat), [Subtract(Element(Vector::XOp))]),
        statement("", Vector::FHat, Element(Vector::StoredFHat), []),
    ];
    if controller.filter.is_some() {
        let start = Element(Vector::StoredYF);
        all.push(statement("", Vector::YF, start, [Subtract(Element(Vector::YOp))]));
    }
    all
}

/// The innovation; with a current estimator, the correction of the estimate by it.
fn estimates(controller: &Controller) -> Vec<Statement> {
    use Operation::{Accumulate, Add, Subtract};
    use Term::{Element, Product, Zero};
    let (equation, observed) = match controller.filter {
        Some(_) => ("e = y_f - C x_hat", Vector::YF),
        None => ("e = y - C x_hat", Vector::Y),
    };
    let predicted = Subtract(Product(Matrix::C, Vector::XHat));
    let mut all = vec![statement(equation, Vector::E, Element(observed), [predicted])];
    if controller.estimator == Estimator::Prediction {
        all.push(statement("estimates", Vector::XValue, Element(Vector::StoredXHat), []));
        all.push(statement("", Vector::FValue, Element(Vector::StoredFHat), []));
        return all;
    }
    all.push(statement(
        "x_hat = x_hat + L_x e",
        Vector::XHat,
        Element(Vector::XHat),
        [Accumulate(Matrix::LX, Vector::E)],
    ));
    all.push(Statement {
        when: while_estimating(controller),
        ..statement(
            "f_hat = f_hat + L_f e",
            Vector::FHat,
            Element(Vector::FHat),
            [Accumulate(Matrix::LF, Vector::E)],
        )
    });
    let x_value = [Add(Element(Vector::XOp))];
    all.push(statement("estimates", Vector::XValue, Element(Vector::XHat), x_value));
    all.push(statement("", Vector::FValue, Element(Vector::FHat), [Add(Zero)]));
    all
}

/// The commands without limits.
fn commands() -> [Statement; 3] {
    use Operation::Add;
    use Term::{Element, Product};
    [
        statement("u = K_x x_hat", Vector::U, Product(Matrix::KX, Vector::XHat), []),
        Statement {
            when: When::Compensating,
            ..statement(
                "u = u + K_f f_hat",
                Vector::U,
                Element(Vector::U),
                [Add(Product(Matrix::KF, Vector::FHat))],
            )
        },
        statement("commands", Vector::Command, Element(Vector::U), [Add(Element(Vector::UOp))]),
    ]
}

/// The estimate for the next sample.
fn predictions(controller: &Controller) -> Vec<Statement> {
    use Operation::{Accumulate, Add};
    use Term::{Element, FilterStep, Product};
    let corrected = controller.estimator == Estimator::Prediction;
    let (b, f_a) = (Product(Matrix::B, Vector::U), Product(Matrix::FA, Vector::FHat));
    let mut operations = vec![Add(b), Add(f_a)];
    operations.extend(corrected.then_some(Accumulate(Matrix::LX, Vector::E)));
    operations.push(Add(Element(Vector::XOp)));
    let mut all = vec![Statement {
        operations,
        ..statement(
            if corrected {
                "x_hat[k+1] = A x_hat + B u + F_a f_hat + L_x e"
            } else {
                "x_hat[k+1] = A x_hat + B u + F_a f_hat"
            },
            Vector::NextXHat,
            Product(Matrix::A, Vector::XHat),
            [],
        )
    }];
    all.extend(fault_predictions(controller));
    if controller.filter.is_some() {
        all.push(statement(
            "y_f[k+1] = y_f + W (y - y_f)",
            Vector::NextYF,
            FilterStep,
            [Add(Element(Vector::YF)), Add(Element(Vector::YOp))],
        ));
    }
    all
}

fn fault_predictions(controller: &Controller) -> Vec<Statement> {
    use Operation::{Accumulate, Add};
    use Term::{Element, Product, Zero};
    let estimating = while_estimating(controller);
    let corrected = controller.estimator == Estimator::Prediction;
    let kept =
        statement("f_hat[k+1] = f_hat", Vector::NextFHat, Element(Vector::FHat), [Add(Zero)]);
    let correction = Accumulate(Matrix::LF, Vector::E);
    let (equation, start, mut operations) = match (controller.constant_faults, corrected) {
        (true, false) => return vec![kept],
        (true, true) => {
            ("f_hat[k+1] = f_hat + L_f e", Zero, vec![correction, Add(Element(Vector::FHat))])
        }
        (false, false) => ("f_hat[k+1] = A_f f_hat", Product(Matrix::AF, Vector::FHat), Vec::new()),
        (false, true) => {
            ("f_hat[k+1] = A_f f_hat + L_f e", Product(Matrix::AF, Vector::FHat), vec![correction])
        }
    };
    operations.push(Add(Zero));
    let next = Statement {
        when: estimating,
        operations,
        ..statement(equation, Vector::NextFHat, start, [])
    };
    match estimating {
        When::Always => vec![next],
        _ => vec![next, Statement { when: When::NotCompensating, ..kept }],
    }
}

/// Faults are estimated while they are compensated; with `monitor`, always.
fn while_estimating(controller: &Controller) -> When {
    if controller.monitor { When::Always } else { When::Compensating }
}

impl Matrix {
    pub(super) const ALL: [Self; 9] =
        [Self::A, Self::B, Self::C, Self::FA, Self::AF, Self::KX, Self::KF, Self::LX, Self::LF];

    /// The matrix of a controller.
    pub(super) fn of(self, controller: &Controller) -> &DMatrix<f64> {
        match self {
            Self::A => &controller.a,
            Self::B => &controller.b,
            Self::C => &controller.c,
            Self::FA => &controller.f_a,
            Self::AF => &controller.a_f,
            Self::KX => &controller.k_x,
            Self::KF => &controller.k_f,
            Self::LX => &controller.l_x,
            Self::LF => &controller.l_f,
        }
    }

    /// The name in the design file.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::A => "A",
            Self::B => "B",
            Self::C => "C",
            Self::FA => "F_a",
            Self::AF => "A_f",
            Self::KX => "K_x",
            Self::KF => "K_f",
            Self::LX => "L_x",
            Self::LF => "L_f",
        }
    }
}

impl Vector {
    /// The name without its owner.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::StoredXHat | Self::XHat => "x_hat",
            Self::StoredFHat | Self::FHat => "f_hat",
            Self::StoredYF | Self::YF => "y_f",
            Self::Measured | Self::Y => "y",
            Self::XOp => "x_op",
            Self::UOp => "u_op",
            Self::YOp => "y_op",
            Self::E => "e",
            Self::U => "u",
            Self::Command => "command",
            Self::XValue => "x_value",
            Self::FValue => "f_value",
            Self::NextXHat => "next_x_hat",
            Self::NextFHat => "next_f_hat",
            Self::NextYF => "next_y_f",
        }
    }

    /// Whether it is part of the controller's state.
    pub(super) fn is_stored(self) -> bool {
        matches!(self, Self::StoredXHat | Self::StoredFHat | Self::StoredYF | Self::Measured)
    }

    /// The signals that its elements belong to.
    pub(super) fn kind(self) -> Kind {
        match self {
            Self::StoredXHat | Self::XHat | Self::XOp | Self::XValue | Self::NextXHat => {
                Kind::State
            }
            Self::StoredFHat | Self::FHat | Self::FValue | Self::NextFHat => Kind::Fault,
            Self::UOp | Self::U | Self::Command => Kind::Actuator,
            Self::StoredYF
            | Self::Measured
            | Self::YOp
            | Self::Y
            | Self::E
            | Self::YF
            | Self::NextYF => Kind::Measurement,
        }
    }
}

/// The signals of a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    State,
    Fault,
    Actuator,
    Measurement,
}

impl Kind {
    pub(super) fn count(self, controller: &Controller) -> usize {
        match self {
            Self::State => controller.states.len(),
            Self::Fault => controller.faults.len(),
            Self::Actuator => controller.actuators.len(),
            Self::Measurement => controller.measurements.len(),
        }
    }

    /// The name of their number.
    pub(super) fn plural(self) -> &'static str {
        match self {
            Self::State => "STATES",
            Self::Fault => "FAULTS",
            Self::Actuator => "ACTUATORS",
            Self::Measurement => "MEASUREMENTS",
        }
    }
}
