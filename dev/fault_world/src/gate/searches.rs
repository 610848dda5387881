//! What may happen in each search. Every message may overtake those on other routes in all of them.

use super::Bounds;

const NOTHING: Bounds = Bounds {
    answers: 0,
    withdrawals: 0,
    stops: 0,
    losses: 0,
    repeats: 0,
    restarts: 0,
    forgeries: 0,
    periods: 0,
};

/// The searches of the tests.
pub const SEARCHES: &[Bounds] = &[
    Bounds {
        answers: 2,
        ..NOTHING
    },
    Bounds {
        answers: 1,
        withdrawals: 1,
        ..NOTHING
    },
    Bounds {
        answers: 1,
        forgeries: 1,
        ..NOTHING
    },
    Bounds {
        answers: 1,
        losses: 1,
        ..NOTHING
    },
    Bounds {
        answers: 1,
        repeats: 1,
        ..NOTHING
    },
    Bounds {
        answers: 1,
        periods: 3,
        ..NOTHING
    },
    Bounds {
        answers: 1,
        stops: 1,
        ..NOTHING
    },
    Bounds {
        answers: 1,
        restarts: 1,
        ..NOTHING
    },
    Bounds {
        answers: 2,
        restarts: 1,
        ..NOTHING
    },
    Bounds {
        answers: 1,
        stops: 1,
        restarts: 1,
        ..NOTHING
    },
];

/// The searches of the command beyond those, which take minutes and gigabytes.
pub const DEEP: &[Bounds] = &[
    Bounds {
        answers: 2,
        losses: 1,
        ..NOTHING
    },
    Bounds {
        answers: 2,
        repeats: 1,
        ..NOTHING
    },
    Bounds {
        answers: 2,
        withdrawals: 1,
        ..NOTHING
    },
    Bounds {
        answers: 2,
        forgeries: 1,
        ..NOTHING
    },
    Bounds {
        answers: 3,
        ..NOTHING
    },
    Bounds {
        answers: 4,
        ..NOTHING
    },
    Bounds {
        answers: 2,
        stops: 1,
        ..NOTHING
    },
    Bounds {
        restarts: 1,
        forgeries: 1,
        ..NOTHING
    },
    Bounds {
        restarts: 2,
        ..NOTHING
    },
    Bounds {
        answers: 1,
        losses: 1,
        restarts: 1,
        ..NOTHING
    },
    Bounds {
        answers: 1,
        repeats: 1,
        restarts: 1,
        ..NOTHING
    },
    Bounds {
        answers: 1,
        withdrawals: 1,
        restarts: 1,
        ..NOTHING
    },
];
