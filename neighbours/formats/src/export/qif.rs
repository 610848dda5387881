//! QIF 3.0 (ISO 23952) Results: features as fitted, sizes as characteristics with their combined standard uncertainty, and every
//! touch as a measured point with its deviation. A limit of a plan that nothing has measured is a characteristic without a result.
//!
//! Diameters are `DiameterCharacteristic`, every other size is a `UserDefinedLinearCharacteristic` that says what it is. Lengths
//! are mm. The coverage factor stands in the attribute `CoverageFactor` of each value.

mod measured;
mod nominal;

use exchange::export::{Record, Size, date_time};
use probecell_msgs::{InspectionFeature, InspectionPlan};

use connector::uuid::unique;
use connector::xml::Xml;

const NAMESPACE: &str = "http://qifstandards.org/xsd/qif3";

/// Identifiers of one nominal feature or size: definition, nominal, item.
#[derive(Clone, Copy)]
struct Ids {
    definition: u32,
    nominal: u32,
    item: u32,
}

struct Writer<'a> {
    record: &'a Record,
    xml: Xml,
    next: u32,
}

/// The document.
pub fn write(record: &Record) -> String {
    // The number of identifiers stands in the root, before they are given.
    let count = Writer::new(record, 0).document().1;
    Writer::new(record, count).document().0
}

impl<'a> Writer<'a> {
    fn new(record: &'a Record, count: u32) -> Self {
        let root = [
            ("xmlns", NAMESPACE),
            ("xmlns:xsi", "http://www.w3.org/2001/XMLSchema-instance"),
            (
                "xsi:schemaLocation",
                "http://qifstandards.org/xsd/qif3 ../QIFApplications/QIFDocument.xsd",
            ),
            ("versionQIF", "3.0.0"),
            ("idMax", &count.to_string()),
        ];
        Self {
            record,
            xml: Xml::new("QIFDocument", &root),
            next: 0,
        }
    }

    fn id(&mut self) -> u32 {
        self.next += 1;
        self.next
    }

    fn ids(&mut self, count: usize) -> Vec<Ids> {
        let mut ids = || Ids {
            definition: self.id(),
            nominal: self.id(),
            item: self.id(),
        };
        (0..count).map(|_| ids()).collect()
    }

    fn document(mut self) -> (String, u32) {
        let record = self.record;
        let stamps = record.sizes.iter().map(|size| size.result.header.stamp);
        let last = stamps.max_by_key(|stamp| (stamp.sec, stamp.nanosec));
        self.xml
            .leaf("QPId", unique(&["document", &record.cell, &record.name]));
        self.xml.open("Version", &[]);
        self.xml
            .leaf("TimeCreated", date_time(last.unwrap_or_default()));
        self.xml.close();
        self.xml.open("Header", &[]);
        self.xml.open("Application", &[]);
        self.xml.leaf("Name", "probecell");
        self.xml.close();
        self.xml.leaf(
            "Description",
            format!("probecell {}: recording {}", record.version, record.name),
        );
        self.xml.close();
        let standard = self.standard();
        self.units();
        let part = self.product();
        let features: Vec<(&InspectionPlan, &InspectionFeature)> = (record.plans.iter())
            .flat_map(|plan| plan.features.iter().map(move |feature| (plan, feature)))
            .collect();
        let feature_ids = self.ids(features.len());
        self.features(&features, &feature_ids);
        let unmeasured = nominal::unmeasured(record);
        let sizes: Vec<&Size> = record.sizes.iter().chain(&unmeasured).collect();
        let size_ids = self.ids(sizes.len());
        let of_size = |size: &Size| {
            let same = |(plan, feature): &(&InspectionPlan, &InspectionFeature)| {
                plan.plan_id == size.result.plan_id && feature.id == size.result.feature_id
            };
            features.iter().position(same)
        };
        self.characteristics(standard, &sizes, &size_ids, &|size| {
            of_size(size).map(|index| feature_ids[index])
        });
        self.results(part, &size_ids, &|size| {
            of_size(size).map(|index| feature_ids[index])
        });
        let count = self.next;
        (self.xml.finish(), count)
    }

    /// The standard by which sizes are meant.
    fn standard(&mut self) -> u32 {
        let id = self.id();
        self.xml.list("StandardsDefinitions", 1);
        self.xml.open("Standard", &[("id", &id.to_string())]);
        self.xml.open("Organization", &[]);
        self.xml.leaf("StandardsOrganizationEnum", "ISO");
        self.xml.close();
        self.xml.leaf("Designator", "14405-1");
        self.xml.leaf("Year", "2016");
        self.xml.close();
        self.xml.close();
        id
    }

    fn units(&mut self) {
        let xml = &mut self.xml;
        xml.open("FileUnits", &[]);
        xml.open("PrimaryUnits", &[]);
        for (unit, si, name, factor) in [
            ("AngularUnit", "radian", "rad", "1"),
            ("LinearUnit", "meter", "mm", "0.001"),
        ] {
            xml.open(unit, &[]);
            xml.leaf("SIUnitName", si);
            xml.leaf("UnitName", name);
            xml.open("UnitConversion", &[]);
            xml.leaf("Factor", factor);
            xml.close();
            xml.close();
        }
        xml.close();
        xml.close();
    }

    /// The part; gives the identifier of the path to it in the assembly.
    fn product(&mut self) -> u32 {
        let (part, component, path) = (self.id(), self.id(), self.id());
        let name = self
            .record
            .plans
            .last()
            .map_or("", |plan| plan.part_id.as_str());
        let xml = &mut self.xml;
        xml.open("Product", &[]);
        xml.list("PartSet", 1);
        xml.open("Part", &[("id", &part.to_string()), ("label", name)]);
        xml.leaf("UUID", unique(&["part", name]));
        xml.leaf("ModelNumber", name);
        xml.close();
        xml.close();
        xml.list("ComponentSet", 1);
        xml.open("Component", &[("id", &component.to_string())]);
        xml.leaf("UUID", unique(&["component", name]));
        xml.open("Part", &[]);
        xml.leaf("Id", part);
        xml.close();
        xml.close();
        xml.close();
        xml.list("AsmPaths", 1);
        xml.open("AsmPath", &[("id", &path.to_string())]);
        xml.list("ComponentIds", 1);
        xml.leaf("Id", component);
        xml.close();
        xml.close();
        xml.close();
        xml.close();
        path
    }
}

/// QIF's name of a kind of feature.
fn feature_name(kind: u8) -> &'static str {
    match kind {
        InspectionFeature::PLANE => "Plane",
        InspectionFeature::CYLINDER | InspectionFeature::BORE => "Cylinder",
        InspectionFeature::SPHERE => "Sphere",
        InspectionFeature::CONE => "Cone",
        _ => "PointDefinedSurface",
    }
}

fn characteristic_name(size: &Size) -> &'static str {
    if size.is_diameter() {
        "DiameterCharacteristic"
    } else {
        "UserDefinedLinearCharacteristic"
    }
}

fn vector(values: [f64; 3]) -> String {
    values.map(|value| value.to_string()).join(" ")
}
