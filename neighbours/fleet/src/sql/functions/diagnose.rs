//! `diagnose(uri)`.

use std::sync::Arc;

use arrow_array::{ArrayRef, StructArray};
use arrow_schema::DataType;
use datafusion::common::cast::as_string_array;
use datafusion::common::{Result, ScalarValue};
use datafusion::logical_expr::{
    ColumnarValue, ScalarFunctionArgs, ScalarUDFImpl, Signature, Volatility,
};

use super::failed;
use crate::answer::{ANSWER, diagnoses};

/// The diagnosis of a recording.
#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct Diagnose {
    signature: Signature,
}

impl Diagnose {
    pub(super) fn new() -> Self {
        // The same within a query; a recording may be written again between two.
        Self {
            signature: Signature::exact(vec![DataType::Utf8], Volatility::Stable),
        }
    }
}

impl ScalarUDFImpl for Diagnose {
    fn name(&self) -> &'static str {
        "diagnose"
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, _: &[DataType]) -> Result<DataType> {
        Ok(DataType::Struct(ANSWER.clone()))
    }

    fn invoke_with_args(&self, args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        let of = |names: &ArrayRef| -> Result<StructArray> {
            diagnoses(as_string_array(names)?.iter()).map_err(|error| failed(&error))
        };
        match &args.args[0] {
            ColumnarValue::Array(names) => Ok(ColumnarValue::Array(Arc::new(of(names)?))),
            // Once for all rows.
            ColumnarValue::Scalar(name) => {
                let answer = Arc::new(of(&name.to_array()?)?);
                Ok(ColumnarValue::Scalar(ScalarValue::Struct(answer)))
            }
        }
    }
}
