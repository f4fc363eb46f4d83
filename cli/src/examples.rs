//! The examples at the end of the help of each verb.

use clap::builder::{StyledStr, Styles};

/// A command, and what it does.
type Example = (&'static str, &'static str);

pub(crate) const REPRODUCE: [Example; 3] = [
    ("aso-ftc reproduce", "Packs both FMUs and compares a run of 100 s with the paper"),
    (
        "aso-ftc reproduce --scenario paper-literal --out results/literal",
        "Does the same with the initial state that the paper states",
    ),
    ("aso-ftc reproduce --set plant.F_s=28", "Changes the static friction of the cart"),
];

pub(crate) const RUN: [Example; 3] = [
    (
        "aso-ftc run dist/FrictionPendulum.fmu dist/AsoController.fmu --explain",
        "Connects two FMUs where names are equal, and explains the algorithm",
    ),
    (
        "aso-ftc run --set plant.F_c=20 --plot plant.x_p --report",
        "Runs this pair, the default, with less friction; writes a plot and a page",
    ),
    (
        "aso-ftc run --isolate --time-limit 10 --stop-time 5",
        "Runs each FMU in its own process, so that none can crash or hang the run",
    ),
];

pub(crate) const DESIGN: [Example; 3] = [
    (
        "aso-ftc design examples/dc-servo/plant.toml --out results/design/servo.toml",
        "Writes a design and its report",
    ),
    (
        "aso-ftc design examples/dc-servo/plant.toml --out results/design/servo.toml --fmu results/design/Servo.fmu",
        "Also makes the controller FMU",
    ),
    (
        "aso-ftc design examples/dc-servo/plant.toml --compare --report results/design/laws.html",
        "Compares the laws that estimate faults",
    ),
];

pub(crate) const CAMPAIGN: [Example; 3] = [
    ("aso-ftc campaign docs/how-to/campaigns/pendulum.toml --check", "Checks a campaign"),
    ("aso-ftc campaign docs/how-to/campaigns/pendulum.toml --workers 2", "Does all of its runs"),
    (
        "aso-ftc campaign results/pendulum --show 3",
        "Prints the system.toml of one of its runs, for aso-ftc run",
    ),
];

pub(crate) const REPORT: [Example; 3] = [
    ("aso-ftc report results/reproduce/results.csv", "Writes results/reproduce/results.html"),
    (
        "aso-ftc report results/reproduce/results.csv --variables 'plant.*' --out results/plant.html",
        "Shows the variables of the plant only",
    ),
    (
        "aso-ftc report results/run/results.csv --against results/reproduce/results.csv",
        "Shows the difference of two runs",
    ),
];

pub(crate) const CHECK: [Example; 3] = [
    ("aso-ftc check dist/AsoController.fmu", "Checks the files of an FMU, and runs it"),
    ("aso-ftc check dist/AsoController.fmu --no-run", "Checks the files only"),
    ("aso-ftc check dist/AsoController.fmu --json", "Prints the findings for a program"),
];

pub(crate) const PACK: [Example; 3] = [
    ("aso-ftc pack", "Packs the plant and the controller of this clone into dist"),
    ("aso-ftc pack examples/van-der-pol --fmi both", "Packs a crate for FMI 2.0 and 3.0"),
    ("aso-ftc pack --ssp --out results/fmus", "Also writes an SSP that connects both FMUs"),
];

pub(crate) const NEW: [Example; 3] = [
    ("aso-ftc new heat-pump", "Writes the crate heat-pump with the model HeatPump"),
    ("aso-ftc new heat-pump --path models/heat-pump", "Writes it into another folder"),
    ("aso-ftc new heat-pump --fmu crates/fmu", "States where the crate fmu is"),
];

pub(crate) const COMMAND: [Example; 3] = [
    ("aso-ftc reproduce", "Repeats the paper's experiment, from the sources to the figures"),
    ("aso-ftc run --help", "Explains all options of a verb; -h lists them"),
    ("aso-ftc completions bash", "Prints completions for a shell; `aso-ftc man` a manual page"),
];

/// Returns the text of these examples with a title in the style of clap's headings.
pub(crate) fn text(examples: &[Example]) -> StyledStr {
    let header = *Styles::styled().get_header();
    let lines = examples.iter().map(|(command, effect)| format!("\n  {command}\n      {effect}"));
    format!("{header}Examples:{header:#}{}", lines.collect::<String>()).into()
}
