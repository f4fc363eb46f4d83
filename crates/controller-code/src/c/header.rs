//! The header: the description, the types, the functions.

use super::Source;
use crate::detection::Method;
use crate::rounding::RoundingBound;
use crate::summary::summary;
use crate::symbols::{Kind, Vector};
use crate::tables::stored;
use crate::text::file_text;

impl Source<'_> {
    pub(super) fn header(&self, bound: Option<&RoundingBound>) -> String {
        let Self { request, controller, fields, real, capital } = self;
        let name = &request.prefix;
        let mut lines = vec!["/*".to_owned()];
        for line in summary(request, controller, fields, bound, &self.vocabulary()) {
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
        let first_integer = lines.len();
        if controller.has_counter() {
            lines.push("    uint32_t sample;".to_owned());
        }
        if controller.limits_holds() {
            lines.push(format!("    uint32_t held[{}];", self.count(Kind::Measurement)));
        }
        if controller.counts_since_rest() {
            lines.push("    uint32_t running;".to_owned());
        }
        let is_transferred = controller.transfer.is_some();
        let is_reconfigurable = controller.reconfiguration.is_some();
        if is_transferred {
            lines.push("    uint32_t law;".to_owned());
        }
        if is_transferred && is_reconfigurable {
            lines.push("    uint32_t last_set;".to_owned());
        }
        self.reconfiguration_state(&mut lines, false);
        if is_transferred && is_reconfigurable {
            lines.push(format!("    bool was_gone[{}];", self.count(Kind::Actuator)));
        }
        self.detection_state(&mut lines, false);
        if controller.filter.is_some() {
            lines.push("    bool started;".to_owned());
        }
        // The flags come last, so that there is no padding between the fields.
        lines[first_integer..].sort_by_key(|line| line.starts_with("    bool "));
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
        file_text(&lines)
    }

    /// Adds macros: the numbers of signals, the sample time, the first samples, the bits of the status.
    fn macros(&self, lines: &mut Vec<String>) {
        let Self { controller, capital, .. } = self;
        for kind in self.kinds() {
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
        if let Some(detection) = &controller.detection {
            lines.extend([
                String::new(),
                "/* The first sample whose residuals are tested. */".to_owned(),
                format!("#define {capital}_FIRST_TESTED {}U", detection.first_tested),
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
        if controller.limits_holds() {
            lines.push(format!("#define {capital}_LOST 16U"));
        }
        lines.push(String::new());
    }

    fn structure(&self, lines: &mut Vec<String>, what: &str, fields: &[String]) {
        lines.extend(["typedef struct".to_owned(), "{".to_owned()]);
        lines.extend(fields.iter().map(|field| format!("    {} {field};", self.real)));
        lines.extend([format!("}} {}_{what};", self.request.prefix), String::new()]);
    }

    /// Adds the structure with decision, residuals and statistics of a sample; nothing without a detection.
    fn detection_structure(&self, lines: &mut Vec<String>) {
        if self.controller.detection.is_none() {
            return;
        }
        let (name, real) = (&self.request.prefix, self.real);
        let (residuals, tests) = (self.count(Kind::Residual), self.count(Kind::Test));
        lines.push(format!(
            "typedef struct
{{
    bool detected;
    int32_t isolated;
    {real} t_detected;
    {real} t_onset;
    {real} residual[{residuals}];
    {real} statistic[{tests}];
}} {name}_Detection;
"
        ));
    }

    /// Adds the fields of the detection in an instance: the real numbers if `of_reals`, else counters and flags.
    fn detection_state(&self, lines: &mut Vec<String>, of_reals: bool) {
        let Some(detection) = &self.controller.detection else { return };
        let (real, tests) = (self.real, self.count(Kind::Test));
        lines.extend(match (of_reals, detection.method) {
            (true, Method::Cusum) => vec![
                format!("    {real} statistic[{tests}];"),
                format!("    {real} sums[{tests}][2];"),
            ],
            (true, Method::Window) => vec![
                format!("    {real} statistic[{tests}];"),
                format!("    {real} sums[{}];", self.count(Kind::Residual)),
            ],
            (false, method) => {
                let since = match method {
                    Method::Cusum => vec![format!("    uint32_t since[{tests}][2];")],
                    Method::Window => vec![
                        format!("    uint32_t since[{tests}];"),
                        format!("    uint32_t taken[{tests}];"),
                    ],
                };
                let rest = ["uint32_t detected_at;", "uint32_t onset;", "int32_t isolated;"]
                    .map(|field| format!("    {field}"));
                let alarmed = format!("    bool alarmed[{tests}];");
                since.into_iter().chain(rest).chain([alarmed]).collect()
            }
        });
    }

    /// Adds the structure with the inputs about actuators that are gone; nothing without a reconfiguration.
    fn actuators_structure(&self, lines: &mut Vec<String>) {
        if self.controller.reconfiguration.is_none() {
            return;
        }
        lines.push("typedef struct\n{".to_owned());
        let fields = self.fields.switches(self.controller);
        lines.extend(fields.iter().map(|field| format!("    bool {field};")));
        lines.push(format!("}} {}_Actuators;\n", self.request.prefix));
    }

    /// Adds the fields of the reconfiguration in an instance: the real numbers if `of_reals`, else counters and flags.
    fn reconfiguration_state(&self, lines: &mut Vec<String>, of_reals: bool) {
        let Some(reconfiguration) = &self.controller.reconfiguration else { return };
        let (real, cases, actuators) =
            (self.real, self.count(Kind::Case), self.count(Kind::Actuator));
        let has_cases = !reconfiguration.cases.is_empty();
        if of_reals {
            lines.extend(has_cases.then(|| format!("    {real} lost[{cases}];")));
            return;
        }
        lines.extend(has_cases.then(|| format!("    uint32_t above_for[{cases}];")));
        lines.extend(["    uint32_t set;", "    int32_t reconfiguration;"].map(str::to_owned));
        lines.push(format!("    bool gone[{actuators}];"));
        lines.extend(has_cases.then(|| format!("    bool decided[{cases}];")));
    }
}
