//! What moves of a session are judged by: its machine, its plan and the ball of its stylus.

use machine::{Chain, Nominal};
use probecell_msgs::InspectionPlan;

/// The machine, the plan and the ball of a session.
pub(super) struct Probing<'a> {
    pub(super) chain: &'a Chain,
    pub(super) plan: &'a InspectionPlan,
    pub(super) nominal: Nominal,
}

impl Probing<'_> {
    /// Straight distance of the ball between two sets of positions, in the part frame, m.
    pub(super) fn ball_path(&self, from: &[f64], to: &[f64]) -> f64 {
        let place = |at: &[f64]| {
            self.chain
                .ball_in_part(at, &self.nominal.part_pose, &self.nominal.ball)
        };
        (place(to) - place(from)).norm()
    }
}
