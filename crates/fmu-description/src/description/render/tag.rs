//! A start tag and the text of its attributes.

use std::borrow::Cow;

use quick_xml::events::BytesStart;

/// A value of an attribute.
pub(super) trait Value {
    fn text(&self) -> Cow<'_, str>;
}

impl Value for str {
    fn text(&self) -> Cow<'_, str> {
        if self.chars().all(is_xml) {
            return Cow::Borrowed(self);
        }
        let replace = |character| {
            if is_xml(character) { character } else { '\u{fffd}' }
        };
        Cow::Owned(self.chars().map(replace).collect())
    }
}

impl Value for String {
    fn text(&self) -> Cow<'_, str> {
        self.as_str().text()
    }
}

impl Value for f64 {
    fn text(&self) -> Cow<'_, str> {
        Cow::Owned(format!("{self:?}"))
    }
}

macro_rules! displayed {
    ($($kind:ty),*) => {$(
        impl Value for $kind {
            fn text(&self) -> Cow<'_, str> {
                Cow::Owned(self.to_string())
            }
        }
    )*};
}

displayed!(i32, u32, bool);

/// A start tag under construction.
pub(super) struct Tag<'a>(pub(super) BytesStart<'a>);

impl<'a> Tag<'a> {
    pub(super) fn new(name: &'a str) -> Self {
        Tag(BytesStart::new(name))
    }

    pub(super) fn with(mut self, name: &str, value: &(impl Value + ?Sized)) -> Self {
        self.0.push_attribute((name, value.text()));
        self
    }

    pub(super) fn maybe(self, name: &str, value: Option<&(impl Value + ?Sized)>) -> Self {
        match value {
            Some(value) => self.with(name, value),
            None => self,
        }
    }

    /// Adds an attribute, unless it has its default, zero or false.
    pub(super) fn unless_default<T: Value + Default + PartialEq>(
        self,
        name: &str,
        value: &T,
    ) -> Self {
        if *value == T::default() { self } else { self.with(name, value) }
    }
}

/// Whether XML 1.0 allows `character` (its production 2).
pub(in crate::description) fn is_xml(character: char) -> bool {
    matches!(character, '\t' | '\n' | '\r' | ' '..='\u{d7ff}' | '\u{e000}'..='\u{fffd}')
        || character >= '\u{10000}'
}
