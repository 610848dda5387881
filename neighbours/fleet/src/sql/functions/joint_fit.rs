//! `joint_fit(uri)`.

use std::collections::BTreeSet;
use std::sync::Arc;

use arrow_array::ArrayRef;
use arrow_schema::{DataType, Field, FieldRef};
use datafusion::common::cast::{as_list_array, as_string_array};
use datafusion::common::{Result, ScalarValue};
use datafusion::logical_expr::function::{AccumulatorArgs, StateFieldsArgs};
use datafusion::logical_expr::{Accumulator, AggregateUDFImpl, Signature, Volatility};

use super::failed;
use crate::answer::{ANSWER, Answer, column, list};
use crate::diagnose::diagnose_together;

/// The joint diagnosis of the recordings of a group.
#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct JointFit {
    signature: Signature,
}

impl JointFit {
    pub(super) fn new() -> Self {
        Self {
            signature: Signature::exact(vec![DataType::Utf8], Volatility::Stable),
        }
    }
}

impl AggregateUDFImpl for JointFit {
    fn name(&self) -> &'static str {
        "joint_fit"
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, _: &[DataType]) -> Result<DataType> {
        Ok(DataType::Struct(ANSWER.clone()))
    }

    fn accumulator(&self, _: AccumulatorArgs<'_>) -> Result<Box<dyn Accumulator>> {
        Ok(Box::new(Recordings::default()))
    }

    fn state_fields(&self, args: StateFieldsArgs<'_>) -> Result<Vec<FieldRef>> {
        let name = format!("{}[recordings]", args.name);
        Ok(vec![Arc::new(Field::new(name, list(DataType::Utf8), true))])
    }
}

/// Names of the recordings of a group; sorted, so that the answer does not depend on the order of the rows.
#[derive(Debug, Default)]
struct Recordings {
    names: BTreeSet<String>,
}

impl Accumulator for Recordings {
    fn update_batch(&mut self, values: &[ArrayRef]) -> Result<()> {
        let names = as_string_array(&values[0])?.iter().flatten();
        self.names.extend(names.map(ToOwned::to_owned));
        Ok(())
    }

    fn merge_batch(&mut self, states: &[ArrayRef]) -> Result<()> {
        for names in as_list_array(&states[0])?.iter().flatten() {
            self.update_batch(&[names])?;
        }
        Ok(())
    }

    fn state(&mut self) -> Result<Vec<ScalarValue>> {
        let names: Vec<ScalarValue> = self.names.iter().map(|name| name.as_str().into()).collect();
        let names = ScalarValue::new_list_nullable(&names, &DataType::Utf8);
        Ok(vec![ScalarValue::List(names)])
    }

    fn evaluate(&mut self) -> Result<ScalarValue> {
        let names: Vec<String> = self.names.iter().cloned().collect();
        let answer =
            (!names.is_empty()).then(|| Answer::of(names.len(), diagnose_together(&names)));
        let one = column(&ANSWER, vec![answer]).map_err(|error| failed(&error))?;
        Ok(ScalarValue::Struct(Arc::new(one)))
    }

    fn size(&self) -> usize {
        size_of_val(self) + self.names.iter().map(String::capacity).sum::<usize>()
    }
}
