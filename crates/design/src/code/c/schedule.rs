//! The place of the scheduling variable in its grid, and the numbers between two points of it.

use super::Source;
use crate::code::symbols::Kind;
use crate::code::tables::operating_vectors;

impl Source<'_> {
    /// The variables of a sample that a schedule needs.
    pub(super) fn schedule_locals(&self, lines: &mut Vec<String>) {
        let Self { controller, real, .. } = self;
        if controller.schedule.is_none() {
            return;
        }
        for (vector, _) in operating_vectors(controller) {
            lines.push(format!("    {real} {}[{}];", vector.name(), self.count(vector.kind())));
        }
        if controller.is_limited() {
            let actuators = self.count(Kind::Actuator);
            lines.extend(["u_low", "u_high"].map(|own| format!("    {real} {own}[{actuators}];")));
        }
        lines.extend([format!("    {real} weights[2];"), "    uint32_t at;".to_owned()]);
    }

    /// The place in the grid, the operating point there, and the limits as deviations from it.
    pub(super) fn interpolation(&self, lines: &mut Vec<String>) {
        let Some(schedule) = &self.controller.schedule else { return };
        let theta = match schedule.measurement {
            Some(k) => format!("state->y[{k}]"),
            None => "state->theta".to_owned(),
        };
        lines.extend([
            String::new(),
            "    /* The operating point at the scheduling variable. */".to_owned(),
            format!("    status = status | find_place({theta}, &at, weights);"),
        ]);
        for (vector, table) in operating_vectors(self.controller) {
            let name = vector.name();
            let body = format!(
                "        {name}[i] = ({table}[at][i] * weights[0]) + ({table}[at + 1U][i] * weights[1]);"
            );
            self.loop_over(lines, 1, vector.kind(), &[&body]);
        }
        if self.controller.is_limited() {
            let [low, high] = ["low", "high"].map(|side| {
                let limit = if side == "low" { "u_min" } else { "u_max" };
                format!("        u_{side}[i] = {limit}[i] - u_op[i];")
            });
            self.loop_over(lines, 1, Kind::Actuator, &[&low, &high]);
        }
    }

    /// The functions that a schedule needs.
    pub(super) fn schedule_helpers(&self, lines: &mut Vec<String>) {
        if self.controller.schedule.is_none() {
            return;
        }
        let Self { real, capital, .. } = self;
        let (zero, one, points) = (self.literal(0.0), self.literal(1.0), self.count(Kind::Point));
        lines.push(format!(
            "
/* Finds the interval of the grid that has theta, from its point `at` on, and the weights of the two
 * points. Theta beyond the grid is held at its end; the flag says so. */
static uint32_t find_place({real} theta, uint32_t *at, {real} weights[2])
{{
    {real} value = theta + {zero};
    uint32_t first = 0U;
    uint32_t status = 0U;
    uint32_t i;

    if (value < grid[0])
    {{
        value = grid[0];
        status = {capital}_OUTSIDE;
    }}
    else if (value > grid[{points} - 1U])
    {{
        value = grid[{points} - 1U];
        status = {capital}_OUTSIDE;
    }}
    else
    {{
        /* within the grid */
    }}
    for (i = 1U; i < ({points} - 1U); i++)
    {{
        if (value >= grid[i])
        {{
            first = i;
        }}
    }}
    weights[1] = (value - grid[first]) / (grid[first + 1U] - grid[first]);
    weights[0] = {one} - weights[1];
    *at = first;
    return status;
}}

/* Adds a row between two points times a vector to a sum, one product after the other. */
static {real} accumulate_between({real} start, const {real} low[], const {real} high[],
    const {real} weights[2], const {real} vector[], uint32_t count)
{{
    {real} sum = start;
    uint32_t k;

    for (k = 0U; k < count; k++)
    {{
        sum = sum + (((low[k] * weights[0]) + (high[k] * weights[1])) * vector[k]);
    }}
    return sum;
}}

/* A row between two points times a vector. */
static {real} product_between(const {real} low[], const {real} high[], const {real} weights[2],
    const {real} vector[], uint32_t count)
{{
    return accumulate_between(-{zero}, low, high, weights, vector, count);
}}"
        ));
    }
}
