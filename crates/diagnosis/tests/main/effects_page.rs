//! The reference page of all effects, `docs/effects.md`: written from the registry and from the heads of the effects' files, so that it
//! cannot go stale. After a change `UPDATE_EXPECT=1 cargo test --release -p diagnosis --test main effects_page` writes it again.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use diagnosis::in_display_units;
use effects::effect::{Constants, Instance, Subject};
use effects::{Effect, Parameter, Variant, drive, motion, record, registry, touch};
use expect_test::expect_file;
use machine::Chain;

/// A linear and a rotary axis.
const MACHINE: &str = r#"<robot name="machine"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
  <joint name="C" type="revolute"><parent link="foundation"/><child link="workpiece"/><axis xyz="0 0 1"/>
    <limit lower="-6.3" upper="6.3" effort="1" velocity="1"/></joint>
  <joint name="X" type="prismatic"><parent link="foundation"/><child link="probe_mount"/><axis xyz="1 0 0"/>
    <limit lower="-0.5" upper="0.5" effort="1" velocity="1"/></joint></robot>"#;

/// What stands before the tables.
const HEAD: &str = "\
# Effects

Every cause that a [gap report](howto/read-a-gap-report.md) can name. This page is written from the registry of effects and from the
heads of their files in `crates/effects/src`, and a test compares it with them; `UPDATE_EXPECT=1 cargo test --release -p diagnosis --test
main effects_page` writes it again ([how to add an effect](howto/add-an-effect.md)).

In an identifier `<A>` stands for the name of an axis and `<c>` for one of X, Y, Z, A, B, C: `axis.X.scale`, `link.EC0B`.

A size after ≤ is the largest one that is usually met, in the units of a report: the width of the prior in the diagnosis of touches. A larger
one is possible, but improbable, and is found all the same. After *with* stand the other numbers of a report: a phase (shown in degrees), a constant such as a period or a time constant, or which variant of
the effect it is. Numbers in JSON are in SI units; here a unit stands in brackets where no size is given.

How each effect acts is told in these letters: d is the deviation of a touch along the outward normal n of the surface, positive where
material is left; p the touched point in the frame of the part; q the position of an axis, δq its error, q̇ and v speeds, a an acceleration; t the time
since the first touch; e a displacement; R(mount) the orientation of the probe; f an effort. A typical size is of machines, probes and parts in good order.
";

/// A machine, one of its axes, and what such an axis is called.
struct Case<'a> {
    label: &'static str,
    chain: &'a Chain,
    of: Instance<'a>,
}

/// Every kind of machine and axis on which an effect may differ.
struct Machines {
    tool: Chain,
    arm: Chain,
    /// Without masses.
    light: Chain,
}

impl Machines {
    fn new() -> Self {
        let chain = |urdf: &str| Chain::from_urdf(urdf).expect("a machine");
        Self {
            tool: chain(MACHINE),
            arm: chain(&arm(
                r#"<inertial><mass value="10"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>"#,
            )),
            light: chain(&arm("")),
        }
    }

    fn cases(&self, pattern: &str) -> Vec<Case<'_>> {
        let case = |label, chain, axis, component| Case {
            label,
            chain,
            of: Instance { axis, component },
        };
        if pattern.contains("<c>") {
            vec![
                case("X, Y, Z", &self.tool, "C", Some('X')),
                case("A, B, C", &self.tool, "C", Some('A')),
            ]
        } else if pattern.contains("<A>") {
            vec![
                case("linear axis", &self.tool, "X", None),
                case("rotary axis", &self.tool, "C", None),
                case("joint of an arm", &self.arm, "A2", None),
            ]
        } else {
            vec![
                case("machine tool", &self.tool, "", None),
                case("arm with masses", &self.arm, "", None),
                case("arm without masses", &self.light, "", None),
            ]
        }
    }
}

/// An arm of six joints, each link of which holds `inertial`.
fn arm(inertial: &str) -> String {
    let mut text = String::from(
        r#"<robot name="arm"><link name="foundation"/><link name="workpiece"/>
        <joint name="table" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>"#,
    );
    let mut parent = "foundation".to_owned();
    for (number, axis) in (1..).zip(["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0"]) {
        let child = if number == 6 {
            "probe_mount".to_owned()
        } else {
            format!("link_{number}")
        };
        write!(
            text,
            r#"<link name="{child}">{inertial}</link><joint name="A{number}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
            <origin xyz="0.1 0 0.3"/><axis xyz="{axis}"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>"#
        )
        .unwrap();
        parent = child;
    }
    text + "</robot>"
}

/// The variants that a cell may declare: without temperatures, and with one that is called `<sensor>`.
fn variants(effect: &dyn Effect, case: &Case<'_>) -> Vec<Variant> {
    let sensors = ["g_<sensor>", "x_<sensor>", "y_<sensor>", "z_<sensor>"];
    let value = |name: &str| match name {
        "targets" => Some(3.0),
        "e1" | "e2" | "e3" => Some(0.0),
        _ => None,
    };
    let declared = |names: &[&str]| {
        effect.declared(
            case.chain,
            &case.of,
            &Constants {
                value: &value,
                names,
            },
        )
    };
    let mut all = declared(&[]);
    all.extend(declared(&sensors));
    all
}

/// What a report may state of an effect: names with sizes, and names with units.
#[derive(Default)]
struct Quantities {
    sized: Vec<(String, String)>,
    others: Vec<String>,
}

impl Quantities {
    fn of(effect: &dyn Effect, case: &Case<'_>) -> Self {
        let mut found = Self::default();
        // Drives and times are fitted without a prior of sizes.
        let subject = effect.acts_on().subject;
        let without_sizes = matches!(subject, Subject::Drive | Subject::Motion);
        if effect.undeclarable().is_some() {
            for one in effect.parameters(case.chain, &case.of) {
                if without_sizes {
                    found.other(&one.name, one.unit);
                } else {
                    found.sized(&one.name, &one);
                }
            }
            return found;
        }
        for variant in variants(effect, case) {
            let waves = variant.form.waves();
            if waves.is_empty() {
                for one in &variant.parameters {
                    found.sized(&one.name, one);
                }
            }
            for wave in waves {
                found.sized(wave.amplitude, &variant.parameters[wave.first]);
                found.other(wave.phase, "rad");
            }
            let shape = variant.shape.iter().map(|shape| (shape.name, shape.unit));
            let constants = variant
                .constants
                .iter()
                .map(|&(name, _, unit)| (name, unit));
            for (name, unit) in shape.chain(constants) {
                found.other(name, unit);
            }
        }
        found
    }

    fn sized(&mut self, name: &str, one: &Parameter) {
        // The number of a touch is no size.
        if one.unit == "1" {
            self.other(name, one.unit);
            return;
        }
        let shown = in_display_units(name, one.plausible, one.unit, None);
        let (_, size) = shown.split_once(" = ").unwrap();
        let entry = (name.to_owned(), size.to_owned());
        if !self.sized.contains(&entry) {
            self.sized.push(entry);
        }
    }

    fn other(&mut self, name: &str, unit: &str) {
        let entry = match unit {
            "1" => format!("`{name}`"),
            unit => format!("`{name}` ({unit})"),
        };
        if !self.others.contains(&entry) {
            self.others.push(entry);
        }
    }

    /// In words; empty where the effect does not act there.
    fn text(&self) -> String {
        let mut groups: Vec<(Vec<String>, &str)> = Vec::new();
        for (name, size) in &self.sized {
            let name = format!("`{name}`");
            match groups.last_mut() {
                Some((names, of)) if *of == size.as_str() => names.push(name),
                _ => groups.push((vec![name], size.as_str())),
            }
        }
        let sized: Vec<String> = groups
            .iter()
            .map(|(names, size)| format!("{} ≤ {size}", names.join(", ")))
            .collect();
        let others = self.others.join(", ");
        match (sized.is_empty(), others.is_empty()) {
            (true, _) => others,
            (false, true) => sized.join(", "),
            (false, false) => format!("{}; with {others}", sized.join(", ")),
        }
    }
}

/// The quantities of an effect, by kind of axis where they differ.
fn quantities(machines: &Machines, effect: &dyn Effect) -> String {
    let cases = machines.cases(effect.id());
    let mut texts: Vec<(Vec<&str>, String)> = Vec::new();
    for case in &cases {
        let text = Quantities::of(effect, case).text();
        match texts.iter_mut().find(|(_, known)| *known == text) {
            Some((labels, _)) => labels.push(case.label),
            None => texts.push((vec![case.label], text)),
        }
    }
    texts.retain(|(_, text)| !text.is_empty());
    assert!(!texts.is_empty(), "{} has no quantity", effect.id());
    if let [(labels, text)] = &texts[..]
        && labels.len() == cases.len()
    {
        return text.clone();
    }
    let labelled = texts
        .iter()
        .map(|(labels, text)| format!("{}: {text}", labels.join(", ")));
    labelled.collect::<Vec<_>>().join("<br>")
}

/// What the head of each effect's file in a folder says after its identifier.
fn heads(family: &str) -> BTreeMap<String, String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../effects/src")
        .join(family);
    let mut heads = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let text = std::fs::read_to_string(entry.unwrap().path()).unwrap();
        let head = text.lines().map_while(|line| line.strip_prefix("//!"));
        let words: Vec<&str> = head.flat_map(str::split_whitespace).collect();
        let head = words.join(" ");
        if let Some((id, acts)) = head
            .strip_prefix('`')
            .and_then(|rest| rest.split_once("`: "))
        {
            assert!(
                !acts.contains("[`"),
                "{id}: a link within the code means nothing to a reader of the page"
            );
            heads.insert(id.to_owned(), acts.to_owned());
        }
    }
    heads
}

/// A family: a table, and how each of its effects acts.
fn section(
    page: &mut String,
    machines: &Machines,
    family: &str,
    title: &str,
    all: &mut [&dyn Effect],
) {
    all.sort_by_key(|effect| effect.id());
    writeln!(
        page,
        "\n## {title}\n\n| identifier | what it is | in the report | remedy |\n|---|---|---|---|"
    )
    .unwrap();
    for effect in &*all {
        let definition = effect.definition();
        let name = definition.name.replace("<A>", "*A*");
        let quantities = quantities(machines, *effect);
        let (id, remedy) = (definition.id, definition.remedy);
        writeln!(page, "| `{id}` | {name} | {quantities} | {remedy} |").unwrap();
    }
    let heads = heads(family);
    page.push('\n');
    for effect in &*all {
        let id = effect.id();
        let acts = heads.get(id).unwrap_or_else(|| {
            panic!("no file of crates/effects/src/{family} begins with `{id}`: and how it acts")
        });
        writeln!(page, "- `{id}`: {acts}").unwrap();
    }
}

#[test]
fn the_page_of_the_effects_is_that_of_the_registry() {
    let machines = Machines::new();
    let mut page = HEAD.to_owned();
    let of_moves = motion::ALL.iter().map(|&effect| effect as &dyn Effect);
    let mut families = [
        ("touch", "Touches", touch::ALL.to_vec()),
        ("drive", "Drives", drive::ALL.to_vec()),
        ("motion", "Time of moves", of_moves.collect()),
        ("record", "Records", record::ALL.to_vec()),
    ];
    let listed: usize = families.iter().map(|(.., all)| all.len()).sum();
    assert_eq!(listed, registry::all().count(), "a family is missing");
    for (family, title, all) in &mut families {
        section(&mut page, &machines, family, title, all);
    }
    expect_file![concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../docs/effects.md"
    )]
    .assert_eq(&page);
}
