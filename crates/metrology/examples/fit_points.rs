//! Fits shapes to point sets: one JSON object per line in, one per line out.
//!
//! In: `{"shape": "circle", "points": [[x, y, z], …]}` with shape line, plane, circle, sphere, cylinder or cone, in m.
//! Out: the fit as JSON, or `{"error": "…"}`. `tests/scipy_compare.py` compares it with SciPy.

use std::io::{BufRead, BufReader, BufWriter, Write};

use metrology::fit::{self, Fit, FitError, Point};
use serde::{Deserialize, Serialize};

#[derive(Deserialize)]
struct Request {
    shape: String,
    points: Vec<Point>,
}

fn answer<S: Serialize>(fit: Result<Fit<S>, FitError>) -> serde_json::Result<String> {
    match fit {
        Ok(fit) => serde_json::to_string(&fit),
        Err(error) => Ok(serde_json::json!({ "error": error.to_string() }).to_string()),
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut out = BufWriter::new(std::io::stdout().lock());
    for line in BufReader::new(std::io::stdin().lock()).lines() {
        let request: Request = serde_json::from_str(&line?)?;
        let points = &request.points;
        let text = match request.shape.as_str() {
            "plane" => answer(fit::plane(points)),
            "circle" => answer(fit::circle(points)),
            "sphere" => answer(fit::sphere(points)),
            "cylinder" => answer(fit::cylinder(points)),
            "cone" => answer(fit::cone(points)),
            other => return Err(format!("no shape is called {other}").into()),
        }?;
        writeln!(out, "{text}")?;
    }
    out.flush()?;
    Ok(())
}
