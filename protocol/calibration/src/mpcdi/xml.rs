//! Elements and values of an XML description.
//! In: nodes. Out: children, attributes and numbers, or an error that names the line. Names are compared without case:
//! writers disagree ("Xresolution", "xResolution"; "originof3DData", "originOf3DData"). It resolves no entities.

use std::ops::RangeInclusive;

use roxmltree::{Document, Node, ParsingOptions};

use crate::ReadError;

/// Most nodes of a description: a region has about 150, blanks included.
const MOST_NODES: u32 = 1 << 18;

/// Parses a description without document type.
pub(super) fn parse<'a>(text: &'a str, file: &str) -> Result<Document<'a>, ReadError> {
    let options = ParsingOptions {
        allow_dtd: false,
        nodes_limit: MOST_NODES,
        ..ParsingOptions::default()
    };
    let text = text.trim_start_matches('\u{FEFF}');
    Document::parse_with_options(text, options).map_err(|error| match error {
        roxmltree::Error::DtdDetected => ReadError::XmlDocumentType {
            file: file.to_owned(),
        },
        error => ReadError::Xml {
            file: file.to_owned(),
            line: error.pos().row,
            reason: error.to_string(),
        },
    })
}

/// An element of a description.
#[derive(Clone, Copy)]
pub(super) struct Element<'a, 'input> {
    pub(super) node: Node<'a, 'input>,
    pub(super) file: &'a str,
}

impl<'a, 'input> Element<'a, 'input> {
    pub(super) fn name(self) -> &'a str {
        self.node.tag_name().name()
    }

    pub(super) fn is(self, name: &str) -> bool {
        self.name().eq_ignore_ascii_case(name)
    }

    /// Its line, from 1.
    pub(super) fn line(self) -> u32 {
        self.node
            .document()
            .text_pos_at(self.node.range().start)
            .row
    }

    pub(super) fn children(self) -> impl Iterator<Item = Self> {
        let file = self.file;
        self.node
            .children()
            .filter(Node::is_element)
            .map(move |node| Self { node, file })
    }

    pub(super) fn child(self, name: &str) -> Option<Self> {
        self.children().find(|child| child.is(name))
    }

    pub(super) fn needed_child(self, name: &str) -> Result<Self, ReadError> {
        self.child(name)
            .ok_or_else(|| self.missing(&format!("<{name}>")))
    }

    pub(super) fn missing(self, wanted: &str) -> ReadError {
        ReadError::MissingElement {
            file: self.file.to_owned(),
            line: self.line(),
            parent: self.name().to_owned(),
            wanted: wanted.to_owned(),
        }
    }

    pub(super) fn attribute(self, name: &str) -> Option<&'a str> {
        let mut attributes = self.node.attributes();
        let found = attributes.find(|attribute| attribute.name().eq_ignore_ascii_case(name))?;
        Some(found.value().trim())
    }

    pub(super) fn needed_attribute(self, name: &str) -> Result<&'a str, ReadError> {
        self.attribute(name)
            .ok_or_else(|| self.missing(&format!("attribute {name}")))
    }

    pub(super) fn number_attribute(
        self,
        name: &str,
        range: RangeInclusive<f64>,
    ) -> Result<f64, ReadError> {
        self.number(name, self.needed_attribute(name)?, range)
    }

    pub(super) fn text(self) -> &'a str {
        self.node.text().unwrap_or("").trim()
    }

    /// The text of a child.
    pub(super) fn needed_text(self, name: &str) -> Result<&'a str, ReadError> {
        let child = self.needed_child(name)?;
        let text = child.text();
        if text.is_empty() {
            return Err(child.missing("text"));
        }
        Ok(text)
    }

    /// The number that a child holds.
    pub(super) fn needed_number(
        self,
        name: &str,
        range: RangeInclusive<f64>,
    ) -> Result<f64, ReadError> {
        self.needed_child(name)?
            .number(name, self.needed_text(name)?, range)
    }

    /// A number in a range.
    pub(super) fn number(
        self,
        key: &str,
        value: &str,
        range: RangeInclusive<f64>,
    ) -> Result<f64, ReadError> {
        value
            .parse()
            .ok()
            .filter(|number| range.contains(number))
            .ok_or_else(|| {
                self.refuse(
                    key,
                    value,
                    &format!("a number of {}…{}", range.start(), range.end()),
                )
            })
    }

    pub(super) fn refuse(self, key: &str, value: &str, wanted: &str) -> ReadError {
        crate::text::Line {
            file: self.file,
            number: self.line(),
        }
        .refuse(key, value, wanted)
    }
}
