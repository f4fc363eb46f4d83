//! The names of the channels of a signal.

/// `name` for the only channel, `name[k]` for channel k of several; `position` counts from 0.
#[must_use]
pub fn channel(name: &str, position: usize, count: usize) -> String {
    if count == 1 { name.to_owned() } else { format!("{name}[{}]", position + 1) }
}

/// The names of all `count` channels.
#[must_use]
pub fn channels(name: &str, count: usize) -> std::vec::IntoIter<String> {
    let names: Vec<_> = (0..count).map(|position| channel(name, position, count)).collect();
    names.into_iter()
}
