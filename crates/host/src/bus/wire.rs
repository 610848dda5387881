//! Spells what rmw_zenoh puts on the wire: data keys, liveliness tokens, attachments, global identifiers.
//!
//! Pure functions of text and bytes; no session. Source of the format: rmw_zenoh_cpp of jazzy and kilted
//! (`liveliness_utils`, `attachment_helpers`) and its design document. A token is
//!
//! ```text
//! @ros2_lv/<domain>/<zenoh id>/<node id>/<entity id>/<kind>/<enclave>/<namespace>/<node>[/<name>/<type>/<hash>/<qos>]
//! ```
//!
//! with `/` inside a component written `%`. A data key is `<domain>/<name without outer slashes>/<type>/<hash>`.
//! The identifier (GID) of an endpoint is the XXH3-128 hash of its token, low half first, both halves little endian.
//! What newer distributions append behind the quality of service (buffer backends) is ignored on reading, and
//! never written.

use super::config::Followed;
use super::qos::Qos;
use super::{BusError, TypeId};

/// First component of every liveliness token of ROS 2.
pub(crate) const TOKEN_SPACE: &str = "@ros2_lv";

/// What a token announces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EntityKind {
    /// A node.
    Node,
    /// A publisher of a topic.
    Publisher,
    /// A subscription to a topic.
    Subscription,
    /// A server of a service.
    Server,
    /// A client of a service.
    Client,
}

impl EntityKind {
    fn code(self) -> &'static str {
        match self {
            Self::Node => "NN",
            Self::Publisher => "MP",
            Self::Subscription => "MS",
            Self::Server => "SS",
            Self::Client => "SC",
        }
    }

    fn from_code(code: &str) -> Option<Self> {
        Some(match code {
            "NN" => Self::Node,
            "MP" => Self::Publisher,
            "MS" => Self::Subscription,
            "SS" => Self::Server,
            "SC" => Self::Client,
            _ => return None,
        })
    }
}

/// A node as its token names it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeName {
    /// Security enclave, `/` by default.
    pub enclave: String,
    /// Namespace, `/` for none.
    pub namespace: String,
    /// Name without namespace.
    pub name: String,
}

impl NodeName {
    /// Namespace and name as `ros2 node list` prints them.
    pub fn full(&self) -> String {
        if self.namespace == "/" {
            format!("/{}", self.name)
        } else {
            format!("{}/{}", self.namespace, self.name)
        }
    }

    /// Key expression of the tokens that a session of this node follows.
    pub(crate) fn tokens(&self, domain_id: u32, followed: Followed) -> Option<String> {
        // Session, node, entity, kind (a publisher or a subscription), enclave; then the namespace.
        match followed {
            Followed::Domain => Some(format!("{TOKEN_SPACE}/{domain_id}/**")),
            Followed::Topics => Some(topic_tokens(domain_id)),
            Followed::OwnTopics => Some(topic_tokens_in(domain_id, &self.namespace)),
            Followed::Nothing => None,
        }
    }
}

/// Topic or service of an endpoint.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Channel {
    /// Absolute name with leading slash.
    pub name: String,
    /// Type and its hash.
    pub ty: TypeId,
    /// Offered or wanted quality of service.
    pub qos: Qos,
}

/// One announced entity of the ROS graph.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Entity {
    /// Domain.
    pub domain_id: u32,
    /// Zenoh session, in hexadecimal.
    pub session: String,
    /// Number of the node within its session.
    pub node_number: u32,
    /// Number of the entity within its session; a node carries its own number twice.
    pub entity_number: u32,
    /// What it is.
    pub kind: EntityKind,
    /// Its node.
    pub node: NodeName,
    /// Topic or service; none for a node.
    pub channel: Option<Channel>,
}

impl Entity {
    /// The liveliness token.
    pub fn token(&self) -> String {
        let mut token = format!(
            "{TOKEN_SPACE}/{}/{}/{}/{}/{}/{}/{}/{}",
            self.domain_id,
            self.session,
            self.node_number,
            self.entity_number,
            self.kind.code(),
            mangle(&self.node.enclave),
            mangle(&self.node.namespace),
            mangle(&self.node.name),
        );
        if let Some(channel) = &self.channel {
            for part in [
                mangle(&channel.name).as_str(),
                channel.ty.dds_name(),
                channel.ty.hash(),
                &channel.qos.to_token(),
            ] {
                token.push('/');
                token.push_str(part);
            }
        }
        token
    }

    /// Reads a liveliness token; none when it is not one of ROS 2.
    pub fn from_token(token: &str) -> Option<Self> {
        let mut parts = token.split('/');
        if parts.next()? != TOKEN_SPACE {
            return None;
        }
        let domain_id = parts.next()?.parse().ok()?;
        let session = parts.next()?.to_owned();
        let node_number = parts.next()?.parse().ok()?;
        let entity_number = parts.next()?.parse().ok()?;
        let kind = EntityKind::from_code(parts.next()?)?;
        let node = NodeName {
            enclave: demangle(parts.next()?),
            namespace: demangle(parts.next()?),
            name: demangle(parts.next()?),
        };
        let channel = if kind == EntityKind::Node {
            None
        } else {
            Some(Channel {
                name: demangle(parts.next()?),
                ty: TypeId::new(parts.next()?.to_owned(), parts.next()?.to_owned()),
                qos: Qos::from_token(parts.next()?)?,
            })
        };
        Some(Self {
            domain_id,
            session,
            node_number,
            entity_number,
            kind,
            node,
            channel,
        })
    }

    /// The global identifier that this entity's samples carry.
    pub fn gid(&self) -> Gid {
        gid(&self.token())
    }
}

/// Key expression of the tokens of all publishers and subscriptions of a domain.
pub(crate) fn topic_tokens(domain_id: u32) -> String {
    format!("{TOKEN_SPACE}/{domain_id}/*/*/*/M$*/**")
}

/// The same of the nodes in one namespace, with its first slash.
pub(crate) fn topic_tokens_in(domain_id: u32, namespace: &str) -> String {
    let namespace = mangle(namespace);
    format!("{TOKEN_SPACE}/{domain_id}/*/*/*/M$*/*/{namespace}/**")
}

/// Global identifier of a publisher or client.
pub type Gid = [u8; 16];

/// Global identifier that belongs to a token.
pub(crate) fn gid(token: &str) -> Gid {
    twox_hash::XxHash3_128::oneshot(token.as_bytes()).to_le_bytes()
}

/// Key of a topic's samples or a service's requests.
pub(crate) fn data_key(domain_id: u32, name: &str, ty: &TypeId) -> String {
    format!(
        "{domain_id}/{}/{}/{}",
        name.trim_matches('/'),
        ty.dds_name(),
        ty.hash()
    )
}

/// Sequence number, source time (ns since 1970) and publisher of one sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Attachment {
    pub(crate) sequence: i64,
    pub(crate) source_time_ns: i64,
    pub(crate) gid: Gid,
}

impl Attachment {
    pub(crate) const LEN: usize = 33;

    pub(crate) fn to_bytes(self) -> [u8; Self::LEN] {
        let mut bytes = [0; Self::LEN];
        bytes[..8].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.source_time_ns.to_le_bytes());
        bytes[16] = 16;
        bytes[17..].copy_from_slice(&self.gid);
        bytes
    }

    /// None when the bytes are not rmw's: samples of plain Zenoh programs carry none.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; Self::LEN] = bytes.try_into().ok()?;
        if bytes[16] != 16 {
            return None;
        }
        let number = |at: usize| Some(i64::from_le_bytes(bytes.get(at..at + 8)?.try_into().ok()?));
        Some(Self {
            sequence: number(0)?,
            source_time_ns: number(8)?,
            gid: bytes[17..].try_into().ok()?,
        })
    }
}

fn mangle(text: &str) -> String {
    if text.is_empty() {
        "%".to_owned()
    } else {
        text.replace('/', "%")
    }
}

fn demangle(text: &str) -> String {
    text.replace('%', "/")
}

/// Refuses what ROS 2 refuses: an absolute name has a leading slash, no empty part, and only letters, digits and
/// underscores in its parts.
pub(crate) fn check_name(name: &str) -> Result<(), BusError> {
    let valid = name.strip_prefix('/').is_some_and(|rest| {
        rest.split('/').all(|part| {
            part.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
                && part
                    .chars()
                    .all(|letter| letter.is_ascii_alphanumeric() || letter == '_')
        })
    });
    if valid {
        Ok(())
    } else {
        Err(BusError::Name {
            name: name.to_owned(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn publisher() -> Entity {
        Entity {
            domain_id: 7,
            session: "a1b2c3d4e5f60718293a4b5c6d7e8f90".to_owned(),
            node_number: 0,
            entity_number: 3,
            kind: EntityKind::Publisher,
            node: NodeName {
                enclave: "/".to_owned(),
                namespace: "/cell".to_owned(),
                name: "probe_events".to_owned(),
            },
            channel: Some(Channel {
                name: "/cell/probe_events".to_owned(),
                ty: TypeId::new("probecell_msgs::msg::dds_::ProbeEvent_", "RIHS01_00ff"),
                qos: Qos::events(),
            }),
        }
    }

    #[test]
    fn publisher_token_is_spelled_as_rmw_spells_it() {
        let token = "@ros2_lv/7/a1b2c3d4e5f60718293a4b5c6d7e8f90/0/3/MP/%/%cell/probe_events/\
                     %cell%probe_events/probecell_msgs::msg::dds_::ProbeEvent_/RIHS01_00ff/::2,:,:,:,,";
        assert_eq!(publisher().token(), token);
        assert_eq!(Entity::from_token(token), Some(publisher()));
    }

    #[test]
    fn token_with_a_fourteenth_component_is_understood() {
        let token = format!("{}/backends:cpu", publisher().token());
        assert_eq!(Entity::from_token(&token), Some(publisher()));
    }

    #[test]
    fn foreign_tokens_are_refused() {
        for token in [
            "",
            "@ros2_lv/0",
            "@other/0/a/0/0/NN/%/%/n",
            "@ros2_lv/0/a/0/0/XX/%/%/n",
            "@ros2_lv/0/a/0/1/MP/%/%/n/%t/ty/hash",
        ] {
            assert_eq!(Entity::from_token(token), None, "{token}");
        }
    }

    /// Reference vectors of XXH3-128 (seed 0) from the xxHash project: the empty input.
    #[test]
    fn gid_of_the_empty_token_is_the_published_hash() {
        // XXH128("") = 99aa06d3014798d86001c324468d497f, high half first.
        assert_eq!(
            gid(""),
            [
                0x7f, 0x49, 0x8d, 0x46, 0x24, 0xc3, 0x01, 0x60, 0xd8, 0x98, 0x47, 0x01, 0xd3, 0x06,
                0xaa, 0x99
            ]
        );
    }

    #[test]
    fn attachment_has_the_33_bytes_of_rmw() {
        let attachment = Attachment {
            sequence: 1,
            source_time_ns: 0x0102_0304_0506_0708,
            gid: std::array::from_fn(|i| i as u8),
        };
        let mut expected = vec![1, 0, 0, 0, 0, 0, 0, 0, 8, 7, 6, 5, 4, 3, 2, 1, 16];
        expected.extend(0..16u8);
        assert_eq!(attachment.to_bytes().as_slice(), expected);
        assert_eq!(Attachment::from_bytes(&expected), Some(attachment));
        assert_eq!(Attachment::from_bytes(&expected[1..]), None);
    }

    #[test]
    fn names_follow_the_rules_of_ros() {
        for good in ["/a", "/cell_1/joint_states", "/_hidden"] {
            assert!(check_name(good).is_ok(), "{good}");
        }
        for bad in ["", "a", "/", "/a/", "/a//b", "/1a", "/a*", "/a b", "/a$"] {
            assert!(check_name(bad).is_err(), "{bad}");
        }
    }
}
