//! A start tag of quick-xml with typed and optional attributes. `BytesStart` accepts text only, and `Display` of an
//! `f64` is not the text of a number in `modelDescription.xml`.

use std::borrow::Cow;

use quick_xml::events::BytesStart;

/// The value of an attribute, as a type that has a text in XML.
pub(crate) trait Value {
    fn text(&self) -> Cow<'_, str>;
}

impl Value for str {
    fn text(&self) -> Cow<'_, str> {
        crate::xml::writable(self)
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

impl<T: Value> Value for Option<T> {
    fn text(&self) -> Cow<'_, str> {
        self.as_ref().map_or(Cow::Borrowed(""), T::text)
    }
}

/// Implements [`Value`] for types whose `Display` is their text in XML.
macro_rules! displayed {
    ($($kind:ty),*) => {$(
        impl Value for $kind {
            fn text(&self) -> Cow<'_, str> {
                Cow::Owned(self.to_string())
            }
        }
    )*};
}

displayed!(i32, i64, i128, u32, u64, bool);

/// A start tag under construction.
pub(crate) struct Tag<'a>(pub(super) BytesStart<'a>);

impl<'a> Tag<'a> {
    pub(crate) fn new(name: &'a str) -> Self {
        Tag(BytesStart::new(name))
    }

    pub(crate) fn with(mut self, name: &str, value: &(impl Value + ?Sized)) -> Self {
        self.0.push_attribute((name, value.text()));
        self
    }

    /// Adds an attribute, if it has a value.
    pub(super) fn maybe(self, name: &str, value: Option<&(impl Value + ?Sized)>) -> Self {
        match value {
            Some(value) => self.with(name, value),
            None => self,
        }
    }

    /// Adds an attribute, unless its value is the default of the type: zero, false or `None`.
    pub(super) fn unless_default<T: Value + Default + PartialEq>(
        self,
        name: &str,
        value: &T,
    ) -> Self {
        if *value == T::default() { self } else { self.with(name, value) }
    }
}
