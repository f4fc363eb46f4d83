//! Reads entries that several tables of a plant file have: numbers in a range, one of two texts, one number for all.

use std::ops::{RangeBounds, RangeInclusive};

use files::{Entry, PlaceError, Table};

pub(crate) type Result<T, E = PlaceError> = std::result::Result<T, E>;

/// Reads a number above 0; `None` if the table does not have the entry.
pub(crate) fn positive(table: &Table<'_>, key: &str) -> Result<Option<f64>> {
    optional(table, key, Entry::positive)
}

/// Reads an entry with `read`; `None` if the table does not have it.
pub(crate) fn optional<'a, T>(
    table: &Table<'a>,
    key: &str,
    read: impl FnOnce(&Entry<'a>) -> Result<T>,
) -> Result<Option<T>> {
    table.get(key).as_ref().map(read).transpose()
}

/// Reads a table with a number above 0 for some of `names`. Returns for each name the number, `None` without a number,
/// or the error, so that callers report mistakes in the order of the names.
pub(crate) fn positives(
    table: &Table<'_>,
    key: &str,
    names: &[&str],
) -> Result<Vec<Result<Option<f64>>>> {
    let Some(entry) = table.get(key) else { return Ok(names.iter().map(|_| Ok(None)).collect()) };
    let stated = entry.table()?;
    stated.allow(names)?;
    Ok(names.iter().map(|name| positive(&stated, name)).collect())
}

/// Reads a number in `range`; `rule` is the text for other numbers, such as "expected at most 1".
pub(crate) fn within(entry: &Entry<'_>, range: impl RangeBounds<f64>, rule: &str) -> Result<f64> {
    match entry.number()? {
        number if range.contains(&number) => Ok(number),
        number => Err(entry.error(format!("{rule}, found {number}"))),
    }
}

/// Reads a number above 0 in `range`; `rule` is the text for other positive numbers.
pub(crate) fn positive_within(
    entry: &Entry<'_>,
    range: impl RangeBounds<f64>,
    rule: &str,
) -> Result<f64> {
    entry.positive()?;
    within(entry, range, rule)
}

pub(crate) fn not_negative(entry: &Entry<'_>) -> Result<f64> {
    within(entry, 0.0.., "expected no less than 0")
}

pub(crate) fn whole(entry: &Entry<'_>, range: RangeInclusive<u32>) -> Result<u32> {
    let (least, most) = range.into_inner();
    let number = entry.number()?;
    if number.fract() == 0.0 && (f64::from(least)..=f64::from(most)).contains(&number) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
        return Ok(number as u32);
    }
    Err(entry.error(format!("expected a whole number from {least} to {most}, found {number}")))
}

/// Reads one of two texts; returns whether the text is the first one.
pub(crate) fn is_first(entry: &Entry<'_>, [first, second]: [&str; 2]) -> Result<bool> {
    match entry.text()? {
        text if text == first || text == second => Ok(text == first),
        other => Err(entry.error(format!("expected {first:?} or {second:?}, found {other:?}"))),
    }
}

/// Reads one value for all of `count` signals, or a list of one for each; `what` names the list in errors.
pub(crate) fn each<'a, T: Clone>(
    entry: &Entry<'a>,
    count: usize,
    what: &str,
    read: impl Fn(&Entry<'a>) -> Result<T>,
) -> Result<Vec<T>> {
    if !entry.is_list() {
        return Ok(vec![read(entry)?; count]);
    }
    let members = entry.list()?;
    if members.len() != count {
        return Err(entry.error(format!("expected {count} {what}, found {}", members.len())));
    }
    members.iter().map(read).collect()
}

/// Refuses the first of `keys` that the table has, with `message`.
pub(crate) fn refuse(table: &Table<'_>, keys: &[&str], message: &str) -> Result<()> {
    match keys.iter().find_map(|key| table.get(key)) {
        Some(entry) => Err(entry.error(message)),
        None => Ok(()),
    }
}

/// Refuses `entry` if the file has one of `others`.
pub(crate) fn alone(entry: &Entry<'_>, file: &Table<'_>, others: &[&str]) -> Result<()> {
    match others.iter().find(|key| file.get(key).is_some()) {
        Some(other) => Err(entry.error(format!("it is not possible together with `{other}`"))),
        None => Ok(()),
    }
}
