//! Counterexamples that seeds have found, as shortened: each is repeated here with what it needed.

use fault_world::{Cells, Fault, Kind, Route, run};

fn holds(seed: u64, faults: &[(f64, Kind)]) {
    let cells = Cells::default();
    let faults: Vec<Fault> = (faults.iter().cloned())
        .map(|(at, kind)| Fault { at, kind })
        .collect();
    assert_eq!(run(cells.of(seed), seed, &faults, None).violation, None);
}

/// A gate whose driver is of another time took its number from the first sample, and told the driver so only with its next sign
/// of life: what it had begun in between was ended by the driver.
#[test]
fn a_gate_tells_a_driver_of_another_time_who_it_is_before_it_begins() {
    holds(13, &[(69.05, Kind::CellRestart(-39.38))]);
}

/// A replay took the first process in a recording for the first process of its node: where that one was the second, and the node
/// was started once more, what the one had published was compared with what the other had.
#[test]
fn a_recording_may_begin_with_the_second_process_of_a_node() {
    holds(1, &[(3.16, Kind::CellRestart(66.38))]);
}

/// A replay took a message that the machine published after its restart for one of the same number that the node had received at
/// its start, from before the recording began.
#[test]
fn a_step_takes_nothing_that_was_published_and_recorded_after_it() {
    holds(
        100_225,
        &[
            (67.72, Kind::CellRestart(5.8)),
            (77.09, Kind::Run(true)),
            (101.77, Kind::Kill("simulator", 3.92, true)),
        ],
    );
}

/// A replay took a message of a process that had been started anew, whose first message was lost on its way, for a repetition of the
/// message of the same number from the process before.
#[test]
fn a_process_whose_first_message_is_lost_is_not_taken_for_the_one_before() {
    let to_planning = Route {
        topic: "operation_requests",
        to: "path_planning",
    };
    holds(
        305_013,
        &[
            (105.37, Kind::Kill("cycle", 3.18, true)),
            (108.75, Kind::Lose(to_planning, 3.68, 1)),
        ],
    );
}

/// A driver that kept running took a gate that was started by a clock set back for an earlier one, and every part was stopped.
#[test]
fn a_gate_by_a_clock_set_back_is_the_gate_once_the_one_before_is_silent() {
    holds(
        300_105,
        &[
            (14.48, Kind::CellRestart(947.89)),
            (27.93, Kind::CellRestart(-864.27)),
        ],
    );
}

/// A replay took the first message of the third process of a node for that of the second, which was lost on its way.
#[test]
fn a_message_is_of_the_latest_process_that_has_published_its_number() {
    let to_analysis = Route {
        topic: "inspection_plan",
        to: "analysis",
    };
    holds(
        300_409,
        &[
            (33.68, Kind::Kill("path_planning", 0.11, true)),
            (38.62, Kind::Lose(to_analysis, 15.2, 3)),
            (55.31, Kind::Kill("path_planning", 4.25, true)),
        ],
    );
    let to_gate = Route {
        topic: "part_status",
        to: "machine_state",
    };
    holds(
        400_809,
        &[
            (0.86, Kind::Lose(to_gate, 2.83, 1)),
            (1.78, Kind::Kill("cycle", 0.45, true)),
            (13.50, Kind::Run(false)),
        ],
    );
}
