//! Origins of joints replaced in the text of a robot description: every other byte stays, comments included.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::Isometry3;
use roxmltree::{Document, Node, ParsingOptions};

use crate::CureError;
use crate::job::File;
use crate::settings::replaced;

/// What rounding leaves of nothing, m or rad.
const NOTHING: f64 = 1e-15;

/// The text with these origins by the name of their joint, and a comment behind the declaration of XML.
///
/// # Errors
/// [`CureError::File`] for a text that is no XML, or without a joint.
pub(crate) fn with_origins(
    file: &File,
    origins: &BTreeMap<&str, Isometry3<f64>>,
    comment: &str,
) -> Result<String, CureError> {
    let wrong = |what: String| CureError::File {
        file: file.name.clone(),
        what,
    };
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    let document = Document::parse_with_options(&file.text, options)
        .map_err(|error| wrong(format!("no XML: {error}")))?;
    let root = document.root_element();
    let start = root.range().start;
    let mut edits = vec![(start..start, comment.to_owned())];
    for (name, origin) in origins {
        let mut joints = root.children().filter(|node| node.has_tag_name("joint"));
        let joint = joints.find(|node| node.attribute("name") == Some(name));
        let joint = joint.ok_or_else(|| wrong(format!("it has no joint {name}")))?;
        edits.extend(of_joint(joint, origin));
    }
    Ok(replaced(&file.text, edits))
}

/// Edits that give a joint its origin.
fn of_joint(joint: Node<'_, '_>, origin: &Isometry3<f64>) -> Vec<(Range<usize>, String)> {
    let at = &origin.translation.vector;
    let (roll, pitch, yaw) = origin.rotation.euler_angles();
    let text_of = |values: [f64; 3]| {
        let [x, y, z] = values.map(|value| if value.abs() < NOTHING { 0.0 } else { value });
        format!("{x} {y} {z}")
    };
    let values = [
        ("xyz", text_of([at.x, at.y, at.z])),
        ("rpy", text_of([roll, pitch, yaw])),
    ];
    let Some(element) = joint.children().find(|node| node.has_tag_name("origin")) else {
        let [(_, xyz), (_, rpy)] = values;
        let place = joint
            .first_child()
            .map_or(joint.range().end, |child| child.range().start);
        return vec![(
            place..place,
            format!(r#"<origin xyz="{xyz}" rpy="{rpy}"/>"#),
        )];
    };
    let name_end = element.range().start + "<origin".len();
    let edit = |(name, value): (&str, String)| match element.attribute_node(name) {
        Some(attribute) => (attribute.range_value(), value),
        None => (name_end..name_end, format!(r#" {name}="{value}""#)),
    };
    values.into_iter().map(edit).collect()
}
