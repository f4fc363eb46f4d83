//! The PI, PID and other controllers of low order of the report.

use crate::report::PidController;
use crate::solve::pid::{columns, reference};
use crate::solve::solution::Solution;
use crate::solve::tracking::Tracking;
use plant_file::PlantFile;
use plant_file::pid::Pair;

/// Returns the controllers of low order of a solution; none for a state feedback.
pub(crate) fn controllers(file: &PlantFile<'_>, designed: &Solution) -> Vec<PidController> {
    let (Some(pid), Some(references)) = (file.pid(), &file.references) else { return Vec::new() };
    let Solution { linear, feedback, tracking, .. } = designed;
    let n_r = tracking.as_ref().and_then(Tracking::feedforward);
    let one = |pair: &Pair| {
        let Pair { actuator, measurement } = *pair;
        let at = columns(pid, references, linear.states.len(), measurement);
        let gain = |column: usize| feedback.gain[(actuator, column)];
        let mut derivatives = at.derivatives.map(|column| -gain(column));
        PidController {
            command: linear.actuators[actuator].name.clone(),
            measurement: linear.measurements[measurement].name.clone(),
            proportional: -gain(at.proportional),
            integral: gain(at.integral),
            derivative: derivatives.next(),
            higher_derivatives: derivatives.collect(),
            set_point: n_r.map(|n_r| n_r[(actuator, reference(references, measurement))]),
            corner: pid.corner,
        }
    };
    pid.pairs.iter().map(one).collect()
}
