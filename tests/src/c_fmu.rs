//! FMUs in C that misbehave on request, as described in `tests/c/slave.h`.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

use fmu_description::package::{Package, platforms};

use crate::root;

const SOURCES: [&str; 6] = ["deeds.c", "files.c", "life.c", "process.c", "steps.c", "values.c"];

/// Libraries that this process has built, by the definitions given to the compiler.
static LIBRARIES: Mutex<BTreeMap<Vec<String>, Vec<u8>>> = Mutex::new(BTreeMap::new());

/// The description of an FMU in C, which [`CFmu::write`] builds.
#[derive(Clone, Debug)]
pub struct CFmu {
    behaviour: String,
    flags: BTreeMap<String, String>,
    definitions: Vec<String>,
    root_attributes: String,
    experiment: String,
    library_name: String,
    /// Whether the FMU has source code in place of a library.
    in_source: bool,
    /// Further variables, as XML.
    variables: String,
    /// Units of u and y.
    units: Option<[String; 2]>,
}

impl CFmu {
    /// Creates an FMU whose parameter `behaviour` has this start value.
    #[must_use]
    pub fn that(behaviour: &str) -> Self {
        let flags = [
            "canHandleVariableCommunicationStepSize",
            "canGetAndSetFMUstate",
            "canSerializeFMUstate",
            "canNotUseMemoryManagementFunctions",
        ];
        let flags = flags.map(|flag| (flag.to_owned(), "true".to_owned()));
        Self {
            behaviour: behaviour.to_owned(),
            flags: flags.into(),
            definitions: Vec::new(),
            root_attributes: String::new(),
            experiment: String::new(),
            library_name: "slave".to_owned(),
            in_source: false,
            variables: String::new(),
            units: None,
        }
    }

    /// Creates an FMU without misbehaviour.
    #[must_use]
    pub fn well_behaved() -> Self {
        Self::that("as it should")
    }

    /// Sets an attribute of the element `CoSimulation`.
    #[must_use]
    pub fn flag(mut self, name: &str, value: bool) -> Self {
        self.flags.insert(name.to_owned(), value.to_string());
        self
    }

    /// Removes the capability to save and restore states.
    #[must_use]
    pub fn without_rollback(self) -> Self {
        self.flag("canGetAndSetFMUstate", false).flag("canSerializeFMUstate", false)
    }

    /// Removes functions of the standard from the library.
    #[must_use]
    pub fn without(mut self, functions: &[&str]) -> Self {
        let renamed = functions.iter().map(|function| format!("-D{function}=left_out_{function}"));
        self.definitions.extend(renamed);
        self
    }

    /// Sets the function that the deed "call a missing function" calls; no library defines it.
    #[must_use]
    pub fn calling(mut self, function: &str) -> Self {
        self.definitions.push(format!("-DMISSING={function}"));
        self
    }

    /// Makes the library do a deed of `tests/c/slave.h` at a `moment`: `ON_LOAD`, `ON_UNLOAD`, or `AT_EXIT`.
    #[must_use]
    pub fn doing(mut self, deed: &str, moment: &str) -> Self {
        self.definitions.push(format!("-D{moment}=\"{deed}\""));
        self
    }

    /// Gives the library this name, other than the model identifier.
    #[must_use]
    pub fn in_library(mut self, name: &str) -> Self {
        name.clone_into(&mut self.library_name);
        self
    }

    /// Replaces the library by source code.
    #[must_use]
    pub fn in_source(mut self) -> Self {
        self.in_source = true;
        self
    }

    /// Sets the result of `fmi2GetVersion`.
    #[must_use]
    pub fn version(mut self, version: &str) -> Self {
        self.definitions.push(format!("-DVERSION=\"{version}\""));
        self
    }

    /// Adds a local Real `hidden` that cannot be read.
    #[must_use]
    pub fn with_unreadable_variable(mut self) -> Self {
        self.variables.push_str(
            "<ScalarVariable name=\"hidden\" valueReference=\"20\"><Real/></ScalarVariable>\n",
        );
        self
    }

    /// Sets the units of input u and output y.
    #[must_use]
    pub fn with_units(mut self, u: &str, y: &str) -> Self {
        self.units = Some([u.to_owned(), y.to_owned()]);
        self
    }

    /// Declares that the FMU provides first derivatives of its outputs.
    #[must_use]
    pub fn promising_output_derivatives(mut self) -> Self {
        self.flags.insert("maxOutputDerivativeOrder".to_owned(), "1".to_owned());
        self
    }

    /// Sets the attributes of the default experiment.
    #[must_use]
    pub fn experiment(mut self, attributes: &str) -> Self {
        self.experiment = format!("<DefaultExperiment {attributes}/>\n");
        self
    }

    /// Sets the default step to `size` s.
    #[must_use]
    pub fn proposing(mut self, size: f64) -> Self {
        self.experiment = format!("<DefaultExperiment stopTime=\"1\" stepSize=\"{size}\"/>\n");
        self
    }

    /// Makes `fmi2GetVersion` return the text that `symbol` points to, which another library in the process must
    /// define.
    #[must_use]
    pub fn expecting(mut self, symbol: &str) -> Self {
        let value = format!("({{ extern const char *{symbol}; {symbol}; }})");
        self.definitions.push(format!("-DVERSION={value}"));
        self
    }

    /// States this tool as the exporter, and that the FMU needs it to run.
    #[must_use]
    pub fn needing(mut self, tool: &str) -> Self {
        let _ = write!(self.root_attributes, " generationTool=\"{tool}\"");
        self.flag("needsExecutionTool", true)
    }

    /// Builds the FMU and writes it to `folder/name.fmu`.
    ///
    /// # Panics
    ///
    /// If it cannot be built or written.
    #[must_use]
    pub fn write(&self, folder: &Path, name: &str) -> PathBuf {
        let mut package = Package::new(self.description());
        let suffix = std::env::consts::DLL_SUFFIX;
        if self.in_source {
            for file in SOURCES.iter().chain(&["slave.h", "fmi2.h"]) {
                let text = fs::read(root().join("tests/c").join(file));
                let text = text.unwrap_or_else(|error| panic!("{error}"));
                package.add(format!("sources/{file}"), text);
            }
        } else {
            let name = &self.library_name;
            package.add(format!("binaries/{}/{name}{suffix}", platforms()[0]), self.library());
        }
        let path = folder.join(name).with_extension("fmu");
        package.write(&path).unwrap_or_else(|error| panic!("{error}"));
        path
    }

    fn description(&self) -> String {
        let flags: Vec<_> =
            self.flags.iter().map(|(name, value)| format!(" {name}=\"{value}\"")).collect();
        let flags = flags.concat();
        let (behaviour, attributes) = (&self.behaviour, &self.root_attributes);
        let experiment = &self.experiment;
        let files = SOURCES.map(|file| format!("<File name=\"{file}\"/>")).concat();
        let sources = if self.in_source {
            format!("<SourceFiles>{files}</SourceFiles>")
        } else {
            String::new()
        };
        let (mut variables, mut units) = (variables(behaviour), String::new());
        if let Some(known) = &self.units {
            let unit = |name: &String| format!("<Unit name=\"{name}\"/>");
            units = format!(
                "<UnitDefinitions>{}</UnitDefinitions>\n",
                known.each_ref().map(unit).concat()
            );
            for (variable, name) in variables.iter_mut().zip(known) {
                *variable = variable.replace("<Real", &format!("<Real unit=\"{name}\""));
            }
        }
        let output = |name| {
            let at = variables.iter().position(|variable| variable.contains(&quoted(name)));
            format!("<Unknown index=\"{}\" dependencies=\"\"/>\n", at.unwrap_or_default() + 1)
        };
        let outputs = ["y", "i_out", "b_out", "s_out", "e_out"].map(output).concat();
        let variables = variables.concat() + &self.variables;
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
             <fmiModelDescription fmiVersion=\"2.0\" modelName=\"Slave\" guid=\"{behaviour}\"\
             {attributes}>\n<CoSimulation modelIdentifier=\"slave\"{flags}>{sources}</CoSimulation>\n\
             {units}<TypeDefinitions><SimpleType name=\"Mode\"><Enumeration><Item name=\"off\" \
             value=\"1\"/><Item name=\"on\" value=\"2\"/></Enumeration></SimpleType>\
             </TypeDefinitions>\n{experiment}<ModelVariables>\n{variables}</ModelVariables>\n\
             <ModelStructure><Outputs>\n{outputs}</Outputs></ModelStructure>\n\
             </fmiModelDescription>\n"
        )
    }

    /// Builds the shared library, once for each set of definitions.
    fn library(&self) -> Vec<u8> {
        let mut known = LIBRARIES.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(library) = known.get(&self.definitions) {
            return library.clone();
        }
        let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
        let target = folder.path().join("slave");
        let mut compiler = Command::new("cc");
        compiler.current_dir(root().join("tests/c")).args(&self.definitions);
        compiler.args(["-std=c11", "-shared", "-fPIC", "-fvisibility=hidden", "-Wall"]);
        compiler.args(["-Wextra", "-Werror", "-o"]).arg(&target).args(SOURCES).arg("-lm");
        assert!(compiler.status().is_ok_and(|status| status.success()), "{compiler:?} fails");
        let library = fs::read(&target).unwrap_or_else(|error| panic!("{error}"));
        known.insert(self.definitions.clone(), library.clone());
        library
    }
}

fn quoted(name: &str) -> String {
    format!("\"{name}\"")
}

/// The variables as XML; `tests/c/slave.h` has their value references.
fn variables(behaviour: &str) -> Vec<String> {
    let variable = |name: &str, reference: u32, role: &str, kind: &str| {
        format!(
            "<ScalarVariable name=\"{name}\" valueReference=\"{reference}\" {role}>{kind}\
             </ScalarVariable>\n"
        )
    };
    let (input, output) = (
        "causality=\"input\" variability=\"discrete\"",
        "causality=\"output\" variability=\"discrete\" initial=\"exact\"",
    );
    let fixed = "causality=\"parameter\" variability=\"fixed\"";
    let text = format!("<String start=\"{behaviour}\"/>");
    vec![
        variable("u", 0, "causality=\"input\"", "<Real start=\"1\"/>"),
        variable("y", 1, "causality=\"output\" initial=\"exact\"", "<Real start=\"0\"/>"),
        variable("i_in", 0, input, "<Integer start=\"0\"/>"),
        variable("i_out", 1, output, "<Integer start=\"0\"/>"),
        variable("b_in", 0, input, "<Boolean start=\"false\"/>"),
        variable("b_out", 1, output, "<Boolean start=\"false\"/>"),
        variable("s_in", 0, input, "<String start=\"\"/>"),
        variable("s_out", 1, output, "<String start=\"\"/>"),
        variable("e_in", 10, input, "<Enumeration declaredType=\"Mode\" start=\"1\"/>"),
        variable("e_out", 11, output, "<Enumeration declaredType=\"Mode\" start=\"1\"/>"),
        variable("t1", 2, fixed, "<Real start=\"0.5\"/>"),
        variable("n", 2, fixed, "<Integer start=\"3\"/>"),
        variable("behaviour", 2, fixed, &text),
    ]
}
