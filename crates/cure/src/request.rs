//! The causes that a format holds, and its file.

use sha2::{Digest, Sha256};

use crate::CureError;
use crate::cause::{Judged, Refused, causes, kind};
use crate::job::{Job, Request};

/// SHA-256 of a text, in hexadecimal digits.
pub fn digest(text: &[u8]) -> String {
    let bytes = Sha256::digest(text);
    let digits = bytes.iter().map(|byte| format!("{byte:02x}"));
    digits.collect::<Vec<_>>().concat()
}

/// The text of the file.
///
/// # Errors
/// [`CureError`]: what is not certain, or no format's, is refused as a whole; [`Request::only`] leaves it out.
pub fn write(request: &Request<'_>) -> Result<String, CureError> {
    let format = request.format;
    let judged = causes(request.report, request.members)?;
    let name = |one: &Judged| match one {
        Ok(cause) => cause.name.clone(),
        Err(refused) => refused.effect.clone(),
    };
    let names: Vec<String> = judged.iter().map(name).collect();
    if let Some(other) = request.only.iter().find(|only| !names.contains(only)) {
        return Err(CureError::Report(format!(
            "--only {other} is not among the causes of this report: {}",
            names.join(", ")
        )));
    }
    let wanted = |name: &String| request.only.is_empty() || request.only.contains(name);
    let mut job = Job {
        request,
        causes: Vec::new(),
        stays: Vec::new(),
    };
    for one in judged {
        match one {
            Ok(cause) if !wanted(&cause.name) => {
                job.stays.push(format!("{}: not asked for", cause.name));
            }
            Ok(cause) if format.holds.contains(&cause.kind()) => job.causes.push(cause),
            Ok(cause) => job
                .stays
                .push(format!("{}: {} does not hold it", cause.name, format.name)),
            Err(Refused { effect, why })
                if wanted(&effect) && format.holds.contains(&kind(&effect)) =>
            {
                return Err(CureError::Refused { effect, why });
            }
            Err(Refused { effect, why }) => job.stays.push(format!("{effect}: {why}")),
        }
    }
    let declared = request.report.declared.iter();
    job.stays.extend(declared.map(|one| {
        format!(
            "{}: declared in the model of the cell, so that the report is without it",
            one.effect
        )
    }));
    if job.causes.is_empty() {
        if let [only] = request.only
            && let Some(stay) = job
                .stays
                .iter()
                .find(|stay| stay.starts_with(only.as_str()))
        {
            return Err(CureError::Report(format!("nothing is written: {stay}")));
        }
        let causes = if names.is_empty() {
            "none".to_owned()
        } else {
            names.join(", ")
        };
        return Err(CureError::Nothing {
            format: format.name,
            causes,
        });
    }
    (format.write)(&job)
}
