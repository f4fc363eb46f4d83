//! PI, PID and other controllers of low order in place of a state feedback.

use std::ops::Range;

use control::stability::instability;
use control::tuning::Structure;
use control::{Domain, Error, lmi};
use files::PlaceError;
use nalgebra::DMatrix;

use crate::plant::filters;
use crate::plant::linear::LinearPlant;
use crate::report::number::rounded;
use plant_file::PlantFile;
use plant_file::loop_shape::LoopShape;
use plant_file::pid::{MOST_ORDER, Pair, Pid};
use plant_file::references::References;

/// Decay rate that a start should reach, relative to that of the state feedback from which it is derived.
const DECAY: f64 = 0.5;

/// The structure that the controllers give to the feedback.
pub(crate) struct PidProblem<'a> {
    pub(crate) pid: &'a Pid,
    pub(crate) shape: &'a LoopShape,
    pub(crate) linear: &'a LinearPlant,
    pub(crate) references: &'a References,
    /// A and B of the feedback.
    pub(crate) pair: &'a (DMatrix<f64>, DMatrix<f64>),
    pub(crate) domain: Domain,
}

/// The columns of one controller's gains in the row of its command, in the feedback [`K_x`, `K_i`].
pub(crate) struct Columns {
    pub(crate) proportional: usize,
    /// The columns of the rate of the filtered measurement, then of its higher derivatives.
    pub(crate) derivatives: Range<usize>,
    pub(crate) integral: usize,
}

impl PidProblem<'_> {
    fn columns(&self, Pair { measurement, .. }: Pair) -> Columns {
        columns(self.pid, self.references, self.linear.states.len(), measurement)
    }

    /// Returns the entries of the feedback that are tuned, as rows and columns.
    pub(crate) fn free(&self) -> Vec<(usize, usize)> {
        let of = |pair: &Pair| {
            let (pair, columns) = (*pair, self.columns(*pair));
            let all = std::iter::once(columns.proportional).chain(columns.derivatives);
            all.chain([columns.integral]).map(move |column| (pair.actuator, column))
        };
        self.pid.pairs.iter().flat_map(of).collect()
    }

    /// Returns the controllers nearest to a state feedback, stable if possible; the observer with their filters; and
    /// the instability of this feedback.
    fn start(
        &self,
        [feedback, observer]: &[DMatrix<f64>; 2],
    ) -> Result<([DMatrix<f64>; 2], f64), Error> {
        let (a, b) = self.pair;
        let free = self.free();
        let structure = Structure { a, b, free: &free, domain: self.domain };
        let decay = DECAY * instability(&(a + b * feedback), self.domain)?;
        let ending = lmi::ending();
        let is_over = || ending.as_ref().is_some_and(|ending| ending());
        let start = structure.projected(feedback)?;
        let (feedback, excess) = structure.stabilised(&start, decay, &is_over)?;
        let mut observer = observer.clone();
        let rows = filters::gains(self.pid, observer.ncols(), self.domain)?;
        let first = self.linear.states.len() - rows.nrows();
        observer.rows_mut(first, rows.nrows()).copy_from(&rows);
        Ok(([feedback, observer], excess))
    }

    /// Returns the starts that are stable; an error if there are none.
    pub(crate) fn starts(
        &self,
        file: &PlantFile<'_>,
        state_feedbacks: &[[DMatrix<f64>; 2]],
    ) -> Result<Vec<[DMatrix<f64>; 2]>, crate::Error> {
        let mut all = Vec::new();
        let mut least = f64::INFINITY;
        for gains in state_feedbacks {
            let (start, instability) = self.start(gains)?;
            least = least.min(instability);
            if instability < 0.0 {
                all.push(start);
            }
        }
        if all.is_empty() {
            return Err(self.not_found(file, least).into());
        }
        Ok(all)
    }

    fn not_found(&self, file: &PlantFile<'_>, instability: f64) -> PlaceError {
        let name = match self.pid.order {
            1 => "PI controllers".to_owned(),
            2 => "PID controllers".to_owned(),
            order => format!("controllers of order {order}"),
        };
        let further = match self.pid.order {
            1 => "`structure = \"PID\"`, ".to_owned(),
            order if order >= MOST_ORDER as usize => String::new(),
            order => format!("a higher order, `structure = {}`, ", order + 1),
        };
        let measure = match self.domain {
            Domain::Continuous => format!("largest real part {}", rounded(instability)),
            Domain::Sampled { .. } => format!("largest modulus {}", rounded(1.0 + instability)),
        };
        let message = format!(
            "no stable loop with {name} was found, from {} starts; the best loop has the {measure}: {further}other \
             `pairs`, another `bandwidth` or a state feedback, which is without `structure`, may help",
            self.shape.starts(self.domain).len()
        );
        file.error_at(&self.shape.place, message)
    }
}

/// Returns the columns of the controller from `measurement`, for a plant of `states` states including the filters.
pub(crate) fn columns(
    pid: &Pid,
    references: &References,
    states: usize,
    measurement: usize,
) -> Columns {
    let measurements = pid.measurements();
    let position = measurements.iter().position(|at| *at == measurement).unwrap_or_default();
    let first = states - pid.order * (measurements.len() - position);
    let reference = reference(references, measurement);
    Columns {
        proportional: first,
        derivatives: first + 1..first + pid.order,
        integral: states + reference,
    }
}

/// Returns the position of the reference of `measurement`.
pub(crate) fn reference(References { h, .. }: &References, measurement: usize) -> usize {
    h.column(measurement).iter().position(|weight| *weight != 0.0).unwrap_or_default()
}

/// Returns the entries of a gain of this shape besides the rows `fixed`.
pub(crate) fn entries_besides(
    fixed: &Range<usize>,
    (rows, columns): (usize, usize),
) -> Vec<(usize, usize)> {
    let is_free = |row: &usize| !fixed.contains(row);
    (0..columns)
        .flat_map(|column| (0..rows).filter(is_free).map(move |row| (row, column)))
        .collect()
}
