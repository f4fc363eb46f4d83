//! Direct feedthrough, y = C x + D u: what it needs, and what is not possible with it.
//!
//! The controller knows its commands and takes D u off the measurements. A fault of an actuator enters the measurements
//! with the command, and must pass a measurement filter, which such a plant therefore needs.

use control::faults::FaultEntry;
use files::PlaceError;

use crate::plant::linear::LinearPlant;
use plant_file::PlantFile;
use plant_file::requirements::Requirement;

/// Refuses a plant with feedthrough and no filter, a filter that nothing needs, and with feedthrough all entries that
/// are for plants without it.
pub(crate) fn check(file: &PlantFile<'_>, linear: &LinearPlant) -> Result<(), PlaceError> {
    let LinearPlant { d, models, measurements, actuators, undelayed, .. } = linear;
    let entries = || (0..d.nrows()).flat_map(|row| (0..d.ncols()).map(move |column| (row, column)));
    let Some((row, column)) = entries().find(|at| d[*at] != 0.0) else {
        let measured = models.iter().any(|model| model.entry.is_measured());
        if file.filter.is_none() || measured {
            return Ok(());
        }
        let delayed = undelayed.d.amax() > 0.0;
        let why = if delayed { "every command that enters one is delayed" } else { "D is 0" };
        let message = format!("no fault enters a measurement, and {why}, so none is needed");
        return Err(file.error(&["filter"], message));
    };
    let fed = format!(
        "the measurement {} depends on {} directly (D is {})",
        measurements[row].name,
        actuators[column].name,
        d[(row, column)]
    );
    if file.filter.is_none() {
        let message = format!(
            "{fed}, which needs `filter`: the rates, in 1/s, of the filter that the measurements pass"
        );
        return Err(file.error(&["D", "measurements"], message));
    }
    for (fault, model) in file.faults.iter().zip(models) {
        if let FaultEntry::LossOfEffectiveness(input) = model.entry
            && d.column(input).amax() > 0.0
        {
            let message = format!(
                "fault `{}`: the measurements contain the command of this actuator directly (D), and its \
                 loss would be seen in them; expected `actuator`, an additive fault",
                fault.name
            );
            return Err(file.error_at(&fault.place, message));
        }
    }
    let referred = file.references.as_ref().map(|references| &references.h * d);
    let refused = [
        ("family", !file.family.is_empty()),
        ("schedule", file.is_scheduled()),
        ("loop", file.loop_shape.is_some()),
        ("reconfiguration", file.reconfiguration.is_some()),
        ("fallback", file.fallback.is_some()),
        ("reference", referred.is_some_and(|h_d| h_d.amax() > 0.0)),
    ];
    if let Some((key, _)) = refused.into_iter().find(|(_, stated)| *stated) {
        let advice = match key {
            "reference" => "expected references of measurements without it",
            "loop" => "expected `feedback` and `observer` in its place",
            _ => "expected a plant without it, for example measurements that are filtered before",
        };
        return Err(file.error(&[key], format!("{fed}; `{key}` is not possible then: {advice}")));
    }
    if let Requirement::HInfinity { .. } = file.feedback.requirement {
        let message = format!(
            "{fed}; the norm of the feedback is not possible then: expected `eigenvalues`, `region` or `Q` \
             and `R`"
        );
        return Err(file.error_at(&file.feedback.place, message));
    }
    match &file.detection {
        Some(detection) if detection.model_error.is_some() => {
            let message = format!("{fed}; `model_error` is not possible then");
            Err(file.error_at(&detection.place, message))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::designed::design;
    use crate::tests::read;

    const MASS: &str = "A = [[0, 1], [-20, -1]]\nB = [[0], [2]]\nC = [[1, 0], [-20, -1]]\nD = [[0], [2]]\n\
        measurements = [\"q\", \"acceleration\"]\nactuator_faults = \"all\"\nfilter = 60\n\
        feedback.eigenvalues = [-5, -6]\nobserver.eigenvalues = [-20, -25, -30, -35, -40]\n";

    /// The error for `MASS` with `from` replaced by `to`.
    fn refused(from: &str, to: &str) -> String {
        assert!(MASS.contains(from), "{from}");
        let error = read(&MASS.replacen(from, to, 1), |file| design(file).err());
        error.expect("a plant file").map_or("none".to_owned(), |error| error.to_string())
    }

    #[test]
    fn what_is_not_possible_with_feedthrough_is_refused_at_its_line() {
        assert_eq!(refused("filter = 60", "filter = 61"), "none");
        let losses = "faults = [{ name = \"f\", loss_of = \"u1\", least_command = 1 }]";
        let detected = "[detection]\nmethod = \"cusum\"\nfalse_alarm_interval = 1e4\nmodel_error = 1.2\n\
                        noise = 0.01\nsizes = { f_u1 = 1 }\ncommands = { u1 = 1 }";
        let observer = "observer.eigenvalues = [-20, -25, -30, -35, -40]";
        for (from, to, expected) in [
            (
                "filter = 60",
                "",
                "plant.toml:4:5: the measurement acceleration depends on u1 directly (D is 2), which needs `filter`",
            ),
            (
                "D = [[0], [2]]",
                "",
                "7:10: no fault enters a measurement, and D is 0, so none is needed",
            ),
            (
                "actuator_faults = \"all\"",
                losses,
                "6:11: fault `f`: the measurements contain the command of this actuator",
            ),
            (
                "filter = 60",
                "filter = 60\nreference.track = [\"acceleration\"]",
                "`reference` is not possible then: expected references of",
            ),
            (
                "feedback.eigenvalues = [-5, -6]",
                "feedback.h_infinity = 3",
                "the norm of the feedback is not possible then",
            ),
            (
                observer,
                &format!("{observer}\n[fallback]\nactuators = \"all\"\nloss = 0.5\n"),
                "`fallback` is not possible then",
            ),
            (observer, &format!("{observer}\n{detected}"), "`model_error` is not possible then"),
        ] {
            let error = refused(from, to);
            assert!(error.contains(expected), "{from} -> {to}: {error}");
        }
    }

    /// An FMU has D without an entry `D` in the file, which `[loop]` excludes.
    #[test]
    fn the_shape_of_a_loop_with_the_feedthrough_of_an_fmu_is_refused() {
        let text = "A = [[-1]]\nB = [[1]]\nC = [[1]]\nactuator_faults = \"all\"\nfilter = 60\n\
                    loop.bandwidth = 1\n";
        let refusal = read(text, |file| {
            let mut linear = LinearPlant::of(file).expect("a plant");
            linear.d[(0, 0)] = 2.0;
            check(file, &linear).expect_err("a refusal").to_string()
        })
        .expect("a plant file");
        let expected = "`loop` is not possible then: expected `feedback` and `observer`";
        assert!(refusal.contains(expected), "{refusal}");
    }
}
