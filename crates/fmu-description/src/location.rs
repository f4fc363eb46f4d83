//! Conversion between paths and `file:` URIs for `fmuResourceLocation` (FMI 2.0.5, section 2.1.5), and
//! paths for `resourcePath` (FMI 3.0.2, section 2.3.1).
//!
//! Written here because the crate `url` ends a path at an unencoded `?` or `#`, which some importers
//! pass, and would add tables for international host names to every exported FMU.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, percent_decode_str, percent_encode};

/// All characters except the unreserved ones of RFC 3986, section 2.3, and the separator.
const ENCODED: AsciiSet =
    NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~').remove(b'/');
/// [`ENCODED`] without the colon, for a path with a drive letter.
const ENCODED_AFTER_DRIVE: AsciiSet = ENCODED.remove(b':');

/// The resource folder that a model receives if the importer names none. The first character, NUL, makes this path
/// invalid on every platform, so that a model cannot read the working directory instead.
pub const NO_FOLDER: &str = "\0(no fmuResourceLocation)";

/// The error of a conversion between a path and a URI.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum LocationError {
    /// The path is relative.
    #[error("expected an absolute path, found {}", path.display())]
    Relative { path: PathBuf },
    /// The path is not valid Unicode.
    #[error("expected a path in Unicode, found {}", path.display())]
    NotUnicode { path: PathBuf },
    /// The URI is not a valid `file:` URI.
    #[error(
        "expected a file URI with an absolute path, such as file:///tmp/fmu/resources, \
         found {uri:?}"
    )]
    NotAFile { uri: String },
    /// The URI names another machine.
    #[error("expected a file on this machine, found host {host:?} in {uri:?}")]
    Host { host: String, uri: String },
}

/// Converts an absolute path to a URI `file:///...` (RFC 8089, appendix B) without a trailing slash.
///
/// # Errors
///
/// [`LocationError`] for a relative path, and on systems other than Unix for a path that is not Unicode.
///
/// ```
/// # #[cfg(unix)] {
/// let uri = fmu_description::location::file_uri("/tmp/a model/50%".as_ref())?;
/// assert_eq!(uri, "file:///tmp/a%20model/50%25");
/// # }
/// # Ok::<(), fmu_description::location::LocationError>(())
/// ```
pub fn file_uri(path: &Path) -> Result<String, LocationError> {
    if !path.is_absolute() {
        return Err(LocationError::Relative { path: path.to_owned() });
    }
    Ok(encode(bytes_of(path)?, cfg!(windows)))
}

/// Returns an absolute path as text with a separator at its end, as `resourcePath` of FMI 3.0 needs it. On
/// Windows, without the prefix `\\?\` of long paths.
///
/// # Errors
///
/// [`LocationError`] for a relative path and for one that is not Unicode.
///
/// ```
/// # #[cfg(unix)] {
/// let path = fmu_description::location::folder_path("/tmp/a model/50%".as_ref())?;
/// assert_eq!(path, "/tmp/a model/50%/");
/// # }
/// # Ok::<(), fmu_description::location::LocationError>(())
/// ```
pub fn folder_path(path: &Path) -> Result<String, LocationError> {
    if !path.is_absolute() {
        return Err(LocationError::Relative { path: path.to_owned() });
    }
    let text = path.to_str().ok_or_else(|| LocationError::NotUnicode { path: path.to_owned() })?;
    // `\\?\` only marks a long path, which some FMUs cannot open.
    let plain = text.strip_prefix(r"\\?\").filter(|_| cfg!(windows)).unwrap_or(text);
    let separated = plain.ends_with(std::path::is_separator);
    Ok(if separated { plain.to_owned() } else { format!("{plain}{}", std::path::MAIN_SEPARATOR) })
}

/// Converts a `file:` URI to a path.
///
/// Accepts `file:///p`, `file:/p` and `file://localhost/p`, with or without a trailing slash,
/// percent-encoded or not; on Windows also a drive letter, `file:///C:/p`. `?` and `#` are part of the
/// path: a file has no query, and some importers do not encode paths.
///
/// # Errors
///
/// [`LocationError`] for another scheme, a relative path, another host or a NUL, and on systems other than Unix
/// for a path that is not UTF-8.
///
/// ```
/// # #[cfg(unix)] {
/// let path = fmu_description::location::path_from_uri("file:/tmp/a%20model/resources/")?;
/// assert_eq!(path, std::path::Path::new("/tmp/a model/resources"));
/// # }
/// # Ok::<(), fmu_description::location::LocationError>(())
/// ```
pub fn path_from_uri(uri: &str) -> Result<PathBuf, LocationError> {
    let bytes = decode(uri, cfg!(windows))?;
    path_of(bytes).ok_or_else(|| LocationError::NotAFile { uri: uri.to_owned() })
}

/// Encodes an absolute path as a URI. `drives` selects paths of Windows, with drive letter and backslashes.
fn encode(path: &[u8], drives: bool) -> String {
    if !drives {
        return format!("file://{}", percent_encode(path, &ENCODED));
    }
    let slashes: Vec<u8> =
        path.iter().map(|byte| if *byte == b'\\' { b'/' } else { *byte }).collect();
    // `\\?\` only marks a long path.
    let plain = slashes.strip_prefix(b"//?/").unwrap_or(&slashes);
    let encoded = percent_encode(plain, &ENCODED_AFTER_DRIVE).to_string();
    if encoded.starts_with("//") { format!("file:{encoded}") } else { format!("file:///{encoded}") }
}

/// Decodes the path of a URI, without slashes at its end. `drives` selects paths of Windows, with drive letter.
fn decode(uri: &str, drives: bool) -> Result<Vec<u8>, LocationError> {
    let wrong = || LocationError::NotAFile { uri: uri.to_owned() };
    let (scheme, rest) = uri.split_once(':').ok_or_else(wrong)?;
    if !scheme.eq_ignore_ascii_case("file") {
        return Err(wrong());
    }
    let path = match rest.strip_prefix("//") {
        None => rest,
        Some(rest) => {
            let slash = rest.find('/').ok_or_else(wrong)?;
            let host = &rest[..slash];
            if !host.is_empty() && !host.eq_ignore_ascii_case("localhost") {
                return Err(LocationError::Host { host: host.to_owned(), uri: uri.to_owned() });
            }
            &rest[slash..]
        }
    };
    let decoded: Cow<'_, [u8]> = percent_decode_str(path).into();
    if !decoded.starts_with(b"/") || decoded.contains(&0) {
        return Err(wrong());
    }
    let mut bytes = decoded.into_owned();
    while bytes.len() > 1 && bytes.last() == Some(&b'/') {
        bytes.pop();
    }
    if drives && bytes.len() >= 3 && bytes[1].is_ascii_alphabetic() && bytes[2] == b':' {
        bytes.remove(0);
        if bytes.len() == 2 {
            bytes.push(b'/');
        }
    }
    Ok(bytes)
}

/// Returns the bytes of a path; an error on systems other than Unix if the path is not Unicode.
fn bytes_of(path: &Path) -> Result<&[u8], LocationError> {
    if cfg!(not(unix)) && path.to_str().is_none() {
        return Err(LocationError::NotUnicode { path: path.to_owned() });
    }
    Ok(path.as_os_str().as_encoded_bytes())
}

#[cfg(unix)]
#[expect(clippy::unnecessary_wraps, reason = "paths of other platforms may not be text")]
fn path_of(bytes: Vec<u8>) -> Option<PathBuf> {
    use std::os::unix::ffi::OsStringExt as _;
    Some(PathBuf::from(std::ffi::OsString::from_vec(bytes)))
}

#[cfg(not(unix))]
fn path_of(bytes: Vec<u8>) -> Option<PathBuf> {
    String::from_utf8(bytes).ok().map(PathBuf::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn every_form_of_a_file_uri_names_the_same_path() {
        for uri in [
            "file:///tmp/a b/r",
            "file:///tmp/a%20b/r",
            "file:///tmp/a%20b/r/",
            "file:///tmp/a%20b/r//",
            "file:/tmp/a%20b/r",
            "file:/tmp/a%20b/r/",
            "file://localhost/tmp/a%20b/r",
            "FILE://LocalHost/tmp/a%20b/r",
            "file:///%74mp/a%20b/%72",
        ] {
            assert_eq!(path_from_uri(uri), Ok(PathBuf::from("/tmp/a b/r")), "{uri}");
        }
        assert_eq!(path_from_uri("file:///"), Ok(PathBuf::from("/")));
        assert_eq!(path_from_uri("file:///a?b#c"), Ok(PathBuf::from("/a?b#c")));
    }

    /// The URIs on the left are the results of `pathlib.PurePosixPath.as_uri` and RFC 8089.
    #[cfg(unix)]
    #[test]
    fn a_path_is_recovered_from_its_uri() {
        for (uri, path) in [
            ("file:///tmp/x", "/tmp/x"),
            ("file:///a%20b/50%25/%23%3F", "/a b/50%/#?"),
            ("file:///%C3%A4/%E2%82%AC", "/\u{e4}/\u{20ac}"),
            ("file:///a%2Bb%26c", "/a+b&c"),
            ("file:///C%3A/x", "/C:/x"),
        ] {
            assert_eq!(file_uri(Path::new(path)).unwrap(), uri);
            assert_eq!(path_from_uri(uri).unwrap(), Path::new(path));
        }
    }

    #[cfg(unix)]
    #[test]
    fn bytes_that_are_not_utf_8_survive() {
        use std::os::unix::ffi::OsStrExt as _;
        let path = Path::new(std::ffi::OsStr::from_bytes(b"/tmp/\xff\xfe"));
        let uri = file_uri(path).unwrap();
        assert_eq!(uri, "file:///tmp/%FF%FE");
        assert_eq!(path_from_uri(&uri).unwrap(), path);
    }

    #[test]
    fn windows_paths_have_their_drive_after_the_third_slash() {
        for (uri, path) in [
            ("file:///C:/x%20y/r", r"C:\x y\r"),
            ("file:///d:/", r"d:\"),
            ("file:///C:/x", r"\\?\C:\x"),
        ] {
            assert_eq!(encode(path.as_bytes(), true), uri);
            let text = String::from_utf8(decode(uri, true).unwrap()).unwrap();
            assert_eq!(text, path.trim_start_matches(r"\\?\").replace('\\', "/"));
        }
        assert_eq!(encode(br"\\server\share\x", true), "file://server/share/x");
        assert_eq!(decode("file:///C%3A/x", true).unwrap(), b"C:/x");
        assert_eq!(decode("file:/C:/x/", true).unwrap(), b"C:/x");
        assert_eq!(decode("file:///C:", true).unwrap(), b"C:/");
        assert_eq!(decode("file:///C:/x", false).unwrap(), b"/C:/x");
    }

    #[test]
    fn other_uris_and_relative_paths_are_refused() {
        for uri in ["", "/tmp", "http://x/y", "file", "file:", "file:tmp", "file://", "file://tmp"]
        {
            assert!(matches!(path_from_uri(uri), Err(LocationError::NotAFile { .. })), "{uri}");
        }
        let nul = path_from_uri("file:///tmp/%00");
        assert!(matches!(nul, Err(LocationError::NotAFile { .. })));
        let host = path_from_uri("file://server/share");
        assert!(matches!(host, Err(LocationError::Host { host, .. }) if host == "server"));
        assert!(matches!(file_uri(Path::new("a/b")), Err(LocationError::Relative { .. })));
    }
}
