//! An approval is a signature over the exact correction, the session and the instant: whatever else comes is refused with
//! its reason on record, by the gate as by `compensation`, and a replay verifies again.

use cell::Cell;
use cell_tests::{
    cell, factories, recording,
    session::{Session, answer, approved, operator_key, operator_keys, sign},
};
use graph::{
    Published,
    replay::{Verdict as Replayed, replay},
    topics,
};
use probecell_msgs::{
    ControllerCommand, Correction, CorrectionAcknowledgement as Ack, Fault, OperatorReply,
    OperatorRequest, PartReport, from_cdr, to_cdr,
};
use serde_json::Value;
use signatures::SecretKey;

fn asking(more: &str) -> Cell {
    cell("turn_mill.toml", |text| {
        let text = text.replace("automatic_approval = true", "automatic_approval = false");
        format!("{text}\n{more}\n")
    })
}

/// A session whose first measurement has proposed two corrections, which wait.
fn proposed(more: &str) -> (Session, Vec<Correction>) {
    let mut session = Session::new(&asking(more));
    session.ask_for("punch");
    session.run_to(topics::PASS_DECISIONS);
    session.run_s(5.0);
    let corrections: Vec<Correction> = session.all(topics::CORRECTIONS);
    assert_eq!(corrections.len(), 2, "one for each tool");
    (session, corrections)
}

/// Number of wear offsets that were written.
fn written(session: &Session) -> usize {
    let commands: Vec<ControllerCommand> = session.all(topics::CONTROLLER_COMMANDS);
    let wear = |one: &&ControllerCommand| one.kind == ControllerCommand::SET_TOOL_WEAR;
    commands.iter().filter(wear).count()
}

/// What the gate answers to a correction that somebody puts on the bus.
fn put(session: &mut Session, correction: &Correction) -> (u8, String) {
    let before = session
        .all::<Ack>(topics::CORRECTION_ACKNOWLEDGEMENTS)
        .len();
    session.send(topics::CORRECTIONS, correction);
    session.run_s(0.2);
    let answers: Vec<Ack> = session.all(topics::CORRECTION_ACKNOWLEDGEMENTS);
    assert_eq!(answers.len(), before + 1, "each is answered");
    let answer = answers.last().expect("an answer");
    (answer.outcome, answer.text.clone())
}

/// What an operator is told.
fn ask(session: &mut Session, request: &OperatorRequest) -> (bool, String) {
    session.send(topics::APPROVALS, request);
    session.run_s(0.2);
    let reply: OperatorReply = session.last(topics::APPROVAL_REPLIES);
    (reply.accepted, reply.text)
}

#[test]
fn the_word_of_a_correction_about_its_own_approval_counts_for_nothing() {
    let (mut session, corrections) = proposed("");
    let forged = |approval: u8| Correction {
        approval,
        approved_by: "Chief Engineer".to_owned(),
        approved_at: corrections[0].header.stamp,
        lower_bound: -1.0,
        upper_bound: 1.0,
        new_value: 5e-3,
        ..corrections[0].clone()
    };
    for (approval, says) in [
        (
            Correction::APPROVAL_POLICY,
            "the cell file does not approve corrections by policy",
        ),
        (
            Correction::APPROVAL_OPERATOR,
            "the approval of Chief Engineer is not signed",
        ),
    ] {
        let refused = put(&mut session, &forged(approval));
        assert_eq!(refused, (Ack::REFUSED_NOT_APPROVED, says.to_owned()));
    }
    // Signed by a key of the stranger's own.
    let mut signed = forged(Correction::APPROVAL_OPERATOR);
    sign(&mut signed, &SecretKey::from_seed([66; 32]));
    let says = "Chief Engineer is not an operator of this cell: probecell key list prints them";
    assert_eq!(
        put(&mut session, &signed),
        (Ack::REFUSED_NOT_APPROVED, says.to_owned())
    );
    signed.approved_by = "Ada".to_owned();
    sign(&mut signed, &SecretKey::from_seed([66; 32]));
    let says = "the signature of Ada does not match this correction";
    assert_eq!(
        put(&mut session, &signed),
        (Ack::REFUSED_NOT_APPROVED, says.to_owned())
    );
    // The cell's own key, while the policy may not approve.
    let policy = approved(corrections[0].clone(), "policy", session.now());
    assert_eq!(put(&mut session, &policy).0, Ack::REFUSED_NOT_APPROVED);
    assert_eq!(written(&session), 0);
}

/// Each leaf of a JSON value changed, one at a time, with its path.
fn changed(value: &Value) -> Vec<(String, Value)> {
    match value {
        Value::Object(fields) => (fields.iter())
            .flat_map(|(name, inner)| {
                changed(inner).into_iter().map(move |(path, other)| {
                    let mut all = fields.clone();
                    all.insert(name.clone(), other);
                    (format!("{name} {path}"), Value::Object(all))
                })
            })
            .collect(),
        Value::Array(items) => {
            let longer = items.last().map(|last| {
                let mut all = items.clone();
                all.push(last.clone());
                ("longer".to_owned(), Value::Array(all))
            });
            let each = items.iter().enumerate().flat_map(|(index, inner)| {
                changed(inner).into_iter().map(move |(path, other)| {
                    let mut all = items.clone();
                    all[index] = other;
                    (format!("{index} {path}"), Value::Array(all))
                })
            });
            each.chain(longer).collect()
        }
        Value::Bool(flag) => vec![(String::new(), Value::Bool(!flag))],
        Value::String(text) => vec![(String::new(), Value::String(format!("{text}x")))],
        Value::Number(number) => {
            let next = match (number.as_u64(), number.as_i64(), number.as_f64()) {
                (Some(number), ..) if number < 255 => Value::from(number + 1),
                (Some(number), ..) => Value::from(number - 1),
                (_, Some(number), _) => Value::from(number + 1),
                // The next number that a double can hold.
                (_, _, Some(number)) => Value::from(f64::from_bits(number.to_bits() ^ 1)),
                _ => panic!("{number} is no number"),
            };
            vec![(String::new(), next)]
        }
        Value::Null => Vec::new(),
    }
}

#[test]
fn an_approval_holds_for_the_exact_correction_to_the_last_bit() {
    let (mut session, corrections) = proposed("");
    let good = approved(corrections[0].clone(), "Ada", session.now());
    let whole = serde_json::to_value(&good).expect("plain data");
    let mut tried = 0;
    for (path, value) in changed(&whole) {
        // Not signed: when this message was published. To be a replay, or not to claim an approval, is answered otherwise.
        if path.starts_with("header ") || path.starts_with("replayed ") {
            continue;
        }
        let bad: Correction = serde_json::from_value(value).expect("a correction");
        assert_ne!(bad, good, "{path}");
        if bad.approval == Correction::APPROVAL_REJECTED {
            continue;
        }
        let (outcome, text) = put(&mut session, &bad);
        let stale = path.starts_with("approved_at sec") && outcome == Ack::REFUSED_STALE;
        assert!(
            outcome == Ack::REFUSED_NOT_APPROVED || stale,
            "{path}: {outcome}, {text}"
        );
        assert_eq!(written(&session), 0, "{path}");
        tried += 1;
    }
    // 64 bytes of the signature, and every field.
    assert!(tried > 64 + 20, "{tried}");
    // What was changed was sound; and the same approval again writes nothing.
    let (mut session, corrections) = proposed("");
    let good = approved(corrections[0].clone(), "Ada", session.now());
    assert_eq!(put(&mut session, &good).0, Ack::APPLIED);
    assert_eq!(put(&mut session, &good).0, Ack::ALREADY_APPLIED);
    assert_eq!(written(&session), 1);
}

#[test]
fn an_old_approval_and_one_of_another_session_are_refused() {
    let (mut session, corrections) = proposed("");
    let now = session.now();
    let of = |after_s: f64| approved(corrections[0].clone(), "Ada", now.after_s(after_s));
    let old = put(&mut session, &of(-61.0));
    assert_eq!(old.0, Ack::REFUSED_STALE);
    let says = "the approval of Ada was signed 61 s ago";
    assert!(old.1.starts_with(says), "{}", old.1);
    let early = put(&mut session, &of(60.0));
    assert_eq!(early.0, Ack::REFUSED_STALE, "{}", early.1);
    let mut foreign = of(0.0);
    foreign.session = "simulator-0".to_owned();
    sign(&mut foreign, &operator_key("Ada"));
    assert_eq!(put(&mut session, &foreign).0, Ack::REFUSED_STALE);
    assert_eq!(written(&session), 0);
}

#[test]
fn a_withdrawn_key_is_refused_at_once_and_no_older_list_brings_it_back() {
    let (mut session, corrections) = proposed("");
    let eve = answer(&corrections[0], "Eve", true, session.now());
    let says = "the key of Eve was withdrawn".to_owned();
    assert_eq!(ask(&mut session, &eve), (false, says.clone()));
    let eve = approved(corrections[0].clone(), "Eve", session.now());
    assert_eq!(put(&mut session, &eve), (Ack::REFUSED_NOT_APPROVED, says));
    assert_eq!(written(&session), 0);

    let (mut session, corrections) = proposed("");
    // Signed while it was in force.
    let grace = answer(&corrections[0], "Grace", true, session.now());
    session.send(topics::OPERATOR_KEYS, &operator_keys(2, &["Eve", "Grace"]));
    session.send(topics::OPERATOR_KEYS, &operator_keys(1, &[]));
    let mut forged = operator_keys(3, &[]);
    forged.signature[5] ^= 1;
    session.send(topics::OPERATOR_KEYS, &forged);
    session.run_s(0.1);
    let says = "the key of Grace was withdrawn".to_owned();
    assert_eq!(ask(&mut session, &grace), (false, says));
    // The other operator works on.
    let ada = answer(&corrections[0], "Ada", true, session.now());
    assert_eq!(ask(&mut session, &ada), (true, String::new()));
    session.run_s(1.0);
    assert_eq!(written(&session), 1);
}

#[test]
fn an_approval_from_before_a_restart_of_the_gate_is_refused() {
    let cell = asking("");
    let (mut session, corrections) = proposed("");
    let mut before = approved(corrections[0].clone(), "Ada", session.now());
    session.run_s(1.0);
    session.kill("machine_state");
    session.restart(&cell, "machine_state");
    session.run_s(0.5);
    session.send(topics::OPERATOR_KEYS, &operator_keys(2, &[]));
    // With a new header, which is not signed.
    before.header = session.now().header("");
    let refused = put(&mut session, &before);
    assert_eq!(refused.0, Ack::REFUSED_STALE);
    assert!(
        refused.1.contains("before this gate began"),
        "{}",
        refused.1
    );
    assert_eq!(written(&session), 0);
}

/// `ros2 service call /turn_mill/approve_correction ...` of somebody without a key.
fn unsigned(correction: &Correction, approve: bool) -> OperatorRequest {
    OperatorRequest {
        subject: correction.correction_id.clone(),
        operator_name: "Ada".to_owned(),
        approve,
        ..OperatorRequest::default()
    }
}

#[test]
fn a_call_without_a_signature_is_refused_with_the_reason_and_the_proposal_waits_on() {
    let (mut session, corrections) = proposed("");
    let says = "the approval of Ada is not signed".to_owned();
    for approve in [true, false] {
        let request = unsigned(&corrections[0], approve);
        assert_eq!(ask(&mut session, &request), (false, says.clone()));
    }
    // A signature on the approval is none on the rejection, and one on the other correction is none on this.
    let mut other = answer(&corrections[0], "Ada", true, session.now());
    other.approve = false;
    assert!(!ask(&mut session, &other).0);
    other.approve = true;
    other.subject.clone_from(&corrections[1].correction_id);
    assert!(!ask(&mut session, &other).0);
    let old = answer(&corrections[0], "Ada", true, session.now().after_s(-61.0));
    assert!(!ask(&mut session, &old).0);
    assert!(
        session.all::<PartReport>(topics::PART_REPORTS).is_empty(),
        "the part waits"
    );

    let request = answer(&corrections[0], "Grace", true, session.now());
    assert_eq!(ask(&mut session, &request), (true, String::new()));
    let recorded: Correction = session.last(topics::CORRECTIONS);
    assert_eq!(
        (recorded.approved_by, recorded.shown, recorded.signature),
        ("Grace".to_owned(), request.shown, request.signature)
    );
    session.run_s(1.0);
    assert_eq!(written(&session), 1);
}

#[test]
fn a_cell_may_allow_approvals_without_a_signature_and_records_a_warning_of_each() {
    let (mut session, corrections) = proposed("[approvals]\nunsigned_operators = true");
    let request = unsigned(&corrections[0], true);
    assert_eq!(ask(&mut session, &request), (true, String::new()));
    session.run_s(1.0);
    assert_eq!(written(&session), 1);
    let faults: Vec<Fault> = session.all(topics::COMPENSATION_FAULTS);
    let warnings: Vec<_> = faults
        .iter()
        .map(|fault| (fault.severity, fault.code.as_str()))
        .collect();
    assert_eq!(warnings, [(Fault::WARNING, "approval_unsigned")]);
    // A wrong signature is not better than none.
    let mut wrong = answer(&corrections[1], "Ada", true, session.now());
    wrong.signature[0] ^= 1;
    assert!(!ask(&mut session, &wrong).0);
    // Nor does it let anybody speak for the policy.
    let policy = Correction {
        approval: Correction::APPROVAL_POLICY,
        approved_by: "policy of the cell file".to_owned(),
        approved_at: session.now().time(),
        ..corrections[1].clone()
    };
    assert_eq!(put(&mut session, &policy).0, Ack::REFUSED_NOT_APPROVED);
    assert_eq!(written(&session), 1);
}

#[test]
fn a_cell_without_a_key_writes_no_correction() {
    let text = asking("").text().clone();
    let text = cell::CellText {
        cell: text
            .cell
            .replace("automatic_approval = false", "automatic_approval = true"),
        key: String::new(),
        ..text
    };
    let mut session = Session::new(&Cell::from_text(text).expect("a cell"));
    let report = session.make("punch");
    assert_eq!(report.verdict, PartReport::STOPPED);
    let refused: Ack = session.last(topics::CORRECTION_ACKNOWLEDGEMENTS);
    let says = "this cell has no key, so that no approval can be verified";
    assert_eq!(
        (refused.outcome, refused.text.as_str()),
        (Ack::REFUSED_NOT_APPROVED, says)
    );
    assert_eq!(written(&session), 0);
}

/// The cell as a recording knows it: with the public key, and the signatures in place of the private one.
fn of_recording(cell: &Cell, log: &[Published]) -> Cell {
    let corrections = (log.iter())
        .filter(|one| one.topic == topics::CORRECTIONS.name)
        .map(|one| from_cdr(&one.payload).expect("a correction"));
    let read = Cell::from_text(cell.text().clone()).expect("a cell");
    read.with_recorded_approvals(corrections)
}

#[test]
fn a_replay_has_no_private_key_and_verifies_every_signature_again() {
    let cell = cell("turn_mill.toml", str::to_owned);
    let mut session = Session::new(&cell);
    assert_eq!(session.make("punch").verdict, PartReport::QUALIFIED);
    let log = session.finish();
    let nodes = cell.node_names();
    let again = |cell: &Cell, log: &[Published]| {
        replay(&recording(log), &factories(cell, &nodes))
            .expect("a replay")
            .verdict
    };
    assert_eq!(again(&of_recording(&cell, &log), &log), Replayed::Equal);
    // A signature, the key of the cell, or a correction with its signature changed in the recording.
    let changed = |change: &dyn Fn(&mut Correction)| -> Vec<Published> {
        let mut log = log.clone();
        let first = log
            .iter_mut()
            .find(|one| one.topic == topics::CORRECTIONS.name);
        let first = first.expect("a correction");
        let mut correction = from_cdr(&first.payload).expect("a correction");
        change(&mut correction);
        first.payload = to_cdr(&correction);
        log
    };
    let forged = changed(&|one| one.signature[9] ^= 1);
    assert_eq!(
        again(&of_recording(&cell, &forged), &forged),
        Replayed::Different
    );
    let larger = changed(&|one| one.new_value -= 1e-6);
    assert_eq!(
        again(&of_recording(&cell, &larger), &larger),
        Replayed::Different
    );
    let other = of_recording(&cell, &log).with_key(SecretKey::from_seed([8; 32]).public());
    assert_eq!(again(&other, &log), Replayed::Different);
}
