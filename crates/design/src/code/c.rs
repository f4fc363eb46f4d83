//! The controller in C99: a header and a source file.

use std::path::PathBuf;

use super::arithmetic::Memory;
use super::controller::Controller;
use super::recursion::{Operation, Recursion, Statement, Term, When};
use super::rounding::RoundingBound;
use super::summary::{Fields, Vocabulary, summary};
use super::symbols::{Kind, Vector};
use super::tables::{Constants, kept, locals, shown, stored, tables};
use super::{Precision, Request};

/// The longest line of a table.
const WIDTH: usize = 100;

/// What every function of this file renders from.
struct Source<'a> {
    request: &'a Request<'a>,
    controller: &'a Controller,
    recursion: &'a Recursion,
    fields: &'a Fields,
    /// `double` or `float`, and the start of the names of macros.
    real: &'static str,
    capital: String,
}

/// Returns header and source with their names.
pub(super) fn files(
    request: &Request<'_>,
    (controller, recursion, fields): (&Controller, &Recursion, &Fields),
    bound: Option<&RoundingBound>,
) -> Vec<(PathBuf, String)> {
    let real = match request.precision {
        Precision::Double => "double",
        Precision::Single => "float",
    };
    let capital = request.prefix.to_ascii_uppercase();
    let source = Source { request, controller, recursion, fields, real, capital };
    let name = &request.prefix;
    vec![
        (format!("{name}.h").into(), source.header(bound)),
        (format!("{name}.c").into(), source.implementation()),
    ]
}

impl Source<'_> {
    fn vocabulary(&self) -> Vocabulary {
        let (name, capital) = (&self.request.prefix, &self.capital);
        let flag = |own: &str| format!("{capital}_{own}");
        Vocabulary {
            init: format!("{name}_init"),
            init_at: format!("{name}_init_at"),
            step: format!("{name}_step"),
            held: flag("HELD"),
            at_limit: flag("AT_LIMIT"),
            overflow: flag("OVERFLOW"),
            real: self.real,
            compiler: "-std=c99 -ffp-contract=off without -ffast-math (gcc, clang); on 32-bit x86 also \
                       -msse2 -mfpmath=sse.",
        }
    }

    /// A number with the suffix of its type.
    fn literal(&self, value: f64) -> String {
        let suffix = if self.request.precision == Precision::Single { "F" } else { "" };
        let most = if self.request.precision == Precision::Single { "FLT_MAX" } else { "DBL_MAX" };
        if value.is_infinite() {
            return format!("{}{most}", if value < 0.0 { "-" } else { "" });
        }
        format!("{}{suffix}", self.request.precision.literal(value))
    }

    fn count(&self, kind: Kind) -> String {
        format!("{}_{}", self.capital, kind.plural())
    }

    fn header(&self, bound: Option<&RoundingBound>) -> String {
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
        let kinds = Kind::ALL.into_iter().filter(|kind| *kind != Kind::Integral);
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
        lines.extend([
            String::new(),
            "/* Bits of the status. */".to_owned(),
            format!("#define {capital}_HELD 1U"),
            format!("#define {capital}_AT_LIMIT 2U"),
            format!("#define {capital}_OVERFLOW 4U"),
            String::new(),
        ]);
        self.structure(&mut lines, "Measurements", &fields.measurements);
        if !fields.references.is_empty() {
            self.structure(&mut lines, "References", &fields.references);
        }
        self.structure(&mut lines, "Commands", &fields.actuators);
        self.structure(&mut lines, "Estimates", &fields.estimates(controller));
        lines.push("/* One instance; its fields belong to the functions below. */".to_owned());
        lines.extend(["typedef struct".to_owned(), "{".to_owned()]);
        for vector in stored(controller).into_iter().chain([Vector::U]) {
            let count = self.count(vector.kind());
            lines.push(format!("    {real} {}[{count}];", vector.name()));
        }
        if controller.first_compensated > 0 {
            lines.push("    uint32_t sample;".to_owned());
        }
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

    /// The head of the function that takes a sample.
    fn signature(&self) -> String {
        let name = &self.request.prefix;
        let references = match self.fields.references.as_slice() {
            [] => String::new(),
            _ => format!("const {name}_References *references, "),
        };
        format!(
            "uint32_t {name}_step({name}_State *state, const {name}_Measurements *measurements,\n    \
             {references}bool compensate,\n    {name}_Commands *commands, {name}_Estimates *estimates)"
        )
    }

    fn structure(&self, lines: &mut Vec<String>, what: &str, fields: &[String]) {
        lines.extend(["typedef struct".to_owned(), "{".to_owned()]);
        lines.extend(fields.iter().map(|field| format!("    {} {field};", self.real)));
        lines.extend([format!("}} {}_{what};", self.request.prefix), String::new()]);
    }

    fn implementation(&self) -> String {
        let Self { request, controller, recursion, .. } = self;
        let name = &request.prefix;
        let Memory { constants, .. } = Memory::of(controller, recursion, request.precision);
        let mut lines = vec![
            format!(
                "/* Written by {}; {name}.h describes it. */",
                super::summary::ascii(request.identity)
            ),
            format!("#include \"{name}.h\""),
            String::new(),
            "#include <float.h>".to_owned(),
            String::new(),
            "#if defined(__FAST_MATH__)".to_owned(),
            "#error \"-ffast-math removes the checks of NaN and changes the results\"".to_owned(),
            "#endif".to_owned(),
            "#if defined(__clang__) || !defined(__GNUC__)".to_owned(),
            "#pragma STDC FP_CONTRACT OFF".to_owned(),
            "#endif".to_owned(),
            String::new(),
            format!("/* Constants: {constants} bytes. */"),
        ];
        for table in tables(controller, recursion) {
            self.table(&mut lines, &table);
        }
        self.helpers(&mut lines);
        self.initialisation(&mut lines);
        self.step(&mut lines);
        finished(&lines)
    }

    fn table(&self, lines: &mut Vec<String>, table: &Constants) {
        let Constants { name, meaning, rows, columns, values } = table;
        if !meaning.is_empty() {
            lines.extend([String::new(), format!("/* The {meaning}. */")]);
        }
        let rows = self.count(*rows);
        let sizes = match columns {
            Some(columns) => format!("[{rows}][{}]", self.count(*columns)),
            None => format!("[{rows}]"),
        };
        lines.push(format!("static const {} {name}{sizes} =", self.real));
        lines.push("{".to_owned());
        for row in values {
            let numbers = row.iter().map(|value| self.literal(*value));
            let indent = if columns.is_some() { "        " } else { "    " };
            let wrapped = wrapped(numbers, indent);
            match (columns, wrapped.as_slice()) {
                (None, _) => lines.extend(wrapped),
                (Some(_), [only]) => lines.push(format!("    {{{}}},", only.trim())),
                (Some(_), _) => {
                    lines.push("    {".to_owned());
                    lines.extend(wrapped);
                    lines.push("    },".to_owned());
                }
            }
        }
        if let Some(last) = lines.last_mut() {
            let trimmed = last.trim_end_matches(',').len();
            last.truncate(trimmed);
        }
        lines.push("};".to_owned());
    }

    fn helpers(&self, lines: &mut Vec<String>) {
        let real = self.real;
        let most = self.literal(f64::INFINITY);
        let (zero, one) = (self.literal(0.0), self.literal(1.0));
        lines.push(format!(
            "
/* False for NaN, too. */
static bool is_finite({real} value)
{{
    return (value >= -{most}) && (value <= {most});
}}

/* Keeps a value that is a number; returns the flag for one that is none. */
static uint32_t take({real} *kept, {real} value, uint32_t flag)
{{
    uint32_t status = flag;

    if (is_finite(value))
    {{
        *kept = value;
        status = 0U;
    }}
    return status;
}}

/* Adds a row times a vector to a sum, one product after the other. */
static {real} accumulate({real} start, const {real} row[], const {real} vector[], uint32_t count)
{{
    {real} sum = start;
    uint32_t k;

    for (k = 0U; k < count; k++)
    {{
        sum = sum + (row[k] * vector[k]);
    }}
    return sum;
}}

/* A row times a vector. -0.0 + x has the bits of x. */
static {real} product(const {real} row[], const {real} vector[], uint32_t count)
{{
    return accumulate(-{zero}, row, vector, count);
}}"
        ));
        if !self.controller.losses.is_empty() {
            lines.push(format!(
                "
/* E_hat = -u f_hat / (u^2 + u_e^2). */
static {real} lost_effectiveness({real} u, {real} f_hat, {real} squared_least_command)
{{
    const {real} scale = {one} / ((u * u) + squared_least_command);

    return (-(u * scale)) * f_hat;
}}"
            ));
        }
    }

    fn initialisation(&self, lines: &mut Vec<String>) {
        let Self { request, controller, real, .. } = self;
        let name = &request.prefix;
        let (n, q) = (self.count(Kind::State), self.count(Kind::Fault));
        let zeros = vec![self.literal(0.0); controller.faults.len()];
        let zeros = wrapped(zeros.into_iter(), "        ").join("\n");
        let zeros = zeros.trim_end_matches(',');
        lines.push(format!(
            "
void {name}_init({name}_State *state)
{{
    static const {real} no_faults[{q}] =
    {{
{zeros}
    }};

    {name}_init_at(state, x_op, no_faults);
}}

void {name}_init_at({name}_State *state, const {real} x_hat_0[{n}],
    const {real} f_hat_0[{q}])
{{
    uint32_t i;
"
        ));
        let filtered =
            if controller.filter.is_some() { "        state->y_f[i] = y_op[i];\n" } else { "" };
        for (kind, body) in [
            (Kind::State, "        state->x_hat[i] = x_hat_0[i];".to_owned()),
            (Kind::Fault, "        state->f_hat[i] = f_hat_0[i];".to_owned()),
            (Kind::Measurement, format!("{filtered}        state->y[i] = y_op[i];")),
            (Kind::Actuator, "        state->u[i] = u_op[i];".to_owned()),
            (Kind::Reference, "        state->r[i] = r_op[i];".to_owned()),
            (Kind::Integral, format!("        state->x_i[i] = {};", self.literal(0.0))),
        ] {
            if kind.count(controller) > 0 {
                self.loop_over(lines, 1, kind, &[&body]);
            }
        }
        if controller.first_compensated > 0 {
            lines.push("    state->sample = 0U;".to_owned());
        }
        if controller.filter.is_some() {
            lines.push("    state->started = false;".to_owned());
        }
        lines.push("}".to_owned());
    }

    /// A loop over the signals of a kind; `body` has its indent.
    fn loop_over(&self, lines: &mut Vec<String>, depth: usize, kind: Kind, body: &[&str]) {
        let indent = "    ".repeat(depth);
        lines.push(format!("{indent}for (i = 0U; i < {}; i++)", self.count(kind)));
        lines.push(format!("{indent}{{"));
        lines.extend(body.iter().map(|line| (*line).to_owned()));
        lines.push(format!("{indent}}}"));
    }

    fn step(&self, lines: &mut Vec<String>) {
        let Self { controller, recursion, real, capital, .. } = self;
        lines.extend([String::new(), self.signature(), "{".to_owned()]);
        for vector in locals(recursion) {
            lines.push(format!("    {real} {}[{}];", vector.name(), self.count(vector.kind())));
        }
        let compensating = match controller.first_compensated {
            0 => "compensate".to_owned(),
            _ => format!("compensate && (state->sample >= {capital}_FIRST_COMPENSATED)"),
        };
        lines.extend([
            format!("    {real} sum;"),
            "    uint32_t i;".to_owned(),
            "    uint32_t status = 0U;".to_owned(),
            "    bool finite = true;".to_owned(),
            format!("    const bool compensating = {compensating};"),
            String::new(),
        ]);
        self.inputs(lines);
        if controller.filter.is_some() {
            lines.extend(["    if (!state->started)".to_owned(), "    {".to_owned()]);
            self.loop_over(
                lines,
                2,
                Kind::Measurement,
                &["            state->y_f[i] = state->y[i];"],
            );
            lines.extend(["        state->started = true;".to_owned(), "    }".to_owned()]);
        }
        for statement in &recursion.before_limits {
            self.statement(lines, statement);
        }
        lines.extend([String::new(), "    /* Is every output a number? */".to_owned()]);
        self.check(lines, &[Vector::Command, Vector::XValue, Vector::FValue]);
        self.limits(lines);
        for statement in &recursion.after_limits {
            self.statement(lines, statement);
        }
        lines.extend([String::new(), "    /* Is the next estimate one? */".to_owned()]);
        let kept = kept(controller);
        self.check(lines, &kept.iter().map(|(next, _)| *next).collect::<Vec<_>>());
        self.keep(lines, &kept);
        self.outputs(lines);
        lines.extend(["    return status;".to_owned(), "}".to_owned()]);
    }

    /// Takes the inputs that are numbers.
    fn inputs(&self, lines: &mut Vec<String>) {
        lines.push("    /* The last finite inputs. */".to_owned());
        for (owner, fields, vector) in [
            ("measurements", &self.fields.measurements, "y"),
            ("references", &self.fields.references, "r"),
        ] {
            for (k, field) in fields.iter().enumerate() {
                let (kept, capital) = (format!("state->{vector}[{k}]"), &self.capital);
                lines.push(format!(
                    "    status = status | take(&{kept}, {owner}->{field}, {capital}_HELD);"
                ));
            }
        }
    }

    fn check(&self, lines: &mut Vec<String>, vectors: &[Vector]) {
        for vector in vectors {
            let body = format!("        finite = is_finite({}[i]) && finite;", vector.name());
            self.loop_over(lines, 1, vector.kind(), &[&body]);
        }
    }

    fn limits(&self, lines: &mut Vec<String>) {
        if !self.controller.is_limited() {
            return;
        }
        lines.extend([
            String::new(),
            "    /* The observer uses the limited commands. */".to_owned(),
        ]);
        let mut body = Vec::new();
        for (start, sign, own, value) in
            [("if", '<', "u_low", "u_min"), ("else if", '>', "u_high", "u_max")]
        {
            body.extend([
                format!("        {start} (u[i] {sign} {own}[i])"),
                "        {".to_owned(),
                format!("            u[i] = {own}[i];"),
                format!("            command[i] = {value}[i];"),
                format!("            status = status | {}_AT_LIMIT;", self.capital),
                "        }".to_owned(),
            ]);
        }
        body.extend(
            ["        else", "        {", "            /* not at a limit */", "        }"]
                .map(str::to_owned),
        );
        let body: Vec<_> = body.iter().map(String::as_str).collect();
        self.loop_over(lines, 1, Kind::Actuator, &body);
    }

    fn keep(&self, lines: &mut Vec<String>, kept: &[(Vector, Vector)]) {
        lines.extend(["    if (finite)".to_owned(), "    {".to_owned()]);
        for (next, stored) in kept {
            let body = format!("            {} = {}[i];", self.element(*stored), next.name());
            self.loop_over(lines, 2, next.kind(), &[&body]);
        }
        self.loop_over(lines, 2, Kind::Actuator, &["            state->u[i] = command[i];"]);
        lines.extend(["    }".to_owned(), "    else".to_owned(), "    {".to_owned()]);
        for (value, stored) in shown(self.controller) {
            let body = format!("            {}[i] = {};", value.name(), self.element(stored));
            self.loop_over(lines, 2, value.kind(), &[&body]);
        }
        let capital = &self.capital;
        lines.extend([
            format!("        status = (status & {capital}_HELD) | {capital}_OVERFLOW;"),
            "    }".to_owned(),
        ]);
        if self.controller.first_compensated > 0 {
            lines.extend([
                format!("    if (state->sample < {capital}_FIRST_COMPENSATED)"),
                "    {".to_owned(),
                "        state->sample++;".to_owned(),
                "    }".to_owned(),
            ]);
        }
    }

    fn outputs(&self, lines: &mut Vec<String>) {
        let Self { controller, fields, .. } = self;
        lines.push(String::new());
        for (j, field) in fields.actuators.iter().enumerate() {
            lines.push(format!("    commands->{field} = state->u[{j}];"));
        }
        for (i, field) in fields.states.iter().enumerate() {
            lines.push(format!("    estimates->x_hat_{field} = x_value[{i}];"));
        }
        for (i, field) in fields.faults.iter().enumerate() {
            lines.push(format!("    estimates->f_hat_{field} = f_value[{i}];"));
        }
        for loss in &controller.losses {
            lines.push(format!(
                "    estimates->E_hat_{} = lost_effectiveness(state->u[{}], f_value[{}],\n        {});",
                fields.faults[loss.fault],
                loss.actuator,
                loss.fault,
                self.literal(loss.least_command * loss.least_command)
            ));
        }
        for (i, field) in fields.integrals.iter().enumerate() {
            lines.push(format!("    estimates->x_i_{field} = x_i_value[{i}];"));
        }
    }

    fn statement(&self, lines: &mut Vec<String>, statement: &Statement) {
        let Statement { when, equation, target, start, operations } = statement;
        if !equation.is_empty() {
            lines.extend([String::new(), format!("    /* {equation} */")]);
        }
        let depth = usize::from(*when != When::Always);
        match when {
            When::Always => {}
            When::Compensating => lines.push("    if (compensating)".to_owned()),
            When::NotCompensating => lines.push("    if (!compensating)".to_owned()),
        }
        if depth > 0 {
            lines.push("    {".to_owned());
        }
        let indent = "    ".repeat(depth + 2);
        let mut body = Vec::new();
        if operations.is_empty() {
            body.push(format!("{indent}{}[i] = {};", target.name(), self.term(*start)));
        } else {
            body.push(format!("{indent}sum = {};", self.term(*start)));
            for operation in operations {
                body.push(format!(
                    "{indent}sum = {};",
                    match *operation {
                        Operation::Add(term) => format!("sum + {}", self.term(term)),
                        Operation::Subtract(term) => format!("sum - {}", self.term(term)),
                        Operation::TimesPeriod => format!("sum * {}_SAMPLE_TIME", self.capital),
                        Operation::Accumulate(matrix, vector) => format!(
                            "accumulate(sum, {}[i], {}, {})",
                            matrix.name(),
                            self.vector(vector),
                            self.count(vector.kind())
                        ),
                    }
                ));
            }
            body.push(format!("{indent}{}[i] = sum;", target.name()));
        }
        let body: Vec<_> = body.iter().map(String::as_str).collect();
        self.loop_over(lines, depth + 1, target.kind(), &body);
        if depth > 0 {
            lines.push("    }".to_owned());
        }
    }

    fn term(&self, term: Term) -> String {
        match term {
            Term::Zero => self.literal(0.0),
            Term::Element(vector) => self.element(vector),
            Term::Product(matrix, vector) => format!(
                "product({}[i], {}, {})",
                matrix.name(),
                self.vector(vector),
                self.count(vector.kind())
            ),
            Term::FilterStep => "filter[i] * (y[i] - y_f[i])".to_owned(),
        }
    }

    fn element(&self, vector: Vector) -> String {
        format!("{}[i]", self.vector(vector))
    }

    #[expect(clippy::unused_self, reason = "as its neighbours")]
    fn vector(&self, vector: Vector) -> String {
        let owner = if vector.is_stored() { "state->" } else { "" };
        format!("{owner}{}", vector.name())
    }
}

/// Numbers with commas, as many in a line as fit.
pub(super) fn wrapped(numbers: impl Iterator<Item = String>, indent: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for number in numbers {
        match lines.last_mut() {
            Some(line) if line.len() + number.len() + 2 <= WIDTH => {
                line.extend([" ", &number, ","]);
            }
            _ => lines.push(format!("{indent}{number},")),
        }
    }
    lines
}

fn finished(lines: &[String]) -> String {
    let mut text = lines.join("\n");
    text.push('\n');
    text
}
