//! The driver against a simulated robot that misbehaves as robots do, in virtual time.

use std::collections::BTreeSet;

use machine::Chain;
use nalgebra::DMatrix;
use probecell_msgs::ControllerReply;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

use super::{
    leg::ARRIVED,
    simulated::{BRAKE, Behaviour, FEED, Outcome, World},
    trajectory::check_start,
    wire::{Waypoint, send_goal},
};

const MS: i64 = 1_000_000;

fn measured(is: Behaviour) -> Outcome {
    World::new(is).measure()
}

/// It has failed or was refused with this sentence; the arm stands.
fn expect(outcome: &Outcome, says: &str) {
    assert_ne!(outcome.reply.outcome, ControllerReply::DONE);
    assert!(outcome.reply.text.contains(says), "{}", outcome.reply.text);
    assert!(!outcome.is_moving, "it still moves");
}

fn expect_nothing_sent(outcome: &Outcome, says: &str) {
    expect(outcome, says);
    assert_eq!(outcome.goals, 0, "{}", outcome.reply.text);
}

/// It has measured the face at z = 0.
fn expect_touch(outcome: &Outcome, within: f64) {
    let text = &outcome.reply.text;
    assert_eq!(outcome.reply.outcome, ControllerReply::DONE, "{text}");
    let [touch] = outcome.triggers.as_slice() else {
        panic!("{} triggers", outcome.triggers.len());
    };
    assert!(touch.tripped && !touch.tripped_before);
    let error = touch.axis_positions[2];
    assert!(error.abs() < within, "{:.1} µm", error * 1e6);
}

/// The deepest that an arm gets which stops at once when a contact arrives, m.
fn deepest(is_jitter: i64) -> f64 {
    // A step for the contact to be seen, one for what is called to be served, and one of the motion.
    FEED * (is_jitter + BRAKE + 4 * MS) as f64 * 1e-9
}

#[test]
fn a_robot_as_it_should_be_is_measured_at_every_rate_and_whether_it_stops_itself_or_not() {
    for period in [1, 2, 4, 20] {
        for stops_itself in [false, true] {
            for seed in 0..4 {
                let outcome = measured(Behaviour {
                    seed,
                    period: period * MS,
                    stops_itself,
                    ..Behaviour::default()
                });
                // At 50 Hz the samples bound the position to 4 µm.
                expect_touch(&outcome, 4e-6);
                assert_eq!(outcome.goals, 3);
            }
        }
    }
    let latched = measured(Behaviour {
        latched: true,
        ..Behaviour::default()
    });
    expect_touch(&latched, 1e-9);
}

#[test]
fn a_contact_stops_the_arm_whatever_its_stamp() {
    for latched in [false, true] {
        let ahead: [fn(i64, bool) -> i64; 3] = [
            |_, is_new| if is_new { 5_000 * MS } else { 0 },
            |_, is_new| if is_new { -5_000 * MS } else { 0 },
            |_, is_new| if is_new { -i64::MAX / 2 } else { 0 },
        ];
        for level_ahead in ahead {
            let outcome = measured(Behaviour {
                level_ahead,
                latched,
                ..Behaviour::default()
            });
            let depth = -outcome.lowest;
            assert!(outcome.contact.is_some(), "it touches");
            assert!(depth > 0.0 && depth < deepest(MS), "{:.3} mm", depth * 1e3);
            expect(&outcome, "/contact");
        }
    }
}

#[test]
fn over_clocks_and_jitter_the_arm_is_never_deeper_than_it_needs_to_stop() {
    let mut random = Pcg64::seed_from_u64(200);
    let (mut touched, mut refused) = (0, 0);
    for seed in 0..200 {
        // Half of the clocks differ by up to 1 s, half by up to 4 ms.
        let most = if seed % 2 == 0 { 1_000 * MS } else { 4 * MS };
        let offset = random.random_range(-most..=most);
        let jitter = random.random_range(MS..20 * MS);
        let outcome = measured(Behaviour {
            seed,
            offsets: [offset, 0],
            jitter,
            stops_itself: random.random_bool(0.3),
            ..Behaviour::default()
        });
        let depth = (-outcome.lowest).max(0.0);
        assert!(
            depth < deepest(jitter),
            "seed {seed}: {:.3} mm",
            depth * 1e3
        );
        if outcome.reply.outcome == ControllerReply::DONE {
            touched += 1;
            // The difference of the clocks that is not seen: the limit of 2 ms, and what jitter of few messages leaves.
            expect_touch(&outcome, FEED * 2e-3 + FEED * jitter as f64 * 1e-9);
        } else {
            refused += 1;
            expect(&outcome, "both need one clock");
        }
        assert!(offset.abs() < 25 * MS || outcome.goals == 0, "seed {seed}");
    }
    println!("{touched} touched, {refused} refused");
    assert!(touched > 30 && refused > 80, "{touched}, {refused}");
}

#[test]
fn clocks_that_differ_are_refused_with_both_topics_and_the_difference() {
    for (offsets, says) in [
        ([200 * MS, 0], "the clock of /joint_states is 200."),
        ([0, 100 * MS], "ms behind that of /contact"),
        ([-500 * MS, 0], "ms behind that of /contact"),
    ] {
        let outcome = measured(Behaviour {
            offsets,
            jitter: MS / 5,
            ..Behaviour::default()
        });
        expect_nothing_sent(&outcome, says);
        assert!(outcome.reply.text.contains("2.0 ms are allowed"));
    }
}

#[test]
fn a_clock_that_runs_away_or_goes_back_ends_the_measurement() {
    // 2 ms a second from the begin: 3 ms when the measurement begins, or from then on.
    let runs = measured(Behaviour {
        joints_ahead: |now| now / 500,
        ..Behaviour::default()
    });
    expect(&runs, "both need one clock");
    let later = measured(Behaviour {
        joints_ahead: |now| (now - 1_600 * MS).max(0) / 50,
        ..Behaviour::default()
    });
    expect(&later, "both need one clock");
    assert!(
        later.goals > 0 && later.contact.is_none(),
        "{}",
        later.goals
    );
    let back = measured(Behaviour {
        joints_ahead: |now| if now > 1_700 * MS { -3_000 * MS } else { 0 },
        ..Behaviour::default()
    });
    expect(
        &back,
        "the stamps of /joint_states have gone back by 2996.0 ms",
    );
    assert!(back.goals > 0 && back.contact.is_none());
    assert!(back.cancelled.is_some());
}

#[test]
fn joint_states_without_stamps_are_refused_in_a_sentence() {
    let outcome = measured(Behaviour {
        no_stamps: true,
        ..Behaviour::default()
    });
    expect_nothing_sent(&outcome, "the stamps of /joint_states are zero");
}

#[test]
fn a_level_published_once_a_second_is_waited_for_and_enough() {
    let outcome = measured(Behaviour {
        beat: 990 * MS,
        ..Behaviour::default()
    });
    expect_touch(&outcome, 1e-6);
}

#[test]
fn joint_states_that_come_too_seldom_refuse_the_touch_with_its_instant() {
    let outcome = measured(Behaviour {
        period: 100 * MS,
        ..Behaviour::default()
    });
    expect(&outcome, "the touch of point 0 at 1700000");
    let depth = -outcome.lowest;
    assert!(depth < deepest(MS), "{:.3} mm", depth * 1e3);
}

#[test]
fn two_publishers_of_joint_states_keep_the_arm_from_moving_and_stop_it() {
    // Far away, and next to where the arm is.
    for elsewhere in [[0.0, 1.6, 0.0], [0.0, 0.0, 4.9e-3]] {
        let before = measured(Behaviour {
            second: Some((0, elsewhere)),
            ..Behaviour::default()
        });
        expect_nothing_sent(&before, "two nodes publish /joint_states");
        let under_way = measured(Behaviour {
            second: Some((1_620 * MS, elsewhere)),
            ..Behaviour::default()
        });
        expect(&under_way, "/joint_states");
        assert!(under_way.cancelled.is_some() && under_way.contact.is_none());
    }
}

#[test]
fn a_jump_beyond_top_speed_stops_the_arm() {
    let elsewhere = [0.0, 1.6, 0.0];
    let before = measured(Behaviour {
        jump: Some((1_480 * MS, elsewhere)),
        ..Behaviour::default()
    });
    let says =
        "/joint_states: joint \"Y\" jumps by 1.6000 m in 4.0 ms, and its top speed is 1.000 m/s";
    expect_nothing_sent(&before, says);
    let under_way = measured(Behaviour {
        jump: Some((1_640 * MS, elsewhere)),
        ..Behaviour::default()
    });
    expect(&under_way, says);
    assert!(under_way.cancelled.is_some() && under_way.contact.is_none());
}

#[test]
fn goals_without_an_answer_and_standstills_that_do_not_come_end_by_a_deadline() {
    let seconds = |outcome: &Outcome| (outcome.times[1] - outcome.times[0]) / (1_000 * MS);
    let unanswered = measured(Behaviour {
        answers_goals: false,
        ..Behaviour::default()
    });
    expect(&unanswered, "no answer within 7 s");
    assert!(seconds(&unanswered) < 15);
    assert!(unanswered.cancelled.is_some());
    let creeping = measured(Behaviour {
        creeps: 0.02,
        ..Behaviour::default()
    });
    expect_nothing_sent(
        &creeping,
        "the robot moves although nothing of this cell moves it",
    );
    assert!(seconds(&creeping) < 15);
    let silent = measured(Behaviour {
        silent_from: 1_640 * MS,
        ..Behaviour::default()
    });
    assert!(
        silent
            .reply
            .text
            .contains("the robot publishes no joint states")
    );
    assert!(silent.contact.is_none() || -silent.lowest < deepest(MS));
}

#[test]
fn a_goal_that_is_accepted_after_it_was_cancelled_is_cancelled_again() {
    // The clock goes back while the touch is not answered yet, which begins only then.
    let outcome = measured(Behaviour {
        answers_after: 400 * MS,
        joints_ahead: |now| if now > 2_150 * MS { -3_000 * MS } else { 0 },
        ..Behaviour::default()
    });
    expect(&outcome, "have gone back by");
    assert_eq!(outcome.goals, 2);
    // Its answer is seen in the next poll.
    let way = 2e-3 - outcome.lowest;
    assert!(way > 0.0 && way < deepest(10 * MS), "{:.3} mm", way * 1e3);
}

#[test]
fn a_first_waypoint_that_is_not_where_the_arm_is_is_not_sent() {
    let urdf = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../launch-scripts/robot_arm.urdf"
    );
    let urdf = std::fs::read_to_string(urdf).expect("a robot description");
    let chain = Chain::from_urdf(&urdf).expect("an arm");
    let newest = [0.0, -1.5, 1.5, 0.0, 0.0, 0.0];
    let mut positions = newest.to_vec();
    positions[1] += 0.04;
    let near = [Waypoint {
        time: 0.02,
        positions: positions.clone(),
    }];
    assert_eq!(check_start(&chain, &newest, &near), Ok(()));
    positions[1] += 1.548;
    let far = [Waypoint {
        time: 0.02,
        positions,
    }];
    let told = check_start(&chain, &newest, &far).expect_err("it is far away");
    let says = "1.5880 m or rad of axis \"A2\" from where the robot is, to be reached in 0.020 s";
    assert!(told.contains(says), "{told}");
}

#[test]
fn a_probe_that_is_tripped_before_a_move_keeps_the_arm_where_it_is() {
    let outcome = measured(Behaviour {
        stuck: true,
        ..Behaviour::default()
    });
    expect_nothing_sent(&outcome, "probe_stuck: ");
}

#[test]
fn a_contact_of_the_way_back_stops_the_arm() {
    let outcome = measured(Behaviour {
        second_face: 3e-3,
        seed: 2,
        ..Behaviour::default()
    });
    // The first way, down from 5 mm, is beyond the second face already.
    expect(&outcome, "unplanned_touch: ");
    let told: BTreeSet<_> = outcome.triggers.iter().map(|one| one.point_index).collect();
    assert!(told.len() < 2);
}

#[test]
fn what_the_controller_answers_to_a_goal_is_said_by_name_and_the_arm_is_not_moved_again() {
    let path = "Aborted due to path tolerance violation";
    let new = "Current goal cancelled due to new incoming action.";
    for (ends, says) in [
        (
            (6, -4, path),
            "the controller has aborted the trajectory with PATH_TOLERANCE_VIOLATED (-4): Aborted due to path tolerance violation",
        ),
        (
            (6, -1, new),
            "has aborted the trajectory with INVALID_GOAL (-1): Current goal cancelled due to new incoming action.",
        ),
        (
            (5, 0, ""),
            "the controller has cancelled the trajectory without an error code",
        ),
        (
            (6, -7, ""),
            "the controller has aborted the trajectory with error code -7",
        ),
        ((4, 0, "Goal successfully reached!"), "has succeeded, but"),
    ] {
        // Half way of the rapid move, and of the touch.
        for goal in [1, 2] {
            let (status, code, text) = ends;
            let outcome = measured(Behaviour {
                ends: Some((goal, status, code, text)),
                ..Behaviour::default()
            });
            expect(&outcome, says);
            assert_eq!(outcome.goals, goal);
            assert!(outcome.triggers.is_empty());
        }
    }
}

#[test]
fn a_goal_that_a_contact_cannot_have_ended_is_not_waited_for() {
    let seconds = |code| {
        let outcome = measured(Behaviour {
            ends: Some((2, 6, code, "")),
            ..Behaviour::default()
        });
        (outcome.times[1] - outcome.times[0]) as f64 * 1e-9
    };
    // The message of a contact may come half a second later.
    let (given_way, violated) = (seconds(-1), seconds(-4));
    assert!((violated - given_way - 0.5).abs() < 0.05);
}

#[test]
fn an_arm_that_stands_in_its_trajectory_is_cancelled_in_the_end() {
    let outcome = measured(Behaviour {
        ends: Some((1, 0, 0, "")),
        ..Behaviour::default()
    });
    expect(
        &outcome,
        "the controller has not ended the trajectory within 60.",
    );
    let text = &outcome.reply.text;
    assert!(
        text.contains("axis \"Z\" is 0.00") && text.contains(" m from its target"),
        "{text}"
    );
    assert!(outcome.cancelled.is_some() && outcome.goals == 1);
}

#[test]
fn a_goal_has_succeeded_only_within_a_millimetre_of_each_joint() {
    let joints = ["X", "Y"].map(str::to_owned);
    let points = [Waypoint {
        time: 0.5,
        positions: vec![0.1, 0.2],
    }];
    let sent = send_goal(&[7; 16], &joints, &points, ARRIVED);
    // Name of one letter, alignment, position, velocity, acceleration.
    let of = |name: u8| {
        let mut bytes = vec![2, 0, 0, 0, name, 0];
        bytes.resize(8, 0);
        for value in [ARRIVED, 0.0, 0.0] {
            bytes.extend(value.to_le_bytes());
        }
        bytes
    };
    let found = |name| sent.windows(32).any(|window| window == of(name));
    assert!(found(b'X') && found(b'Y'));
}

/// The size of a ball from five touches: of what errs in a touch only the instant of the contact is stated, 0.2 ms.
#[test]
fn the_stated_uncertainty_covers_the_size_of_balls_at_every_rate() {
    const INSTANT: f64 = 0.2e-3;
    let (sin, cos) = (1.05_f64).sin_cos();
    let normals = [
        [0.0, 0.0, 1.0],
        [sin, 0.0, cos],
        [-sin, 0.0, cos],
        [0.0, sin, cos],
        [0.0, -sin, cos],
    ];
    // Centre and radius by least squares: what each touch adds to the radius.
    let design = DMatrix::from_fn(5, 4, |touch, column| match column {
        3 => 1.0,
        axis => normals[touch][axis],
    });
    let normal = (design.transpose() * &design)
        .try_inverse()
        .expect("a ball");
    let shares = (normal * design.transpose()).row(3).transpose();
    let expanded = 2.0 * INSTANT * FEED * shares.norm();
    let mut random = Pcg64::seed_from_u64(400);
    let (mut covered, mut worst, mut refused) = (0, 0.0_f64, 0);
    for ball in 0..400 {
        let period = [MS, 2 * MS, 4 * MS, 8 * MS, 20 * MS][ball % 5];
        let stops_itself = random.random_bool(0.5);
        let mut touch = || {
            let late: f64 = random.sample(rand_distr::StandardNormal);
            let outcome = measured(Behaviour {
                seed: random.random(),
                period,
                jitter: random.random_range(MS / 2..5 * MS),
                offsets: [0, (late * INSTANT * 1e9) as i64],
                stops_itself,
                ..Behaviour::default()
            });
            let is_done = outcome.reply.outcome == ControllerReply::DONE;
            refused += u32::from(!is_done);
            is_done.then(|| outcome.triggers[0].axis_positions[2])
        };
        // A touch that is refused is made again.
        let radius: f64 = (shares.iter())
            .map(|share| share * (0..20).find_map(|_| touch()).expect("a touch"))
            .sum();
        covered += usize::from(radius.abs() <= expanded);
        worst = worst.max(radius.abs());
    }
    println!(
        "{covered} of 400 within {:.2} µm, worst {:.2} µm; {refused} touches refused",
        expanded * 1e6,
        worst * 1e6
    );
    assert_eq!(covered, 382);
}
