//! The machine and patterns of `docs/source_systems.md, D`, and the session in which they are probed. Metres and
//! radians.

use machine::models::WCBXFZYST;
use machine::{Chain, ChainErrors, LinkError};
use machining::mismatch::{LINKS, MismatchTest, Pattern, ROTARY};
use nalgebra::{Isometry3, Point3, Unit, Vector3};

use diagnosis::Session;

use crate::scenarios::ScenarioError;
use crate::scenarios::probed::{Probed, Touch};

/// Noise of a surface, m (D.4).
pub(crate) const NOISE: f64 = 1.5e-6;

/// The test with these patterns on the nominal machine.
pub(crate) fn test(patterns: Vec<Pattern>) -> Result<MismatchTest, ScenarioError> {
    Ok(MismatchTest::new(
        Chain::from_urdf(WCBXFZYST)?,
        Isometry3::identity(),
        Point3::origin(),
        &ROTARY,
        patterns,
    )?)
}

/// The eight link errors, each at the size of the sensitivity table times `share` of its place.
pub(crate) fn links(
    chain: &Chain,
    mut share: impl FnMut(usize) -> f64,
) -> Result<Vec<LinkError>, ScenarioError> {
    LINKS
        .iter()
        .enumerate()
        .map(|(place, (name, size))| Ok(LinkError::named(chain, name, share(place) * size)?))
        .collect()
}

/// Case E1 of D.4: angles + − + − + − + by 50 µrad, EX0C + 20 µm.
pub(crate) fn case_e1(chain: &Chain) -> Result<Vec<LinkError>, ScenarioError> {
    const SIGNS: [f64; 8] = [1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0];
    links(chain, |place| SIGNS[place])
}

/// Cuts the patterns on a machine with `errors` and probes both halves of each at both indices and at `extra` ones (rad):
/// three places on each surface, with the spindle at 0 and at 180° in turn.
pub(crate) fn session(
    name: &str,
    test: &MismatchTest,
    errors: &ChainErrors,
    extra: &[Vec<f64>],
    seed: u64,
) -> Result<Session, ScenarioError> {
    let names = [ROTARY[0], ROTARY[1], "S"];
    let mut probed = Probed {
        robot_description: WCBXFZYST,
        errors,
        ball: Point3::origin(),
        rotary_names: &names,
        features: Vec::new(),
        operations: Vec::new(),
        tool_radius: 0.005,
        cut_here: true,
        noise: NOISE,
    };
    let mut touches = Vec::new();
    for pattern in test.patterns() {
        for (half, cut) in pattern.indices.iter().enumerate() {
            let cut = with_spindle(cut, 0.0);
            let operation = probed.operations.len() as i32;
            probed.operations.push(cut.clone());
            for (side, outward) in pattern.directions.iter().enumerate() {
                let feature = probed.features.len();
                let letter = ["a", "b"][side];
                probed
                    .features
                    .push(format!("{}{letter}{}", pattern.id, half + 1));
                for offset in spread(pattern, side, half) {
                    let point = pattern.point + offset;
                    let cut_error = probed.cutting_error(test.chain(), &point, &cut)?;
                    for index in pattern.indices.iter().chain(extra) {
                        let spindle = if touches.len().is_multiple_of(2) {
                            0.0
                        } else {
                            std::f64::consts::PI
                        };
                        touches.push(Touch {
                            feature,
                            point,
                            normal: *outward,
                            rotary: with_spindle(index, spindle),
                            operation,
                            tool_height: 0.0,
                            left: outward.dot(&cut_error),
                        });
                    }
                }
            }
        }
    }
    probed.session(name, &touches, seed)
}

fn with_spindle(index: &[f64], spindle: f64) -> Vec<f64> {
    index.iter().copied().chain([spindle]).collect()
}

/// Three places on one surface of one half, from where the halves meet, m.
fn spread(pattern: &Pattern, side: usize, half: usize) -> [Vector3<f64>; 3] {
    let [a, b] = &pattern.directions;
    let along: Unit<Vector3<f64>> = Unit::new_normalize(a.cross(b));
    let across = if side == 0 { b } else { a };
    let away = if half == 0 { 4e-3 } else { -4e-3 };
    [-1.0, 0.0, 1.0]
        .map(|step| along.into_inner() * (away + 1e-3 * step) + across.into_inner() * (2e-3 * step))
}
