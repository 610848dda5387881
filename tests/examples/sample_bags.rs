//! Makes the samples of `bags/samples` from their recipes: all, or those named. Prints their sizes.

use std::{
    fs,
    io::{Write as _, stdout},
};

use bags::Bag;
use cell_tests::sample;

fn main() {
    let named: Vec<String> = std::env::args().skip(1).collect();
    for name in sample::names() {
        if !named.is_empty() && !named.contains(&name) {
            continue;
        }
        let recipe = sample::recipe(&name);
        let cell = sample::cell(&recipe);
        let file = sample::folder().join(format!("{name}.mcap"));
        sample::write(&cell, &sample::make(&recipe, &cell), &file);
        let bag = Bag::open(&file).unwrap_or_else(|error| panic!("{error}"));
        let twin = sample::twin(&name, &sample::read(&cell, &bag));
        let readable = file.with_extension("jsonl");
        fs::write(&readable, &twin)
            .unwrap_or_else(|error| panic!("{}: {error}", readable.display()));
        let report = sample::gap_report(&name, &recipe, &cell, &file);
        let text = file.with_extension("report.txt");
        fs::write(&text, format!("{report}\n"))
            .unwrap_or_else(|error| panic!("{}: {error}", text.display()));
        let bytes = fs::metadata(&file).map_or(0, |file| file.len());
        writeln!(
            stdout(),
            "{name}: {bytes} bytes, readable twin {} bytes",
            twin.len()
        )
        .expect("standard output");
    }
}
