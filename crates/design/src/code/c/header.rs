//! The header: the description, the types, the functions.

use super::{Source, finished};
use crate::code::rounding::RoundingBound;
use crate::code::summary::summary;
use crate::code::symbols::{Kind, Vector};
use crate::code::tables::stored;

impl Source<'_> {
    pub(super) fn header(&self, bound: Option<&RoundingBound>) -> String {
        let Self { request, controller, recursion, fields, real, capital } = self;
        let name = &request.prefix;
        let mut lines = vec!["/*".to_owned()];
        let parts = (*recursion, *fields);
        for line in summary(request, controller, parts, bound, &self.vocabulary()) {
            lines.push(format!(" * {line}").trim_end().to_owned());
        }
        lines.push(" */".to_owned());
        lines.extend([
            format!("#ifndef {capital}_H"),
            format!("#define {capital}_H"),
            String::new(),
            "#include <stdbool.h>".to_owned(),
            "#include <stdint.h>".to_owned(),
            String::new(),
            "#ifdef __cplusplus".to_owned(),
            "extern \"C\" {".to_owned(),
            "#endif".to_owned(),
            String::new(),
            "/* Numbers of signals. */".to_owned(),
        ]);
        self.macros(&mut lines);
        self.structure(&mut lines, "Measurements", &fields.measurements);
        if !fields.references.is_empty() {
            self.structure(&mut lines, "References", &fields.references);
        }
        if !fields.schedule.is_empty() {
            self.structure(&mut lines, "Schedule", &fields.schedule);
        }
        self.actuators_structure(&mut lines);
        self.structure(&mut lines, "Commands", &fields.actuators);
        self.structure(&mut lines, "Estimates", &fields.estimates(controller));
        self.detection_structure(&mut lines);
        lines.push("/* One instance; its fields belong to the functions below. */".to_owned());
        lines.extend(["typedef struct".to_owned(), "{".to_owned()]);
        for vector in stored(controller).into_iter().chain([Vector::U]) {
            let count = self.count(vector.kind());
            lines.push(format!("    {real} {}[{count}];", vector.name()));
        }
        if !fields.schedule.is_empty() {
            lines.push(format!("    {real} theta;"));
        }
        self.detection_state(&mut lines, true);
        self.reconfiguration_state(&mut lines, true);
        if controller.has_counter() {
            lines.push("    uint32_t sample;".to_owned());
        }
        self.reconfiguration_state(&mut lines, false);
        self.detection_state(&mut lines, false);
        if controller.filter.is_some() {
            lines.push("    bool started;".to_owned());
        }
        let (n, q) = (self.count(Kind::State), self.count(Kind::Fault));
        lines.extend([
            format!("}} {name}_State;"),
            String::new(),
            "/* Starts at the operating point, without faults. */".to_owned(),
            format!("void {name}_init({name}_State *state);"),
            String::new(),
            "/* Starts at these estimates of states and faults. */".to_owned(),
            format!("void {name}_init_at({name}_State *state, const {real} x_hat_0[{n}],"),
            format!("    const {real} f_hat_0[{q}]);"),
            String::new(),
            "/* Takes a sample; returns the bits of the status. */".to_owned(),
            format!("{};", self.signature()),
            String::new(),
            "#ifdef __cplusplus".to_owned(),
            "}".to_owned(),
            "#endif".to_owned(),
            String::new(),
            format!("#endif /* {capital}_H */"),
        ]);
        finished(&lines)
    }

    /// Numbers of signals, the sample time, bits of the status.
    fn macros(&self, lines: &mut Vec<String>) {
        let Self { controller, capital, .. } = self;
        let kinds = Kind::ALL.into_iter().filter(|kind| *kind != Kind::Integral);
        let kinds = kinds.chain(Kind::OTHERS);
        for kind in kinds.filter(|kind| kind.count(controller) > 0) {
            lines.push(format!("#define {} {}U", self.count(kind), kind.count(controller)));
        }
        lines.extend([
            String::new(),
            "/* The sample time in s. */".to_owned(),
            format!("#define {capital}_SAMPLE_TIME {}", self.literal(controller.sample_time)),
        ]);
        if controller.first_compensated > 0 {
            lines.extend([
                String::new(),
                "/* The first sample at which faults are compensated. */".to_owned(),
                format!("#define {capital}_FIRST_COMPENSATED {}U", controller.first_compensated),
            ]);
        }
        if let Some(own) = &controller.detection {
            lines.extend([
                String::new(),
                "/* The first sample whose residuals are tested. */".to_owned(),
                format!("#define {capital}_FIRST_TESTED {}U", own.first_tested),
            ]);
        }
        lines.extend([
            String::new(),
            "/* Bits of the status. */".to_owned(),
            format!("#define {capital}_HELD 1U"),
            format!("#define {capital}_AT_LIMIT 2U"),
            format!("#define {capital}_OVERFLOW 4U"),
        ]);
        if controller.schedule.is_some() {
            lines.push(format!("#define {capital}_OUTSIDE 8U"));
        }
        lines.push(String::new());
    }

    fn structure(&self, lines: &mut Vec<String>, what: &str, fields: &[String]) {
        lines.extend(["typedef struct".to_owned(), "{".to_owned()]);
        lines.extend(fields.iter().map(|field| format!("    {} {field};", self.real)));
        lines.extend([format!("}} {}_{what};", self.request.prefix), String::new()]);
    }
}
