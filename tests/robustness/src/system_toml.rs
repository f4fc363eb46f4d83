//! The fuzz target `system_toml`. It panics if a claim does not hold.

use std::path::Path;

use study::config::{Config, parse};

/// A `system.toml`: a file that was read is written and reads back the same; an error says where.
pub fn system_toml(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let mut config = match parse(text, Path::new("/models/system.toml")) {
        Ok(config) => config,
        Err(error) => return located(text, &error.to_string()),
    };
    let done = config.make_absolute();
    done.unwrap_or_else(|error| panic!("{error}: {text}"));
    let written = config.render().unwrap_or_else(|error| panic!("{error}: {text}"));
    let again = parse(&written, Path::new("/elsewhere/system.toml"));
    let again = again.unwrap_or_else(|error| panic!("{error}\n{written}"));
    assert_eq!(again.render().ok().as_ref(), Some(&written));
    // NaN is not equal to itself.
    assert!(
        without_places(again) == without_places(config) || written.contains("nan"),
        "{written}"
    );
}

/// Settings contain their position in the file.
fn without_places(mut config: Config) -> Config {
    for (_, _, place) in &mut config.settings.0 {
        *place = 0..0;
    }
    config
}

/// The message starts with a position in the text and a reason, and shows the line with a mark.
fn located(text: &str, message: &str) {
    let mut parts = message.splitn(4, ':');
    assert_eq!(parts.next(), Some("/models/system.toml"));
    let mut number = || parts.next().and_then(|part| part.parse::<usize>().ok()).unwrap_or(0);
    let (line, column) = (number(), number());
    let lines: Vec<&str> = text.split('\n').collect();
    assert!((1..=lines.len()).contains(&line), "{message}");
    let shown = lines[line - 1];
    assert!((1..=shown.chars().count() + 1).contains(&column), "{message}");
    assert!(parts.next().is_some_and(|reason| reason.trim_start().len() > 5), "{message}");
    assert!(message.contains(shown.trim_end_matches('\r')), "{message}");
    assert!(message.ends_with('^'), "{message}");
}
