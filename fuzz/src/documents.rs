//! Any text as a document of another measuring system: QIF or DMIS, a plan or results.

use formats::import::{dmis, qif};
use probecell_msgs::Value;

const DMIS: &str = "DMISMN/'bracket',05.0\nUNITS/MM,ANGDEC  $$ lengths are mm\nT(BORE_T)=TOL/DIAM,-0.02,0.03\n\
    F(BORE)=FEAT/CYLNDR,INNER,CART,10.5,20,0, $\n        0,0,1,12.5,30\nF(TOP)=FEAT/PLANE,CART,0,0,25,0,0,1\n\
    F(P1)=FEAT/POINT,CART,1,2,25,0,0,1\nFA(P1)=FEAT/POINT,CART,1,2,25.01,0,0,1\nMEAS/PLANE,F(TOP),1\n\
    PTMEAS/CART,5,5,25,0,0,1\nENDMES\nOUTPUT/FA(BORE),TA(BORE_T)\nENDFIL\n";
const QIF: &str = r#"<QIFDocument xmlns="http://qifstandards.org/xsd/qif3" versionQIF="3.0.0" idMax="9">
<Features><FeatureDefinitions><PointFeatureDefinition id="1"/>
<CylinderFeatureDefinition id="2"><InternalExternal>INTERNAL</InternalExternal><Diameter>10</Diameter></CylinderFeatureDefinition>
</FeatureDefinitions><FeatureNominals>
<PointFeatureNominal id="3"><FeatureDefinitionId>1</FeatureDefinitionId><Location>1 2 3</Location><Normal>0 0 1</Normal></PointFeatureNominal>
<CylinderFeatureNominal id="4"><FeatureDefinitionId>2</FeatureDefinitionId><Axis><AxisPoint>0 0 0</AxisPoint><Direction>0 0 1</Direction></Axis></CylinderFeatureNominal>
</FeatureNominals><FeatureItems>
<PointFeatureItem id="5"><FeatureNominalId>3</FeatureNominalId><FeatureName>P</FeatureName></PointFeatureItem>
<CylinderFeatureItem id="6"><FeatureNominalId>4</FeatureNominalId><FeatureName>B</FeatureName></CylinderFeatureItem>
</FeatureItems></Features><MeasurementsResults><MeasurementResults id="7"><MeasuredFeatures>
<PointFeatureMeasurement id="8"><FeatureItemId>5</FeatureItemId><Location>1 2 3.01</Location></PointFeatureMeasurement>
</MeasuredFeatures></MeasurementResults></MeasurementsResults></QIFDocument>"#;

/// Reads the text in each way that there is.
pub fn target(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    for plan in [qif::plan(text).ok(), dmis::plan(text).ok()]
        .into_iter()
        .flatten()
    {
        let plan = plan.plan("plan");
        // Described, a plan takes ten times as much.
        if plan.features.len() > 1_000 {
            continue;
        }
        for (path, value) in Value::of(&plan).leaves() {
            assert!(value != "NaN", "the plan's {path} is {value}");
        }
    }
    // Most texts have no results.
    let _ = (qif::results(text), dmis::results(text));
}

/// One of each.
pub fn seeds() -> Vec<Vec<u8>> {
    vec![QIF.into(), DMIS.into()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_have_points_and_results() {
        let points = |plan: formats::import::plan::ForeignPlan| plan.plan("p").points.len();
        assert_eq!(qif::plan(QIF).map(points), Ok(1));
        assert_eq!(dmis::plan(DMIS).map(points), Ok(2));
        assert_eq!(qif::results(QIF).map(|(found, _)| found.len()), Ok(1));
        assert_eq!(dmis::results(DMIS).map(|found| found.len()), Ok(1));
    }
}
