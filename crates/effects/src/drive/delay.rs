//! `drive.delay`: motion or effort follows its cause by a delay.
//!
//! (s(t − tau) − s(t))/tau of the command, or of the effort as the other effects explain it; its slope for the shortest
//! delay, to which a lag of the axis is equal.

use inference::linear::{add_scaled, dot};

use super::{Channel, Drive, Signals, Term, acts_on, signals::derivative, term};
use crate::drive::columns::DriveEffect;
use crate::effect::{Definition, Effect};

pub(super) struct Delay;

impl Effect for Delay {
    fn definition(&self) -> Definition {
        Definition {
            id: "drive.delay",
            name: "delay between effort and motion of the drive",
            remedy: "raise the velocity feed-forward of the position loop, or shorten its cycle",
            parameters: &[("tau", "s", 0.1)],
            acts_on: acts_on(),
        }
    }

    fn drive(&self, drive: &Drive<'_>, before: &[DriveEffect]) -> Option<DriveEffect> {
        let signals = drive.signals;
        let (signal, late) = match drive.channel {
            Channel::Motion => (signals.command.clone(), &LATE[..]),
            // Later copies of what an acceleration predicts would share its noise; its slope does not.
            Channel::Effort => (expected(&signals.effort, before), &[][..]),
        };
        let offered = drive.on(drive.channel, self.id(), || shapes(signals, &signal, late));
        let effect = offered.map(|effect| effect.signed(1.0))?;
        Some(match drive.channel {
            Channel::Motion => effect.same_as(format!("axis.{}.lag", signals.axis)),
            Channel::Effort => effect,
        })
    }
}

/// Delays that are tried in addition to the infinitesimal one, samples.
const LATE: [usize; 12] = [1, 2, 3, 4, 5, 6, 8, 10, 13, 17, 22, 28];

/// The slope of a signal, and its later copies.
fn shapes(signals: &Signals, signal: &[f64], late: &[usize]) -> Vec<Vec<Term>> {
    let (time, piece) = (&signals.time, &signals.piece);
    let slope = derivative(time, piece, signal).iter().map(|f| -f).collect();
    let mut shapes = vec![vec![term("tau", "s", slope)]];
    for &steps in late {
        if steps * 20 > signal.len() {
            break;
        }
        let column = (0..signal.len())
            .map(|at| {
                let before = at.saturating_sub(steps);
                if piece[before] != piece[at] || before == at {
                    return 0.0;
                }
                (signal[before] - signal[at]) / (time[at] - time[before])
            })
            .collect();
        shapes.push(vec![term("tau", "s", column)]);
    }
    shapes
}

/// The effort as the linear effects together explain it: free of the sensor's noise, which a delayed copy of the
/// measured effort would bring into its own explanation.
fn expected(effort: &[f64], effects: &[DriveEffect]) -> Vec<f64> {
    let columns: Vec<&Vec<f64>> = (effects.iter())
        .filter_map(|effect| effect.shapes.get(effect.shapes.len() / 2))
        .flatten()
        .map(|term| &term.column)
        .collect();
    let n = columns.len();
    let size: Vec<f64> = (columns.iter())
        .map(|column| dot(column, column).sqrt().max(f64::MIN_POSITIVE))
        .collect();
    let normal = nalgebra::DMatrix::from_fn(n, n, |i, k| {
        let ridge = if i == k { 1e-9 } else { 0.0 };
        dot(columns[i], columns[k]) / (size[i] * size[k]) + ridge
    });
    let right = nalgebra::DVector::from_fn(n, |i, _| dot(columns[i], effort) / size[i]);
    let mut sum = vec![0.0; effort.len()];
    if let Some(factor) = nalgebra::Cholesky::new(normal) {
        for ((column, own), length) in columns.iter().zip(factor.solve(&right).iter()).zip(&size) {
            add_scaled(&mut sum, own / length, column);
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::specimen::{columns, signals};

    #[test]
    fn the_shortest_delay_is_the_slope_of_the_command() {
        let column = &columns(&Delay, Channel::Motion)[0];
        let speed = signals().command_speed;
        for (value, v) in column.iter().zip(&speed).skip(2).take(190) {
            assert!((value + v).abs() < 2e-3 * speed[0], "{value} for {v}");
        }
    }
}
