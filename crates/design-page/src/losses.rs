//! The section on losses of effectiveness.

use maud::{Markup, html};

use super::number::number;
use super::plant::effectiveness;
use super::table::{Cell, Columns, table, table_of};
use design_report::Report;
use design_report::losses::{LossLoop, LossPeak, LossReport, described};

pub(super) fn losses(report: &Report) -> Markup {
    html! {
        (effectiveness(report))
        @if let Some(losses) = &report.losses { (proofs(losses)) }
    }
}

/// The proofs about losses up to the stated fractions.
fn proofs(losses: &LossReport) -> Markup {
    html! {
        p {
            "The plant file states losses up to " (described(&losses.stated)) ". A loss may have any value \
             from 0 to this one. Proven are losses that change at any time and as fast as they like: one \
             matrix P decreases xᵀ P x along all motions (quadratic stability; Boyd et al. 1994). The \
             inequalities are checked again by eigenvalues. Losses beyond the largest constant ones make \
             the loop unstable. Between the two, constant losses are stable as far as they were tested, \
             and nothing is known of losses that change."
        }
        @for loop_losses in &losses.loops { (of_loop(loop_losses, losses)) }
    }
}

fn of_loop(loop_losses: &LossLoop, losses: &LossReport) -> Markup {
    let limits: Vec<Vec<Cell>> = loop_losses
        .constant
        .iter()
        .enumerate()
        .map(|(at, constant)| {
            let certified = loop_losses.certified.get(at);
            let case = match at {
                0 if losses.stated.len() > 1 => {
                    "all, in proportion to the stated losses".to_owned()
                }
                0 => losses.stated[0].name.clone(),
                at => format!("{} alone", losses.stated[at - 1].name),
            };
            vec![
                (&case).into(),
                certified.map_or(Cell::Missing, |bound| (&described(&bound.losses)).into()),
                certified.map(|bound| bound.factor).into(),
                (&described(&constant.losses)).into(),
                Some(constant.factor).filter(|_| !constant.stable).into(),
                if constant.stable { "stable up to here" } else { "unstable beyond" }.into(),
            ]
        })
        .collect();
    let heads = [
        "losses",
        "proven up to",
        "factor of the stated losses",
        "largest constant losses",
        "their factor",
        "there",
    ];
    let peaks: Columns<'_, LossPeak, 4> = [
        ("disturbance → state", |peak| {
            (&format!("{} → {}", peak.disturbance, peak.state)).into()
        }),
        ("largest disturbance", |peak| peak.size.into()),
        ("bound of the state", |peak| peak.largest.into()),
        ("unit", |peak| (&peak.unit).into()),
    ];
    html! {
        h3 { "Losses, " (loop_losses.name) }
        p { (loop_losses.meaning) "." }
        @match &loop_losses.proof {
            Ok(proof) => {
                p {
                    strong { "The stated losses are proven" } " with the margin "
                    (number(proof.margin))
                    @if let Some(decay) = proof.decay {
                        "; the loop decays with at least " (number(decay)) " 1/s for all of them"
                    }
                    "."
                }
            }
            Err(reason) => p { strong { "The stated losses are not proven: " } (reason) "." },
        }
        (table(&format!("Limits of the losses, {}", loop_losses.name), heads, &limits))
        @if let Ok(proof) = &loop_losses.proof {
            @let caption = format!("Largest states for all stated losses, {}", loop_losses.name);
            (table_of(&caption, &proof.peaks, &peaks))
        }
    }
}
