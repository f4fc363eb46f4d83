//! Reads a request of HTTP/1.1 within limits of size and time.

use std::io::{ErrorKind, Read};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Largest number of bytes of request line and headers.
const HEAD: usize = 8 << 10;
/// Largest number of headers of a request.
const HEADERS: usize = 64;
/// Largest number of bytes of the body of a request.
const BODY: usize = 64 << 10;

/// A request of HTTP/1.1.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct HttpRequest {
    pub(crate) method: String,
    pub(crate) path: String,
    /// The part of the target after the question mark.
    pub(crate) query: String,
    pub(crate) host: Option<String>,
    pub(crate) origin: Option<String>,
    /// The header `Sec-Fetch-Site`, which browsers send.
    pub(crate) site: Option<String>,
    /// The header `Sec-Fetch-Mode`, which browsers send.
    pub(crate) mode: Option<String>,
    /// The header `Content-Type`.
    pub(crate) kind: Option<String>,
    pub(crate) body: String,
}

/// Status and reason of a refusal; `None` if the connection is broken, so that no answer is possible.
pub(crate) type Refusal = Option<(u16, &'static str)>;

/// The head of a request.
#[derive(Debug)]
struct Head {
    /// The request, without its body.
    request: HttpRequest,
    /// Length of the head in bytes.
    size: usize,
    /// Length of the body in bytes.
    body_size: usize,
}

/// Reads a request until `deadline`. Refuses late, too large and other than HTTP/1.1 requests, and a body not in UTF-8.
pub(crate) fn read(stream: &mut TcpStream, deadline: Instant) -> Result<HttpRequest, Refusal> {
    let mut bytes = Vec::new();
    let Head { mut request, size, body_size } = loop {
        if let Some(head) = parse_head(&bytes).map_err(Some)? {
            break head;
        }
        receive(stream, deadline, &mut bytes)?;
    };
    let end = size + body_size;
    while bytes.len() < end {
        receive(stream, deadline, &mut bytes)?;
    }
    let body = bytes[size..end].to_vec();
    request.body = String::from_utf8(body).map_err(|_| Some((400, "the body is not UTF-8")))?;
    Ok(request)
}

/// Appends the bytes that arrive next. The error is the answer 408 if nothing arrives before `deadline`, `None` if the
/// connection ends.
fn receive(stream: &mut TcpStream, deadline: Instant, bytes: &mut Vec<u8>) -> Result<(), Refusal> {
    let late = Some((408, "the request took too long"));
    let left = deadline.saturating_duration_since(Instant::now());
    if left < Duration::from_millis(1) {
        return Err(late);
    }
    stream.set_read_timeout(Some(left)).map_err(|_| None)?;
    let mut chunk = [0; 4096];
    match stream.read(&mut chunk) {
        Ok(0) => Err(None),
        Ok(count) => {
            bytes.extend_from_slice(&chunk[..count]);
            Ok(())
        }
        Err(error) => match error.kind() {
            ErrorKind::Interrupted => Ok(()),
            ErrorKind::WouldBlock | ErrorKind::TimedOut => Err(late),
            _ => Err(None),
        },
    }
}

/// Parses the head of a request; `None` if the head is not complete. Returns the status and the reason of a refusal if
/// the head is too large, ambiguous or not HTTP/1.1.
fn parse_head(bytes: &[u8]) -> Result<Option<Head>, (u16, &'static str)> {
    let mut headers = [httparse::EMPTY_HEADER; HEADERS];
    let mut parser = httparse::Request::new(&mut headers);
    let size = match parser.parse(bytes) {
        Ok(httparse::Status::Complete(size)) if size <= HEAD => size,
        Ok(httparse::Status::Partial) if bytes.len() < HEAD => return Ok(None),
        Err(httparse::Error::TooManyHeaders) | Ok(_) => {
            return Err((431, "the head of the request is too large"));
        }
        Err(_) => return Err((400, "this is no request of HTTP/1.1")),
    };
    let target = parser.path.unwrap_or_default();
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let mut request = HttpRequest {
        method: parser.method.unwrap_or_default().to_owned(),
        path: path.to_owned(),
        query: query.to_owned(),
        ..HttpRequest::default()
    };
    let mut length = None;
    for header in parser.headers {
        let name = header.name.to_ascii_lowercase();
        let value = std::str::from_utf8(header.value).unwrap_or("?").trim().to_owned();
        let field = match name.as_str() {
            "host" => &mut request.host,
            "origin" => &mut request.origin,
            "sec-fetch-site" => &mut request.site,
            "sec-fetch-mode" => &mut request.mode,
            "content-type" => &mut request.kind,
            "content-length" => &mut length,
            "transfer-encoding" => return Err((411, "expected a body with its Content-Length")),
            _ => continue,
        };
        if field.replace(value).is_some() {
            return Err((400, "a header is stated twice"));
        }
    }
    let digits = |text: &String| text.bytes().all(|byte| byte.is_ascii_digit());
    let body_size = match length {
        None => 0,
        Some(text) if !text.is_empty() && digits(&text) => text.parse().unwrap_or(usize::MAX),
        Some(_) => return Err((400, "the Content-Length is no number")),
    };
    if body_size > BODY {
        return Err((413, "the body of the request is too large"));
    }
    Ok(Some(Head { request, size, body_size }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(text: &str) -> u16 {
        parse_head(text.as_bytes())
            .map_or_else(|(status, _)| status, |actual| if actual.is_some() { 200 } else { 0 })
    }

    #[test]
    fn a_head_is_read_whole_and_only_once_it_is_complete() {
        let text = "POST /t/scenario?a=b HTTP/1.1\r\nHost: 127.0.0.1:1\r\nORIGIN: http://x\r\nContent-Length: 3\r\n\r\nabc";
        let head = parse_head(text.as_bytes()).unwrap().unwrap();
        let Head { request: actual, size, body_size } = head;
        assert_eq!((actual.method.as_str(), actual.path.as_str()), ("POST", "/t/scenario"));
        assert_eq!((actual.query.as_str(), body_size, size), ("a=b", 3, text.len() - 3));
        assert_eq!(
            (actual.host.as_deref(), actual.origin.as_deref()),
            (Some("127.0.0.1:1"), Some("http://x"))
        );
        for end in 0..size {
            assert!(parse_head(&text.as_bytes()[..end]).unwrap().is_none(), "{end}");
        }
    }

    #[test]
    fn ambiguous_and_oversized_heads_are_refused() {
        assert_eq!(status("GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n"), 400);
        assert_eq!(
            status("POST / HTTP/1.1\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\n"),
            400
        );
        assert_eq!(status("POST / HTTP/1.1\r\nContent-Length: +1\r\n\r\n"), 400);
        assert_eq!(status("POST / HTTP/1.1\r\nContent-Length: -1\r\n\r\n"), 400);
        assert_eq!(status("POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n"), 411);
        assert_eq!(status("POST / HTTP/1.1\r\nContent-Length: 65537\r\n\r\n"), 413);
        assert_eq!(
            status(&format!("POST / HTTP/1.1\r\nContent-Length: {}\r\n\r\n", "9".repeat(40))),
            413
        );
        assert_eq!(status(&format!("GET /{} HTTP/1.1\r\n", "a".repeat(HEAD))), 431);
        assert_eq!(
            status(&format!("GET / HTTP/1.1\r\n{}\r\n", "a: b\r\n".repeat(HEADERS + 1))),
            431
        );
        assert_eq!(status("nonsense\r\n\r\n"), 400);
        assert_eq!(status("\x16\x03\x01\x02"), 400);
    }
}
