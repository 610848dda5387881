//! A robot description changed in its text: every other byte stays, comments included.

use std::ops::Range;

use machine::Inertial;
use nalgebra::Isometry3;
use roxmltree::{Document, Node, ParsingOptions};

use crate::CureError;
use crate::job::File;
use crate::settings::replaced;

/// What rounding leaves of nothing, m or rad.
const NOTHING: f64 = 1e-15;

/// A robot description and what is changed in it.
pub(crate) struct Description<'a> {
    file: &'a File,
    document: Document<'a>,
    edits: Vec<(Range<usize>, String)>,
}

impl<'a> Description<'a> {
    /// # Errors
    /// [`CureError::File`] for a text that is no XML.
    pub(crate) fn of(file: &'a File) -> Result<Self, CureError> {
        let options = ParsingOptions {
            allow_dtd: true,
            ..ParsingOptions::default()
        };
        let document = Document::parse_with_options(&file.text, options);
        let document = document.map_err(|error| file.wrong(format!("no XML: {error}")))?;
        Ok(Self {
            file,
            document,
            edits: Vec::new(),
        })
    }

    fn find(&self, kind: &str, name: &str) -> Result<Node<'_, 'a>, CureError> {
        let mut all =
            (self.document.root_element().children()).filter(|one| one.has_tag_name(kind));
        let found = all.find(|one| one.attribute("name") == Some(name));
        found.ok_or_else(|| self.file.wrong(format!("it has no {kind} {name}")))
    }

    /// Gives an element these attributes inside another; it is added where there is none.
    fn set(of: Node<'_, '_>, tag: &str, values: &[(&str, String)]) -> Vec<(Range<usize>, String)> {
        let Some(element) = of.children().find(|node| node.has_tag_name(tag)) else {
            let values = values
                .iter()
                .map(|(name, value)| format!(r#" {name}="{value}""#));
            return vec![inside(
                of,
                format!("<{tag}{}/>", values.collect::<String>()),
            )];
        };
        let name_end = element.range().start + 1 + tag.len();
        let edit = |(name, value): &(&str, String)| match element.attribute_node(*name) {
            Some(attribute) => (attribute.range_value(), value.clone()),
            None => (name_end..name_end, format!(r#" {name}="{value}""#)),
        };
        values.iter().map(edit).collect()
    }

    /// Gives a joint its origin.
    ///
    /// # Errors
    /// [`CureError::File`] for a text without that joint.
    pub(crate) fn origin(&mut self, joint: &str, origin: &Isometry3<f64>) -> Result<(), CureError> {
        let at = &origin.translation.vector;
        let (roll, pitch, yaw) = origin.rotation.euler_angles();
        let values = [
            ("xyz", numbers([at.x, at.y, at.z])),
            ("rpy", numbers([roll, pitch, yaw])),
        ];
        let edits = Self::set(self.find("joint", joint)?, "origin", &values);
        self.edits.extend(edits);
        Ok(())
    }

    /// Gives a joint its friction; what is `None` stays.
    ///
    /// # Errors
    /// [`CureError::File`] for a text without that joint.
    pub(crate) fn friction(
        &mut self,
        joint: &str,
        [damping, friction]: [Option<f64>; 2],
    ) -> Result<(), CureError> {
        let values = [("damping", damping), ("friction", friction)];
        let values: Vec<(&str, String)> = (values.into_iter())
            .filter_map(|(name, value)| Some((name, value?.to_string())))
            .collect();
        let edits = Self::set(self.find("joint", joint)?, "dynamics", &values);
        self.edits.extend(edits);
        Ok(())
    }

    /// Gives a link its mass.
    ///
    /// # Errors
    /// [`CureError::File`] for a text without that link.
    pub(crate) fn inertial(&mut self, link: &str, body: &Inertial) -> Result<(), CureError> {
        let [x, y, z] = body.centre.into();
        let moment = |row: usize, column: usize| body.inertia[(row, column)];
        let text = format!(
            "<inertial><origin xyz=\"{}\" rpy=\"0 0 0\"/><mass value=\"{}\"/><inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" \
             iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/></inertial>",
            numbers([x, y, z]),
            body.mass,
            moment(0, 0),
            moment(0, 1),
            moment(0, 2),
            moment(1, 1),
            moment(1, 2),
            moment(2, 2),
        );
        let link = self.find("link", link)?;
        let declared = link.children().find(|node| node.has_tag_name("inertial"));
        let edit = declared.map_or_else(
            || inside(link, text.clone()),
            |node| (node.range(), text.clone()),
        );
        self.edits.push(edit);
        Ok(())
    }

    /// The text with its changes, and a comment behind the declaration of XML.
    pub(crate) fn changed(mut self, head: &[String]) -> String {
        // Two hyphens would end the comment.
        let head: Vec<String> = (head.iter())
            .map(|line| line.replace("--", "- -").replace("->", "to"))
            .collect();
        let start = self.document.root_element().range().start;
        self.edits
            .push((start..start, format!("<!-- {} -->\n", head.join("\n     "))));
        replaced(&self.file.text, self.edits)
    }
}

/// An edit that puts a text first into an element.
fn inside(of: Node<'_, '_>, text: String) -> (Range<usize>, String) {
    if let Some(child) = of.first_child() {
        let place = child.range().start;
        return (place..place, text);
    }
    let (name, end) = (of.tag_name().name(), of.range().end);
    let source = of.document().input_text();
    if source[of.range()].ends_with("/>") {
        return (end - 2..end, format!(">{text}</{name}>"));
    }
    let place = end - format!("</{name}>").len();
    (place..place, text)
}

fn numbers(values: [f64; 3]) -> String {
    let [x, y, z] = values.map(|value| if value.abs() < NOTHING { 0.0 } else { value });
    format!("{x} {y} {z}")
}
