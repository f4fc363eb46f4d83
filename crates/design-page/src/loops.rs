//! The sections on the eigenvalues of the loops: maps, tables, conditioning.

use maud::{Markup, html};

use super::number::number;
use super::plane::{Plane, Pole, pairs};
use super::pole_map::{Group, Map, Sign};
use super::table::{Cell, Columns, table, table_of};
use design_report::number::rounded;
use design_report::{Loop, LowerBoundFor, NormReport, Plant, Region, Report};

/// Returns the required and the actual eigenvalues of a loop, mapped by `place`; no group without eigenvalues.
fn groups(system: &Loop, place: impl Fn(Pole) -> Pole) -> Vec<Group> {
    [("required", Sign::Ring, &system.required), ("reached", Sign::Cross, &system.eigenvalues)]
        .into_iter()
        .map(|(name, sign, poles)| group(name, sign, poles, &place))
        .filter(|group| !group.poles.is_empty())
        .collect()
}

/// Returns the eigenvalues mapped by `place`, without those whose real part is then not finite.
fn group(name: &'static str, sign: Sign, poles: &[Pole], place: impl Fn(Pole) -> Pole) -> Group {
    let places = poles.iter().map(|pole| place(*pole)).filter(|place| place[0].is_finite());
    Group { name, sign, poles: places.collect() }
}

/// Shows the maps in 1/s; for a sampled loop, also the maps of the z-plane.
fn maps(report: &Report, plane: Plane) -> Markup {
    let (feedback, observer) = (&report.feedback, &report.observer);
    let (slow, fast) = (feedback.region.as_ref(), observer.region.as_ref());
    let rate = |pole| plane.rate(pole);
    let of_plant = Plane::of_plant(&report.plant);
    let open = |place: fn(Plane, Pole) -> Pole| {
        let place = |pole| place(plane, of_plant.rate(pole));
        group("open loop", Sign::Diamond, &report.plant.eigenvalues, place)
    };
    let with_open = |open, mut groups: Vec<Group>| {
        groups.insert(0, open);
        groups
    };
    let both = with_open(open(|_, pole| pole), groups(feedback, rate));
    let all = [
        open(|_, pole| pole),
        group("feedback loop", Sign::Cross, &feedback.eigenvalues, rate),
        group("observer", Sign::Square, &observer.eigenvalues, rate),
    ];
    let map = |id, title, plane, groups: &[Group], region| {
        Map { id, title, plane, groups, region }.figure()
    };
    let s = Plane::Continuous;
    html! {
        div.figures {
            (map("map-feedback", "Feedback loop and open loop", s, &both, slow))
            (map("map-observer", "Observer", s, &groups(observer, rate), fast))
            (map("map-all", "All eigenvalues", s, &all, None))
            @if let Plane::Sampled(_) = plane {
                @let both = with_open(open(Plane::place), groups(feedback, |pole| pole));
                (map("map-feedback-z", "Feedback loop and open loop, z-plane", plane, &both, slow))
                @let only = groups(observer, |pole| pole);
                (map("map-observer-z", "Observer, z-plane", plane, &only, fast))
            }
        }
    }
}

/// Shows maps and tables of the eigenvalues.
pub(super) fn poles(report: &Report) -> Markup {
    let plane = Plane::of(report);
    let (feedback, observer) = (&report.feedback, &report.observer);
    html! {
        p {
            "Where the axes show powers of ten, they are linear around zero and have decades "
            "beyond. The pointer on a sign shows all its digits."
            @if let Plane::Sampled(period) = plane {
                " The loops are sampled every T = " (number(period)) " s: a loop is stable when its \
                 eigenvalues z lie within the circle of radius one. The maps in 1/s show ln z / T, \
                 the eigenvalues of the continuous system with the same samples."
            }
        }
        (maps(report, plane))
        (region("feedback loop", feedback.region.as_ref()))
        (region("observer", observer.region.as_ref()))
        div.side {
            (eigenvalues("Feedback loop", feedback, plane))
            (eigenvalues("Observer", observer, plane))
            (open_loop(&report.plant))
        }
    }
}

/// Shows the required region of the eigenvalues; nothing without one.
fn region(name: &str, region: Option<&Region>) -> Markup {
    let Some(region) = region else { return html! {} };
    html! {
        p {
            "Requirements on the eigenvalues of the " (name) ":"
            @if let Some(decay) = region.decay {
                " real parts below −" (number(decay)) " 1/s;"
            }
            @if let Some((center, radius)) = region.disc_center.zip(region.disc_radius) {
                " at most " (number(radius)) " 1/s from " (number(center)) " 1/s;"
            }
            @if let Some(sector) = region.sector {
                " at most " (number(sector)) "° from the negative real axis (damping ratio at \
                 least " (rounded(sector.to_radians().cos())) ");"
            }
            " this is the region whose boundary the map shows."
        }
    }
}

/// Shows a row for each eigenvalue: required, actual, and its properties.
fn eigenvalues(name: &str, system: &Loop, plane: Plane) -> Markup {
    let rows: Vec<_> = pairs(system)
        .into_iter()
        .enumerate()
        .map(|(index, (required, reached))| {
            let rate = reached.map(|pole| plane.rate(pole)).filter(|rate| rate[0].is_finite());
            let equivalent = if matches!(plane, Plane::Continuous) { None } else { rate };
            let frequency = rate.map(|rate| rate[0].hypot(rate[1]));
            let damping = rate.zip(frequency).map(|(rate, size)| -rate[0] / size);
            vec![
                Cell::Text((index + 1).to_string()),
                required.into(),
                reached.into(),
                equivalent.into(),
                frequency.into(),
                damping.filter(|ratio| ratio.is_finite()).into(),
            ]
        })
        .collect();
    let unit = plane.unit();
    let heads = [
        "no.",
        &format!("required{unit}"),
        &format!("reached{unit}"),
        "equivalent ln z / T (1/s)",
        "natural frequency (rad/s)",
        "damping ratio",
    ];
    table(&format!("{name}, {}", system.matrix), heads, &rows)
}

fn open_loop(plant: &Plant) -> Markup {
    let plane = Plane::of_plant(plant);
    let row = |(index, pole): (usize, &Pole)| {
        let stable = if plane.is_stable(*pole) { "stable" } else { "not stable" };
        vec![Cell::Text((index + 1).to_string()), Some(*pole).into(), stable.into()]
    };
    let rows: Vec<_> = plant.eigenvalues.iter().enumerate().map(row).collect();
    table("Open loop, A", ["no.", &format!("eigenvalue{}", plane.unit()), "on its own"], &rows)
}

/// Shows how the gains were found and how well conditioned the loops are.
pub(super) fn conditioning<'a>(report: &'a Report) -> Markup {
    let columns: Columns<'_, (&'a str, &'a Loop), 6> = [
        ("loop", |(name, _)| (*name).into()),
        ("matrix", |(_, system)| (&system.matrix).into()),
        ("method", |(_, system)| (&system.method).into()),
        ("condition", |(_, system)| system.condition.into()),
        ("condition, balanced", |(_, system)| system.balanced_condition.into()),
        ("pole error, relative", |(_, system)| system.pole_error.into()),
    ];
    let loops = [("feedback", &report.feedback), ("observer", &report.observer)];
    html! {
        (table_of("Condition of the eigenvectors, and distance from the required eigenvalues", &loops, &columns))
        p {
            "A change of the matrix moves an eigenvalue by at most the condition number times the \
             norm of the change (Bauer and Fike, 1960). Balanced: in coordinates \
             scaled so that rows and columns of the matrix have similar size, with little of the \
             part that comes from the units of the states. The pole error is the largest distance of an eigenvalue from the \
             required one, relative to that."
        }
        (norms(report))
    }
}

/// Shows the weights over frequency of the norms by which gains were designed; empty without weights.
fn weights(report: &Report) -> Markup {
    let polynomial =
        |all: &[f64]| all.iter().map(|one| format!("{one:.5e}")).collect::<Vec<_>>().join(", ");
    let loops =
        [&report.feedback, &report.observer].into_iter().filter_map(|one| one.norm.as_ref());
    let rows: Vec<_> = loops
        .flat_map(|norm| &norm.weights)
        .map(|weight| {
            vec![
                weight.signal.as_str().into(),
                Cell::Text(polynomial(&weight.numerator)),
                Cell::Text(polynomial(&weight.denominator)),
                weight.table_deviation.map(|factor| 20.0 * factor.log10()).into(),
            ]
        })
        .collect();
    let variable = if report.sampling.is_some() { "z" } else { "s" };
    let heads = [
        "signal",
        &format!("numerator in {variable}, highest power first"),
        "denominator",
        "largest deviation from the table (dB)",
    ];
    html! { @if !rows.is_empty() { (table("Weights over frequency", heads, &rows)) } }
}

/// The gains or filters for which a lower bound holds, in words.
fn bound_for(scope: LowerBoundFor) -> &'static str {
    match scope {
        LowerBoundFor::Filters => "all filters",
        LowerBoundFor::Disc => "disc",
    }
}

/// Shows the norms by which gains were designed, with their bounds; empty without such gains.
fn norms<'a>(report: &'a Report) -> Markup {
    let loops = [("feedback", &report.feedback), ("observer", &report.observer)];
    let norms = loops.into_iter().filter_map(|(name, system)| Some((name, system.norm.as_ref()?)));
    let norms: Vec<_> = norms.collect();
    let columns: Columns<'_, (&'a str, &'a NormReport), 9> = [
        ("loop", |(name, _)| (*name).into()),
        ("from, to", |(_, norm)| (&norm.channel).into()),
        ("norm", |(_, norm)| norm.norm.into()),
        ("proven bound", |(_, norm)| norm.certified.into()),
        ("lower bound", |(_, norm)| norm.lower_bound.into()),
        ("lower bound for", |(_, norm)| norm.lower_bound_for.map_or("", bound_for).into()),
        ("gap (%)", |(_, norm)| norm.gap.map(|gap| 100.0 * gap).into()),
        ("without weights and noise", |(_, norm)| norm.unweighted.into()),
        ("norm of the gain", |(_, norm)| norm.gain.into()),
    ];
    html! {
        @if !norms.is_empty() {
            (table_of("H-infinity norms", &norms, &columns))
            p {
                "No observer, of any order, and no state feedback, even one that knows the states of the \
                 weights, has a norm below the lower bound. A lower bound marked \"disc\" holds only for \
                 gains that place all eigenvalues in the disc of the region. The gap is the relative \
                 distance from the lower bound; with a lower bound of 0, ever larger gains lower the norm \
                 without end."
            }
            (weights(report))
        }
    }
}
