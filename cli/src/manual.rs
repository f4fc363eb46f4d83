//! `aso-ftc completions` and `aso-ftc man`: completions and manual pages, which a package installs beside the command.

use std::path::PathBuf;

use clap_complete::Shell;
use clap_mangen::Man;

use crate::outputs;

#[derive(clap::Args)]
pub(crate) struct CompletionOptions {
    /// The shell
    shell: Shell,
}

#[derive(clap::Args)]
pub(crate) struct ManOptions {
    /// Write the pages of all verbs into this folder
    ///
    /// Without it, the page of the command itself goes to standard output.
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
}

/// Prints the completions of `command` for a shell.
pub(crate) fn completions(options: &CompletionOptions, mut command: clap::Command) {
    let name = command.get_name().to_owned();
    let mut script = Vec::new();
    clap_complete::generate(options.shell, &mut command, &name, &mut script);
    // For bash, clap_complete 4.6 escapes the hyphen of the name in two ways. Its script then completes
    // no option of a verb.
    let escaped = ["__subcmd__", "__"].map(|separator| name.replace('-', separator));
    print!("{}", String::from_utf8_lossy(&script).replace(&escaped[0], &escaped[1]));
}

/// Writes the manual pages of `command` and its verbs to the folder `--out`; by default, prints the one of `command`.
pub(crate) fn man(options: &ManOptions, command: clap::Command) -> anyhow::Result<()> {
    let pages = pages(command)?;
    let Some(folder) = &options.out else {
        print!("{}", pages[0].1);
        return Ok(());
    };
    for (name, text) in pages {
        let path = folder.join(name);
        outputs::write(&path, text.as_bytes())?;
        println!("{}", path.display());
    }
    Ok(())
}

/// Returns file name and text of the manual pages: first of `command`, then of its verbs that are not hidden.
fn pages(command: clap::Command) -> std::io::Result<Vec<(String, String)>> {
    let mut command = command.disable_help_subcommand(true);
    command.build();
    let verbs = command.get_subcommands().filter(|verb| !verb.is_hide_set());
    std::iter::once(&command).chain(verbs).map(page).collect()
}

fn page(command: &clap::Command) -> std::io::Result<(String, String)> {
    let examples = command.get_after_long_help().map(ToString::to_string).unwrap_or_default();
    let man = Man::new(command.clone().after_long_help(None::<&str>));
    let man = man.source(concat!("aso-ftc ", env!("CARGO_PKG_VERSION")));
    let mut page = Vec::new();
    man.render(&mut page)?;
    let page = String::from_utf8_lossy(&page);
    Ok((man.get_filename(), page.trim_end().to_owned() + &section(&examples)))
}

/// Converts the end of a help text, `Title:` and lines, to a section of a manual page with the same line breaks.
/// Returns an empty line for a text without this form.
fn section(text: &str) -> String {
    let Some((title, lines)) = text.split_once(":\n") else { return "\n".to_owned() };
    let lines = lines.replace('\\', r"\e").replace('-', r"\-");
    format!("\n.SH {}\n.nf\n{lines}\n.fi\n", title.to_uppercase())
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use crate::Arguments;

    #[test]
    fn each_verb_has_a_page_with_its_options_and_examples() {
        let pages = super::pages(Arguments::command()).unwrap();
        let mut command = Arguments::command();
        command.build();
        let verbs = command.get_subcommands().filter(|verb| !verb.is_hide_set());
        for verb in verbs.filter(|verb| verb.get_name() != "help") {
            let name = format!("aso-ftc-{}.1", verb.get_name());
            let (_, page) = pages.iter().find(|(file, _)| *file == name).unwrap();
            for option in verb.get_opts().filter(|option| !option.is_hide_set()) {
                let long = option.get_long().unwrap().replace('-', r"\-");
                assert!(page.contains(&format!(r"\-\-{long}")), "{name}: {long}");
            }
            let examples = page.split_once(".SH EXAMPLES\n.nf\n").unwrap().1;
            let start = format!(r"  aso\-ftc {}", verb.get_name());
            assert_eq!(examples.lines().filter(|line| line.starts_with(&start)).count(), 3);
        }
        assert_eq!(pages[0].0, "aso-ftc.1");
    }
}
