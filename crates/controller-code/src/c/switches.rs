//! The sizes, numbers and switches that a design states for `aso_controller.h`.

use super::Source;
use crate::detection::Method;
use crate::reconfiguration::Reconfiguration;
use crate::symbols::{Kind, Matrix};
use crate::tables::has_constant_matrix;
use crate::text::Lines;
use aso_controller::design::Estimator;

impl Source<'_> {
    /// The kinds of signals, tests, sets of gains, ... that the design has; integrals count as references.
    pub(super) fn kinds(&self) -> impl Iterator<Item = Kind> {
        let signals = Kind::ALL.into_iter().filter(|kind| *kind != Kind::Integral);
        signals.chain(Kind::OTHERS).filter(|kind| kind.count(self.controller) > 0)
    }

    pub(super) fn settings(&self, lines: &mut Lines) {
        let Self { controller, capital, .. } = self;
        let mut set = |name: &str, value: String| {
            lines.push(format!("#define ASO_{name} {value}"));
        };
        for kind in self.kinds() {
            set(kind.plural(), self.count(kind));
        }
        let losses = controller.losses.len();
        if losses > 0 {
            set("LOSSES", format!("{losses}U"));
        }
        set("SAMPLE_TIME", format!("{capital}_SAMPLE_TIME"));
        if let Some(transfer) = controller.transfer {
            set("TRANSFER", self.literal(transfer));
        }
        set("LARGEST", self.literal(f64::INFINITY));
        let first_compensated = controller.first_compensated;
        set("FIRST_COMPENSATED", format!("{first_compensated}U"));
        if let Some(detection) = &controller.detection {
            set("FIRST_TESTED", format!("{}U", detection.first_tested));
        }
        if controller.has_counter() {
            let last = if controller.counts_all() {
                "UINT32_MAX".to_owned()
            } else {
                format!("{first_compensated}U")
            };
            set("LAST_COUNTED", last);
        }
        if Kind::Case.count(controller) == 0 {
            set("CASES", "0U".to_owned());
        }
        let regular = controller.reconfiguration.as_ref().map(Reconfiguration::regular_sets);
        if let Some(count) = regular {
            set("REGULAR_SETS", format!("{count}U"));
        }
        if let Some(schedule) = &controller.schedule {
            let measured = schedule.measurement.map(|k| format!("y[{k}]"));
            set("THETA", measured.unwrap_or_else(|| "theta".to_owned()));
        }
        for (name, is_on) in self.switches() {
            set(name, u32::from(is_on).to_string());
        }
    }

    fn switches(&self) -> [(&'static str, bool); 26] {
        let controller = self.controller;
        let fallback = controller
            .reconfiguration
            .as_ref()
            .and_then(|reconfiguration| reconfiguration.fallback);
        let windows = controller
            .detection
            .as_ref()
            .is_some_and(|detection| detection.method == Method::Window);
        [
            ("IS_CURRENT", controller.estimator == Estimator::Current),
            ("MONITORS", controller.monitor),
            ("COUNTS_SAMPLES", controller.has_counter()),
            ("HAS_CONSTANT_MATRIX", has_constant_matrix(controller)),
            ("HAS_FEEDTHROUGH", controller.has(Matrix::D)),
            ("HAS_FILTER", controller.filter.is_some()),
            ("HAS_FAULT_MODEL", controller.has(Matrix::AF)),
            ("HAS_DIRECT_TERM", controller.has(Matrix::PF)),
            ("HAS_SLIDING_MODE", controller.sliding_mode.is_some()),
            ("HAS_REFERENCES", !controller.references.is_empty()),
            ("HAS_INTEGRALS", controller.has(Matrix::H)),
            ("HAS_SENSOR_FAULTS_IN_INTEGRALS", controller.has(Matrix::FI)),
            ("HAS_BACK_CALCULATION", controller.has(Matrix::LW)),
            ("HAS_FEEDFORWARD", controller.has(Matrix::NR)),
            ("HAS_TRANSFER", controller.transfer.is_some()),
            ("HAS_LIMITS", controller.is_limited()),
            ("HAS_LOSSES", !controller.losses.is_empty()),
            ("HAS_SCHEDULE", controller.schedule.is_some()),
            ("HAS_SCHEDULE_INPUT", !controller.schedule_inputs().is_empty()),
            ("HAS_DETECTION", controller.detection.is_some()),
            ("HAS_WINDOWS", windows),
            ("HAS_RECONFIGURATION", controller.reconfiguration.is_some()),
            ("CHECKS_MEASUREMENTS", controller.checks_measurements()),
            ("LIMITS_HOLDS", controller.limits_holds()),
            ("HAS_FALL_BACK", fallback.is_some()),
            ("FALL_BACK_COMPENSATES", fallback == Some(true)),
        ]
    }
}
