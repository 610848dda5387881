//! Makes a part in a simulated cell on virtual time, and writes the recording: `make_part CELL.toml PART FILE.mcap`.

use std::path::Path;

use cell::Cell;
use cell_tests::{sample, session::Session};
use graph::topics;
use probecell_msgs::OperatorRequest;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [file, part, recording] = words.as_slice() else {
        panic!("make_part CELL.toml PART FILE.mcap");
    };
    let cell = Cell::read(Path::new(file)).unwrap_or_else(|error| panic!("{error}"));
    let cell = cell.simulated();
    let mut session = Session::new(&cell);
    let request = OperatorRequest {
        subject: part.clone(),
        operator_name: "operator".to_owned(),
        ..OperatorRequest::default()
    };
    session.send(topics::RUN_REQUESTS, &request);
    session.wait_for_report();
    session.run_s(0.1);
    sample::write(&cell, &session.finish(), Path::new(recording));
}
