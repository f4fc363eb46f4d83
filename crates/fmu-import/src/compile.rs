//! Builds the library of an FMU for this platform from the FMU's source code.

mod description;

use std::ffi::{OsStr, OsString};
use std::fs;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;

use fmu_description::package::{Package, PackageError, TemporaryFolder, Unpacked, platforms_of};
use fmu_description::{ModelDescription, Version, package};

use description::{BuildConfiguration, SourceFileSet};

/// The header files of the standard, which the sources of an FMU include but need not contain.
const HEADERS: [(&str, &str); 6] = [
    ("fmi2FunctionTypes.h", include_str!("../headers/fmi2FunctionTypes.h")),
    ("fmi2Functions.h", include_str!("../headers/fmi2Functions.h")),
    ("fmi2TypesPlatform.h", include_str!("../headers/fmi2TypesPlatform.h")),
    ("fmi3FunctionTypes.h", include_str!("../headers/fmi3FunctionTypes.h")),
    ("fmi3Functions.h", include_str!("../headers/fmi3Functions.h")),
    ("fmi3PlatformTypes.h", include_str!("../headers/fmi3PlatformTypes.h")),
];
/// The folders that are copied from an FMU to the FMU that is built from it.
const PARTS: [&str; 4] = ["binaries", "resources", "terminalsAndIcons", "extra"];
/// Version of the build procedure, a part of the cache key. Change it whenever the procedure changes.
const RECIPE: u32 = 6;
/// Largest number of characters of compiler output that an error quotes.
const OUTPUT: usize = 4000;

/// Why the library of an FMU cannot be built.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum CompileError {
    /// The FMU cannot be read or written, or has no source code.
    #[error(transparent)]
    Package(Box<PackageError>),
    /// The FMU states no way, or an invalid way, to build its library.
    #[error("{}: {reason}", path.display())]
    Description { path: PathBuf, reason: String },
    /// None of the compilers that were tried runs.
    #[error("{}: no compiler for {language} here: tried {tried}; the variable {variable} names one", path.display())]
    NoCompiler { path: PathBuf, language: &'static str, tried: String, variable: &'static str },
    /// The compiler or the linker fails.
    #[error("{}: {command} failed: {output}", path.display())]
    Failed {
        path: PathBuf,
        /// The program and the file, or "linking".
        command: String,
        /// The start of the program's output; without any, its exit status or signal.
        output: String,
    },
    /// A file or folder cannot be read or written, or a program cannot be started.
    #[error("cannot {action} {}", path.display())]
    File { action: &'static str, path: PathBuf, source: io::Error },
}

impl From<PackageError> for CompileError {
    fn from(error: PackageError) -> Self {
        CompileError::Package(Box::new(error))
    }
}

fn file_error(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> CompileError {
    let path = path.to_owned();
    move |source| CompileError::File { action, path, source }
}

/// Returns the path of an FMU with the content of the FMU at `path` and a library for this platform.
///
/// If the FMU has the libraries of its interfaces for this platform, returns `path`. Otherwise builds the missing ones
/// from the folder `sources`, as `buildDescription.xml` or, in FMI 2.0, the elements `SourceFiles` state, with the
/// compiler in the variable `CC` (C++: `CXX`) or the first common one that runs. The built FMU is stored in the user's
/// cache folder and used again for the same content and compiler.
///
/// # Errors
///
/// [`CompileError`] if the FMU cannot be read, has neither a library nor source code, or does not state how it is
/// built, if there is no compiler, if the compiler fails, or if the built FMU cannot be written.
pub fn compile(path: &Path) -> Result<PathBuf, CompileError> {
    let unpacked =
        if path.is_dir() { Unpacked::in_folder(path)? } else { Unpacked::open_whole(path)? };
    let identifiers = identifiers(&unpacked.description);
    let refused = identifiers.iter().find_map(|identifier| unpacked.library(identifier).err());
    let Some(refused) = refused else { return Ok(path.to_owned()) };
    if !unpacked.has_sources() {
        return Err(refused.into());
    }
    let build = Build::new(path, &unpacked)?;
    let target = cache().join(build.key(&identifiers)?).join(file_name(path));
    if !target.is_file() {
        let mut package = content(&unpacked)?;
        let platform = platforms_of(unpacked.description.version()).first().copied();
        for identifier in identifiers.iter().filter(|name| unpacked.library(name).is_err()) {
            let library = build.library(identifier)?;
            let name = format!("{identifier}{}", std::env::consts::DLL_SUFFIX);
            package.add(format!("binaries/{}/{name}", platform.unwrap_or_default()), library);
        }
        package.write(&target)?;
        tracing::info!("{}: built from its source code: {}", path.display(), target.display());
    }
    Ok(target)
}

/// Returns the model identifiers of an FMU, the names of its libraries.
fn identifiers(description: &ModelDescription) -> Vec<String> {
    let simulation = description.stepped().map(|flags| flags.model_identifier);
    let exchange = description.model_exchange.as_ref().map(|flags| flags.model_identifier.clone());
    let mut identifiers: Vec<String> = simulation.into_iter().chain(exchange).collect();
    identifiers.dedup();
    identifiers
}

/// Returns the file name of the built FMU.
fn file_name(path: &Path) -> OsString {
    let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(".fmu");
    name
}

/// Returns the folder for built FMUs: in the user's cache folder, or without one in the temporary folder.
fn cache() -> PathBuf {
    let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
    let home = || variable("HOME").map(PathBuf::from);
    let user = if cfg!(windows) {
        variable("LOCALAPPDATA").map(PathBuf::from)
    } else {
        let stated = variable("XDG_CACHE_HOME").map(PathBuf::from);
        let folder = if cfg!(target_os = "macos") { "Library/Caches" } else { ".cache" };
        stated.or_else(|| home().map(|home| home.join(folder)))
    };
    user.unwrap_or_else(std::env::temp_dir).join("aso-ftc").join("compiled")
}

/// Returns the content of the built FMU: the model description and [`PARTS`].
fn content(unpacked: &Unpacked) -> Result<Package, CompileError> {
    let file = unpacked.folder().join(package::DESCRIPTION);
    let xml = fs::read(&file).map_err(file_error("read", &file))?;
    let mut content = Package::new(xml).for_version(unpacked.description.version());
    for part in PARTS {
        let folder = unpacked.folder().join(part);
        if folder.is_dir() {
            content.add_folder(part, &folder)?;
        }
    }
    Ok(content)
}

struct Compiler {
    /// The program of the compiler and the program's arguments.
    words: Vec<OsString>,
    /// The output of the compiler's option `--version`, a part of the cache key.
    version: String,
}

impl Compiler {
    /// Returns the compiler in the variable `CC` or `CXX`; without the variable the first common one that runs.
    fn find(path: &Path, cpp: bool) -> Result<Self, CompileError> {
        let (variable, known, language) = if cpp {
            ("CXX", ["c++", "g++", "clang++"], "C++")
        } else {
            ("CC", ["cc", "gcc", "clang"], "C")
        };
        let stated = std::env::var_os(variable).map(|command| absolute(words(&command)));
        let commands = stated.filter(|words| !words.is_empty()).map_or_else(
            || known.map(|program| vec![OsString::from(program)]).to_vec(),
            |words| vec![words],
        );
        let mut compilers = commands.iter().filter_map(|words| {
            let output =
                Command::new(&words[0]).args(&words[1..]).arg("--version").output().ok()?;
            let version = String::from_utf8_lossy(&output.stdout).into_owned();
            output.status.success().then(|| Self { words: words.clone(), version })
        });
        compilers.next().ok_or_else(|| {
            let tried: Vec<String> = commands
                .iter()
                .map(|words| words.join(OsStr::new(" ")).to_string_lossy().into_owned())
                .collect();
            CompileError::NoCompiler {
                path: path.to_owned(),
                language,
                tried: tried.join(", "),
                variable,
            }
        })
    }

    fn command(&self) -> Command {
        let mut command = Command::new(&self.words[0]);
        command.args(&self.words[1..]);
        command
    }
}

/// Makes the path of the program absolute, because files are compiled in the folder of the sources; keeps a bare name.
fn absolute(mut words: Vec<OsString>) -> Vec<OsString> {
    if let Some(program) = words.first_mut()
        && Path::new(&*program).components().count() > 1
        && let Ok(path) = std::path::absolute(&*program)
    {
        *program = path.into_os_string();
    }
    words
}

/// Splits a command at its white space. The words may contain any bytes.
#[cfg(unix)]
fn words(command: &OsStr) -> Vec<OsString> {
    use std::os::unix::ffi::OsStrExt as _;
    let words = command.as_bytes().split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    words.map(|word| OsStr::from_bytes(word).to_owned()).collect()
}

/// Splits a command at its white space.
#[cfg(not(unix))]
fn words(command: &OsStr) -> Vec<OsString> {
    command.to_string_lossy().split_whitespace().map(OsString::from).collect()
}

/// The data for building the libraries of an FMU.
struct Build<'a> {
    path: &'a Path,
    sources: PathBuf,
    version: Version,
    configurations: Vec<BuildConfiguration>,
    /// The compiler for C.
    c: Compiler,
    /// The compiler for C++, if a source file needs it.
    cpp: Option<Compiler>,
}

impl<'a> Build<'a> {
    fn new(path: &'a Path, unpacked: &Unpacked) -> Result<Self, CompileError> {
        let platforms = platforms_of(unpacked.description.version());
        let configurations = description::read(unpacked.folder(), platforms);
        let configurations = configurations
            .map_err(|reason| CompileError::Description { path: path.to_owned(), reason })?;
        let mut sets = configurations.iter().flat_map(|configuration| &configuration.sets);
        let has_cpp = sets.any(SourceFileSet::has_cpp);
        Ok(Self {
            path,
            sources: unpacked.folder().join("sources"),
            version: unpacked.description.version(),
            c: Compiler::find(path, false)?,
            cpp: has_cpp.then(|| Compiler::find(path, true)).transpose()?,
            configurations,
        })
    }

    /// Returns a hash of the content of the FMU and of the compilers: the name of the FMU's folder in the cache.
    fn key(&self, identifiers: &[String]) -> Result<String, CompileError> {
        let mut hasher = DefaultHasher::new();
        (RECIPE, std::env::consts::ARCH, std::env::consts::OS).hash(&mut hasher);
        identifiers.hash(&mut hasher);
        for compiler in [Some(&self.c), self.cpp.as_ref()].into_iter().flatten() {
            (&compiler.words, &compiler.version).hash(&mut hasher);
        }
        if let Some(folder) = self.sources.parent() {
            hash_folder(folder, &mut hasher).map_err(file_error("read", folder))?;
        }
        Ok(format!("{:016x}", hasher.finish()))
    }

    /// Builds the library `identifier` and returns the content of its file.
    fn library(&self, identifier: &str) -> Result<Vec<u8>, CompileError> {
        let is_called =
            |configuration: &&BuildConfiguration| configuration.model_identifier == identifier;
        let configuration = self.configurations.iter().find(is_called);
        // Some FMUs state an outdated identifier: a single configuration is used for every library.
        let only = || self.configurations.first().filter(|_| self.configurations.len() == 1);
        let configuration = configuration.or_else(only).ok_or_else(|| {
            let reason = format!("no source files of {identifier} are stated");
            CompileError::Description { path: self.path.to_owned(), reason }
        })?;
        let folder = TemporaryFolder::new()
            .map_err(file_error("create a folder in", &std::env::temp_dir()))?;
        let headers = folder.path().join("headers");
        fs::create_dir(&headers).map_err(file_error("create", &headers))?;
        for (name, text) in HEADERS {
            let file = headers.join(name);
            fs::write(&file, text).map_err(file_error("write", &file))?;
        }
        let mut objects = Vec::new();
        for set in &configuration.sets {
            for file in &set.files {
                let object = folder.path().join(format!("{}.o", objects.len()));
                self.object(set, file, &headers, &object)?;
                objects.push(object);
            }
        }
        let linker =
            self.cpp.as_ref().filter(|_| configuration.sets.iter().any(SourceFileSet::has_cpp));
        let library = folder.path().join(format!("library{}", std::env::consts::DLL_SUFFIX));
        let (binaries, platforms) =
            (self.sources.with_file_name("binaries"), platforms_of(self.version));
        let link = |options: &[&str]| {
            let mut command = linker.unwrap_or(&self.c).command();
            command.arg("-shared").args(options).arg("-o").arg(&library).args(&objects);
            let libraries = configuration.libraries.iter();
            command.args(libraries.map(|name| library_argument(&binaries, platforms, name)));
            command.arg("-lm");
            self.run(&mut command, "linking")
        };
        if let Err(mut error) = link(&["-Wl,--no-undefined"]) {
            let unlisted = self.unlisted(configuration, &error.to_string()).join(", ");
            if let CompileError::Failed { output, .. } = &mut error
                && !unlisted.is_empty()
            {
                *output = format!(
                    "{output}; the list of source files does not name {unlisted}, which is in sources and may have \
                     these functions"
                );
                return Err(error);
            }
            // Another library in the process may define the functions.
            link(&[])?;
        }
        fs::read(&library).map_err(file_error("read", &library))
    }

    /// Returns the names of C and C++ files at the top of `sources` that the configuration does not list, that no
    /// other file there includes, and that contain one of the functions that a linker's `message` calls undefined.
    fn unlisted(&self, configuration: &BuildConfiguration, message: &str) -> Vec<String> {
        let lines = message.lines().filter(|line| line.contains("undefined"));
        let functions =
            lines.filter_map(|line| line.trim_end_matches('\'').rsplit(['`', ' ']).next());
        let functions: Vec<&str> = functions.filter(|function| !function.is_empty()).collect();
        let files = configuration.sets.iter().flat_map(|set| &set.files);
        let listed: Vec<PathBuf> = files.map(|file| source_file(&self.sources, file)).collect();
        let entries = fs::read_dir(&self.sources).into_iter().flatten().flatten();
        let read = |path: PathBuf| {
            let text = String::from_utf8_lossy(&fs::read(&path).ok()?).into_owned();
            Some((path.file_name()?.to_string_lossy().into_owned(), listed.contains(&path), text))
        };
        let texts: Vec<_> = entries.filter_map(|entry| read(entry.path())).collect();
        let is_unlisted = |(name, listed, text): &&(String, bool, String)| {
            [".c", ".cc", ".cpp", ".cxx"].iter().any(|extension| name.ends_with(extension))
                && !listed
                && functions.iter().any(|function| text.contains(function))
                && !texts.iter().any(|(_, _, other)| other.contains(&format!("{name}\"")))
        };
        let mut names: Vec<String> =
            texts.iter().filter(is_unlisted).map(|(name, ..)| name.clone()).collect();
        names.sort();
        names
    }

    /// Compiles a source file.
    fn object(
        &self,
        set: &SourceFileSet,
        file: &str,
        headers: &Path,
        object: &Path,
    ) -> Result<(), CompileError> {
        let compiler = self.cpp.as_ref().filter(|_| set.is_cpp(file)).unwrap_or(&self.c);
        let mut command = compiler.command();
        command.current_dir(&self.sources).args(["-c", "-fPIC", "-O2", "-w"]);
        command.args(set.standard(file).map(|standard| format!("-std={standard}")));
        command.arg("-I").arg(&self.sources);
        for folder in &set.include_folders {
            command.arg("-I").arg(self.sources.join(folder));
        }
        // Searched last: headers that the FMU contains have priority.
        command.arg("-I").arg(headers);
        // The functions of a shared library have no prefix.
        command.arg(match self.version {
            Version::V3 => "-DFMI3_OVERRIDE_FUNCTION_PREFIX",
            _ => "-DFMI2_FUNCTION_PREFIX=",
        });
        command.args(set.definitions.iter().map(|(name, value)| match value {
            Some(value) => format!("-D{name}={value}"),
            None => format!("-D{name}"),
        }));
        command.arg("-o").arg(object).arg(source_file(&self.sources, file));
        self.run(&mut command, file)
    }

    /// Runs a command; an error names its purpose, `what`.
    fn run(&self, command: &mut Command, what: &str) -> Result<(), CompileError> {
        let program = command.get_program().to_string_lossy().into_owned();
        let output = command.output().map_err(file_error("start", Path::new(&program)))?;
        if output.status.success() {
            return Ok(());
        }
        let messages = String::from_utf8_lossy(&output.stderr)
            .replace(&format!("{}/", self.sources.display()), "");
        let messages = messages.chars().take(OUTPUT).collect::<String>();
        let output = match messages.trim() {
            "" => output.status.to_string(),
            messages => messages.to_owned(),
        };
        let (path, command) = (self.path.to_owned(), format!("{program} for {what}"));
        Err(CompileError::Failed { path, command, output })
    }
}

/// Returns the path of a source file. Some exporters start its stated name with `sources/`.
fn source_file(sources: &Path, file: &str) -> PathBuf {
    let stated = sources.join(file);
    let without = file.strip_prefix("sources/").map(|file| sources.join(file));
    without.filter(|path| !stated.is_file() && path.is_file()).unwrap_or(stated)
}

/// Returns the argument of the linker for the library `name`: the file in a folder of `platforms` below `binaries`, or
/// a library of the system if there is no such file.
fn library_argument(binaries: &Path, platforms: &[&str], name: &str) -> OsString {
    let names = [name.to_owned(), format!("lib{name}.a")];
    let mut paths = platforms
        .iter()
        .flat_map(|platform| names.iter().map(move |name| binaries.join(platform).join(name)));
    let file = paths.find(|path| path.is_file());
    file.map_or_else(|| format!("-l{name}").into(), PathBuf::into_os_string)
}

/// Hashes the names and contents of all files of a folder.
fn hash_folder(folder: &Path, hasher: &mut DefaultHasher) -> io::Result<()> {
    let mut paths: Vec<PathBuf> =
        fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<io::Result<_>>()?;
    paths.sort();
    for path in paths {
        path.file_name().hash(hasher);
        if path.is_dir() {
            hash_folder(&path, hasher)?;
        } else {
            fs::read(&path)?.hash(hasher);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_a_source_file_may_include_the_folder() {
        let folder = TemporaryFolder::new().unwrap();
        let (file, nested) = (folder.path().join("a.c"), folder.path().join("sources/a.c"));
        fs::write(&file, "").unwrap();
        assert_eq!(source_file(folder.path(), "sources/a.c"), file);
        fs::create_dir(folder.path().join("sources")).unwrap();
        fs::write(&nested, "").unwrap();
        assert_eq!(source_file(folder.path(), "sources/a.c"), nested);
    }

    /// FMI 3.0.2, section 2.4.10: a library is in the folder of the platform unless it is `external`.
    #[test]
    fn a_library_in_the_fmu_is_linked_from_its_file() {
        let folder = TemporaryFolder::new().unwrap();
        let binaries = folder.path().join("binaries");
        let platform = binaries.join("x86_64-linux");
        fs::create_dir_all(&platform).unwrap();
        for name in ["openlibm.a", "libsolver.a"] {
            fs::write(platform.join(name), "").unwrap();
        }
        for (name, expected) in [
            ("openlibm.a", platform.join("openlibm.a").into_os_string()),
            ("solver", platform.join("libsolver.a").into_os_string()),
            ("hdf5", "-lhdf5".into()),
        ] {
            assert_eq!(library_argument(&binaries, &["linux64", "x86_64-linux"], name), expected);
        }
    }
}
