//! Names of message and service types, as they stand on the wire.

use std::borrow::Cow;

use probecell_msgs::{MessageType, ServiceType};

/// A message type: its name in DDS spelling (`pkg::msg::dds_::Type_`) and its hash (`RIHS01_` and 64 digits).
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TypeId {
    dds_name: Cow<'static, str>,
    hash: Cow<'static, str>,
}

/// A service type: `pkg::srv::dds_::Type_` and the hash of the service.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ServiceId(pub(crate) TypeId);

impl TypeId {
    /// Takes the DDS name and the hash as they are.
    pub fn new(dds_name: impl Into<Cow<'static, str>>, hash: impl Into<Cow<'static, str>>) -> Self {
        Self {
            dds_name: dds_name.into(),
            hash: hash.into(),
        }
    }

    /// `pkg::msg::dds_::Type_`.
    pub fn dds_name(&self) -> &str {
        &self.dds_name
    }

    /// `RIHS01_…`.
    pub fn hash(&self) -> &str {
        &self.hash
    }

    /// `pkg/msg/Type`, as `ros2 topic type` prints it; the DDS name where it is none of ROS.
    pub fn ros_name(&self) -> String {
        self.parts().map_or_else(
            || self.dds_name.clone().into_owned(),
            |(package, kind, name)| format!("{package}/{kind}/{name}"),
        )
    }

    /// Package, `msg` or `srv`, and name.
    pub(crate) fn parts(&self) -> Option<(&str, &str, &str)> {
        let (package, rest) = self.dds_name.split_once("::")?;
        let (kind, rest) = rest.split_once("::dds_::")?;
        Some((package, kind, rest.strip_suffix('_')?))
    }
}

impl ServiceId {
    /// Takes the DDS name and the hash as they are.
    pub fn new(dds_name: impl Into<Cow<'static, str>>, hash: impl Into<Cow<'static, str>>) -> Self {
        Self(TypeId::new(dds_name, hash))
    }
}

impl From<&MessageType> for TypeId {
    fn from(ty: &MessageType) -> Self {
        Self::new(ty.dds_name, ty.type_hash)
    }
}

impl From<&ServiceType> for ServiceId {
    fn from(ty: &ServiceType) -> Self {
        Self::new(ty.dds_name, ty.type_hash)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dds_names_are_read_as_ros_names() {
        let ty = TypeId::new("std_msgs::msg::dds_::String_", "RIHS01_0");
        assert_eq!(ty.ros_name(), "std_msgs/msg/String");
        assert_eq!(TypeId::new("other", "").ros_name(), "other");
    }
}
