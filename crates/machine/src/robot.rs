//! The description of a robot as its maker ships it, made that of a cell.
//!
//! A cell knows three links: `foundation`, on which everything stands, `workpiece` and `probe_mount`. Descriptions of robots have
//! none of them. What is added are links without mass behind fixed joints, at the root of the tree and at the end of its arm.

use std::collections::BTreeMap;

use crate::{
    chain::{FOUNDATION, PROBE_MOUNT, WORKPIECE},
    description::ChainError,
    urdf::Robot,
};

/// A description with the links of a cell, and what was added, for a person.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CellDescription {
    /// The URDF text; the given one but for what was added before its end.
    pub text: String,
    /// What was added: one sentence each.
    pub added: Vec<String>,
    /// The link on which the probe hangs.
    pub mount: String,
}

/// Names by which descriptions call the place of a tool, the most precise first (ROS-Industrial; REP 199).
const TOOL_FRAMES: [&str; 3] = ["tool0", "flange", "ee_link"];

/// Adds the links of a cell where a URDF text lacks them. The probe hangs on `mount`; where that is not named, on the link behind the
/// most of the joints in `reported`, the frame of a tool first. A description with a link `probe_mount` keeps it.
///
/// # Errors
/// [`ChainError::Urdf`] where the text is no robot description, [`ChainError::MissingLink`] where it has no link `mount`.
pub fn as_cell(
    text: &str,
    mount: Option<&str>,
    reported: &[String],
) -> Result<CellDescription, ChainError> {
    let robot = Robot::read(text)?;
    let has = |name: &str| robot.links.iter().any(|link| link.name == name);
    let parents: BTreeMap<&str, usize> = (robot.joints.iter().enumerate())
        .map(|(index, joint)| (joint.child.as_str(), index))
        .collect();
    let roots = robot
        .links
        .iter()
        .filter(|link| !parents.contains_key(link.name.as_str()));
    let root = roots.map(|link| link.name.as_str()).next();
    let root = root.ok_or_else(|| ChainError::Urdf("it has no root link".to_owned()))?;
    // Reported joints on the way to a link, and all joints on it.
    let way = |link: &str| {
        let (mut moving, mut all, mut at) = (0, 0, link);
        while let Some(&index) = parents.get(at) {
            let joint = &robot.joints[index];
            moving += usize::from(reported.contains(&joint.name) && !joint.mimics);
            all += 1;
            if all > robot.joints.len() {
                break;
            }
            at = &joint.parent;
        }
        (moving, all)
    };
    let tip = match mount {
        Some(name) if !has(name) => {
            return Err(ChainError::MissingLink(name.to_owned()));
        }
        Some(name) => name,
        None => {
            // Of links behind equally many joints that move the nearest: fingers hang on fixed joints of a flange.
            let links = robot.links.iter().map(|link| link.name.as_str());
            let rank = |link: &str| {
                let is = |name: &&str| link == *name || link.ends_with(&format!("_{name}"));
                let named = TOOL_FRAMES.iter().position(is);
                TOOL_FRAMES.len() - named.unwrap_or(TOOL_FRAMES.len())
            };
            let end = links.max_by_key(|link| {
                let (moving, all) = way(link);
                (moving, rank(link), std::cmp::Reverse(all))
            });
            end.unwrap_or(root)
        }
    };
    let mut added = Vec::new();
    let mut elements: Vec<String> = Vec::new();
    for (link, parent, child, what) in [
        (
            FOUNDATION,
            FOUNDATION,
            root,
            format!("foundation carries {root}"),
        ),
        (
            WORKPIECE,
            FOUNDATION,
            WORKPIECE,
            "workpiece stands on foundation".to_owned(),
        ),
        (
            PROBE_MOUNT,
            tip,
            PROBE_MOUNT,
            format!("probe_mount is at {tip}"),
        ),
    ] {
        if !has(link) {
            elements.push(format!(
                "  <link name=\"{link}\"/>\n  <joint name=\"{link}_of_cell\" type=\"fixed\"><parent link=\"{parent}\"/>\
                 <child link=\"{child}\"/></joint>\n"
            ));
            added.push(what);
        }
    }
    let end = text
        .rfind("</robot>")
        .ok_or_else(|| ChainError::Urdf("it has no end of `robot`".to_owned()))?;
    Ok(CellDescription {
        text: format!("{}{}{}", &text[..end], elements.concat(), &text[end..]),
        added,
        mount: if has(PROBE_MOUNT) {
            PROBE_MOUNT.to_owned()
        } else {
            tip.to_owned()
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Chain;

    const ARM: &str = r#"<robot name="arm"><link name="base"/><link name="upper"/><link name="flange"/><link name="finger"/>
        <joint name="J1" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
        <joint name="J2" type="revolute"><parent link="upper"/><child link="flange"/><axis xyz="0 1 0"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
        <joint name="grip" type="prismatic"><parent link="flange"/><child link="finger"/><axis xyz="0 1 0"/>
        <limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>"#;

    #[test]
    fn an_arm_gets_the_links_of_a_cell_and_its_probe_at_the_flange() {
        let reported = ["J1".to_owned(), "J2".to_owned()];
        let made = as_cell(ARM, None, &reported).expect("a robot");
        assert_eq!(
            made.added,
            [
                "foundation carries base",
                "workpiece stands on foundation",
                "probe_mount is at flange"
            ]
        );
        let chain = Chain::from_urdf(&made.text).expect("a machine");
        assert_eq!(chain.axis_names().collect::<Vec<_>>(), ["J1", "J2"]);
        assert_eq!(
            as_cell(&made.text, None, &reported).expect("a cell").text,
            made.text
        );
        // The frame of a tool is taken before the link that is nearer, and no name that only ends like one.
        let frames = ARM.replace(
            "<joint name=\"grip\"",
            r#"<link name="ee_link"/><link name="arm_tool0"/><link name="mytool0"/>
            <joint name="e" type="fixed"><parent link="flange"/><child link="ee_link"/></joint>
            <joint name="m" type="fixed"><parent link="flange"/><child link="mytool0"/></joint>
            <joint name="t" type="fixed"><parent link="ee_link"/><child link="arm_tool0"/></joint><joint name="grip""#,
        );
        let framed = as_cell(&frames, None, &reported).expect("a robot");
        assert_eq!(framed.mount, "arm_tool0");
        let told = as_cell(ARM, Some("tool"), &reported).expect_err("no such link");
        assert!(told.to_string().contains("no link `tool`"), "{told}");
    }
}
