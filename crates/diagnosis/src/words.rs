//! The effects of the vocabulary in the field's words, for people: what the interface contract's table says of each.

/// What an effect is, as a noun phrase; the identifier itself where it is none of the vocabulary.
pub fn of(effect: &str) -> String {
    if let Some((axis, kind)) = effect
        .strip_prefix("axis.")
        .and_then(|rest| rest.rsplit_once('.'))
        && let Some(words) = of_axis(axis, kind)
    {
        return words;
    }
    if let Some(words) = effect.strip_prefix("link.E").and_then(of_link) {
        return words;
    }
    common(effect).unwrap_or(effect).to_owned()
}

fn of_axis(axis: &str, kind: &str) -> Option<String> {
    Some(match kind {
        "scale" => format!("scale of axis {axis}: its true travel is not what it reads"),
        "straightness" => format!("straightness of axis {axis}: it strays sideways as it travels"),
        "angular" => format!("roll, pitch or yaw that grows along axis {axis}"),
        "backlash" => format!("backlash of axis {axis}: lost motion on reversal"),
        "cyclic" => format!("periodic positioning error of axis {axis} (screw or scale)"),
        "lag" => format!(
            "lag of axis {axis}: its reading leads the true position in proportion to speed"
        ),
        "indexing" => format!("indexing error of rotary axis {axis}, harmonic in the angle"),
        "error_motion" => {
            format!("error motion of rotary axis {axis}: radial run-out, harmonic in the angle")
        }
        _ => return None,
    })
}

/// ISO 230-1: position (X, Y, Z) or orientation (A, B, C) error of an axis of rotation or translation.
fn of_link(rest: &str) -> Option<String> {
    let (component, axis) = rest.split_once('0')?;
    let along = match component {
        "X" | "Y" | "Z" => format!("axis {axis} sits off its nominal place along {component}"),
        "A" => format!("axis {axis} is tilted about X (squareness)"),
        "B" => format!("axis {axis} is tilted about Y (squareness)"),
        "C" => format!("axis {axis} is tilted about Z (squareness)"),
        _ => return None,
    };
    Some(along)
}

fn common(effect: &str) -> Option<&'static str> {
    Some(match effect {
        "probe.stylus_offset" => "stylus ball off the spindle axis",
        "probe.stylus_length" => "stylus longer or shorter than declared",
        "probe.ball_radius" => "effective ball radius wrong, constant pretravel included",
        "probe.pretravel_lobing" => {
            "pretravel that varies with the direction of the touch (lobing)"
        }
        "probe.trigger_latency" => "trigger latency: the position is latched late",
        "thermal.spindle_growth" => "thermal growth of the spindle",
        "thermal.part_expansion" => "thermal expansion of the part, uncompensated",
        "thermal.drift" => "slow drift between part and probe",
        "fixture.shift" => "the clamped part sits off its nominal place",
        "fixture.tilt" => "the clamped part is tilted",
        "process.tool_radius" => "radius of the finishing tool wrong: constant material left",
        "process.tool_wear" => "tool wear: material left grows with the length cut",
        "process.tool_runout" => "tool run-out: effective radius varies along the tool",
        "process.deflection" => "deflection of tool or part under the cut",
        "process.slip" => "slip: from some instant on everything is displaced",
        "data.outliers" => "isolated false touches",
        "data.quantisation" => "coarse resolution of the latched positions",
        "time.clock_offset" => "event stamps shifted against axis stamps",
        "drive.viscous_friction" => "viscous friction of the drive",
        "drive.coulomb_friction" => "Coulomb friction of the drive",
        "drive.friction_offset" => "constant offset of the drive's effort",
        "drive.stribeck" => "Stribeck friction of the drive near standstill",
        "drive.inertia" => "inertia of the drive other than declared",
        "drive.gravity" => "gravity load of the drive",
        "drive.compliance" => "compliance of the drive",
        "drive.cogging" => "cogging of the drive, periodic in the position",
        "drive.backlash" => "backlash of the drive",
        "drive.delay" => "delay between effort and motion of the drive",
        "unknown" => "something outside the vocabulary",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const ARM: &str = r#"<robot name="m"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
        <link name="a"/>
        <joint name="fixed" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
        <joint name="X" type="prismatic"><parent link="foundation"/><child link="a"/><axis xyz="1 0 0"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
        <joint name="A1" type="revolute"><parent link="a"/><child link="probe_mount"/><axis xyz="0 0 1"/>
        <limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"#;

    /// No identifier of a machine's vocabulary is left untranslated, and no two share their words.
    #[test]
    fn every_identifier_has_words_of_its_own() {
        let chain = machine::Chain::from_urdf(ARM).expect("a machine");
        let mut known = crate::vocabulary::of(&chain);
        let mut words: Vec<String> = known.iter().map(|effect| of(effect)).collect();
        assert!(
            known
                .iter()
                .zip(&words)
                .all(|(effect, words)| effect != words)
        );
        words.sort_unstable();
        words.dedup();
        known.dedup();
        assert_eq!(words.len(), known.len());
    }

    #[test]
    fn location_errors_are_read_as_iso_230_1_writes_them() {
        assert_eq!(of("link.EX0C"), "axis C sits off its nominal place along X");
        assert_eq!(of("link.EB0A3"), "axis A3 is tilted about Y (squareness)");
        assert_eq!(
            of("axis.A1.scale"),
            "scale of axis A1: its true travel is not what it reads"
        );
        assert_eq!(of("x.thing"), "x.thing");
    }
}
