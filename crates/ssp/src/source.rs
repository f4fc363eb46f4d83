//! Resolves the URIs in an SSD (SSP 1.0.1, sections 2.3 and 5.4).

use std::path::{Path, PathBuf};

use fmu_description::location::path_from_uri;
use percent_encoding::percent_decode_str;

/// The base of relative URIs in a file.
#[derive(Clone, Debug, Default)]
pub(super) struct Base {
    /// The folder at which relative URIs start.
    pub(super) folder: PathBuf,
    /// Name of the folder for messages, such as `plant.ssp/resources` for a temporary folder.
    pub(super) shown: PathBuf,
    /// The folder of the unpacked archive that contains the file; URIs must not leave it.
    pub(super) archive: Option<PathBuf>,
}

/// The file that a URI refers to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Target {
    /// Path of the file.
    pub(super) path: PathBuf,
    /// Name of the file for messages.
    pub(super) shown: PathBuf,
    /// The fragment after `#`.
    pub(super) fragment: Option<String>,
    /// A warning: a part of the URI that is ignored.
    pub(super) warning: Option<String>,
}

impl Target {
    /// Creates a target without a fragment.
    pub(super) fn new(path: PathBuf, shown: PathBuf) -> Self {
        Target { path, shown, fragment: None, warning: None }
    }
}

impl Base {
    /// Returns the base of files at the root of an archive that is unpacked in `folder`; messages state the path
    /// `shown`.
    pub(super) fn archive(folder: &Path, shown: &Path) -> Self {
        let (folder, shown) = (folder.to_owned(), shown.to_owned());
        Base { archive: Some(folder.clone()), folder, shown }
    }

    /// Returns the base for URIs in the file `target`.
    pub(super) fn of_file(&self, target: &Target) -> Self {
        let folder = |path: &Path| path.parent().map(Path::to_path_buf).unwrap_or_default();
        Base {
            folder: folder(&target.path),
            shown: folder(&target.shown),
            archive: self.archive.clone(),
        }
    }

    /// Returns the file that `uri` refers to, or an error sentence.
    ///
    /// For `proxyfmu://HOST?file=URI`, which libcosim and Ecos run in another process or on another machine, this is
    /// the file itself, with a warning.
    pub(super) fn resolve(&self, uri: &str) -> Result<Target, String> {
        // A proxy URI must not contain another one.
        if let Some(file) = proxied(uri).filter(|file| proxied(file).is_none()) {
            let target = self.resolve(file)?;
            let warning =
                format!("{uri} is taken for the file {file}, which runs here without proxyfmu");
            return Ok(Target { warning: Some(warning), ..target });
        }
        let (path, fragment) = match uri.split_once('#') {
            Some((path, fragment)) => (path, Some(decoded(fragment)?)),
            None => (uri, None),
        };
        if path.contains('?') {
            return Err(format!("{uri:?} has a query, expected the path of a file"));
        }
        if let Some(scheme) = scheme(path) {
            if !scheme.eq_ignore_ascii_case("file") {
                return Err(format!(
                    "{uri:?} has the scheme {scheme}, expected a relative path or file:"
                ));
            }
            self.refuse_absolute(uri)?;
            let path = path_from_uri(path).map_err(|error| error.to_string())?;
            return Ok(Target { shown: path.clone(), path, fragment, warning: None });
        }
        let stated = decoded(path)?;
        let decoded = stated.replace('\\', "/");
        let sentence = || format!("{uri:?} has backslashes, which are taken for slashes");
        let warning = (decoded != stated).then(sentence);
        if decoded.starts_with('/') {
            self.refuse_absolute(uri)?;
            let path = PathBuf::from(decoded);
            return Ok(Target { shown: path.clone(), path, fragment, warning });
        }
        let (folder, shown) = (self.walk(&self.folder, &decoded), self.walk(&self.shown, &decoded));
        match (folder, shown) {
            (Some(path), Some(shown)) => Ok(Target { path, shown, fragment, warning }),
            _ => Err(format!("{uri:?} leads out of the archive")),
        }
    }

    fn refuse_absolute(&self, uri: &str) -> Result<(), String> {
        match self.archive {
            Some(_) => Err(format!("{uri:?} is absolute, expected a path inside the archive")),
            None => Ok(()),
        }
    }

    /// Appends the path `relative` to `folder`; `None` if the result leaves the archive.
    fn walk(&self, folder: &Path, relative: &str) -> Option<PathBuf> {
        let inside = |path: &Path| path.parent().map(Path::to_path_buf);
        let mut depth = match &self.archive {
            Some(root) => Some(self.folder.strip_prefix(root).ok()?.components().count()),
            None => None,
        };
        let mut path = folder.to_owned();
        for part in relative.split('/') {
            match (part, &mut depth) {
                ("" | ".", _) => {}
                ("..", Some(depth)) => {
                    *depth = depth.checked_sub(1)?;
                    path = inside(&path)?;
                }
                (part, depth) => {
                    *depth = depth.map(|depth| depth + 1);
                    path.push(part);
                }
            }
        }
        Some(path)
    }
}

/// Returns the URI of the file in `proxyfmu://localhost?file=a.fmu`; `None` for other URIs.
fn proxied(uri: &str) -> Option<&str> {
    let scheme = scheme(uri).filter(|scheme| scheme.eq_ignore_ascii_case("proxyfmu"))?;
    let (_, query) = uri[scheme.len()..].split_once('?')?;
    query.split('&').find_map(|part| part.strip_prefix("file="))
}

fn decoded(text: &str) -> Result<String, String> {
    let decoded = percent_decode_str(text).decode_utf8();
    let decoded = decoded.map_err(|_| format!("{text:?} is not UTF-8 once decoded"))?;
    if decoded.contains('\0') {
        return Err(format!("{text:?} has a NUL"));
    }
    Ok(decoded.into_owned())
}

/// Returns the scheme of an absolute URI (RFC 3986, section 3.1); `None` for a relative one.
fn scheme(uri: &str) -> Option<&str> {
    let (scheme, _) = uri.split_once(':')?;
    let mut characters = scheme.chars();
    let starts = characters.next().is_some_and(|first| first.is_ascii_alphabetic());
    let rest = |character: char| character.is_ascii_alphanumeric() || "+-.".contains(character);
    (starts && characters.all(rest)).then_some(scheme)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn archive() -> Base {
        let mut base = Base::archive(Path::new("/tmp/x"), Path::new("a.ssp"));
        base.folder.push("resources");
        base.shown.push("resources");
        base
    }

    fn disk() -> Base {
        Base { folder: "/data/s".into(), shown: "s".into(), archive: None }
    }

    #[test]
    fn relative_uris_are_decoded_and_start_at_the_ssd() {
        for (uri, path, shown) in [
            ("a.fmu", "/tmp/x/resources/a.fmu", "a.ssp/resources/a.fmu"),
            ("./b%20c/d%25.fmu", "/tmp/x/resources/b c/d%.fmu", "a.ssp/resources/b c/d%.fmu"),
            ("../e.ssv", "/tmp/x/e.ssv", "a.ssp/e.ssv"),
            ("f:g.fmu/../h.fmu", "", ""),
        ] {
            let actual = archive().resolve(uri);
            if path.is_empty() {
                assert!(actual.unwrap_err().contains("the scheme f"), "{uri}");
                continue;
            }
            let expected = Target::new(path.into(), shown.into());
            assert_eq!(actual, Ok(expected), "{uri}");
        }
        let actual = archive().resolve("sub.ssp#Variant%20B.ssd").unwrap();
        assert_eq!(actual.fragment.as_deref(), Some("Variant B.ssd"));
    }

    #[test]
    fn nothing_leads_out_of_an_archive() {
        for uri in ["../../a", "%2e%2e/%2E%2E/a", "b/../../../a", "..%2f..%2fa"] {
            let sentence = archive().resolve(uri).unwrap_err();
            assert!(sentence.ends_with("leads out of the archive"), "{sentence}");
        }
        for uri in ["/etc/passwd", "file:///etc/passwd", "%2Fetc"] {
            let sentence = archive().resolve(uri).unwrap_err();
            assert!(sentence.contains("is absolute"), "{sentence}");
        }
    }

    #[test]
    fn the_file_of_a_proxy_is_used_itself_with_a_warning() {
        let actual = disk().resolve("proxyfmu://localhost?file=../f%20g/a.fmu").unwrap();
        assert_eq!(actual.path, Path::new("/data/s/../f g/a.fmu"));
        assert!(actual.warning.unwrap().ends_with("which runs here without proxyfmu"));
        let actual = disk().resolve("proxyfmu://h:9090?a=b&file=file:///a.fmu").unwrap();
        assert_eq!(actual.path, Path::new("/a.fmu"));
        let sentence = archive().resolve("proxyfmu://localhost?file=../../a").unwrap_err();
        assert!(sentence.ends_with("leads out of the archive"), "{sentence}");
    }

    #[test]
    fn backslashes_are_taken_for_slashes_with_a_warning() {
        let actual = archive().resolve("..\\b c\\d.fmu").unwrap();
        assert_eq!(actual.path, Path::new("/tmp/x/b c/d.fmu"));
        assert!(actual.warning.unwrap().ends_with("has backslashes, which are taken for slashes"));
        for uri in ["..\\..\\a", "..%5c..%5Ca", "b\\../..\\../a"] {
            let sentence = archive().resolve(uri).unwrap_err();
            assert!(sentence.ends_with("leads out of the archive"), "{sentence}");
        }
        assert!(archive().resolve("\\etc").unwrap_err().contains("is absolute"));
    }

    #[test]
    fn a_file_on_disk_may_name_others_anywhere_on_disk_but_not_elsewhere() {
        let path = |uri| disk().resolve(uri).unwrap().path;
        assert_eq!(path("../fmi2/a.fmu"), Path::new("/data/s/../fmi2/a.fmu"));
        assert_eq!(path("file:///b%20c.fmu"), Path::new("/b c.fmu"));
        assert_eq!(path("/d.fmu"), Path::new("/d.fmu"));
        for (uri, words) in [
            ("https://x.org/a.fmu", "the scheme https"),
            ("a.fmu?x=1", "a query"),
            ("proxyfmu://localhost", "the scheme proxyfmu"),
            ("proxyfmu://a?file=proxyfmu://b?file=c.fmu", "a query"),
            ("a%00b", "a NUL"),
            ("%ff", "not UTF-8"),
        ] {
            let sentence = disk().resolve(uri).unwrap_err();
            assert!(sentence.contains(words), "{sentence}");
        }
    }
}
