//! What a check finds, for people and as JSON.

use std::fmt;

use serde::Serialize;

/// How much a finding weighs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Severity {
    /// Breaks the standard, or an importer refuses the FMU.
    Error,
    /// Some importer, some day, will stumble.
    Warning,
    /// Good to know.
    Note,
}

/// Which part of the FMU a finding is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Part {
    /// The ZIP archive and its files.
    Archive,
    /// `modelDescription.xml`.
    Description,
    /// The shared libraries.
    Binaries,
    /// What the library of this platform does.
    Behaviour,
}

/// One finding.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Finding {
    pub(crate) severity: Severity,
    pub(crate) part: Part,
    /// The file, the place in it, or the function.
    #[serde(rename = "where")]
    pub(crate) place: String,
    /// What was expected and found.
    pub(crate) what: String,
    /// Who stumbles, and how.
    pub(crate) why: Option<String>,
    /// Section of FMI 2.0.5.
    pub(crate) section: Option<&'static str>,
}

impl fmt::Display for Finding {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = match self.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Note => "note",
        };
        write!(formatter, "{severity}: {}: {}", self.place, self.what)?;
        if let Some(section) = self.section {
            write!(formatter, " (section {section})")?;
        }
        match &self.why {
            Some(why) => write!(formatter, "\n    {why}"),
            None => Ok(()),
        }
    }
}

/// The findings about one part, as they come.
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
        (why, section): (&str, &'static str),
    ) {
        self.all.push(Finding {
            severity,
            part: self.part,
            place: place.into(),
            what: what.into(),
            why: (!why.is_empty()).then(|| why.to_owned()),
            section: (!section.is_empty()).then_some(section),
        });
    }
}
