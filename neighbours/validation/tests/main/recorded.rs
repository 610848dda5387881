//! A scenario that was written as a recording.

use session_io::write::write;
use validation::scenarios::{Recorded, register};

/// What is read back from the recording of a scenario is what the scenario gave.
#[test]
fn a_recorded_session_comes_back_whole() {
    let scenario = register().iter().find(|one| one.name == "A-probe-offset");
    let sessions = scenario.and_then(|one| one.sessions).expect("its sessions");
    let recorded: Vec<Recorded> = sessions(1).expect("a run");
    let folder = tempfile::tempdir().expect("a folder");
    for Recorded { name, session, .. } in &recorded {
        let to = folder.path().join(name);
        write(&to, "scenario", session).expect("a recording");
        let bag = bags::Bag::open(&to).expect("a bag");
        let read = bags::Session::read(&bag).expect("a session");
        assert!(read.damage.is_empty());
        assert_eq!(read.robot_description, session.robot_description);
        assert_eq!(read.plan, session.plan);
        let same = |read: usize, given: usize| assert!(given > 0 && read == given);
        same(read.events.len(), session.events.len());
        same(read.joint_states.len(), session.joint_states.len());
        same(read.machine_states.len(), session.machine_states.len());
        same(read.references.len(), session.references.len());
        let events = read.events.iter().map(|stamped| &stamped.message);
        assert!(events.eq(&session.events));
        assert!(
            write(&to, "scenario", session).is_err(),
            "never over another"
        );
    }
}
