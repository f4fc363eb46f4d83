//! Answers of HTTP/1.1, with the headers that protect the page.

use std::borrow::Cow;
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// The content security policy: the page loads files of this server only, runs no inline code and is in no frame.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src data:; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// Largest number of bytes of a refused request that are still read, so that the client can read the answer.
const REST: usize = 256 << 10;
/// Longest time for reading the rest of a refused request.
const REST_TIME: Duration = Duration::from_millis(500);

pub(crate) struct Answer {
    pub(crate) status: u16,
    pub(crate) kind: &'static str,
    pub(crate) body: Cow<'static, str>,
    /// The methods that the address allows (header `Allow`), if the request has another method.
    pub(crate) allow: Option<&'static str>,
}

impl Answer {
    /// Creates an answer with a file of the page.
    pub(crate) fn file(kind: &'static str, body: &'static str) -> Self {
        Self { status: 200, kind, body: Cow::Borrowed(body), allow: None }
    }

    /// Creates an answer in JSON.
    pub(crate) fn json(status: u16, value: &Value) -> Self {
        Self::text_of_json(status, value.to_string())
    }

    /// Creates an answer from JSON text.
    pub(crate) fn text_of_json(status: u16, body: String) -> Self {
        Self { status, kind: "application/json", body: Cow::Owned(body), allow: None }
    }

    /// Creates a refusal with its reason.
    pub(crate) fn refusal(status: u16, reason: &str) -> Self {
        Self::json(status, &json!({ "error": reason }))
    }

    fn head(&self) -> String {
        let reason = match self.status {
            200 => "OK",
            202 => "Accepted",
            400 => "Bad Request",
            403 => "Forbidden",
            404 => "Not Found",
            405 => "Method Not Allowed",
            408 => "Request Timeout",
            410 => "Gone",
            411 => "Length Required",
            413 => "Content Too Large",
            415 => "Unsupported Media Type",
            422 => "Unprocessable Content",
            431 => "Request Header Fields Too Large",
            _ => "Service Unavailable",
        };
        let allow = self.allow.map(|allow| format!("Allow: {allow}\r\n")).unwrap_or_default();
        format!(
            "HTTP/1.1 {} {reason}\r\nContent-Type: {}; charset=utf-8\r\nContent-Length: {}\r\n{allow}\
             Connection: close\r\nCache-Control: no-store\r\nContent-Security-Policy: {POLICY}\r\n\
             X-Content-Type-Options: nosniff\r\nX-Frame-Options: DENY\r\nReferrer-Policy: same-origin\r\n\
             Cross-Origin-Resource-Policy: same-origin\r\nCross-Origin-Opener-Policy: same-origin\r\n\r\n",
            self.status,
            self.kind,
            self.body.len()
        )
    }

    /// Writes the answer and closes the connection for writing. After a refusal, also reads the rest of the request.
    /// Returns an error if the client does not receive the answer until `deadline`.
    pub(crate) fn write(&self, stream: &mut TcpStream, deadline: Instant) -> io::Result<()> {
        put(stream, self.head().as_bytes(), deadline)?;
        put(stream, self.body.as_bytes(), deadline)?;
        stream.shutdown(Shutdown::Write)?;
        if self.status >= 400 {
            drain(stream);
        }
        Ok(())
    }
}

fn put(stream: &mut TcpStream, mut bytes: &[u8], deadline: Instant) -> io::Result<()> {
    while !bytes.is_empty() {
        let left = deadline.saturating_duration_since(Instant::now());
        stream.set_write_timeout(Some(left.max(Duration::from_millis(1))))?;
        if left.is_zero() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        match stream.write(bytes) {
            Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
            Ok(count) => bytes = &bytes[count..],
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Reads the bytes that the client still sends, within limits: the answer would be lost if the connection were closed.
fn drain(stream: &mut TcpStream) {
    let end = Instant::now() + REST_TIME;
    let (mut chunk, mut count) = ([0; 4096], 0);
    while count < REST {
        let left = end.saturating_duration_since(Instant::now());
        if left.is_zero() || stream.set_read_timeout(Some(left)).is_err() {
            return;
        }
        match stream.read(&mut chunk) {
            Ok(more) if more > 0 => count += more,
            _ => return,
        }
    }
}
