//! The sections on theorem 1, the free P, norms and bounds.

use maud::{Markup, html};

use super::matrix::square;
use super::table::{Cell, Columns, table, table_of};
use design_report::{Bound, FreeP, Norm, Report, Theorem1, Ultimate};

pub(super) fn bounds(report: &Report) -> Markup {
    let columns: Columns<'_, Bound, 5> = [
        ("fault → quantity", |bound| (&format!("{} → {}", bound.fault, bound.error)).into()),
        ("unit of the quantity", |bound| (&bound.unit).into()),
        ("gain of the fault", |bound| bound.gain_of_fault.into()),
        ("gain of its rate", |bound| bound.gain_of_rate.into()),
        ("bound of the quantity", |bound| bound.largest.into()),
    ];
    html! {
        p {
            "The peak-to-peak (L1) gain is the largest magnitude that a quantity can reach while \
             the fault, or its rate, stays within plus and minus one. The gain of the rate does not \
             count what the commands leave of the fault itself. The bound is the gain of the \
             fault times its " code { "bound" } " in the plant file. A constant fault that has a "
            code { "rate_bound" } ", too, has a smaller one if the gain of its rate times "
            code { "rate_bound" } ", with what the commands leave of the fault, is less; without "
            code { "bound" } ", if they leave nothing. A bound by the rate does not hold for a sudden \
             change, such as " code { "step" } ", whose largest errors the responses show."
        }
        (table_of("Largest values", &report.bounds, &columns))
    }
}

pub(super) fn certificate(report: &Report) -> Markup {
    let certificate = &report.certificate;
    html! {
        h3 { "Theorem 1 as printed (Patton and Klinkhieo, 2009)" }
        p.formula {
            "P (A" sub { "0" } " − L C" sub { "0" } ") + (A" sub { "0" } " − L C" sub { "0" } ")"
            sup { "T" } " P = −α β I" span.equation { "(12)" }
        }
        p.formula {
            "δ = (2 / α) √" span.root { "λ" sub { "max" } "(P F" sub { "0" } " F" sub { "0" }
            sup { "T" } " P)" } span.equation { "(16)" }
        }
        @match &certificate.printed {
            Ok(theorem) => (printed(report, theorem)),
            Err(reason) => p { strong { "It does not hold here: " } (reason) },
        }
        h3 { "The same with free P" }
        @match &certificate.free {
            Ok(free) => (self::free(report, free)),
            Err(reason) => p { strong { "It was not found: " } (reason) },
        }
        h3 { "Ultimate bound of the error for bounded rates" }
        @match &certificate.ultimate {
            Ok(ultimate) => (self::ultimate(report, ultimate)),
            Err(reason) => p { strong { "It is not known: " } (reason) },
        }
        (norms(&certificate.norms))
    }
}

fn ultimate(report: &Report, ultimate: &Ultimate) -> Markup {
    let rows = [
        ("bound of the norm of the rates", ultimate.rate),
        ("radius of the ball around the ellipsoid", ultimate.radius),
        ("margin of the inequalities, relative", ultimate.margin),
    ];
    let names = error_names(report, ultimate.peaks.len());
    let peaks: Vec<(&str, f64)> =
        names.iter().map(String::as_str).zip(ultimate.peaks.iter().copied()).collect();
    html! {
        p {
            "The smallest ball with an ellipsoid inside that the error does not leave once it is \
             there, by linear matrix inequalities, while the faults change no faster than stated."
        }
        (numbers("Invariant ellipsoid", &rows))
        (numbers("Largest value of each error in it", &peaks))
    }
}

fn printed(report: &Report, theorem: &Theorem1) -> Markup {
    let rows = [
        ("α, the design parameter", theorem.alpha),
        ("β, the bound of the fault", theorem.beta),
        ("δ, the bound of the error", theorem.delta),
        ("least eigenvalue of P", theorem.smallest_eigenvalue),
        ("largest eigenvalue of P", theorem.largest_eigenvalue),
        ("relative residual of (12)", theorem.residual),
    ];
    html! {
        p {
            "The theorem says that the estimation error ends within a ball of radius δ around \
             zero; what follows from P is that it ends in the smallest ellipsoid of P around that \
             ball. P grows in proportion to α, which therefore cancels in δ: other than the paper \
             says, a larger α does not shrink the region. One number for all errors, in whatever \
             units they have, says little of any of them; the table of largest values says more."
        }
        (numbers("Theorem 1", &rows))
        (p_matrix(report, "p-printed", ["P", "solution of (12)"], &theorem.p))
    }
}

fn free(report: &Report, free: &FreeP) -> Markup {
    let rows = [
        ("largest certified decay rate (1/s)", free.decay),
        ("margin of its inequality, relative", free.decay_margin),
        ("smallest certified δ", free.delta),
        ("margin of the inequalities, relative", free.margin),
    ];
    html! {
        p {
            "P is not tied to the right side of (12): any P with P (A₀ − L C₀) + (A₀ − L C₀)ᵀ P ≤ −I \
             serves the theorem as well, and the one with the smallest δ is taken; for the decay rate \
             any P with P (A₀ − L C₀) + (A₀ − L C₀)ᵀ P < −2 α P. The solver is not trusted: the inequalities \
             were checked again by eigenvalues, and hold by the margin stated."
        }
        (numbers("Free P", &rows))
        (p_matrix(report, "p-free", ["P_free", "by linear matrix inequalities"], &free.p))
    }
}

fn numbers(caption: &str, rows: &[(&str, f64)]) -> Markup {
    let rows: Vec<Vec<Cell>> =
        rows.iter().map(|(name, value)| vec![(*name).into(), (*value).into()]).collect();
    table(caption, ["quantity", "value"], &rows)
}

/// Returns the row names of L_x and L_f as names of `count` errors; numbers from 1 if there are not as many rows.
fn error_names(report: &Report, count: usize) -> Vec<String> {
    let rows = |gain| report.gains.iter().filter(move |matrix| matrix.name == gain);
    let named: Vec<String> =
        rows("L_x").chain(rows("L_f")).flat_map(|matrix| matrix.rows.clone()).collect();
    if named.len() == count { named } else { (1..=count).map(|k| k.to_string()).collect() }
}

/// Returns the matrix P with the names of the errors for rows and columns; `titles`: its name and its meaning.
fn p_matrix(report: &Report, id: &str, titles: [&str; 2], values: &[Vec<f64>]) -> Markup {
    square(id, titles, &error_names(report, values.len()), values)
}

fn norms(norms: &[Norm]) -> Markup {
    let columns: Columns<'_, Norm, 5> = [
        ("norm", |norm| (&norm.name).into()),
        ("from", |norm| (&norm.from).into()),
        ("to", |norm| (&norm.to).into()),
        ("value", |norm| norm.value.into()),
        ("method", |norm| (&norm.method).into()),
    ];
    html! {
        @if !norms.is_empty() {
            h3 { "Norms" }
            (table_of("Norms of the error's dynamics", norms, &columns))
        }
    }
}
