//! The signals of the controller: as the importer sees them, and as the deviations of the equations.

use serde::{Deserialize, Serialize};

use crate::mode::{Law, Mode};
use aso_controller::design::Design;

/// The signals as the importer sees them.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Values {
    /// The estimates z = [x_hat; f_hat; y_f; x_i; u_t].
    pub(crate) z: Vec<f64>,
    /// The measurements, and their derivatives with respect to time.
    pub(crate) y: Vec<f64>,
    pub(crate) y_slopes: Vec<f64>,
    /// The references, and their derivatives with respect to time.
    pub(crate) r: Vec<f64>,
    pub(crate) r_slopes: Vec<f64>,
    /// The commands.
    pub(crate) u: Vec<f64>,
    /// The law of the commands; `None` before the first commands and at rest.
    pub(crate) law: Option<Law>,
}

/// The operating point, zero where the design states none; in a direction, its derivatives.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct OperatingPoint {
    /// [x_op; 0; y_op; 0; 0], the last parts where the design has a filter, integrals and a transfer.
    pub(crate) z: Vec<f64>,
    y: Vec<f64>,
    pub(crate) r: Vec<f64>,
    pub(crate) u: Vec<f64>,
}

/// The signals of the equations: deviations from the operating point, or a direction in them.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Signals {
    /// The estimates z = [x_hat; f_hat; y_f; x_i; u_t].
    pub(crate) z: Vec<f64>,
    /// The measurements.
    pub(crate) y: Vec<f64>,
    /// The references.
    pub(crate) r: Vec<f64>,
    /// The innovations.
    pub(crate) e: Vec<f64>,
    /// The estimates of the faults in a design with a direct term; empty in others, whose z has them.
    pub(crate) f_hat: Vec<f64>,
    /// The commands.
    pub(crate) u: Vec<f64>,
}

/// Applies `change` to each element of x_hat and y_f in z, of y and of r, with its operating point in `design`.
fn change_by_operating_point(
    [z, y, r]: [&mut [f64]; 3],
    design: &Design,
    change: impl Fn(&mut f64, f64),
) {
    let [x_hat, _, y_f, ..] = design.parts_mut(z);
    let states = design.states.iter().map(|signal| signal.operating);
    let measured = || design.measurements.iter().map(|signal| signal.operating);
    let referred = design.references.iter().map(|signal| signal.operating);
    let of_z = x_hat.iter_mut().zip(states).chain(y_f.iter_mut().zip(measured()));
    let of_inputs = y.iter_mut().zip(measured()).chain(r.iter_mut().zip(referred));
    for (element, operating) in of_z.chain(of_inputs) {
        change(element, operating.unwrap_or_default());
    }
}

impl OperatingPoint {
    /// The operating point of `design`.
    pub(crate) fn of(design: &Design) -> Self {
        let Signals { z, y, r, u, .. } = Signals::zero(design);
        let mut point = Self { z, y, r, u };
        point.read(design);
        point
    }

    /// Copies the operating point of `design`, without allocation.
    pub(crate) fn read(&mut self, design: &Design) {
        let Self { z, y, r, .. } = self;
        change_by_operating_point([z, y, r], design, |element, operating| *element = operating);
        for (to, actuator) in self.u.iter_mut().zip(&design.actuators) {
            *to = actuator.operating.unwrap_or_default();
        }
    }
}

impl Signals {
    /// All signals of `design`, zero.
    pub(crate) fn zero(design: &Design) -> Self {
        let zeros = |count| vec![0.0; count];
        let (p, m, t) =
            (design.measurements.len(), design.actuators.len(), design.references.len());
        let f_hat = zeros(design.p_f.as_ref().map_or(0, |p_f| p_f.rows));
        Self { z: zeros(design.order()), y: zeros(p), r: zeros(t), e: zeros(p), f_hat, u: zeros(m) }
    }

    /// Sets z, y and r to the deviations of `values` from `point`, with y and r extrapolated by `offset` s.
    pub(crate) fn set(&mut self, values: &Values, point: &OperatingPoint, offset: f64) {
        for ((z, value), point) in self.z.iter_mut().zip(&values.z).zip(&point.z) {
            *z = value - point;
        }
        self.set_inputs(values, point, offset);
    }

    /// Subtracts D u from the measurements, with the commands u of the sample before. Does nothing without D.
    pub(crate) fn remove_feedthrough(&mut self, design: &Design) {
        let Some(d) = &design.d else { return };
        for (k, y) in self.y.iter_mut().enumerate() {
            *y -= d.row(k).iter().zip(&self.u).map(|(entry, u)| entry * u).sum::<f64>();
        }
    }

    /// Sets z, y and r to the derivatives of their deviations with respect to time: z' and the slopes in `values`, less
    /// the derivatives of the operating point, which are the operating point of `design`.
    pub(crate) fn set_rates(&mut self, z: &[f64], values: &Values, design: &Design) {
        self.z.copy_from_slice(z);
        self.y.copy_from_slice(&values.y_slopes);
        self.r.copy_from_slice(&values.r_slopes);
        let Self { z, y, r, .. } = self;
        change_by_operating_point([z, y, r], design, |slope, operating| *slope -= operating);
    }

    /// Sets y and r to the deviations of the inputs in `values`, extrapolated by `offset` s.
    pub(crate) fn set_inputs(&mut self, values: &Values, point: &OperatingPoint, offset: f64) {
        let measured = values.y.iter().zip(&values.y_slopes).zip(&point.y);
        let referred = values.r.iter().zip(&values.r_slopes).zip(&point.r);
        let inputs = self.y.iter_mut().chain(&mut self.r);
        for (input, ((value, slope), point)) in inputs.zip(measured.chain(referred)) {
            *input = value - point + slope * offset;
        }
    }
}

impl Values {
    /// All signals of `design`, zero.
    pub(crate) fn zero(design: &Design) -> Self {
        let Signals { z, y, r, u, .. } = Signals::zero(design);
        Self { z, y_slopes: y.clone(), y, r_slopes: r.clone(), r, u, law: None }
    }

    /// Sets z, or as many of its first elements as `z` has, to the operating point plus the deviations `z`.
    pub(crate) fn set_estimate(&mut self, z: &[f64], point: &OperatingPoint) {
        for ((value, deviation), point) in self.z.iter_mut().zip(z).zip(&point.z) {
            *value = deviation + point;
        }
    }

    /// Sets z to the operating point, and removes the law.
    pub(crate) fn rest(&mut self, point: &OperatingPoint) {
        self.law = None;
        for (value, point) in self.z.iter_mut().zip(&point.z) {
            // Adding 0 turns -0 into 0, as in `set_estimate`.
            *value = 0.0 + point;
        }
    }

    /// Sets u to the operating point plus the deviations `u`. A channel at a limit gets the limit, a stuck channel its
    /// stuck command.
    pub(crate) fn set_commands(
        &mut self,
        u: &[f64],
        design: &Design,
        mode: Mode,
        point: &OperatingPoint,
    ) {
        let free = u.iter().zip(&point.u).map(|(u, point)| u + point);
        for (j, (value, free)) in self.u.iter_mut().zip(free).enumerate() {
            *value = mode.held_command(design, j).unwrap_or(free);
        }
    }
}
