//! TOML tables whose entries keep the order of the file.

use std::fmt;
use std::marker::PhantomData;

use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use toml::Spanned;

use files::Place;

/// Names and values in the order of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Ordered<T>(pub Vec<(String, T)>);

impl<T> Default for Ordered<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> Ordered<T> {
    /// Returns the value of `name`, if there is one.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&T> {
        self.0.iter().find(|(known, _)| known == name).map(|(_, value)| value)
    }

    /// Sets the value of `name`: replaces an existing value in its place, or adds the value at the end.
    pub fn put(&mut self, name: String, value: T) {
        match self.0.iter_mut().find(|(known, _)| *known == name) {
            Some((_, old)) => *old = value,
            None => self.0.push((name, value)),
        }
    }
}

impl<T: Serialize> Serialize for Ordered<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, value)| (name, value)))
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Ordered<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut entries: Vec<(String, Spanned<T>)> =
            deserializer.deserialize_map(Entries(PhantomData))?;
        entries.sort_by_key(|(_, value)| value.span().start);
        Ok(Self(entries.into_iter().map(|(name, value)| (name, value.into_inner())).collect()))
    }
}

/// Visitor that reads a table as a list of entries.
struct Entries<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for Entries<T> {
    type Value = Vec<(String, Spanned<T>)>;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a table")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut entries = Vec::new();
        while let Some(entry) = map.next_entry()? {
            entries.push(entry);
        }
        Ok(entries)
    }
}

/// The value of a setting.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum SettingValue {
    Boolean(bool),
    Integer(i64),
    Real(f64),
    Text(String),
}

impl fmt::Display for SettingValue {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Boolean(value) => write!(formatter, "{value}"),
            Self::Integer(value) => write!(formatter, "{value}"),
            Self::Real(value) => write!(formatter, "{value:?}"),
            Self::Text(value) => formatter.write_str(value),
        }
    }
}

/// Values by `slave.variable`, in the order of the file, each with its location. In the file, a name
/// that occurs twice is an error, and parts of a name may also be tables: `[settings.plant]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings(pub Vec<(String, SettingValue, Place)>);

impl Settings {
    /// Adds a setting of the command line after all others, and removes an earlier setting of the same name.
    pub fn push(&mut self, name: String, value: String) {
        self.0.retain(|(known, _, _)| *known != name);
        self.0.push((name, SettingValue::Text(value), 0..0));
    }
}

impl Serialize for Settings {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, value, _)| (name, value)))
    }
}

impl<'de> Deserialize<'de> for Settings {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let entries = deserializer.deserialize_map(Entries(PhantomData))?;
        let mut flat = Vec::new();
        flatten("", entries, &mut flat);
        flat.sort_by_key(|(_, _, place)| place.start);
        let mut names: Vec<&String> = flat.iter().map(|(name, _, _)| name).collect();
        names.sort();
        if let Some(position) = (1..names.len()).find(|&k| names[k - 1] == names[k]) {
            return Err(D::Error::custom(format!("{} is set twice", names[position])));
        }
        Ok(Self(flat))
    }
}

/// A value, or a table of values.
enum Node {
    Value(SettingValue),
    Table(Vec<(String, Spanned<Node>)>),
}

fn flatten(
    prefix: &str,
    entries: Vec<(String, Spanned<Node>)>,
    flat: &mut Vec<(String, SettingValue, Place)>,
) {
    for (key, node) in entries {
        let place = node.span();
        let name = if prefix.is_empty() { key } else { format!("{prefix}.{key}") };
        match node.into_inner() {
            Node::Value(value) => flat.push((name, value, place)),
            Node::Table(entries) => flatten(&name, entries, flat),
        }
    }
}

impl<'de> Deserialize<'de> for Node {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NodeVisitor)
    }
}

struct NodeVisitor;

impl<'de> Visitor<'de> for NodeVisitor {
    type Value = Node;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a number, true, false, a text in quotes, or a table of them")
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<Node, E> {
        Ok(Node::Value(SettingValue::Boolean(value)))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Node, E> {
        Ok(Node::Value(SettingValue::Integer(value)))
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Node, E> {
        Ok(Node::Value(SettingValue::Real(value)))
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Node, E> {
        Ok(Node::Value(SettingValue::Text(value.to_owned())))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Node, A::Error> {
        Entries(PhantomData).visit_map(map).map(Node::Table)
    }
}
