//! Tables of texts and numbers.

use design_report::number::rounded;
use maud::{Markup, html};

use super::number::{complex, exact};

/// The content of a cell; an empty text is `Missing`.
pub(super) enum Cell {
    Text(String),
    Number(f64),
    Complex([f64; 2]),
    /// Whether a condition holds.
    Holds(bool),
    /// No value, shown as a dash.
    Missing,
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        if text.is_empty() { Self::Missing } else { Self::Text(text.to_owned()) }
    }
}

impl From<&String> for Cell {
    fn from(text: &String) -> Self {
        text.as_str().into()
    }
}

impl From<&Option<String>> for Cell {
    fn from(text: &Option<String>) -> Self {
        text.as_deref().map_or(Self::Missing, Self::from)
    }
}

impl From<f64> for Cell {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<Option<f64>> for Cell {
    fn from(number: Option<f64>) -> Self {
        number.map_or(Self::Missing, Self::Number)
    }
}

impl From<Option<[f64; 2]>> for Cell {
    fn from(number: Option<[f64; 2]>) -> Self {
        number.map_or(Self::Missing, Self::Complex)
    }
}

impl Cell {
    fn render(&self, numeric: bool) -> Markup {
        match self {
            Self::Text(text) => html! { td { (text) } },
            Self::Number(value) => {
                html! { td.number title=(exact(*value)) { (rounded(*value)) } }
            }
            Self::Complex(value) => {
                html! { td.number title=(complex(*value, exact)) { (complex(*value, rounded)) } }
            }
            Self::Holds(true) => html! { td.holds { "✓ yes" } },
            Self::Holds(false) => html! { td.fails { "✗ no" } },
            Self::Missing => html! { td .number[numeric] { "–" } },
        }
    }
}

/// Returns a table whose first column names its rows. Other columns without a value are left out; without rows the
/// result is empty.
pub(super) fn table<'a>(
    caption: &str,
    heads: impl IntoIterator<Item = &'a str>,
    rows: &[Vec<Cell>],
) -> Markup {
    let heads: Vec<&str> = heads.into_iter().collect();
    let filled = |column: usize| rows.iter().any(|row| !matches!(row[column], Cell::Missing));
    let is_number = |cell: &Cell| matches!(cell, Cell::Number(_) | Cell::Complex(_));
    let numeric = |column: usize| rows.iter().any(|row| is_number(&row[column]));
    let columns: Vec<(usize, bool)> = (0..heads.len())
        .filter(|column| *column == 0 || filled(*column))
        .map(|column| (column, numeric(column)))
        .collect();
    html! {
        @if !rows.is_empty() {
            (scrolled(caption, &html! {
                table {
                    caption { (caption) }
                    thead {
                        tr {
                            @for (column, numeric) in &columns {
                                th scope="col" .number[*numeric] { (heads[*column]) }
                            }
                        }
                    }
                    tbody {
                        @for row in rows {
                            tr {
                                @for (column, numeric) in &columns {
                                    @if *column == 0 {
                                        (row_name(&row[0]))
                                    } @else {
                                        (row[*column].render(*numeric))
                                    }
                                }
                            }
                        }
                    }
                }
            }))
        }
    }
}

/// The columns of a table of items: each has a head and gives the cell of an item.
pub(super) type Columns<'a, T, const N: usize> = [(&'a str, fn(&T) -> Cell); N];

/// Returns the [`table`] with a row for each item.
pub(super) fn table_of<'a, T: 'a, const N: usize>(
    caption: &str,
    items: impl IntoIterator<Item = &'a T>,
    columns: &Columns<'_, T, N>,
) -> Markup {
    let heads = columns.map(|(head, _)| head);
    let row = |item: &T| columns.iter().map(|(_, cell)| cell(item)).collect();
    table(caption, heads, &items.into_iter().map(row).collect::<Vec<_>>())
}

/// A name with its unit, if any.
pub(super) fn with_unit(name: &str, unit: Option<&String>) -> Cell {
    Cell::Text(unit.map_or_else(|| name.to_owned(), |unit| format!("{name} ({unit})")))
}

fn row_name(cell: &Cell) -> Markup {
    html! {
        th scope="row" {
            @match cell {
                Cell::Text(text) => (text),
                Cell::Number(value) => (rounded(*value)),
                _ => "–",
            }
        }
    }
}

/// Returns a scrollable container for wide content, also scrollable by keys.
pub(super) fn scrolled(name: &str, content: &Markup) -> Markup {
    html! { div.scroll role="region" tabindex="0" aria-label=(name) { (content) } }
}
