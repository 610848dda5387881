//! Diagnoses bags of touches together: `joint FIT… [--withhold BAG…]`, or `joint --halves BAG…`: every second pose withheld.
#![expect(clippy::print_stdout, reason = "a program for a person")]

use std::path::Path;

mod common;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let split = arguments
        .iter()
        .position(|argument| argument == "--withhold")
        .unwrap_or(arguments.len());
    let read = |paths: &[String]| {
        paths
            .iter()
            .map(|path| common::read(Path::new(path)))
            .collect::<Result<Vec<_>, _>>()
    };
    let (fit, withheld) = if arguments.first().is_some_and(|first| first == "--halves") {
        let whole = read(&arguments[1..])?;
        whole.iter().map(common::halves).unzip()
    } else {
        let withheld = read(arguments.get(split + 1..).unwrap_or_default())?;
        (read(&arguments[..split])?, withheld)
    };
    let begun = std::time::Instant::now();
    println!(
        "{}",
        diagnosis::diagnose_together_with_residuals(
            &fit,
            &withheld,
            &diagnosis::Options::default()
        )?
        .0
    );
    println!("{:.0} ms", begun.elapsed().as_secs_f64() * 1e3);
    Ok(())
}
