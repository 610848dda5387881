//! Efforts of a robot description: `inverse_dynamics FILE.urdf JOINT…`, with lines of positions, speeds and accelerations of these
//! joints (rad or m, s) on standard input; a line of efforts (N m or N) for each.
#![expect(clippy::print_stdout, reason = "a program for a person")]

use std::collections::BTreeMap;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments
        .next()
        .ok_or("inverse_dynamics FILE.urdf JOINT…")?;
    let joints: Vec<String> = arguments.collect();
    let text = std::fs::read_to_string(file)?;
    let dynamics = machine::Dynamics::from_urdf(&text, &joints, &BTreeMap::new())?;
    let bodies = dynamics.bodies();
    // In the order of the bodies, and back.
    let place = |body: &machine::Body| joints.iter().position(|joint| *joint == body.joint);
    let order: Vec<usize> = bodies.iter().filter_map(place).collect();
    if order.len() != joints.len() {
        return Err("a joint that moves nothing, or is not there".into());
    }
    for line in std::io::stdin().lines() {
        let values: Vec<f64> =
            (line?.split_whitespace().map(str::parse)).collect::<Result<_, _>>()?;
        let [q, v, a] = [0, 1, 2].map(|part| -> Vec<f64> {
            let first = part * joints.len();
            order.iter().map(|place| values[first + place]).collect()
        });
        let mut efforts = vec![0.0; joints.len()];
        for (place, effort) in order.iter().zip(dynamics.efforts(&q, &v, &a)) {
            efforts[*place] = effort;
        }
        let words: Vec<String> = efforts.iter().map(|effort| format!("{effort:e}")).collect();
        println!("{}", words.join(" "));
    }
    Ok(())
}
