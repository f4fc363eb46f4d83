//! XML elements of the SSP namespaces, with typed access to attributes and children.
//!
//! [`fmu_description::xml`] parses the text and quick-xml resolves the namespaces. Undeclared prefixes, which
//! some tools write, give a warning; roxmltree would refuse them.

use std::collections::HashSet;
use std::str::FromStr;

use fmu_description::Position;
use fmu_description::limits::{HELP, exceeds};
use fmu_description::xml::{self, is_character};
use quick_xml::name::{Namespace, NamespaceResolver, QName, ResolveResult};

use super::error::SspError;

/// Common start of all namespaces of SSP 1.0 and 2.0.
const NAMESPACE: &str = "http://ssp-standard.org/SSP1/";
/// The usual prefixes of the SSP namespaces, which are accepted without a declaration.
const PREFIXES: [&str; 5] = ["ssd", "ssc", "ssv", "ssm", "ssb"];
/// Largest accepted file in bytes.
const CAPACITY: usize = 64 << 20;
/// Maximum number of tags; limits the memory for a file of many short tags.
const TAGS: usize = 4_000_000;
/// The white space of XML.
const WHITE_SPACE: [char; 4] = [' ', '\t', '\r', '\n'];

/// An element. All SSP namespaces count as one: their element names do not collide, and some tools
/// write `ssd:Real` for `ssc:Real`.
#[derive(Debug)]
pub(super) struct Node {
    /// Name without prefix.
    pub(super) name: String,
    /// Whether the element belongs to an SSP namespace.
    is_ssp: bool,
    /// The text, without white space around it.
    pub(super) content: String,
    attributes: Vec<(String, String)>,
    pub(super) children: Vec<Node>,
    pub(super) at: Position,
}

/// Reads a file whose root element is `root` in the namespace that ends in `space`. Also returns
/// a warning with its position for a root element in another SSP namespace, and for each undeclared prefix.
///
/// Returns an error if the file is too large or not well-formed, has another root element, or states a version
/// other than 1.x and 2.x.
pub(super) fn read(bytes: &[u8], space: &str, root: &str) -> Result<(Node, Vec<String>), SspError> {
    if exceeds(bytes.len(), CAPACITY) {
        return Err(SspError::Limit { limit: CAPACITY, what: "bytes", help: HELP });
    }
    if exceeds(bytes.split(|byte| *byte == b'<').count(), TAGS) {
        return Err(SspError::Limit { limit: TAGS, what: "tags", help: HELP });
    }
    let element = xml::read(bytes)?;
    let required = format!("{NAMESPACE}{space}");
    let mut scope = Scope::default();
    scope.open(&element);
    let namespace = scope.space(&element).unwrap_or_default().to_owned();
    let is_ssp = namespace.starts_with(NAMESPACE)
        || (namespace.is_empty() && scope.has_assumed_prefix(&element));
    if !is_ssp || local(&element.name) != root {
        return Err(SspError::Content {
            at: element.at,
            actual: format!("namespace {namespace:?}"),
            element: element.name,
            expected: format!("the root element {root} of the namespace {required:?}"),
        });
    }
    let mut warnings = Vec::new();
    if !namespace.is_empty() && namespace != required {
        let at = element.at;
        warnings.push(format!("{at}: expected the namespace {required:?}, found {namespace:?}"));
    }
    let node = scope.node(element)?;
    node.version()?;
    warnings.extend(scope.undeclared.iter().map(|(prefix, at)| undeclared(prefix, *at)));
    Ok((node, warnings))
}

fn undeclared(prefix: &str, at: Position) -> String {
    let assumed = if PREFIXES.contains(&prefix) {
        "assumed to be the prefix of SSP"
    } else {
        "assumed not to be of SSP"
    };
    format!("{at}: the prefix {prefix}: is used without xmlns:{prefix}; it is {assumed}")
}

/// The declared namespaces.
#[derive(Default)]
struct Scope {
    spaces: NamespaceResolver,
    /// Undeclared prefixes with the position of their first use.
    undeclared: Vec<(String, Position)>,
}

impl Scope {
    /// Adds the declarations of `element`.
    fn open(&mut self, element: &xml::Element) {
        self.spaces.set_level(self.spaces.level().saturating_add(1));
        for (name, space) in &element.attributes {
            if let Some(prefix) = QName(name).as_namespace_binding() {
                // Fails for `xml` and `xmlns`, which no file needs to declare, and for the 129th declaration.
                let _ = self.spaces.add(prefix, Namespace(space));
            }
        }
    }

    /// Removes the declarations of the element that was opened last.
    fn close(&mut self) {
        self.spaces.pop();
    }

    /// Returns the namespace of an element whose declarations were added; `None` if its prefix is not declared.
    fn space(&self, element: &xml::Element) -> Option<&str> {
        match self.spaces.resolve_prefix(QName(&element.name).prefix(), true) {
            ResolveResult::Bound(space) => Some(space.into_inner()),
            ResolveResult::Unbound | ResolveResult::Unknown(_) => None,
        }
    }

    /// Returns whether the element has an undeclared prefix that is usual for SSP.
    fn has_assumed_prefix(&self, element: &xml::Element) -> bool {
        self.space(element).is_none() && PREFIXES.contains(&prefix(element))
    }

    fn node(&mut self, element: xml::Element) -> Result<Node, SspError> {
        self.open(&element);
        let space = self.space(&element);
        let is_ssp = space.is_some_and(|space| space.starts_with(NAMESPACE))
            || self.has_assumed_prefix(&element);
        let prefix = prefix(&element);
        let is_known = space.is_some() || prefix.is_empty();
        if !is_known && !self.undeclared.iter().any(|(known, _)| known == prefix) {
            self.undeclared.push((prefix.to_owned(), element.at));
        }
        let xml::Element { name, text: content, attributes, children, at } = element;
        let children = children.into_iter().map(|child| self.node(child));
        let children = children.collect::<Result<Vec<Node>, SspError>>()?;
        self.close();
        let name = local(&name).to_owned();
        let node = Node { name, is_ssp, content, attributes, children, at };
        node.characters()?;
        Ok(node)
    }
}

/// Parses a finite number.
pub(super) fn finite(text: &str) -> Option<f64> {
    f64::from_str(text).ok().filter(|value| value.is_finite())
}

/// Returns a name without its prefix.
fn local(name: &str) -> &str {
    name.rsplit(':').next().unwrap_or_default()
}

fn prefix(element: &xml::Element) -> &str {
    element.name.split_once(':').map_or("", |(prefix, _)| prefix)
}

/// Converts an element and ignores its namespaces.
impl From<xml::Element> for Node {
    fn from(element: xml::Element) -> Self {
        let xml::Element { name, text: content, attributes, children, at } = element;
        let children = children.into_iter().map(Node::from).collect();
        Node { name: local(&name).to_owned(), is_ssp: false, content, attributes, children, at }
    }
}

impl Node {
    /// Returns an error about the content of this element.
    pub(super) fn wrong(&self, expected: impl Into<String>, actual: impl Into<String>) -> SspError {
        let (at, element) = (self.at, self.name.clone());
        SspError::Content { at, element, expected: expected.into(), actual: actual.into() }
    }

    /// Checks that the attributes contain XML characters only, so that they can be written again.
    fn characters(&self) -> Result<(), SspError> {
        for (name, value) in &self.attributes {
            if let Some(character) = value.chars().find(|character| !is_character(*character)) {
                let expected = format!("characters of XML in the attribute {name}");
                return Err(self.wrong(expected, format!("U+{:04X}", u32::from(character))));
            }
        }
        Ok(())
    }

    /// Checks the attribute `version` of a root element; versions 1.x and 2.x are accepted (section
    /// 2.2).
    fn version(&self) -> Result<(), SspError> {
        let version = self.required("version")?.trim_matches(WHITE_SPACE);
        if let Some(("1" | "2", minor)) = version.split_once('.')
            && !minor.is_empty()
        {
            return Ok(());
        }
        Err(self.wrong("version 1.0 or 2.0", format!("{version:?}")))
    }

    /// Returns the names of the attributes, except `xmlns` and names with a prefix.
    pub(super) fn attribute_names(&self) -> impl Iterator<Item = &str> {
        let names = self.attributes.iter().map(|(name, _)| name.as_str());
        names.filter(|name| *name != "xmlns" && !name.contains(':'))
    }

    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        let attribute = self.attributes.iter().find(|(known, _)| known == name);
        attribute.map(|(_, value)| value.as_str())
    }

    pub(super) fn text(&self, name: &str) -> Option<String> {
        self.attribute(name).map(str::to_owned)
    }

    /// Returns the attribute `name`; an empty attribute counts as absent.
    pub(super) fn stated(&self, name: &str) -> Option<String> {
        self.text(name).filter(|text| !text.is_empty())
    }

    pub(super) fn required(&self, name: &str) -> Result<&str, SspError> {
        let value = self.attribute(name);
        value.ok_or_else(|| self.wrong(format!("the attribute {name}"), "none"))
    }

    /// Parses the attribute `name`, without the white space around it, with `read`, which returns `None` for
    /// invalid text. Returns `None` if the attribute is absent.
    pub(super) fn parsed<T>(
        &self,
        name: &str,
        expected: &str,
        read: impl Fn(&str) -> Option<T>,
    ) -> Result<Option<T>, SspError> {
        let wrong = |text: &str| {
            self.wrong(format!("{expected} in the attribute {name}"), format!("{text:?}"))
        };
        let value = self.attribute(name);
        value
            .map(|text| read(text.trim_matches(WHITE_SPACE)).ok_or_else(|| wrong(text)))
            .transpose()
    }

    /// Splits the attribute `name` at white space, for arrays of SSP 2.0.
    pub(super) fn words(&self, name: &str) -> impl Iterator<Item = &str> {
        let value = self.attribute(name).unwrap_or_default();
        value.split(WHITE_SPACE).filter(|word| !word.is_empty())
    }

    /// Reads an integer of up to 128 bits; `None` if the attribute is absent.
    pub(super) fn long(&self, name: &str) -> Result<Option<i128>, SspError> {
        self.parsed(name, "an integer", |text| i128::from_str(text).ok())
    }

    /// Reads a finite `xs:double`; `None` if the attribute is absent.
    pub(super) fn number(&self, name: &str) -> Result<Option<f64>, SspError> {
        self.parsed(name, "a finite number", finite)
    }

    /// Reads an `xs:int`; `None` if the attribute is absent.
    pub(super) fn integer(&self, name: &str) -> Result<Option<i32>, SspError> {
        let expected = "an integer from -2147483648 to 2147483647";
        self.parsed(name, expected, |text| i32::from_str(text).ok())
    }

    /// Reads an `xs:boolean`; `None` if the attribute is absent.
    pub(super) fn boolean(&self, name: &str) -> Result<Option<bool>, SspError> {
        self.parsed(name, "true, false, 1 or 0", |text| match text {
            "true" | "1" => Some(true),
            "false" | "0" => Some(false),
            _ => None,
        })
    }

    /// Reads the attribute `name` with `read`; returns an error if it is absent.
    pub(super) fn needed<T>(
        &self,
        name: &str,
        read: impl Fn(&Self, &str) -> Result<Option<T>, SspError>,
    ) -> Result<T, SspError> {
        self.required(name)?;
        read(self, name)?.ok_or_else(|| self.wrong(format!("the attribute {name}"), "none"))
    }

    /// Returns the children in SSP namespaces.
    pub(super) fn ssp_children(&self) -> impl Iterator<Item = &Node> {
        self.children.iter().filter(|child| child.is_ssp)
    }

    /// Returns the children called `name` in any namespace.
    pub(super) fn any_children(&self, name: &str) -> impl Iterator<Item = &Node> {
        self.children.iter().filter(move |child| child.name == name)
    }

    /// Returns the first child called `name` in any namespace, for annotations.
    pub(super) fn any_child(&self, name: &str) -> Option<&Node> {
        self.any_children(name).next()
    }

    pub(super) fn children_named(&self, name: &str) -> impl Iterator<Item = &Node> {
        self.ssp_children().filter(move |child| child.name == name)
    }

    /// Returns the child called `name` in an SSP namespace, if there is one; more than one is an error.
    pub(super) fn child(&self, name: &str) -> Result<Option<&Node>, SspError> {
        let mut children = self.children_named(name);
        let first = children.next();
        match children.next() {
            None => Ok(first),
            Some(second) => {
                Err(self.wrong(format!("one element {name}"), format!("another at {}", second.at)))
            }
        }
    }

    /// Reads each child `item` of the child `list` with `read`; empty without such a list. Several lists of one name
    /// are joined; [`super::schema::check`] warns about these.
    pub(super) fn list<T>(
        &self,
        list: &str,
        item: &str,
        read: impl Fn(&Node) -> Result<T, SspError>,
    ) -> Result<Vec<T>, SspError> {
        self.children_named(list).flat_map(|list| list.children_named(item)).map(read).collect()
    }

    /// Returns an error if two of `names` are equal.
    pub(super) fn unique<'a>(
        &self,
        what: &str,
        names: impl IntoIterator<Item = &'a str>,
    ) -> Result<(), SspError> {
        let mut earlier = HashSet::new();
        match names.into_iter().find(|name| !earlier.insert(*name)) {
            None => Ok(()),
            Some(name) => {
                Err(self
                    .wrong(format!("{what} of different names"), format!("two called {name:?}")))
            }
        }
    }
}
