//! The header: the description, the types, the functions.

use super::Source;
use crate::detection::Method;
use crate::rounding::RoundingBound;
use crate::summary::summary;
use crate::symbols::{Kind, Vector};
use crate::tables::stored;
use crate::text::Lines;

impl Source<'_> {
    pub(super) fn header(&self, bound: Option<&RoundingBound>) -> String {
        let Self { request, controller, fields, real, capital } = self;
        let name = &request.prefix;
        let mut lines = Lines::default();
        lines.push("/*");
        for line in summary(request, controller, fields, bound, &self.vocabulary()) {
            lines.push(format!(" * {line}").trim_end());
        }
        lines.push(format!(
            " */
#ifndef {capital}_H_
#define {capital}_H_

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern \"C\" {{
#endif

/* Numbers of signals. */"
        ));
        self.macros(&mut lines);
        for (kind, what, fields) in [
            (*real, "Measurements", &fields.measurements),
            (*real, "References", &fields.references),
            (*real, "Schedule", &fields.schedule),
            ("bool", "Actuators", &fields.switches(controller)),
            (*real, "Commands", &fields.actuators),
            (*real, "Estimates", &fields.estimates(controller)),
        ] {
            if !fields.is_empty() {
                lines.push("typedef struct\n{");
                lines.extend(fields.iter().map(|field| format!("    {kind} {field};")));
                lines.push(format!("}} {name}_{what};\n"));
            }
        }
        self.detection_structure(&mut lines);
        lines.push(
            "/* One instance; its fields belong to the functions below. */\ntypedef struct\n{",
        );
        for vector in stored(controller).into_iter().chain([Vector::U]) {
            let count = self.count(vector.kind());
            lines.push(format!("    {real} {}[{count}];", vector.name()));
        }
        lines.push_if(!fields.schedule.is_empty(), format!("    {real} theta;"));
        self.detection_state(&mut lines, true);
        self.reconfiguration_state(&mut lines, true);
        let first_integer = lines.0.len();
        lines.push_if(controller.has_counter(), "    uint32_t sample;");
        let held = format!("    uint32_t held[{}];", self.count(Kind::Measurement));
        lines.push_if(controller.limits_holds(), held);
        lines.push_if(controller.counts_since_rest(), "    uint32_t running;");
        let is_transferred = controller.transfer.is_some();
        let is_reconfigurable = controller.reconfiguration.is_some();
        lines.push_if(is_transferred, "    uint32_t law;");
        lines.push_if(is_transferred && is_reconfigurable, "    uint32_t last_set;");
        self.reconfiguration_state(&mut lines, false);
        let was_gone = format!("    bool was_gone[{}];", self.count(Kind::Actuator));
        lines.push_if(is_transferred && is_reconfigurable, was_gone);
        self.detection_state(&mut lines, false);
        lines.push_if(controller.filter.is_some(), "    bool started;");
        // The flags come last, so that there is no padding between the fields.
        lines.0[first_integer..].sort_by_key(|line| line.starts_with("    bool "));
        let (n, q) = (self.count(Kind::State), self.count(Kind::Fault));
        lines.push(format!(
            "}} {name}_State;

/* Starts at the operating point, without faults. */
void {name}_init({name}_State *state);

/* Starts at these estimates of states and faults. */
void {name}_init_at({name}_State *state, const {real} x_hat_0[{n}],
    const {real} f_hat_0[{q}]);

/* Takes a sample; returns the bits of the status. */
{};

#ifdef __cplusplus
}}
#endif

#endif /* {capital}_H_ */",
            self.signature()
        ));
        lines.text()
    }

    /// Adds macros: the numbers of signals, the sample time, the first samples, the bits of the status.
    fn macros(&self, lines: &mut Lines) {
        let Self { controller, capital, .. } = self;
        for kind in self.kinds() {
            lines.push(format!("#define {} {}U", self.count(kind), kind.count(controller)));
        }
        let mut constant = |meaning: &str, name: &str, value: String| {
            lines.push(format!("\n/* {meaning} */\n#define {capital}_{name} {value}"));
        };
        let sample_time = self.literal(controller.sample_time);
        constant("The sample time in s.", "SAMPLE_TIME", sample_time);
        if controller.first_compensated > 0 {
            let meaning = "The first sample at which faults are compensated.";
            constant(meaning, "FIRST_COMPENSATED", format!("{}U", controller.first_compensated));
        }
        if let Some(detection) = &controller.detection {
            let meaning = "The first sample whose residuals are tested.";
            constant(meaning, "FIRST_TESTED", format!("{}U", detection.first_tested));
        }
        constant("Bits of the status.", "HELD", "1U".to_owned());
        lines.push(format!("#define {capital}_AT_LIMIT 2U\n#define {capital}_OVERFLOW 4U"));
        lines.push_if(controller.schedule.is_some(), format!("#define {capital}_OUTSIDE 8U"));
        lines.push_if(controller.limits_holds(), format!("#define {capital}_LOST 16U"));
        lines.push("");
    }

    /// Adds the structure with decision, residuals and statistics of a sample; nothing without a detection.
    fn detection_structure(&self, lines: &mut Lines) {
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
    fn detection_state(&self, lines: &mut Lines, of_reals: bool) {
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

    /// Adds the fields of the reconfiguration in an instance: the real numbers if `of_reals`, else counters and flags.
    fn reconfiguration_state(&self, lines: &mut Lines, of_reals: bool) {
        let Some(reconfiguration) = &self.controller.reconfiguration else { return };
        let (real, cases, actuators) =
            (self.real, self.count(Kind::Case), self.count(Kind::Actuator));
        let has_cases = !reconfiguration.cases.is_empty();
        if of_reals {
            return lines.push_if(has_cases, format!("    {real} lost[{cases}];"));
        }
        lines.push_if(has_cases, format!("    uint32_t above_for[{cases}];"));
        lines.extend(["    uint32_t set;", "    int32_t reconfiguration;"]);
        lines.push(format!("    bool gone[{actuators}];"));
        lines.push_if(has_cases, format!("    bool decided[{cases}];"));
    }
}
