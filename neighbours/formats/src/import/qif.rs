//! QIF 3.0 (ISO 23952), plans and results: features with tolerances and points, and points that were measured.
//!
//! Elements are found by name and identifier, whatever application wrote them. Points are `PointFeature`, `EdgePointFeature` and the
//! defining points of a `PointDefinedSurface`; planes, cylinders, spheres, cones and circles are features; limits are those of
//! diameters, of point profiles and of linear sizes that one feature has. What a plan of ours has no place for is listed.

mod plan;
mod results;

use std::collections::BTreeMap;

use exchange::ImportError;
use exchange::import::features::unit;
use roxmltree::{Document, Node, ParsingOptions};

pub use plan::plan;
pub use results::results;

/// Most elements and texts of a document.
const MOST_NODES: u32 = 3_000_000;

/// A document with its elements by identifier.
struct Qif<'a> {
    document: &'a Document<'a>,
    by_id: BTreeMap<&'a str, Node<'a, 'a>>,
    /// m of its unit of length.
    metre: f64,
}

fn child<'a>(of: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    of.children().find(|node| node.tag_name().name() == name)
}

fn text<'a>(of: Node<'a, 'a>, name: &str) -> Option<&'a str> {
    child(of, name).and_then(|node| node.text()).map(str::trim)
}

impl<'a> Qif<'a> {
    fn new(document: &'a Document<'a>) -> Result<Self, ImportError> {
        let root = document.root_element();
        if root.tag_name().name() != "QIFDocument" {
            let what = format!("this is no QIFDocument but {}", root.tag_name().name());
            return Err(ImportError::whole(what));
        }
        if let Some(version) = root
            .attribute("versionQIF")
            .filter(|version| !version.starts_with("3."))
        {
            return Err(ImportError::whole(format!(
                "QIF {version} is not read; 3.x is"
            )));
        }
        let identified = document
            .descendants()
            .filter_map(|node| Some((node.attribute("id")?, node)));
        let mut qif = Self {
            document,
            by_id: identified.collect(),
            metre: 1e-3,
        };
        // Without units lengths are mm (ISO 23952, primary units).
        if let Some(unit) = document
            .descendants()
            .find(|node| node.tag_name().name() == "LinearUnit")
        {
            qif.metre = match child(unit, "UnitConversion").and_then(|node| child(node, "Factor")) {
                Some(factor) => qif.numbers::<1>(factor)?[0],
                None => 1.0,
            };
        }
        Ok(qif)
    }

    fn at(&self, node: Node<'_, '_>, what: impl Into<String>) -> ImportError {
        let place = self.document.text_pos_at(node.range().start);
        ImportError::at(u64::from(place.row), u64::from(place.col), what)
    }

    fn numbers<const N: usize>(&self, node: Node<'_, '_>) -> Result<[f64; N], ImportError> {
        let values: Option<Vec<f64>> = node
            .text()
            .unwrap_or_default()
            .split_whitespace()
            .map(|word| word.parse().ok().filter(|value: &f64| value.is_finite()))
            .collect();
        values
            .and_then(|values| values.try_into().ok())
            .ok_or_else(|| {
                let name = node.tag_name().name();
                self.at(
                    node,
                    format!(
                        "expected {N} finite numbers in {name}, found {:?}",
                        node.text().unwrap_or_default()
                    ),
                )
            })
    }

    /// A length or point in m.
    fn lengths<const N: usize>(&self, node: Node<'_, '_>) -> Result<[f64; N], ImportError> {
        Ok(self.numbers::<N>(node)?.map(|value| value * self.metre))
    }

    fn point(&self, of: Node<'a, 'a>, name: &str) -> Result<[f64; 3], ImportError> {
        let node = child(of, name).ok_or_else(|| self.at(of, format!("expected a {name}")))?;
        self.lengths(node)
    }

    fn direction(&self, of: Node<'a, 'a>, name: &str) -> Result<[f64; 3], ImportError> {
        let node = child(of, name).ok_or_else(|| self.at(of, format!("expected a {name}")))?;
        unit(self.numbers(node)?)
            .ok_or_else(|| self.at(node, format!("{name} is not of unit length")))
    }

    /// The element that an identifier in a child refers to.
    fn referred(&self, of: Node<'a, 'a>, name: &str) -> Result<Node<'a, 'a>, ImportError> {
        let id = text(of, name).ok_or_else(|| self.at(of, format!("expected {name}")))?;
        self.by_id
            .get(id)
            .copied()
            .ok_or_else(|| self.at(of, format!("{name} {id} is nowhere in the document")))
    }

    /// Why a document gives nothing: what it lacks, and what it states of parts as a whole, by serial number where it has one.
    fn without(&self, what: &str) -> ImportError {
        let statuses = self
            .document
            .descendants()
            .filter(|node| node.tag_name().name() == "ActualComponent");
        let statuses: Vec<String> = statuses
            .filter_map(|part| {
                let status = text(child(part, "Status")?, "InspectionStatusEnum")?;
                let serial = text(part, "SerialNumber").unwrap_or("without number");
                Some(format!("{status} for the part {serial}"))
            })
            .collect();
        let stated = match statuses.as_slice() {
            [] => String::new(),
            some => format!("; it states {}", some.join(", ")),
        };
        ImportError::whole(format!("the document has no {what}{stated}"))
    }

    /// Elements below the one of that name.
    fn below(&self, list: &'static str) -> impl Iterator<Item = Node<'a, 'a>> + use<'a> {
        let lists = self
            .document
            .descendants()
            .filter(move |node| node.tag_name().name() == list);
        lists.flat_map(|list| list.children().filter(Node::is_element))
    }
}

fn parsed(text: &str) -> Result<Document<'_>, ImportError> {
    let options = ParsingOptions {
        nodes_limit: MOST_NODES,
        ..ParsingOptions::default()
    };
    Document::parse_with_options(text, options).map_err(|error| {
        let place = error.pos();
        ImportError::at(
            u64::from(place.row),
            u64::from(place.col),
            error.to_string(),
        )
    })
}
