//! What a robot's settings say that its nodes publish and serve is what its driver subscribes to and calls.

use std::{
    any::Any,
    fs,
    sync::{Arc, Mutex},
    time::Duration,
};

use controllers::{
    driver::{ConnectError, RosBus, RosEndpoints, RosMachine, RosSample, RosService, RosType},
    ros2::RawConfig,
};
use machine::Chain;

/// A bus without a robot that keeps the names it was asked for.
#[derive(Default)]
struct Asked(Mutex<RosEndpoints>);

/// A service that nobody serves.
struct Unserved;

impl RosService for Unserved {
    fn call(&self, _: &[u8], _: Duration, _: Duration) -> Result<Vec<u8>, String> {
        Err("nobody serves it".to_owned())
    }
}

impl RosBus for Asked {
    fn subscribe(
        &self,
        topic: &str,
        _: RosType,
        _: bool,
        _: Box<dyn Fn(RosSample<'_>) + Send + Sync>,
    ) -> Result<Box<dyn Any>, ConnectError> {
        let mut asked = self.0.lock().expect("no panic");
        asked.topics.push(topic.to_owned());
        Ok(Box::new(()))
    }

    fn service(&self, service: &str, _: RosType) -> Result<Arc<dyn RosService>, ConnectError> {
        let mut asked = self.0.lock().expect("no panic");
        asked.services.push(service.to_owned());
        Ok(Arc::new(Unserved))
    }
}

fn sorted(mut endpoints: RosEndpoints) -> RosEndpoints {
    endpoints.topics.sort();
    endpoints.services.sort();
    endpoints
}

#[test]
fn endpoints_are_all_that_a_robot_is_subscribed_and_called_by() {
    let file = "../../launch-scripts/robot_arm.urdf";
    let file = format!("{}/{file}", env!("CARGO_MANIFEST_DIR"));
    let urdf = fs::read_to_string(file).expect("a robot description");
    let chain = Chain::from_urdf(&urdf).expect("an arm");
    let contact =
        r#"{ topic = "/contact", positions = "latched", latched_joint_states = "/latched" }"#;
    let measures = format!("action = \"/arm/follow\"\ncontact = {contact}\n");
    let cuts = r#"
        [program]
        node = "/program"
        stop = "/program/stop"
        operations = [{ id = "bore", service = "/program/bore" }, { id = "mill", service = "/program/mill" }]
        tools = [{ number = 1, parameter = "wear" }]
    "#;
    for (text, services) in [(measures.clone(), 3), (measures + cuts, 8)] {
        let settings: RawConfig = toml::from_str(&text).expect("settings");
        let bus = Asked::default();
        let joined = settings.join("session", chain.clone(), &bus);
        drop(joined.expect("an arm with these axes"));
        let asked = bus.0.into_inner().expect("no panic");
        assert_eq!((asked.topics.len(), asked.services.len()), (3, services));
        assert_eq!(sorted(asked), sorted(settings.endpoints()));
    }
}
