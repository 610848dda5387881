//! A spindle that warms over a day with pauses, read at one gauge point; six temperatures are recorded.

use diagnosis::Session;

use super::{Chance, GANTRY, Reading, session, state};

/// Temperatures of the machine, °C: each follows what heats it.
struct Body {
    celsius: f64,
    lag: f64,
}

/// One day of four hours, a reading a minute; `growth` per kelvin of bearing and column, m/K.
pub(crate) fn day(number: u64, growth: (f64, f64), noise: f64) -> Session {
    let mut chance = Chance::new(1000 + number);
    let night = 19.0 + 2.0 * chance.uniform();
    let pauses = (
        60.0 + 40.0 * chance.uniform(),
        130.0 + 40.0 * chance.uniform(),
    );
    let body = |lag: f64| Body {
        celsius: night,
        lag,
    };
    let (mut bearing, mut motor, mut column, mut bed) =
        (body(900.0), body(500.0), body(4500.0), body(9000.0));
    let (mut readings, mut states) = (Vec::new(), Vec::new());
    for minute in 0..240 {
        let minute = f64::from(minute);
        let runs = !(pauses.0..pauses.0 + 25.0).contains(&minute)
            && !(pauses.1..pauses.1 + 40.0).contains(&minute);
        let ambient = night + 2.0 * (minute / 90.0).sin();
        let load = if runs { 1.0 } else { 0.0 };
        for (body, heat) in [
            (&mut bearing, 14.0),
            (&mut motor, 22.0),
            (&mut column, 4.0),
            (&mut bed, 1.0),
        ] {
            for _ in 0..60 {
                body.celsius += (ambient + heat * load - body.celsius) / body.lag;
            }
        }
        let mut read = |celsius: f64| celsius + 0.03 * chance.normal();
        let temperatures = [
            ("bearing", read(bearing.celsius)),
            ("motor", read(motor.celsius)),
            ("column", read(column.celsius)),
            ("bed", read(bed.celsius)),
            ("ambient", read(ambient)),
            ("coolant", read(night + 1.0)),
        ];
        states.push(state(
            60.0 * minute,
            &temperatures,
            if runs { 600.0 } else { 0.0 },
        ));
        let grown = growth.0 * (bearing.celsius - night) + growth.1 * (column.celsius - night);
        // The ball reaches the gauge the earlier the longer the spindle is.
        let z = 0.1 + 0.003 + grown + noise * chance.normal();
        readings.push(Reading {
            feature: 0,
            point: [0.0; 3],
            normal: [0.0, 0.0, 1.0],
            feed: 0.002,
            axes: vec![0.0, 0.0, z],
            time: 60.0 * minute,
        });
    }
    let mut session = session(
        &format!("day {number}"),
        GANTRY,
        &["X", "Y", "Z"],
        ([0.0, 0.0, -0.1], 0.003),
        &readings,
    );
    session.machine_states = states;
    session
}
