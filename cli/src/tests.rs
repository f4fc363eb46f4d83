use super::*;

/// Columns of a terminal.
const COLUMNS: usize = 80;

/// The command, then its verbs, with help texts for a terminal of this width.
fn commands() -> Vec<clap::Command> {
    let mut command = Arguments::command().term_width(COLUMNS);
    command.build();
    std::iter::once(command.clone()).chain(command.get_subcommands().cloned()).collect()
}

/// The verbs of the help.
fn verbs() -> Vec<clap::Command> {
    commands().into_iter().skip(1).filter(|verb| !verb.is_hide_set()).collect()
}

fn is_documented(argument: &clap::Arg) -> bool {
    !argument.is_hide_set() && argument.get_id() != "help" && argument.get_id() != "version"
}

#[test]
fn the_short_help_has_a_line_of_80_columns_for_each_option() {
    for mut command in commands() {
        let help = command.render_help().to_string();
        for line in help.lines() {
            assert!(line.chars().count() <= COLUMNS, "{line:?}");
            assert!(!line.starts_with("       "), "{line:?} continues a line");
        }
        for argument in command.get_arguments().filter(|argument| is_documented(argument)) {
            let help = help.clone();
            let sentence = argument.get_help().unwrap().to_string();
            let line = help.lines().find(|line| line.contains(&sentence));
            let line = line.unwrap_or_else(|| panic!("{sentence:?} is not on one line of\n{help}"));
            let name = argument.get_long().map(|name| format!("--{name}"));
            assert!(line.contains(&name.unwrap_or_default()), "{line}");
        }
    }
}

#[test]
fn the_options_of_a_run_are_in_six_groups() {
    let run = verbs().into_iter().find(|verb| verb.get_name() == "run").unwrap();
    let options = run.get_arguments().filter(|argument| !argument.is_positional());
    let headings: Vec<_> =
        options.filter(|option| is_documented(option)).map(clap::Arg::get_help_heading).collect();
    let mut groups = headings.clone();
    groups.sort_unstable();
    groups.dedup();
    let expected = ["Algorithm", "Faults and safety", "Results", "System", "Time", "Watching"];
    assert_eq!(groups, expected.map(Some));
    let largest =
        expected.map(|name| headings.iter().filter(|option| **option == Some(name)).count());
    assert!(largest.iter().all(|count| (3..=13).contains(count)), "{largest:?}");
}

#[test]
fn each_verb_ends_its_help_with_three_examples_that_it_accepts() {
    for verb in verbs().iter().filter(|verb| verb.get_name() != "help") {
        let text = verb.get_after_long_help().unwrap().to_string();
        let start = format!("  aso-ftc {} ", verb.get_name());
        let examples: Vec<_> = text.lines().map(|line| format!("{line} ")).collect();
        let examples = examples.iter().filter(|line| line.starts_with(&start));
        let examples: Vec<_> = examples.collect();
        assert_eq!(examples.len(), 3, "{text}");
        for example in examples {
            let words = example.split_whitespace().map(|word| word.trim_matches('\''));
            if let Err(error) = Arguments::try_parse_from(words) {
                panic!("{example}: {error}");
            }
        }
    }
}

#[test]
fn the_reference_lists_each_verb() {
    let page = include_str!("../../docs/reference/command-line.md");
    let names: Vec<_> = commands().iter().skip(1).map(|verb| verb.get_name().to_owned()).collect();
    for name in names.iter().filter(|name| *name != "help") {
        assert!(page.contains(&format!("| `{name}` |")), "{name}");
    }
}

#[test]
fn a_time_limit_that_would_have_no_effect_is_refused() {
    let is_accepted = |more: &[&str]| {
        let words = ["aso-ftc", "design", "plant.toml"].into_iter().chain(more.iter().copied());
        Arguments::try_parse_from(words).is_ok()
    };
    for more in [&["--compare"][..], &["--init"], &["--init", "--gain-time=9"]] {
        assert!(is_accepted(more), "{more:?}");
    }
    for (form, limit) in [
        ("--compare", "--gain-time=9"),
        ("--compare", "--certificate-time=9"),
        ("--init", "--certificate-time=9"),
    ] {
        assert!(!is_accepted(&[form, limit]), "{form} {limit}");
    }
}

#[test]
fn a_campaign_that_only_shows_its_results_takes_no_option_of_runs() {
    let is_accepted = |more: &str| {
        let words = ["aso-ftc", "campaign", "results/a"].into_iter().chain(more.split(' '));
        Arguments::try_parse_from(words).is_ok()
    };
    for form in ["--show=3", "--report=a.html"] {
        assert!(is_accepted(form), "{form}");
        for other in ["--out=b", "--workers=2", "--scheduler=c", "--live", "--check"] {
            assert!(is_accepted(other) && !is_accepted(&format!("{form} {other}")), "{other}");
        }
    }
    assert!(!is_accepted("--show=3 --report=a.html"));
}
