//! How the library of an FMU is built: `sources/buildDescription.xml` (FMI 3.0.2, section 2.4.10), or the
//! elements `SourceFiles` of FMI 2.0.

use std::fs;
use std::path::{Component, Path};

use fmu_description::package::DESCRIPTION;
use fmu_description::xml::{self, Element};

/// `BuildConfiguration`: how one library is built.
pub(super) struct BuildConfiguration {
    pub(super) model_identifier: String,
    /// Platform tuple for which the configuration is; `None`: all platforms without a configuration of their own.
    platform: Option<String>,
    pub(super) sets: Vec<SourceFileSet>,
    /// Names of libraries for the linker: of files in `binaries`, or of libraries of the system.
    pub(super) libraries: Vec<String>,
}

/// `SourceFileSet`: source files that are compiled alike.
#[derive(Default)]
pub(super) struct SourceFileSet {
    language: Option<String>,
    /// Paths of the files to compile, below `sources`.
    pub(super) files: Vec<String>,
    /// `PreprocessorDefinition`: names and values, which may be empty. Optional definitions are left out.
    pub(super) definitions: Vec<(String, Option<String>)>,
    /// Paths of folders of headers, below `sources`.
    pub(super) include_folders: Vec<String>,
}

impl SourceFileSet {
    /// Returns whether a file of the set is C++: by the stated language or by the extension of the file.
    pub(super) fn is_cpp(&self, file: &str) -> bool {
        let extension = Path::new(file).extension().unwrap_or_default();
        let language = self.language.as_deref().unwrap_or_default();
        language.to_ascii_uppercase().starts_with("C++")
            || ["cpp", "cc", "cxx"].iter().any(|known| extension.eq_ignore_ascii_case(known))
    }

    /// Returns whether any file of the set is C++.
    pub(super) fn has_cpp(&self) -> bool {
        self.files.iter().any(|file| self.is_cpp(file))
    }

    /// Returns the value of the compiler's option `-std`; `None` if the language states no year, or is C and the file
    /// is C++. `C99` becomes `gnu99`, because sources often use extensions of the compiler, and `C23` becomes `gnu2x`,
    /// which older compilers know, too.
    pub(super) fn standard(&self, file: &str) -> Option<String> {
        let language = self.language.as_deref()?.to_ascii_lowercase();
        let year = language.strip_prefix('c')?;
        let is_year = !year.is_empty() && year.trim_start_matches('+').parse::<u32>().is_ok();
        let is_of_file = year.starts_with('+') == self.is_cpp(file);
        let year = if year == "23" { "2x" } else { year };
        (is_year && is_of_file).then(|| format!("gnu{year}"))
    }
}

/// Returns whether a stated file is compiled. Headers are only included.
fn is_source(path: &String) -> bool {
    let extension = Path::new(path).extension().unwrap_or_default();
    !["h", "hh", "hpp", "hxx", "inc"].iter().any(|known| extension.eq_ignore_ascii_case(known))
}

/// Reads how the libraries of the FMU in `folder` are built: first the configurations for one of `platforms`, then
/// configurations without a platform, then others. On failure returns the missing or wrong entry.
pub(super) fn read(folder: &Path, platforms: &[&str]) -> Result<Vec<BuildConfiguration>, String> {
    let file = folder.join("sources/buildDescription.xml");
    let mut configurations = if file.is_file() {
        let root = root(&file)?;
        children(&root, "BuildConfiguration").map(configuration).collect::<Result<Vec<_>, _>>()?
    } else {
        let root = root(&folder.join(DESCRIPTION))?;
        let interfaces = root.children.iter().filter(|child| {
            ["CoSimulation", "ModelExchange"].contains(&child.name.as_str())
                && children(child, "SourceFiles").next().is_some()
        });
        interfaces.map(source_files).collect::<Result<Vec<_>, _>>()?
    };
    if configurations.is_empty() {
        return Err(
            "expected sources/buildDescription.xml, or in FMI 2.0 the element SourceFiles of an \
                    interface, which say how its source code is built; found neither"
                .to_owned(),
        );
    }
    configurations.sort_by_key(|configuration| match &configuration.platform {
        Some(platform) if platforms.contains(&platform.as_str()) => 0,
        None => 1,
        Some(_) => 2,
    });
    Ok(configurations)
}

fn root(file: &Path) -> Result<Element, String> {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let bytes = fs::read(file).map_err(|error| format!("{name}: {error}"))?;
    xml::read(&bytes).map_err(|error| format!("{name}: {error}"))
}

fn children<'a>(element: &'a Element, name: &'a str) -> impl Iterator<Item = &'a Element> {
    element.children.iter().filter(move |child| child.name == name)
}

fn attribute(element: &Element, name: &str) -> Option<String> {
    let attribute = element.attributes.iter().find(|(known, _)| known == name);
    attribute.map(|(_, value)| value.clone())
}

/// Returns the attribute `name`, a path below `sources`. On failure returns the defect of the path.
fn path(element: &Element) -> Result<String, String> {
    let path = attribute(element, "name").unwrap_or_default();
    let mut parts = Path::new(&path).components();
    let is_inside = !path.is_empty()
        && parts.all(|component| matches!(component, Component::Normal(_) | Component::CurDir));
    let expected = "expected the path of a file or folder below sources";
    is_inside.then_some(path.clone()).ok_or(format!("{}: found {path:?}, {expected}", element.name))
}

/// Returns the paths of the files to compile, without headers.
fn sources<'a>(files: impl Iterator<Item = &'a Element>) -> Result<Vec<String>, String> {
    let paths = files.map(path).collect::<Result<Vec<_>, _>>()?;
    Ok(paths.into_iter().filter(is_source).collect())
}

fn configuration(element: &Element) -> Result<BuildConfiguration, String> {
    let set = |set: &Element| -> Result<SourceFileSet, String> {
        let definition = |definition: &Element| {
            Some((attribute(definition, "name")?, attribute(definition, "value")))
        };
        let is_used = |child: &&Element| {
            !matches!(attribute(child, "optional").as_deref(), Some("true" | "1"))
        };
        Ok(SourceFileSet {
            language: attribute(set, "language").filter(|language| !language.is_empty()),
            files: sources(children(set, "SourceFile"))?,
            definitions: children(set, "PreprocessorDefinition")
                .filter(is_used)
                .filter_map(definition)
                .collect(),
            include_folders: children(set, "IncludeDirectory")
                .map(path)
                .collect::<Result<_, _>>()?,
        })
    };
    let libraries = children(element, "Library").filter_map(|library| attribute(library, "name"));
    Ok(BuildConfiguration {
        model_identifier: attribute(element, "modelIdentifier").unwrap_or_default(),
        platform: attribute(element, "platform"),
        sets: children(element, "SourceFileSet").map(set).collect::<Result<_, _>>()?,
        libraries: libraries.collect(),
    })
}

/// Returns the configuration of an interface of FMI 2.0 from its elements `SourceFiles`.
fn source_files(element: &Element) -> Result<BuildConfiguration, String> {
    let files = children(element, "SourceFiles").flat_map(|list| children(list, "File"));
    let set = SourceFileSet { files: sources(files)?, ..SourceFileSet::default() };
    Ok(BuildConfiguration {
        model_identifier: attribute(element, "modelIdentifier").unwrap_or_default(),
        platform: None,
        sets: vec![set],
        libraries: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use fmu_description::package::TemporaryFolder;

    use super::*;

    #[test]
    fn without_a_stated_language_each_file_has_that_of_its_extension() {
        let element = xml::read(
            br#"<CoSimulation modelIdentifier="m"><SourceFiles>
            <File name="solver.c"/><File name="model.CPP"/><File name="model.hpp"/>
            </SourceFiles></CoSimulation>"#,
        );
        let configuration = source_files(&element.unwrap()).unwrap();
        let set = &configuration.sets[0];
        let files = set.files.iter().map(|file| (file.as_str(), set.is_cpp(file)));
        assert_eq!(files.collect::<Vec<_>>(), [("solver.c", false), ("model.CPP", true)]);
        assert!(set.has_cpp());
    }

    #[test]
    fn a_definition_is_optional_by_each_spelling_of_true() {
        let element = xml::read(
            br#"<BuildConfiguration modelIdentifier="m"><SourceFileSet>
            <PreprocessorDefinition name="A" value="2"/><PreprocessorDefinition name="B"/>
            <PreprocessorDefinition name="C" optional="true"/>
            <PreprocessorDefinition name="D" optional="1"/>
            <PreprocessorDefinition name="E" value="" optional="0"/>
            </SourceFileSet></BuildConfiguration>"#,
        );
        let configuration = configuration(&element.unwrap()).unwrap();
        let definitions = configuration.sets[0].definitions.iter();
        let definitions = definitions.map(|(name, value)| (name.as_str(), value.as_deref()));
        let expected = [("A", Some("2")), ("B", None), ("E", Some(""))];
        assert_eq!(definitions.collect::<Vec<_>>(), expected);
    }

    /// FMI 3.0.2, section 2.4.10: one configuration at most for each platform, and one for all others.
    #[test]
    fn the_configuration_of_this_platform_comes_before_that_of_all_others() {
        let folder = TemporaryFolder::new().unwrap();
        fs::create_dir(folder.path().join("sources")).unwrap();
        let configuration = |attributes: &str, library: &str| {
            format!(
                r#"<BuildConfiguration modelIdentifier="m"{attributes}><SourceFileSet>
                <SourceFile name="m.c"/></SourceFileSet><Library name="{library}"/></BuildConfiguration>"#
            )
        };
        let text = [
            configuration(r#" platform="x86_64-windows""#, "ws2_32"),
            configuration("", "any"),
            configuration(r#" platform="x86_64-linux""#, "rt"),
        ];
        let text = format!("<fmiBuildDescription>{}</fmiBuildDescription>", text.concat());
        fs::write(folder.path().join("sources/buildDescription.xml"), text).unwrap();
        for (platforms, expected) in [
            (["linux64", "x86_64-linux"], "rt"),
            (["win64", "x86_64-windows"], "ws2_32"),
            (["aarch64-darwin", "darwin64"], "any"),
        ] {
            assert_eq!(read(folder.path(), &platforms).unwrap()[0].libraries, [expected]);
        }
    }

    /// A compiler for C compiles `model.cpp` as C++, but does not link the library of C++.
    #[test]
    fn a_file_is_cpp_by_the_stated_language_or_by_its_extension() {
        for (language, is_cpp, standards) in [
            ("C99", [false, true], [Some("gnu99"), None]),
            ("C23", [false, true], [Some("gnu2x"), None]),
            ("C++11", [true, true], [Some("gnu++11"); 2]),
            ("c++11", [true, true], [Some("gnu++11"); 2]),
        ] {
            let language = Some(language.to_owned());
            let set = SourceFileSet { language, ..SourceFileSet::default() };
            let files = ["solver.c", "model.cpp"];
            assert_eq!(files.map(|file| set.is_cpp(file)), is_cpp);
            let expected = standards.map(|standard| standard.map(str::to_owned));
            assert_eq!(files.map(|file| set.standard(file)), expected);
        }
    }
}
