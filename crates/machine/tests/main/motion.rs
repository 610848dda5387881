//! Times of profiles against textbook formulas and numerical integration.

use std::f64::consts::PI;

use machine::motion::{AxisLimits, Motion};
use machine::{Chain, MotionError, RawMotion};

/// Seconds that an axis needs at least, by bang-bang control of the jerk integrated in steps of `step` s: the speed is
/// raised while what would still be covered on braking from it stays within half of the way, symmetrically taken back.
fn integrated(limits: &AxisLimits, distance: f64, step: f64) -> f64 {
    let (v_most, a_most) = (
        limits.velocity,
        limits.acceleration.unwrap_or(f64::INFINITY),
    );
    let jerk = limits.jerk.unwrap();
    // Accelerating for `up` s of rising and `hold` s of constant acceleration, then as long falling: distance and speed
    // at its end, by summation.
    let ramp_up = |up: f64, hold: f64| {
        let (mut x, mut v, mut a) = (0.0, 0.0, 0.0);
        let total = 2.0 * up + hold;
        let steps = (total / step).ceil().max(4000.0) as usize;
        let dt = total / steps as f64;
        for index in 0..steps {
            let t = (index as f64 + 0.5) * dt;
            let j = if t < up {
                jerk
            } else if t < up + hold {
                0.0
            } else {
                -jerk
            };
            let (a0, v0) = (a, v);
            a += j * dt;
            v += 0.5 * (a0 + a) * dt;
            x += v0 * dt + a0 * dt * dt / 3.0 + a * dt * dt / 6.0;
        }
        (x, v)
    };
    // The longest rise that keeps acceleration and speed, then the longest hold, both by bisection on half the way.
    let fits = |up: f64, hold: f64| {
        let (x, v) = ramp_up(up, hold);
        jerk * up <= a_most * (1.0 + 1e-12) && v <= v_most && x <= 0.5 * distance
    };
    let longest = |fits: &dyn Fn(f64) -> bool| {
        let (mut low, mut high) = (0.0, 1.0);
        while fits(high) {
            high *= 2.0;
        }
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if fits(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    };
    let up = longest(&|up| fits(up, 0.0));
    let hold = longest(&|hold| fits(up, hold));
    let (x, v) = ramp_up(up, hold);
    2.0 * (2.0 * up + hold) + (distance - 2.0 * x).max(0.0) / v
}

#[test]
fn s_curve_times_equal_numerical_integration() {
    let mut reached = [0; 4];
    for (velocity, acceleration, jerk) in [
        (0.5, Some(2.0), 20.0),
        (0.5, Some(2.0), 4.0),
        (0.2, Some(10.0), 50.0),
        (0.4, None, 30.0),
        (10.0, Some(40.0), 400.0),
    ] {
        let limits = AxisLimits {
            acceleration,
            jerk: Some(jerk),
            ..AxisLimits::at_speed(velocity)
        };
        for distance in [1e-4, 1e-3, 0.02, 0.1, 0.3, 1.0, 4.0] {
            let profile = limits.profile(distance);
            let exact = integrated(&limits, distance, 1e-4);
            let found = profile.duration();
            assert!(
                (found - exact).abs() < 2e-3 * exact,
                "{limits:?} {distance}: {found} for {exact}"
            );
            // Which of speed and acceleration are reached.
            let v = |t: f64| (profile.distance_at(t + 1e-6) - profile.distance_at(t - 1e-6)) / 2e-6;
            let fast = v(0.5 * found) > velocity * (1.0 - 1e-4);
            let a = |t: f64| (v(t + 1e-4) - v(t - 1e-4)) / 2e-4;
            let steep = acceleration.is_some_and(|most| {
                (1..200).any(|k| a(found * f64::from(k) / 400.0) > most * (1.0 - 1e-2))
            });
            reached[usize::from(fast) + 2 * usize::from(steep)] += 1;
        }
    }
    assert!(reached.iter().all(|&count| count > 0), "{reached:?}");
}

#[test]
fn positions_along_a_profile_keep_every_limit_and_end_where_they_should() {
    for (acceleration, jerk) in [
        (None, None),
        (Some(2.0), None),
        (Some(2.0), Some(25.0)),
        (None, Some(25.0)),
    ] {
        let limits = AxisLimits {
            acceleration,
            jerk,
            clamping: 0.2,
            ..AxisLimits::at_speed(0.5)
        };
        for distance in [0.001, 0.05, 0.3, -2.0_f64] {
            let profile = limits.profile(distance);
            let (all, steps) = (profile.duration(), 4000);
            let dt = all / f64::from(steps);
            let at: Vec<f64> = (0..=steps)
                .map(|k| profile.distance_at(f64::from(k) * dt))
                .collect();
            assert!(at[0] == 0.0 && (at[at.len() - 1] - distance.abs()).abs() < 1e-12);
            assert!(at.is_sorted());
            // Released in the first tenth of a second, clamped in the last.
            assert!(profile.distance_at(0.1) < 1e-12);
            assert!((profile.distance_at(all - 0.1) - distance.abs()).abs() < 1e-9);
            assert!((profile.share_at(0.5 * all) - 0.5).abs() < 1e-9);
            let v: Vec<f64> = at.windows(2).map(|pair| (pair[1] - pair[0]) / dt).collect();
            assert!(v.iter().all(|v| *v <= 0.5 * (1.0 + 1e-9)));
            // The slope of an interval lies between the speeds at its ends, but for what is gained around a peak within it.
            let steepest = acceleration.or(jerk.map(|j: f64| (0.5 * j).sqrt()));
            let slack = 0.5 * steepest.unwrap_or(0.0) * dt + 1e-9;
            let speed = |k: usize| profile.speed_at(k as f64 * dt);
            for (k, slope) in v.iter().enumerate() {
                let (low, high) = (speed(k).min(speed(k + 1)), speed(k).max(speed(k + 1)));
                assert!(
                    (low - slack..=high + slack).contains(slope),
                    "{limits:?} {distance}: {slope} m/s in interval {k}, told {low} to {high}"
                );
            }
            assert_eq!([-1e-6, all + 1e-6].map(|t| profile.speed_at(t)), [0.0; 2]);
            if let Some(most) = acceleration {
                let a = v.windows(2).map(|pair| (pair[1] - pair[0]).abs() / dt);
                assert!(a.fold(0.0, f64::max) <= most * (1.0 + 1e-6));
            }
            if let Some(most) = jerk {
                let a: Vec<f64> = v.windows(2).map(|pair| (pair[1] - pair[0]) / dt).collect();
                let j = a.windows(2).map(|pair| (pair[1] - pair[0]).abs() / dt);
                assert!(j.fold(0.0, f64::max) <= most * (1.0 + 1e-3));
            }
        }
    }
}

/// Times of trapezoids as any textbook of drives has them.
#[test]
fn axis_times_follow_the_trapezoid() {
    let slide = AxisLimits {
        acceleration: Some(2.0),
        ..AxisLimits::at_speed(0.5)
    };
    let time = |axis: &AxisLimits, distance: f64| axis.profile(distance).duration();
    // 0.125 m is where 0.5 m/s is just reached: both formulas give 0.5 s.
    assert!((time(&slide, 0.125) - 0.5).abs() < 1e-12);
    assert!((time(&slide, -0.03125) - 0.25).abs() < 1e-12);
    assert!((time(&slide, 1.0) - 2.25).abs() < 1e-12);
    let table = AxisLimits {
        acceleration: Some(2.0 * PI),
        clamping: 0.4,
        ..AxisLimits::at_speed(PI)
    };
    assert_eq!(time(&table, 0.0), 0.0);
    assert!((time(&table, -0.5 * PI) - 1.4).abs() < 1e-12);
    let axes = Motion::new(vec![slide, table], 0.0);
    assert!((axes.time(&[0.0, 0.0], &[1.0, -0.5 * PI]) - 2.25).abs() < 1e-12);
    let targets = [vec![1.0, 0.0], vec![1.0, -0.5 * PI], vec![1.0, -0.5 * PI]];
    let along = axes.time_along(&[0.0, 0.0], &targets);
    assert!((along - 3.65).abs() < 1e-12);
    // An exact stop at each target that is moved to.
    let stopping = Motion::new(vec![slide, table], 0.1);
    assert!((stopping.time_along(&[0.0, 0.0], &targets) - 3.85).abs() < 1e-12);
}

#[test]
fn much_jerk_is_a_trapezoid_and_much_acceleration_is_top_speed() {
    let at_speed = AxisLimits::at_speed(0.4);
    assert_eq!(at_speed.profile(0.1).duration(), 0.1 / 0.4);
    let trapezoid = AxisLimits {
        acceleration: Some(3.0),
        ..at_speed
    };
    for distance in [1e-3, 0.05, 0.5] {
        let curved = AxisLimits {
            jerk: Some(1e9),
            ..trapezoid
        };
        let (one, other) = (curved.profile(distance), trapezoid.profile(distance));
        assert!((one.duration() - other.duration()).abs() < 1e-6);
        let steep = AxisLimits {
            acceleration: Some(1e12),
            ..at_speed
        };
        let uniform = at_speed.profile(distance);
        assert!((steep.profile(distance).duration() - uniform.duration()).abs() < 1e-6);
        // More time for every limit more.
        assert!(other.duration() > uniform.duration());
    }
}

const MACHINE: &str = r#"<robot name="xc"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
<joint name="C" type="revolute"><parent link="foundation"/><child link="workpiece"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="0" velocity="2"/></joint>
<joint name="X" type="prismatic"><parent link="foundation"/><child link="probe_mount"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="0" velocity="0.5"/></joint></robot>"#;

#[test]
fn settings_of_motion_carry_their_units_and_are_named_where_they_cannot_be_used() {
    let chain = Chain::from_urdf(MACHINE).unwrap();
    let check = |text: &str| {
        let raw: RawMotion = serde_json::from_str(text).unwrap();
        raw.check(&chain)
    };
    let motion = check(
        r#"{"dwell_s": 0.05, "axes": {
        "X": {"acceleration_mm_per_s2": 2000.0, "jerk_mm_per_s3": 40000.0},
        "C": {"acceleration_deg_per_s2": 180.0, "clamping_s": 0.3}}}"#,
    )
    .unwrap();
    assert_eq!(motion.dwell(), 0.05);
    let [c, x] = motion.axes() else {
        panic!("{motion:?}");
    };
    assert_eq!((x.velocity, c.velocity, c.jerk), (0.5, 2.0, None));
    assert!((x.acceleration.unwrap() - 2.0).abs() < 1e-12 && (x.jerk.unwrap() - 40.0).abs() < 1e-9);
    assert!((c.acceleration.unwrap() - PI).abs() < 1e-12 && c.clamping == 0.3);
    assert_eq!(check("{}").unwrap(), *chain.motion());
    let refused = |text: &str| check(text).unwrap_err().to_string();
    assert_eq!(
        check(r#"{"axes": {"Y": {}}}"#),
        Err(MotionError::Axis("Y".to_owned()))
    );
    assert_eq!(
        refused(r#"{"axes": {"C": {"jerk_mm_per_s3": 1.0}}}"#),
        "motion.axes.C.jerk_mm_per_s3 limits a linear axis, but C is a rotary one"
    );
    assert_eq!(
        refused(r#"{"axes": {"X": {"acceleration_mm_per_s2": 0.0}}}"#),
        "motion.axes.X.acceleration_mm_per_s2 = 0 must be a finite number above 0"
    );
    assert_eq!(
        refused(r#"{"dwell_s": -1.0}"#),
        "motion.dwell_s = -1 must be a finite number not below 0"
    );
}
