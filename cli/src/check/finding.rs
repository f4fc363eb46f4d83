//! The findings of a check, as text and as JSON.

use std::fmt;

use serde::Serialize;

/// The severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Severity {
    /// Violates the standard, or makes an importer refuse the FMU.
    Error,
    /// Causes problems in some importers.
    Warning,
    /// Information.
    Note,
}

/// The part of the FMU that a finding concerns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Part {
    /// The ZIP archive and its files.
    Archive,
    /// `modelDescription.xml`.
    Description,
    /// The shared libraries.
    Binaries,
    /// The behaviour of the library of this platform.
    Behaviour,
}

/// A tool, or a way of calling an FMU, that a finding stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Tool {
    /// FMPy with any options.
    Fmpy,
    /// FMPy's `simulate_fmu` with its default options.
    FmpyValidation,
    /// FMI Library (Modelon), which libcosim and `PyFMI` use.
    FmiLibrary,
    /// Importers that call the FMU in their own process.
    InProcess,
    /// Importers on a platform, by the name of its folder.
    Platform(&'static str),
}

impl fmt::Display for Tool {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Tool::Fmpy => formatter.write_str("FMPy"),
            Tool::FmpyValidation => formatter.write_str("FMPy with validate=True, its default"),
            Tool::FmiLibrary => formatter.write_str("FMI Library (libcosim, PyFMI)"),
            Tool::InProcess => formatter.write_str("importers that call it in their own process"),
            Tool::Platform(folder) => write!(formatter, "importers on {folder}"),
        }
    }
}

impl Serialize for Tool {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Finding {
    pub(crate) severity: Severity,
    pub(crate) part: Part,
    /// The subject: the file, the element or variable, or the function.
    #[serde(rename = "where")]
    pub(crate) place: String,
    /// Expected and actual content.
    pub(crate) what: String,
    /// The effect on importers.
    pub(crate) why: Option<String>,
    /// Section of the standard: of FMI 2.0.5 until [`super::sections::renumber`] converts it to the version of the FMU.
    pub(crate) section: Option<&'static str>,
    /// The tools that refuse the FMU because of the finding.
    pub(crate) stops: Vec<Tool>,
}

impl fmt::Display for Severity {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Note => "note",
        })
    }
}

impl Finding {
    /// Writes the finding as text, with the text `more` after [`Finding::what`].
    pub(crate) fn write(&self, formatter: &mut fmt::Formatter<'_>, more: &str) -> fmt::Result {
        let Self { severity, place, what, section, why, .. } = self;
        write!(formatter, "{severity}: {place}: {what}{more}")?;
        if let Some(section) = section {
            write!(formatter, " (section {section})")?;
        }
        match why {
            Some(why) => write!(formatter, "\n    {why}"),
            None => Ok(()),
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write(formatter, "")
    }
}

/// The findings about one part, in the order in which they were added.
pub(crate) struct Findings {
    part: Part,
    pub(crate) all: Vec<Finding>,
}

impl Findings {
    pub(crate) fn about(part: Part) -> Self {
        Self { part, all: Vec::new() }
    }

    /// Adds a finding; `why` and `section` may be empty.
    pub(crate) fn add(
        &mut self,
        severity: Severity,
        place: impl Into<String>,
        what: impl Into<String>,
        why: &str,
        section: &'static str,
    ) {
        self.all.push(Finding {
            severity,
            part: self.part,
            place: place.into(),
            what: what.into(),
            why: (!why.is_empty()).then(|| why.to_owned()),
            section: (!section.is_empty()).then_some(section),
            stops: Vec::new(),
        });
    }

    /// Adds `tools` to the tools that the last finding stops.
    pub(crate) fn stopping(&mut self, tools: &[Tool]) {
        if let Some(last) = self.all.last_mut() {
            last.stops.extend(tools);
        }
    }
}
