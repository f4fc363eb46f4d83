//! A bill of materials of an FMU in `CycloneDX` 1.5: the model and the packages compiled into its libraries.
//!
//! The bill has neither a time nor a serial number, so that the same sources give the same bytes.

use anyhow::{Context, bail};
use cargo_metadata::{Package as Crate, Source};
use cyclonedx_bom::external_models::normalized_string::NormalizedString;
use cyclonedx_bom::external_models::uri::Purl;
use cyclonedx_bom::models::bom::{Bom, SpecVersion};
use cyclonedx_bom::models::component::{Classification, Component, Components};
use cyclonedx_bom::models::dependency::{Dependencies, Dependency};
use cyclonedx_bom::models::license::{LicenseChoice, Licenses};
use cyclonedx_bom::models::metadata::Metadata;
use cyclonedx_bom::prelude::{SpdxExpression, Validate as _};
use fmu_description::ModelDescription;

use super::library::Library;

/// Returns the bill of materials of the FMU with this description, as JSON. `foreign` states that the libraries
/// were built elsewhere, by a compiler of unknown version.
///
/// # Errors
///
/// Returns an error if a crate has a name or a licence expression that is not allowed.
pub(super) fn bill(
    description: &ModelDescription,
    library: &Library,
    foreign: bool,
) -> anyhow::Result<Vec<u8>> {
    let package = &library.package;
    let mut model = component(package, Classification::Application)?;
    model.name = NormalizedString::new(&description.model_name);
    model.description = description.description.as_deref().map(NormalizedString::new);
    let mut parts = library
        .dependencies
        .iter()
        .map(|package| component(package, Classification::Library))
        .collect::<anyhow::Result<Vec<_>>>()?;
    parts.push(standard_library((!foreign).then_some(&library.toolchain.release)));
    let needs = Dependency {
        dependency_ref: reference(package),
        dependencies: parts.iter().filter_map(|part| part.bom_ref.clone()).collect(),
    };
    let bom = Bom {
        serial_number: None,
        metadata: Some(Metadata { component: Some(model), ..Metadata::default() }),
        components: Some(Components(parts)),
        dependencies: Some(Dependencies(vec![needs])),
        spec_version: SpecVersion::V1_5,
        ..Bom::default()
    };
    let result = bom.validate_version(SpecVersion::V1_5);
    if result.has_errors() {
        let faults: Vec<_> =
            result.errors().map(|(field, fault)| format!("{field}: {fault:?}")).collect();
        bail!("the bill of materials of {} is not valid: {}", package.name, faults.join("; "));
    }
    let mut bytes = Vec::new();
    bom.output_as_json(&mut bytes, SpecVersion::V1_5)
        .with_context(|| format!("the bill of materials of {}", package.name))?;
    bytes.push(b'\n');
    Ok(bytes)
}

fn reference(package: &Crate) -> String {
    format!("{}@{}", package.name, package.version)
}

fn component(package: &Crate, kind: Classification) -> anyhow::Result<Component> {
    let (name, version) = (package.name.as_str(), package.version.to_string());
    let mut component = Component::new(kind, name, &version, Some(reference(package)));
    // Without a qualifier, the type `cargo` means a crate of crates.io.
    if package.source.as_ref().is_some_and(Source::is_crates_io) {
        component.purl = Some(Purl::new("cargo", name, &version)?);
    }
    component.licenses = package.license.as_deref().map(licenses).transpose()?;
    Ok(component)
}

/// Parses a licence as an SPDX expression; old crates use a slash for OR.
fn licenses(stated: &str) -> anyhow::Result<Licenses> {
    let expression = SpdxExpression::parse_lax(stated.replace('/', " OR "))
        .with_context(|| format!("the licence {stated:?}"))?;
    Ok(Licenses(vec![LicenseChoice::Expression(expression)]))
}

/// Returns the standard library of the compiler `release`; without one, of unknown version.
fn standard_library(release: Option<&String>) -> Component {
    let name = "rust-std";
    let reference = release.map_or(name.to_owned(), |release| format!("{name}@{release}"));
    let version = release.map_or("", String::as_str);
    let mut component = Component::new(Classification::Library, name, version, Some(reference));
    if release.is_none() {
        component.version = None;
        let what = "of the compiler that built each library";
        component.description = Some(NormalizedString::new(what));
    }
    let licenses = SpdxExpression::new("MIT OR Apache-2.0");
    component.licenses = Some(Licenses(vec![LicenseChoice::Expression(licenses)]));
    component
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_crates_of_the_registry_have_its_package_url() {
        let has_url = |source: Option<&str>| {
            let package = serde_json::json!({
                "name": "fmu", "version": "0.1.0", "id": "fmu", "source": source,
                "dependencies": [], "targets": [], "features": {}, "manifest_path": "Cargo.toml",
            });
            let package: Crate = serde_json::from_value(package).unwrap();
            component(&package, Classification::Library).unwrap().purl.is_some()
        };
        assert!(has_url(Some("registry+https://github.com/rust-lang/crates.io-index")));
        assert!(!has_url(Some("git+https://example.org/fmu#0123456789abcdef")));
        assert!(!has_url(Some("registry+https://example.org/index")));
        assert!(!has_url(None));
    }
}
