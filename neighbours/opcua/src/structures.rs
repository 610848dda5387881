//! Values of the structured data types: of Machinery Result, and of our own namespace. Fields stand in the order of the type's
//! definition ([`crate::model`]).

use opcua::types::{
    BinaryEncodable, DateTime, ExpandedMessageInfo, ExpandedNodeId, ExtensionObject, LocalizedText,
    UAString, UaNullable, Variant,
};

use crate::model::{OWN, RESULT, encodings};
use crate::update::{Cause, Characteristic, Evaluation, Gap, Measured, Stage};

/// 1970 in units of 100 ns since 1601.
const EPOCH: i64 = 116_444_736_000_000_000;

/// An instant in ns since 1970.
pub(crate) fn date_time(nanoseconds: i64) -> DateTime {
    DateTime::from(nanoseconds / 100 + EPOCH)
}

/// Makes a structure's encoding known by the namespace and number of its node.
macro_rules! encoded {
    ($type:ty, $namespace:expr, $encoding:expr, $data_type:expr) => {
        impl ExpandedMessageInfo for $type {
            fn full_type_id(&self) -> ExpandedNodeId {
                ExpandedNodeId::new_with_namespace($namespace, $encoding)
            }
            // No node has these encodings.
            fn full_json_type_id(&self) -> ExpandedNodeId {
                ExpandedNodeId::null()
            }
            fn full_xml_type_id(&self) -> ExpandedNodeId {
                ExpandedNodeId::null()
            }
            fn full_data_type_id(&self) -> ExpandedNodeId {
                ExpandedNodeId::new_with_namespace($namespace, $data_type)
            }
        }
    };
}

#[derive(Clone, Debug, Default, PartialEq, BinaryEncodable, UaNullable)]
pub(crate) struct ProcessingTimes {
    pub(crate) start_time: DateTime,
    pub(crate) end_time: DateTime,
    #[opcua(optional)]
    pub(crate) acquisition_duration: Option<f64>,
    #[opcua(optional)]
    pub(crate) processing_duration: Option<f64>,
}
encoded!(
    ProcessingTimes,
    RESULT,
    encodings::PROCESSING_TIMES,
    3006u32
);

#[derive(Clone, Debug, Default, PartialEq, BinaryEncodable, UaNullable)]
#[expect(
    clippy::option_option,
    reason = "an array may be null, and its field be absent"
)]
pub(crate) struct ResultMetaData {
    pub(crate) result_id: UAString,
    #[opcua(optional)]
    pub(crate) has_transferable_data_on_file: Option<bool>,
    #[opcua(optional)]
    pub(crate) is_partial: Option<bool>,
    #[opcua(optional)]
    pub(crate) is_simulated: Option<bool>,
    #[opcua(optional)]
    pub(crate) result_state: Option<i32>,
    #[opcua(optional)]
    pub(crate) step_id: Option<UAString>,
    #[opcua(optional)]
    pub(crate) part_id: Option<UAString>,
    #[opcua(optional)]
    pub(crate) external_recipe_id: Option<UAString>,
    #[opcua(optional)]
    pub(crate) internal_recipe_id: Option<UAString>,
    #[opcua(optional)]
    pub(crate) product_id: Option<UAString>,
    #[opcua(optional)]
    pub(crate) external_configuration_id: Option<UAString>,
    #[opcua(optional)]
    pub(crate) internal_configuration_id: Option<UAString>,
    #[opcua(optional)]
    pub(crate) job_id: Option<UAString>,
    #[opcua(optional)]
    pub(crate) creation_time: Option<DateTime>,
    #[opcua(optional)]
    pub(crate) processing_times: Option<ProcessingTimes>,
    #[opcua(optional)]
    pub(crate) result_uri: Option<Option<Vec<UAString>>>,
    #[opcua(optional)]
    pub(crate) result_evaluation: Option<i32>,
    #[opcua(optional)]
    pub(crate) result_evaluation_code: Option<i64>,
    #[opcua(optional)]
    pub(crate) result_evaluation_details: Option<LocalizedText>,
    #[opcua(optional)]
    pub(crate) file_format: Option<Option<Vec<UAString>>>,
}
encoded!(ResultMetaData, RESULT, encodings::RESULT_META_DATA, 3007u32);

/// Its metadata may be of a subtype, and so is an extension object.
#[derive(Clone, Debug, Default, PartialEq, BinaryEncodable, UaNullable)]
pub(crate) struct ResultData {
    pub(crate) result_meta_data: ExtensionObject,
    pub(crate) result_content: Option<Vec<Variant>>,
}
encoded!(ResultData, RESULT, encodings::RESULT, 3008u32);

#[derive(Clone, Debug, Default, PartialEq, BinaryEncodable, UaNullable)]
pub(crate) struct CharacteristicData {
    pub(crate) characteristic_identifier: UAString,
    pub(crate) characteristics_class: UAString,
    pub(crate) is_valid: bool,
    #[opcua(optional)]
    pub(crate) result_value: Option<f64>,
    pub(crate) nominal: f64,
    #[opcua(optional)]
    pub(crate) lower_tolerance_limit: Option<f64>,
    #[opcua(optional)]
    pub(crate) upper_tolerance_limit: Option<f64>,
    pub(crate) result_evaluation: i32,
    pub(crate) status: UAString,
    #[opcua(optional)]
    pub(crate) standard_uncertainty: Option<f64>,
    #[opcua(optional)]
    pub(crate) coverage_factor: Option<f64>,
    #[opcua(optional)]
    pub(crate) expanded_uncertainty: Option<f64>,
    pub(crate) decision_rule: UAString,
    #[opcua(optional)]
    pub(crate) nonconformity_probability: Option<f64>,
}
encoded!(CharacteristicData, OWN, encodings::CHARACTERISTIC, 3001u32);

#[derive(Clone, Debug, Default, PartialEq, BinaryEncodable, UaNullable)]
pub(crate) struct Parameter {
    pub(crate) name: UAString,
    pub(crate) unit: UAString,
    #[opcua(optional)]
    pub(crate) value: Option<f64>,
    #[opcua(optional)]
    pub(crate) lower: Option<f64>,
    #[opcua(optional)]
    pub(crate) upper: Option<f64>,
}
encoded!(Parameter, OWN, encodings::PARAMETER, 3002u32);

#[derive(Clone, Debug, Default, PartialEq, BinaryEncodable, UaNullable)]
pub(crate) struct CauseData {
    pub(crate) effect: UAString,
    #[opcua(optional)]
    pub(crate) probability: Option<f64>,
    pub(crate) rivals: Option<Vec<UAString>>,
    pub(crate) parameters: Option<Vec<Parameter>>,
}
encoded!(CauseData, OWN, encodings::CAUSE, 3003u32);

#[derive(Clone, Debug, Default, PartialEq, BinaryEncodable, UaNullable)]
pub(crate) struct GapData {
    pub(crate) plan_identifier: UAString,
    pub(crate) verdict: UAString,
    #[opcua(optional)]
    pub(crate) rms: Option<f64>,
    #[opcua(optional)]
    pub(crate) noise_floor: Option<f64>,
    pub(crate) causes: Option<Vec<CauseData>>,
}
encoded!(GapData, OWN, encodings::GAP, 3004u32);

/// Number of `ResultEvaluationEnum`.
pub(crate) fn evaluation(evaluation: Evaluation) -> i32 {
    match evaluation {
        Evaluation::Undefined => 0,
        Evaluation::Ok => 1,
        Evaluation::NotOk => 2,
        Evaluation::NotDecidable => 3,
    }
}

/// `ResultState`: 1 completed, 2 processing, 3 aborted.
fn state(stage: Stage) -> i32 {
    match stage {
        Stage::Completed => 1,
        Stage::Processing => 2,
        Stage::Aborted => 3,
    }
}

fn some(text: &str) -> Option<UAString> {
    (!text.is_empty()).then(|| text.into())
}

impl From<&Measured> for ResultMetaData {
    fn from(measured: &Measured) -> Self {
        let text = &measured.text;
        Self {
            result_id: measured.id.as_str().into(),
            has_transferable_data_on_file: Some(false),
            is_partial: Some(measured.stage != Stage::Completed),
            is_simulated: measured.is_simulated,
            result_state: Some(state(measured.stage)),
            step_id: some(&measured.pass),
            part_id: some(&measured.part),
            internal_recipe_id: some(&measured.plan),
            creation_time: Some(date_time(measured.end)),
            processing_times: Some(ProcessingTimes {
                start_time: date_time(measured.begin),
                end_time: date_time(measured.end),
                ..ProcessingTimes::default()
            }),
            result_evaluation: Some(evaluation(measured.evaluation)),
            result_evaluation_details: (!text.is_empty()).then(|| text.as_str().into()),
            ..Self::default()
        }
    }
}

impl From<&Characteristic> for CharacteristicData {
    fn from(one: &Characteristic) -> Self {
        Self {
            characteristic_identifier: one.id.as_str().into(),
            characteristics_class: one.class.as_str().into(),
            is_valid: one.value.is_some(),
            result_value: one.value,
            nominal: one.nominal,
            lower_tolerance_limit: one.lower,
            upper_tolerance_limit: one.upper,
            result_evaluation: evaluation(one.evaluation),
            status: one.status.as_str().into(),
            standard_uncertainty: one.standard_uncertainty,
            coverage_factor: one.coverage_factor,
            expanded_uncertainty: one.expanded_uncertainty,
            decision_rule: one.decision_rule.as_str().into(),
            nonconformity_probability: one.nonconformity_probability,
        }
    }
}

impl From<&Cause> for CauseData {
    fn from(cause: &Cause) -> Self {
        let at = |values: &[Option<f64>], index: usize| values.get(index).copied().flatten();
        let parameters = cause
            .names
            .iter()
            .enumerate()
            .map(|(index, name)| Parameter {
                name: name.as_str().into(),
                unit: cause.units.get(index).map_or("", String::as_str).into(),
                value: at(&cause.values, index),
                lower: at(&cause.lower, index),
                upper: at(&cause.upper, index),
            });
        Self {
            effect: cause.effect.as_str().into(),
            probability: cause.probability,
            rivals: Some(cause.rivals.iter().map(|one| one.as_str().into()).collect()),
            parameters: Some(parameters.collect()),
        }
    }
}

impl From<&Gap> for GapData {
    fn from(gap: &Gap) -> Self {
        Self {
            plan_identifier: gap.plan.as_str().into(),
            verdict: gap.verdict.as_str().into(),
            rms: gap.rms,
            noise_floor: gap.noise_floor,
            causes: Some(gap.causes.iter().map(CauseData::from).collect()),
        }
    }
}

/// A structure of the nodes' values.
pub(crate) fn object<T>(value: T) -> ExtensionObject
where
    T: BinaryEncodable
        + ExpandedMessageInfo
        + std::fmt::Debug
        + Clone
        + PartialEq
        + Send
        + Sync
        + 'static,
{
    ExtensionObject::new(value)
}

/// Characteristics of a result, and the gap of its measurement where that is known.
pub(crate) fn content(measured: &Measured, gap: Option<&Gap>) -> Vec<ExtensionObject> {
    let sizes = measured.characteristics.iter();
    let sizes = sizes.map(|one| object(CharacteristicData::from(one)));
    sizes
        .chain(gap.map(|gap| object(GapData::from(gap))))
        .collect()
}
