//! `aso-ftc new`: writes a crate with a small model that can be packed without changes.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

const MANIFEST: &str = include_str!("new/manifest.toml");
const README: &str = include_str!("new/readme.md");
const MODEL: &str = include_str!("new/model.rs");

/// Names reserved by Rust, the template, cargo or Windows, in lower case.
const RESERVED: &str = "about alloc aux clone con core default deserialize err experiment failure fmu \
    into model none nul ok option path prn result self send serde serialize simulation some std \
    step string test variable variables vec";

#[derive(clap::Args)]
pub(crate) struct Options {
    /// Name of the crate, such as heat-pump
    ///
    /// The model is then called `HeatPump`.
    name: String,
    /// Folder to create [default: ./NAME]
    #[arg(long, value_name = "FOLDER")]
    path: Option<PathBuf>,
    /// The crate fmu: a folder or a git URL
    ///
    /// [default: the one in the clone that this program was built in or is called in]
    #[arg(long, value_name = "SOURCE")]
    fmu: Option<String>,
}

/// Writes the crate completely or not at all. An existing folder is an error.
pub(crate) fn new(options: &Options) -> anyhow::Result<()> {
    let model = identifier(&options.name)?;
    let folder = options.path.clone().unwrap_or_else(|| PathBuf::from(&options.name));
    if folder.symlink_metadata().is_ok() {
        bail!("{} exists already: expected a folder that is still to be made", folder.display());
    }
    let manifest = MANIFEST
        .replace("@crate@", &options.name)
        .replace("@model@", &model)
        .replace("@fmu@", &dependency(options.fmu.as_deref())?);
    let files = [
        ("Cargo.toml", manifest),
        ("src/lib.rs", MODEL.replace("NewModel", &model)),
        ("README.md", README.replace("@model@", &model)),
        (".gitignore", "/target\n/dist\n".to_owned()),
    ];
    write(&folder, &files).with_context(|| format!("cannot write {}", folder.display()))?;
    println!("{}", folder.display());
    Ok(())
}

/// Returns the name of the model: the name of the crate in camel case. Returns an error if that is no C identifier or
/// is reserved.
fn identifier(name: &str) -> anyhow::Result<String> {
    let expected = "expected lower-case letters and digits in words joined by - or _, a letter \
                    first, such as heat-pump";
    let words: Vec<&str> = name.split(['-', '_']).collect();
    let letters = |word: &&str| {
        !word.is_empty()
            && word.chars().all(|letter| letter.is_ascii_lowercase() || letter.is_ascii_digit())
    };
    if !words.iter().all(letters) || !name.starts_with(|first: char| first.is_ascii_lowercase()) {
        bail!("the name {name:?} gives no identifier: {expected}");
    }
    if name.len() > 64 {
        bail!("the name {name:?} has {} characters, expected at most 64", name.len());
    }
    let camel = |word: &str| word[..1].to_ascii_uppercase() + &word[1..];
    let identifier: String = words.into_iter().map(camel).collect();
    if RESERVED.split(' ').any(|reserved| identifier.eq_ignore_ascii_case(reserved)) {
        bail!("the name {name:?} is taken: Rust or the template use it for something else");
    }
    Ok(identifier)
}

/// Returns the value of `fmu =` in the manifest: a git URL or a folder. Returns an error for a folder without the crate
/// fmu, and if `source` is `None` outside of a clone.
fn dependency(source: Option<&str>) -> anyhow::Result<String> {
    let is_no_folder = |source: &&str| !Path::new(source).is_dir();
    if let Some(url) = source.filter(is_no_folder).and_then(git_url) {
        return Ok(format!("{{ git = {} }}", quoted(&url)));
    }
    let folder = match source {
        Some(folder) => std::path::absolute(folder)?,
        None => crate_of_clone().context(
            "expected --fmu SOURCE: this program is neither in a clone that has fmu nor called \
             in one",
        )?,
    };
    if !is_fmu(&folder) {
        bail!("{} is not the folder of the crate fmu", folder.display());
    }
    Ok(format!("{{ path = {} }}", quoted(&folder.display().to_string())))
}

/// Returns the URL of a git repository; `None` if `source` does not have the form of one. Git's short form,
/// `user@host:path`, which cargo refuses, becomes a URL.
fn git_url(source: &str) -> Option<String> {
    if source.contains("://") {
        return Some(source.to_owned());
    }
    let (host, path) = source.split_once(':').filter(|(host, _)| host.contains('@'))?;
    Some(format!("ssh://{host}/{}", path.trim_start_matches('/')))
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// Returns the folder of the crate fmu in the clone that contains this program or the current folder,
/// or that the program was built in; `None` if there is no such clone.
fn crate_of_clone() -> Option<PathBuf> {
    let built_in = option_env!("ASO_FTC_CLONE").map(PathBuf::from);
    let places = [std::env::current_exe().ok(), std::env::current_dir().ok(), built_in];
    let folders = places.iter().flatten().flat_map(|place| place.ancestors());
    folders.map(|folder| folder.join("crates/fmu")).find(|folder| is_fmu(folder))
}

/// Whether the folder contains the crate fmu.
fn is_fmu(folder: &Path) -> bool {
    let manifest = fs::read_to_string(folder.join("Cargo.toml")).unwrap_or_default();
    let name = |manifest: toml::Table| Some(manifest.get("package")?.get("name")? == &"fmu".into());
    manifest.parse().ok().and_then(name).unwrap_or(false)
}

/// Writes the files into a temporary folder next to `target`, then renames this folder. Creates the parent folders.
fn write(target: &Path, files: &[(&str, String)]) -> std::io::Result<()> {
    // `components` drops a slash at the end, with which the temporary folder would be inside of the target.
    let target: PathBuf = std::path::absolute(target)?.components().collect();
    let mut partial = target.clone().into_os_string();
    partial.push(format!(".{}.partial", std::process::id()));
    let partial = PathBuf::from(partial);
    let written = fs::create_dir_all(partial.join("src")).and_then(|()| {
        files.iter().try_for_each(|(name, text)| fs::write(partial.join(name), text))?;
        fs::rename(&partial, &target)
    });
    written.inspect_err(|_| {
        // The error of the write is returned; an error of the removal adds nothing.
        let _ = fs::remove_dir_all(&partial);
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_may_be_stated_with_a_slash_at_its_end() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("models/heat-pump/");
        write(&target, &[("Cargo.toml", "[package]".to_owned())]).unwrap();
        assert_eq!(fs::read_to_string(target.join("Cargo.toml")).unwrap(), "[package]");
        assert_eq!(fs::read_dir(folder.path().join("models")).unwrap().count(), 1);
    }

    #[test]
    fn a_folder_with_an_at_sign_in_its_path_is_no_url() {
        let folder = tempfile::tempdir().unwrap();
        let source = folder.path().join("me@home");
        fs::create_dir(&source).unwrap();
        fs::write(source.join("Cargo.toml"), "[package]\nname = \"fmu\"\n").unwrap();
        let source = source.display().to_string();
        let path = format!("{{ path = {} }}", quoted(&source));
        assert_eq!(dependency(Some(&source)).unwrap(), path);
        assert!(
            dependency(Some("you@home")).unwrap_err().to_string().contains("is not the folder")
        );
    }

    /// Cargo answers the short form with "relative URL without a base; try using `ssh://git@example.org/owner/fmu`".
    #[test]
    fn the_short_form_of_a_git_repository_becomes_a_url() {
        for source in ["git@example.org:owner/fmu", "ssh://git@example.org/owner/fmu"] {
            let url = dependency(Some(source)).unwrap();
            assert_eq!(url, "{ git = \"ssh://git@example.org/owner/fmu\" }");
        }
    }
}
