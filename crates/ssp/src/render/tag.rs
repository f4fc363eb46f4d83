//! A tree of elements. quick-xml writes the tree only when it is complete, because the root states the version of SSP
//! that the content requires.

use fmu_description::xml::writable;
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, Event};

/// The prefixes with their namespaces: the usual prefixes, because some importers compare prefixes.
const PREFIXES: [(&str, &str); 6] = [
    ("xmlns:ssd", "http://ssp-standard.org/SSP1/SystemStructureDescription"),
    ("xmlns:ssc", "http://ssp-standard.org/SSP1/SystemStructureCommon"),
    ("xmlns:ssv", "http://ssp-standard.org/SSP1/SystemStructureParameterValues"),
    ("xmlns:ssm", "http://ssp-standard.org/SSP1/SystemStructureParameterMapping"),
    ("xmlns:ssb", "http://ssp-standard.org/SSP1/SystemStructureSignalDictionary"),
    ("xmlns:osp", "http://opensimulationplatform.com/SSP/OSPAnnotations"),
];

/// An element with its attributes and children.
pub(super) struct Tag {
    name: String,
    attributes: Vec<(String, String)>,
    children: Vec<Tag>,
    /// Whether the element or its content requires SSP 2.0.
    newer: bool,
}

impl Tag {
    pub(super) fn new(name: &str) -> Self {
        let (name, attributes, children) = (name.to_owned(), Vec::new(), Vec::new());
        Tag { name, attributes, children, newer: false }
    }

    /// Creates a root element that declares all prefixes.
    pub(super) fn root(name: &str) -> Self {
        PREFIXES.iter().fold(Tag::new(name), |tag, (prefix, space)| tag.with(prefix, space))
    }

    pub(super) fn with(mut self, name: &str, value: impl AsRef<str>) -> Self {
        self.attributes.push((name.to_owned(), writable(value.as_ref()).into_owned()));
        self
    }

    pub(super) fn maybe(self, name: &str, value: Option<&str>) -> Self {
        match value {
            Some(value) => self.with(name, value),
            None => self,
        }
    }

    pub(super) fn add(mut self, child: Tag) -> Self {
        self.newer |= child.newer;
        self.children.push(child);
        self
    }

    /// If `is_newer`, marks the element as an element that SSP 1.0 does not have.
    pub(super) fn newer(mut self, is_newer: bool) -> Self {
        self.newer |= is_newer;
        self
    }

    /// Inserts `version` after the namespaces: the lowest version of SSP that allows the content.
    pub(super) fn versioned(mut self) -> Self {
        let version = if self.newer { "2.0" } else { "1.0" };
        let is_namespace = |(name, _): &&(String, String)| name.starts_with("xmlns");
        let place = self.attributes.iter().take_while(is_namespace).count();
        self.attributes.insert(place, ("version".to_owned(), version.to_owned()));
        self
    }

    pub(super) fn maybe_add(self, child: Option<Tag>) -> Self {
        match child {
            Some(child) => self.add(child),
            None => self,
        }
    }

    /// Adds an element `name` with `items`; adds nothing if there are no items.
    pub(super) fn list(self, name: &str, items: impl Iterator<Item = Tag>) -> Self {
        let list = items.fold(Tag::new(name), Tag::add);
        if list.children.is_empty() { self } else { self.add(list) }
    }

    pub(super) fn render(&self) -> String {
        let mut writer = Writer::new_with_indent(Vec::new(), b' ', 2);
        write(&mut writer, Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)));
        self.write(&mut writer);
        let mut text = String::from_utf8_lossy(&writer.into_inner()).into_owned();
        text.push('\n');
        text
    }

    fn write(&self, writer: &mut Writer<Vec<u8>>) {
        let mut start = BytesStart::new(self.name.as_str());
        for (name, value) in &self.attributes {
            start.push_attribute((name.as_str(), value.as_str()));
        }
        if self.children.is_empty() {
            return write(writer, Event::Empty(start));
        }
        write(writer, Event::Start(start));
        for child in &self.children {
            child.write(writer);
        }
        write(writer, Event::End(BytesEnd::new(self.name.as_str())));
    }
}

fn write(writer: &mut Writer<Vec<u8>>, event: Event<'_>) {
    // Writing into memory cannot fail.
    let _ = writer.write_event(event);
}
