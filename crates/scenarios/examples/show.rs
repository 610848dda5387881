//! Prints the figures of scenarios and what the diagnosis says of their sessions.
#![allow(clippy::print_stdout)]
fn main() {
    let seed = std::env::var("SEED")
        .ok()
        .and_then(|s| s.parse().ok())
        .unwrap_or(1);
    for name in std::env::args().skip(1) {
        let scenario = scenarios::find(&name).unwrap();
        let t = std::time::Instant::now();
        let judged = scenario.judge(&scenarios::Run::silent(seed));
        println!("== {} {:.2}s", scenario.name, t.elapsed().as_secs_f64());
        let judged = match judged {
            Ok(j) => j,
            Err(e) => {
                println!("ERROR {e}");
                continue;
            }
        };
        for f in &judged.outcome.figures {
            println!(
                "{} {:32} ours {:30} source {:20} {:6} [{}]",
                if f.passes() { "ok  " } else { "FAIL" },
                f.key,
                f.ours.text(),
                f.source.as_ref().map_or(String::new(), |s| s.text()),
                f.unit,
                f.rule_text()
            );
        }
        for (r, report) in &judged.sessions {
            println!("--- {}\n{report}", r.name);
        }
    }
}
