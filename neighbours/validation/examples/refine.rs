//! What eight chosen touches are worth on sealed sessions: `refine FIRST_SEED COUNT`.

use validation::blind::{Content, refine::trial};

#[expect(clippy::print_stdout, reason = "the table is its output")]
fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1).map(|word| word.parse::<u64>());
    let first = arguments.next().transpose()?.unwrap_or(1);
    let count = arguments.next().transpose()?.unwrap_or(12);
    let (mut start, mut chosen, mut random, mut same) = (0, 0, 0, 0);
    for seed in first..first + count {
        let trial = trial(seed, Content::Known(1 + (seed % 3) as usize), 8)?;
        start += u32::from(trial.start);
        chosen += u32::from(trial.sure.chosen);
        random += u32::from(trial.sure.random);
        same += u32::from(trial.sure.same);
        if !trial.start {
            println!("{trial:?}");
        }
    }
    println!("of {count}: start {start}, chosen {chosen}, random {random}, same plan {same}");
    Ok(())
}
