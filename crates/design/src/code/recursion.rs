//! The recursion of a sampled controller as data: what both renderers write, what the arithmetic
//! counts, and what the analysis of rounding follows.
//!
//! The statements have the operations of the controller FMU in its order, zeros with a sign
//! included, so that double precision gives the bits of the FMU. `fmu-controller/src/sampled.rs` has the
//! equations.

use super::controller::Controller;
use super::symbols::{Matrix, Vector};
use aso_controller::design::Estimator;

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
    /// `rho[i]` `s[i]` / (|`s[i]`| + `delta[i]`).
    Injection,
}

/// What follows the first term of a statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operation {
    Add(Term),
    Subtract(Term),
    /// Adds row i of a matrix times a vector, one product after the other.
    Accumulate(Matrix, Vector),
    /// Multiplies by the sample time.
    TimesPeriod,
}

/// When a statement is carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum When {
    Always,
    Compensating,
    /// While faults are estimated, and otherwise.
    Estimating,
    NotEstimating,
    /// In the sample at the start, and in all others.
    First,
    Later,
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
        before_limits.extend(commands(controller));
        Self { before_limits, after_limits: predictions(controller) }
    }

    /// The statements of a sample that is not the first one and compensates: the most that a sample has.
    pub(super) fn longest(&self) -> impl Iterator<Item = &Statement> {
        self.statements().filter(|own| !matches!(own.when, When::NotEstimating | When::First))
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
    use Term::{Element, Product, Zero};
    let mut all = vec![
        statement(
            "deviations from the operating point",
            Vector::Y,
            Element(Vector::Measured),
            [Subtract(Element(Vector::YOp)), Add(Zero)],
        ),
        statement("", Vector::XHat, Element(Vector::StoredXHat), [Subtract(Element(Vector::XOp))]),
        statement("", integral(controller), Element(Vector::StoredFHat), []),
    ];
    if controller.d.is_some() {
        let before = [Subtract(Product(Matrix::D, Vector::StoredU))];
        all.push(statement("y = y - D u[k-1]", Vector::Y, Element(Vector::Y), before));
    }
    if controller.filter.is_some() {
        let start = Element(Vector::StoredYF);
        all.push(statement("", Vector::YF, start, [Subtract(Element(Vector::YOp))]));
    }
    if !controller.references.is_empty() {
        let start = Element(Vector::Referred);
        let operations = [Subtract(Element(Vector::ROp)), Add(Zero)];
        all.push(statement("", Vector::R, start, operations));
    }
    all
}

/// The innovation; with a current estimator, the correction of the estimate by it.
fn estimates(controller: &Controller) -> Vec<Statement> {
    use Operation::{Accumulate, Add};
    use Term::{Element, Zero};
    let mut all = vec![innovation(controller)];
    if controller.estimator == Estimator::Prediction {
        all.extend(direct_term(controller));
        all.push(statement("estimates", Vector::XValue, Element(Vector::StoredXHat), []));
        let f_value = match controller.p_f {
            None => Vector::StoredFHat,
            Some(_) => Vector::FHat,
        };
        all.push(statement("", Vector::FValue, Element(f_value), []));
        return all;
    }
    all.push(statement(
        "x_hat = x_hat + L_x e",
        Vector::XHat,
        Element(Vector::XHat),
        [Accumulate(Matrix::LX, Vector::E)],
    ));
    all.extend(fault_corrections(controller));
    if controller.p_f.is_some() {
        // The one of the corrected estimate.
        all.push(innovation(controller));
        all.extend(direct_term(controller));
    }
    let x_value = [Add(Element(Vector::XOp))];
    all.push(statement("estimates", Vector::XValue, Element(Vector::XHat), x_value));
    // The FMU has the operating point of f_hat, which is 0, with z, and no direct term in z.
    let f_value = Statement {
        operations: if controller.p_f.is_none() { vec![Add(Zero)] } else { Vec::new() },
        ..statement("", Vector::FValue, Element(Vector::FHat), [])
    };
    all.push(f_value);
    all
}

fn innovation(controller: &Controller) -> Statement {
    let (equation, observed) = match controller.filter {
        Some(_) => ("e = y_f - C x_hat", Vector::YF),
        None => ("e = y - C x_hat", Vector::Y),
    };
    let predicted = Operation::Subtract(Term::Product(Matrix::C, Vector::XHat));
    statement(equation, Vector::E, Term::Element(observed), [predicted])
}

/// The correction of the estimated faults by the innovation, with a current estimator.
fn fault_corrections(controller: &Controller) -> Vec<Statement> {
    let when = while_estimating(controller);
    if controller.sliding_mode.is_some() {
        let s = Term::Product(Matrix::LF, Vector::E);
        let equation = "f_hat = rho s / (|s| + delta), s = L_f e, element by element";
        return vec![
            statement(equation, Vector::S, s, []),
            Statement { when, ..statement("", Vector::FHat, Term::Injection, []) },
        ];
    }
    let (equation, corrected) = match controller.p_f {
        None => ("f_hat = f_hat + L_f e", Vector::FHat),
        Some(_) => ("f_hat_i = f_hat_i + L_f e", Vector::FHatI),
    };
    let correction = [Operation::Accumulate(Matrix::LF, Vector::E)];
    vec![Statement { when, ..statement(equation, corrected, Term::Element(corrected), correction) }]
}

/// The estimated faults with the direct term of the law, if it has one.
fn direct_term(controller: &Controller) -> Vec<Statement> {
    if controller.p_f.is_none() {
        return Vec::new();
    }
    let when = while_estimating(controller);
    let direct = [Operation::Add(Term::Product(Matrix::PF, Vector::E))];
    let integral = Term::Element(Vector::FHatI);
    let own = statement("f_hat = f_hat_i + P_f e", Vector::FHat, integral, direct);
    let kept = statement("f_hat = f_hat_i", Vector::FHat, integral, []);
    in_turn(Statement { when, ..own }, kept)
}

/// The vector that the observer predicts the faults from: without the direct term.
fn integral(controller: &Controller) -> Vector {
    match controller.p_f {
        None => Vector::FHat,
        Some(_) => Vector::FHatI,
    }
}

/// A statement that is carried out while faults are estimated, or always, and the other one otherwise.
fn in_turn(estimating: Statement, otherwise: Statement) -> Vec<Statement> {
    match estimating.when {
        When::Always => vec![estimating],
        _ => vec![estimating, Statement { when: When::NotEstimating, ..otherwise }],
    }
}

/// The commands without limits.
fn commands(controller: &Controller) -> Vec<Statement> {
    use Operation::Add;
    use Term::{Element, Product};
    let add = |equation, matrix, vector| {
        statement(equation, Vector::U, Element(Vector::U), [Add(Product(matrix, vector))])
    };
    let mut all = vec![
        statement("u = K_x x_hat", Vector::U, Product(Matrix::KX, Vector::XHat), []),
        Statement {
            when: When::Compensating,
            ..add("u = u + K_f f_hat", Matrix::KF, Vector::FHat)
        },
    ];
    if controller.k_i.is_some() {
        all.push(add("u = u + K_i x_i", Matrix::KI, Vector::StoredXI));
    }
    if controller.n_r.is_some() {
        all.push(add("u = u + N_r r", Matrix::NR, Vector::R));
    }
    let u_op = [Add(Element(Vector::UOp))];
    all.push(statement("commands", Vector::Command, Element(Vector::U), u_op));
    if controller.h.is_some() {
        all.push(statement("", Vector::XIValue, Element(Vector::StoredXI), []));
    }
    if controller.l_w.is_some() {
        all.push(statement("", Vector::V, Element(Vector::U), []));
    }
    all
}

/// The estimate for the next sample.
fn predictions(controller: &Controller) -> Vec<Statement> {
    use Operation::{Accumulate, Add};
    use Term::{Element, FilterStep, Product};
    let corrected = controller.estimator == Estimator::Prediction;
    let (b, f_a) = (Product(Matrix::B, Vector::U), Product(Matrix::FA, integral(controller)));
    let mut operations = vec![Add(b), Add(f_a)];
    operations.extend(corrected.then_some(Accumulate(Matrix::LX, Vector::E)));
    operations.push(Add(Element(Vector::XOp)));
    let mut all = vec![Statement {
        operations,
        ..statement(
            match (corrected, controller.p_f.is_some()) {
                (true, false) => "x_hat[k+1] = A x_hat + B u + F_a f_hat + L_x e",
                (true, true) => "x_hat[k+1] = A x_hat + B u + F_a f_hat_i + L_x e",
                (false, false) => "x_hat[k+1] = A x_hat + B u + F_a f_hat",
                (false, true) => "x_hat[k+1] = A x_hat + B u + F_a f_hat_i",
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
    all.extend(integrals(controller));
    if controller.detection.is_some() {
        all.extend(residuals());
    }
    all
}

/// The residuals, which follow the commands that are really applied, and their filter. The sample at the
/// start has none.
fn residuals() -> [Statement; 3] {
    use Operation::Add;
    use Term::{Product, Zero};
    let sum = |equation, target, matrices: [Matrix; 3]| {
        let vectors = [Vector::StoredXR, Vector::U, Vector::Y];
        let terms = matrices.into_iter().zip(vectors);
        let operations = terms.map(|(matrix, vector)| Add(Product(matrix, vector))).collect();
        Statement { operations, ..statement(equation, target, Zero, []) }
    };
    let r = [Matrix::ResidualC, Matrix::ResidualDu, Matrix::ResidualDy];
    let x_r = [Matrix::ResidualA, Matrix::ResidualBu, Matrix::ResidualBy];
    [
        Statement { when: When::Later, ..sum("r = C x_r + D_u u + D_y y", Vector::Residual, r) },
        Statement { when: When::First, ..statement("", Vector::Residual, Zero, []) },
        sum("x_r[k+1] = A x_r + B_u u + B_y y", Vector::NextXR, x_r),
    ]
}

/// The integrals of the distances from the references. The FMU adds `L_w` (u - v) for the commands at a
/// limit; for the others u - v is 0.
fn integrals(controller: &Controller) -> Vec<Statement> {
    use Operation::{Accumulate, Add, Subtract, TimesPeriod};
    use Term::{Element, Product, Zero};
    if controller.h.is_none() {
        return Vec::new();
    }
    let mut all = Vec::new();
    let mut operations = vec![Subtract(Product(Matrix::H, Vector::Y))];
    operations.extend(controller.f_i.is_some().then_some(Add(Product(Matrix::FI, Vector::FHat))));
    operations.push(TimesPeriod);
    if controller.l_w.is_some() {
        let without_limits = [Subtract(Element(Vector::V))];
        all.push(statement("u - v", Vector::Excess, Element(Vector::U), without_limits));
        operations.push(Accumulate(Matrix::LW, Vector::Excess));
    }
    operations.extend([Add(Element(Vector::StoredXI)), Add(Zero)]);
    let equation = match (&controller.f_i, &controller.l_w) {
        (None, None) => "x_i[k+1] = x_i + T (r - H y)",
        (Some(_), None) => "x_i[k+1] = x_i + T (r - H y + F_i f_hat)",
        (None, Some(_)) => "x_i[k+1] = x_i + T (r - H y) + L_w (u - v)",
        (Some(_), Some(_)) => "x_i[k+1] = x_i + T (r - H y + F_i f_hat) + L_w (u - v)",
    };
    let next = statement(equation, Vector::NextXI, Element(Vector::R), []);
    all.push(Statement { operations, ..next });
    all
}

fn fault_predictions(controller: &Controller) -> Vec<Statement> {
    use Operation::{Accumulate, Add};
    use Term::{Element, Product, Zero};
    let when = while_estimating(controller);
    let corrected = controller.estimator == Estimator::Prediction;
    let (direct, own) = (controller.p_f.is_some(), integral(controller));
    let equation = if direct { "f_hat_i[k+1] = f_hat_i" } else { "f_hat[k+1] = f_hat" };
    let kept = statement(equation, Vector::NextFHat, Element(own), [Add(Zero)]);
    let correction = Accumulate(Matrix::LF, Vector::E);
    let (equation, start, mut operations) = match (controller.constant_faults, corrected) {
        (true, false) => return vec![kept],
        (true, true) => (
            ["f_hat[k+1] = f_hat + L_f e", "f_hat_i[k+1] = f_hat_i + L_f e"],
            Zero,
            vec![correction, Add(Element(own))],
        ),
        (false, false) => (
            ["f_hat[k+1] = A_f f_hat", "f_hat_i[k+1] = A_f f_hat_i"],
            Product(Matrix::AF, own),
            Vec::new(),
        ),
        (false, true) => (
            ["f_hat[k+1] = A_f f_hat + L_f e", "f_hat_i[k+1] = A_f f_hat_i + L_f e"],
            Product(Matrix::AF, own),
            vec![correction],
        ),
    };
    operations.push(Add(Zero));
    let equation = equation[usize::from(direct)];
    let next = statement(equation, Vector::NextFHat, start, []);
    in_turn(Statement { when, operations, ..next }, kept)
}

/// Faults are estimated while they are compensated; with `monitor`, always.
fn while_estimating(controller: &Controller) -> When {
    if controller.monitor { When::Always } else { When::Estimating }
}
