//! The text of a file, and lines of comments: paragraphs, columns, ASCII.

/// The largest number of bytes in a line of a paragraph.
const WIDTH: usize = 92;

/// The lines of a file, or of a part of it.
#[derive(Default)]
pub(super) struct Lines(pub(super) Vec<String>);

impl Lines {
    /// Adds a line, or several with line feeds between them.
    pub(super) fn push(&mut self, line: impl Into<String>) {
        self.0.push(line.into());
    }

    /// Adds a line, or several, if `is_stated`.
    pub(super) fn push_if(&mut self, is_stated: bool, line: impl Into<String>) {
        self.0.extend(is_stated.then(|| line.into()));
    }

    /// Removes the comma after the last entry of a list.
    pub(super) fn end_list(&mut self) {
        if let Some(last) = self.0.last_mut() {
            last.truncate(last.trim_end_matches(',').len());
        }
    }

    /// The text of the file.
    pub(super) fn text(&self) -> String {
        self.0.join("\n") + "\n"
    }
}

impl<S: Into<String>> Extend<S> for Lines {
    fn extend<I: IntoIterator<Item = S>>(&mut self, lines: I) {
        self.0.extend(lines.into_iter().map(Into::into));
    }
}

/// Breaks a paragraph into lines of at most [`WIDTH`]; a longer word has a line of its own.
pub(super) fn filled(paragraph: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in paragraph.split(' ') {
        match lines.last_mut() {
            Some(line) if line.len() + word.len() < WIDTH => line.extend([" ", word]),
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// The rows as lines with columns of equal width.
pub(super) fn aligned<const N: usize>(rows: &[[String; N]]) -> Vec<String> {
    let width =
        |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<_> = (0..N).map(width).collect();
    let line = |row: &[String; N]| {
        let cells = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:width$}"));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    rows.iter().map(line).collect()
}

/// The text with spaces in place of control characters, line breaks included.
pub(super) fn one_line(text: &str) -> String {
    text.replace(|sign: char| sign.is_control(), " ")
}

/// Replaces characters beyond printable ASCII, backslashes, marks of comments, trigraphs and code fences.
pub(super) fn ascii(text: &str) -> String {
    let mut plain = String::new();
    for sign in text.chars() {
        match sign {
            '\\' => plain.push('/'),
            ' '..='~' => plain.push(sign),
            _ => plain
                .extend(sign.escape_unicode().map(|sign| if sign == '\\' { '&' } else { sign })),
        }
    }
    for (mark, apart) in
        [("*/", "* /"), ("/*", "/ *"), ("??", "? ?"), ("//", "/ /"), ("```", "` ` `")]
    {
        while plain.contains(mark) {
            plain = plain.replace(mark, apart);
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::ascii;

    #[test]
    fn no_text_ends_a_comment() {
        assert_eq!(ascii("a */ b /* // ??/ \\"), "a * / b / * / / ? ?/ /");
        assert_eq!(ascii("\u{b0}C"), "&u{b0}C");
    }
}
