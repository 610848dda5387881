//! The bags of other programs that follow the interface contract, decoded with the project's messages.

use bags::{Bag, Session, SessionError};

#[test]
fn every_bag_reads_whole_and_every_message_of_a_known_type_decodes() {
    for path in shared_data::bags("trials/dev")
        .into_iter()
        .chain(shared_data::bags("data/bags"))
    {
        let bag = Bag::open(&path).unwrap();
        assert_eq!(bag.verify(), [], "{}", path.display());
        // Independent count: the reader of the mcap crate.
        let bytes = std::fs::read(&path).unwrap();
        let theirs: Vec<_> = mcap::MessageStream::new(&bytes)
            .unwrap()
            .map(Result::unwrap)
            .collect();
        let mut ours = 0;
        let mut before = 0;
        for message in bag.messages().map(Result::unwrap) {
            assert!(message.log_time >= before);
            before = message.log_time;
            let known = probecell_msgs::by_name(&message.channel.type_name).unwrap_or_else(|| {
                panic!(
                    "{}: unknown type {}",
                    path.display(),
                    message.channel.type_name
                )
            });
            known.describe(&message.payload).unwrap();
            ours += 1;
        }
        assert_eq!(ours, theirs.len(), "{}", path.display());
        assert_eq!(bag.counts().iter().sum::<u64>(), ours as u64);
    }
}

#[test]
fn every_bag_is_a_session() {
    for path in shared_data::bags("trials/dev") {
        let session = Session::read(&Bag::open(&path).unwrap())
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        assert!(
            session.plan.is_some()
                && !session.events.is_empty()
                && !session.joint_states.is_empty()
        );
        let reference = path
            .file_stem()
            .unwrap()
            .to_str()
            .unwrap()
            .ends_with("_ref");
        assert_eq!(
            !session.references.is_empty(),
            reference,
            "{}",
            path.display()
        );
    }
    for path in shared_data::bags("data/bags") {
        let session = Session::read(&Bag::open(&path).unwrap())
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let arm = path
            .file_stem()
            .unwrap()
            .to_str()
            .unwrap()
            .starts_with("ur10");
        assert_eq!(session.plan.is_some(), arm, "{}", path.display());
    }
}

#[test]
fn a_cut_off_bag_is_a_session_with_damage_or_says_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let cut = folder.path().join("cut.mcap");
    for path in shared_data::bags("trials/dev").into_iter().take(3) {
        let bytes = std::fs::read(&path).unwrap();
        let whole = Session::read(&Bag::open(&path).unwrap()).unwrap();
        let mut sessions = 0;
        for part in 0..40 {
            std::fs::write(&cut, &bytes[..bytes.len() * part / 40]).unwrap();
            match Session::read(&Bag::open(&cut).unwrap()) {
                Ok(session) => {
                    sessions += 1;
                    assert!(!session.damage.is_empty());
                    assert_eq!(session.plan, whole.plan);
                    assert_eq!(session.events[..], whole.events[..session.events.len()]);
                }
                Err(SessionError::Damaged { .. }) => {}
                Err(other) => panic!("{part}/40 of {}: {other}", path.display()),
            }
        }
        assert!(sessions > 0, "{}", path.display());
    }
}
