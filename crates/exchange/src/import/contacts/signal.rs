//! The contacts of a signal: its rises, of one that bounces the first, and how late one that is polled may be.

/// s; a signal that rises again sooner after it fell bounces: to free a probe and to come back takes longer.
const BOUNCE: f64 = 0.05;
/// Share of its period by which a message of a polled signal may be early or late.
const ON_TIME: f64 = 0.2;
/// Share of the rises of a polled signal that come on time.
const MOSTLY: f64 = 0.8;

/// Instants at which the signal rises; of one that bounces the first.
pub(super) fn rises(signal: &[(f64, bool)], remarks: &mut Vec<String>) -> Vec<f64> {
    if signal.first().is_some_and(|(_, level)| *level) {
        remarks.push(
            "the contact signal is high when the recording begins: no touch is known of that"
                .to_owned(),
        );
    }
    let mut fell = f64::NEG_INFINITY;
    let mut contacts: Vec<f64> = Vec::new();
    let (mut bounces, mut latest, mut bounced) = (0, 0.0_f64, None);
    let mut bouncing = 0;
    for pair in signal.windows(2) {
        let [(_, before), (at, level)] = [pair[0], pair[1]];
        if before && !level {
            fell = at;
        }
        if before || !level {
            continue;
        }
        match contacts.last() {
            Some(first) if at - fell < BOUNCE => {
                bounces += 1;
                latest = latest.max(at - first);
                bouncing += usize::from(bounced != Some(contacts.len()));
                bounced = Some(contacts.len());
            }
            _ => contacts.push(at),
        }
    }
    if bounces > 0 {
        remarks.push(format!(
            "the contact signal bounces: it rises again within {:.1} ms at {bouncing} of {} contacts; the first rise of each is taken, and {bounces} rises are left out",
            latest * 1e3,
            contacts.len()
        ));
    }
    contacts
}

/// Half of the period with which a signal is repeated, s, by which a contact is known; 0 where messages come when the level changes.
///
/// A signal that is polled changes at an instant of its period. One that is repeated beside its changes has these anywhere.
pub(super) fn lateness(signal: &[(f64, bool)], contacts: &[f64], remarks: &mut Vec<String>) -> f64 {
    let pairs = signal.windows(2);
    let mut repeats: Vec<f64> = pairs
        .filter(|pair| pair[0].1 == pair[1].1)
        .map(|pair| pair[1].0 - pair[0].0)
        .collect();
    if repeats.len() <= contacts.len() {
        return 0.0;
    }
    repeats.sort_by(f64::total_cmp);
    let period = repeats[repeats.len() / 2];
    let on_time = contacts.iter().filter(|at| {
        let index = signal.partition_point(|(instant, _)| instant < at);
        let before = index
            .checked_sub(1)
            .map_or(f64::NEG_INFINITY, |before| signal[before].0);
        (**at - before - period).abs() < ON_TIME * period
    });
    if on_time.count() as f64 <= MOSTLY * contacts.len() as f64 {
        return 0.0;
    }
    remarks.push(format!(
        "the contact signal is polled every {:.1} ms: a contact is taken in the middle between the last low and the first high message, which is off by {:.1} ms at most, and U contains it",
        period * 1e3,
        period * 0.5e3
    ));
    0.5 * period
}

#[cfg(test)]
mod tests {
    use super::rises;

    #[test]
    fn a_signal_that_bounces_gives_its_first_rise_and_is_told() {
        let mut signal = vec![(0.0, false)];
        for begin in [1.0, 2.0, 3.0] {
            for (at, level) in [(0.0, true), (1e-3, false), (1.9e-3, true), (4e-3, false)] {
                signal.push((begin + at, level));
            }
            signal.push((begin + 4.7e-3, true));
            signal.push((begin + 0.2, false));
        }
        let mut remarks = Vec::new();
        assert_eq!(rises(&signal, &mut remarks), [1.0, 2.0, 3.0]);
        let says = "rises again within 4.7 ms at 3 of 3 contacts; the first rise of each is taken, and 6 rises are left out";
        assert!(remarks[0].contains(says), "{remarks:?}");
    }

    #[test]
    fn touches_in_quick_succession_are_no_bounces() {
        let signal = [
            (0.0, false),
            (1.0, true),
            (1.01, false),
            (1.07, true),
            (1.2, false),
        ];
        let mut remarks = Vec::new();
        assert_eq!(rises(&signal, &mut remarks), [1.0, 1.07]);
        assert!(remarks.is_empty());
    }
}
