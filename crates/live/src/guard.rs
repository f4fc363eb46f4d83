//! Checks the sender of a request: token, host and origin.

use std::io;

use crate::request::HttpRequest;

/// Number of random bytes in a token.
const BYTES: usize = 24;

/// The random part of the address. A request without this token is refused.
pub(crate) struct Token(String);

impl Token {
    /// Creates a token from 192 random bits of the operating system.
    pub(crate) fn random() -> io::Result<Self> {
        let mut bytes = [0_u8; BYTES];
        getrandom::fill(&mut bytes).map_err(io::Error::other)?;
        Ok(Self(bytes.map(|byte| format!("{byte:02x}")).concat()))
    }

    pub(crate) fn text(&self) -> &str {
        &self.0
    }

    /// Returns whether `other` equals the token, in a time that does not depend on where the two differ.
    pub(crate) fn is(&self, other: &str) -> bool {
        let (token, other) = (self.0.as_bytes(), other.as_bytes());
        let pairs = token.iter().zip(other);
        let differences = pairs.fold(0, |bits, (one, two)| bits | (one ^ two));
        token.len() == other.len() && std::hint::black_box(differences) == 0
    }
}

/// Checks whether a request comes from the page of this server.
pub(crate) struct Guard {
    token: Token,
    hosts: [String; 2],
    origins: [String; 2],
}

impl Guard {
    pub(crate) fn new(token: Token, port: u16) -> Self {
        let hosts = ["127.0.0.1", "localhost"].map(|name| format!("{name}:{port}"));
        let origins = hosts.clone().map(|host| format!("http://{host}"));
        Self { token, hosts, origins }
    }

    /// Returns the path of the request after the token, or the status and the reason of a refusal.
    ///
    /// A page whose name resolves to 127.0.0.1 (DNS rebinding) sends a foreign `Host`; a page of another site in the
    /// same browser sends a foreign `Origin`.
    pub(crate) fn admit<'a>(
        &self,
        request: &'a HttpRequest,
    ) -> Result<&'a str, (u16, &'static str)> {
        let host = request.host.as_deref().unwrap_or_default();
        if !self.hosts.iter().any(|known| known.eq_ignore_ascii_case(host)) {
            return Err((403, "the Host of the request is not this server"));
        }
        let foreign = |origin: &String| !self.origins.contains(&origin.to_ascii_lowercase());
        if request.origin.as_ref().is_some_and(foreign) {
            return Err((403, "the Origin of the request is another site"));
        }
        let site = request.site.as_deref().unwrap_or("none");
        // A link on another site may open the page: browsers report that site.
        let is_navigation = request.method == "GET" && request.mode.as_deref() == Some("navigate");
        if !(["same-origin", "none"].contains(&site) || is_navigation) {
            return Err((403, "the request comes from another site"));
        }
        let path = request.path.strip_prefix('/').unwrap_or(&request.path);
        let parts = path.split_once('/').filter(|(token, _)| self.token.is(token));
        parts.map(|(_, rest)| rest).ok_or((404, "there is nothing at this address"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(path: &str, host: Option<&str>, origin: Option<&str>) -> HttpRequest {
        HttpRequest {
            method: "GET".to_owned(),
            path: path.to_owned(),
            host: host.map(str::to_owned),
            origin: origin.map(str::to_owned),
            ..HttpRequest::default()
        }
    }

    #[test]
    fn only_the_token_the_own_host_and_no_foreign_origin_are_admitted() {
        let token = Token::random().unwrap();
        let path = format!("/{}/state", token.text());
        let guard = Guard::new(token, 81);
        let host = Some("127.0.0.1:81");
        let status = |request: &HttpRequest| guard.admit(request).err().map(|(status, _)| status);
        assert_eq!(guard.admit(&request(&path, host, None)), Ok("state"));
        assert_eq!(
            status(&request(&path, Some("LOCALHOST:81"), Some("http://localhost:81"))),
            None
        );
        for host in
            [None, Some(""), Some("127.0.0.1"), Some("127.0.0.1:82"), Some("evil.example:81")]
        {
            assert_eq!(status(&request(&path, host, None)), Some(403), "{host:?}");
        }
        for origin in
            ["null", "https://127.0.0.1:81", "http://evil.example", "http://127.0.0.1:82", ""]
        {
            assert_eq!(status(&request(&path, host, Some(origin))), Some(403), "{origin}");
        }
        let cut = &path[..path.len() - "x/state".len()];
        for wrong in ["/", "", "/state", "//state", cut, "/../", &format!("/x{path}")] {
            assert_eq!(status(&request(wrong, host, None)), Some(404), "{wrong}");
        }
        let mut other = request(&path, host, None);
        other.site = Some("cross-site".to_owned());
        assert_eq!(status(&other), Some(403));
        other.mode = Some("navigate".to_owned());
        assert_eq!(status(&other), None);
        other.method = "POST".to_owned();
        assert_eq!(status(&other), Some(403));
    }

    #[test]
    fn tokens_differ_and_have_192_bits() {
        let (one, two) = (Token::random().unwrap(), Token::random().unwrap());
        assert!(one.text().len() == 48 && one.is(one.text()) && !one.is(two.text()));
        assert!(!one.is("") && !one.is(&one.text()[1..]) && !one.is(&format!("{}0", one.text())));
    }
}
