//! Examples of each command, below its `--help` and in its man page.

use clap::Command;

/// Command as typed, and its examples.
const EXAMPLES: &[(&str, &[&str])] = &[
    ("up", &["up", "up my_cell.toml --once"]),
    ("demo", &["demo", "demo --out hall"]),
    ("node", &["node analysis --cell my_cell.toml"]),
    (
        "router",
        &[
            "router",
            "router --listen tcp/192.168.1.10:7447 --strangers write",
        ],
    ),
    (
        "record",
        &["record --cell my_cell.toml --folder recordings/by_hand"],
    ),
    (
        "recording start",
        &["recording start shift_2 --cell my_cell.toml"],
    ),
    ("recording stop", &["recording stop --cell my_cell.toml"]),
    ("run", &["run shaft --count 20 --wait --cell my_cell.toml"]),
    ("orders", &["orders", "orders --json --cell my_cell.toml"]),
    ("orders cancel", &["orders cancel 3 4"]),
    ("orders move", &["orders move 5 --to 1"]),
    ("orders resume", &["orders resume", "orders resume 3"]),
    ("orders hold", &["orders hold"]),
    ("stop", &["stop --operator Ada --cell my_cell.toml"]),
    ("status", &["status", "status --json --cell my_cell.toml"]),
    (
        "measure",
        &[
            "measure --resume",
            "measure --again 3 17 --cell my_cell.toml",
        ],
    ),
    (
        "approve",
        &[
            "approve punch/T1/0 --operator Ada",
            "approve punch/T1/0 --operator Ada --reject",
        ],
    ),
    ("key new", &["key new Ada --cell my_cell.toml"]),
    (
        "key add",
        &[
            "key add Bob d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a --cell my_cell.toml",
        ],
    ),
    ("key list", &["key list --cell my_cell.toml"]),
    ("key revoke", &["key revoke Bob --cell my_cell.toml"]),
    (
        "secure",
        &["secure my_cell.toml", "secure my_cell.toml --off"],
    ),
    ("layouts", &["layouts my_cell.toml --out layouts"]),
    ("play", &["play recordings/turn_mill_1 --namespace /again"]),
    (
        "replay",
        &[
            "replay recordings/turn_mill_1",
            "replay bags/samples/punch.mcap --json",
        ],
    ),
    ("info", &["info recordings/turn_mill_1 --verify"]),
    (
        "recover",
        &["recover recordings/broken recordings/saved --later recordings/next"],
    ),
    (
        "plan",
        &["plan my_cell.toml", "plan bags/samples/punch.mcap --json"],
    ),
    (
        "diagnose",
        &[
            "diagnose bags/samples/ball_check.mcap",
            "diagnose monday tuesday --html both.html",
            "diagnose --fit monday --withhold tuesday --json",
        ],
    ),
    (
        "report",
        &[
            "report recordings/turn_mill_1 --html punch.html",
            "report recordings/turn_mill_1 --json",
        ],
    ),
    (
        "cure",
        &[
            "cure gap.json",
            "cure gap.json --as linuxcnc-ini --current mill.ini --out mill_cured.ini",
            "cure recordings/box_1 --as urdf --member link.EC0A1 --urdf arm.urdf",
        ],
    ),
    (
        "adopt",
        &[
            "adopt gap.json --cell my_cell.toml",
            "adopt --list --cell my_cell.toml",
        ],
    ),
    ("identifiability", &["identifiability my_cell.toml"]),
    (
        "simulate",
        &[
            "simulate --like recordings/session_1",
            "simulate --like recordings/session_1 --html check.html --out recordings/session_1_again",
        ],
    ),
    (
        "conformance",
        &["conformance --cell my_cell.toml --no-motion"],
    ),
    ("doctor", &["doctor my_cell.toml"]),
    (
        "schema",
        &["schema", "schema gap-report > gap-report.schema.json"],
    ),
    #[cfg(feature = "manual")]
    ("completions", &["completions bash"]),
    #[cfg(feature = "manual")]
    ("man", &["man target/man"]),
];

/// The command with the examples below its help texts; a command that brings its own keeps them.
pub(crate) fn with_examples(mut command: Command) -> Command {
    for (path, examples) in EXAMPLES {
        let lines: Vec<String> = examples
            .iter()
            .map(|one| format!("  probecell {one}"))
            .collect();
        let title = if lines.len() == 1 {
            "Example"
        } else {
            "Examples"
        };
        let text = format!("{title}:\n{}", lines.join("\n"));
        command = match path.split_once(' ') {
            None => command.mut_subcommand(path, |sub| sub.after_help(text)),
            Some((group, name)) => command.mut_subcommand(group, |sub| {
                sub.mut_subcommand(name, |sub| sub.after_help(text))
            }),
        };
    }
    command
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::Arguments;

    /// Commands without commands of their own, as typed.
    fn leaves(command: &Command, typed: &str, found: &mut Vec<(String, Command)>) {
        for sub in command
            .get_subcommands()
            .filter(|sub| !sub.is_hide_set() && sub.get_name() != "help")
        {
            let typed = format!("{typed} {}", sub.get_name());
            if sub.has_subcommands() {
                leaves(sub, &typed, found);
            } else {
                found.push((typed.trim().to_owned(), sub.clone()));
            }
        }
    }

    /// Words of a line as a shell takes them; quotes group, a backslash at its end continues it.
    fn words(line: &str) -> Vec<String> {
        let mut words = vec![String::new()];
        let mut quoted = false;
        for letter in line.chars() {
            match letter {
                '"' => quoted = !quoted,
                ' ' if !quoted => words.push(String::new()),
                other => words.last_mut().expect("a word").push(other),
            }
        }
        words.retain(|word| !word.is_empty());
        words
    }

    #[test]
    fn every_command_has_examples_and_each_of_them_is_understood() {
        let command = with_examples(Arguments::command());
        let mut found = Vec::new();
        leaves(&command, "", &mut found);
        assert!(found.len() > 25, "{} commands", found.len());
        for (typed, sub) in found {
            let help = sub
                .get_after_help()
                .map(ToString::to_string)
                .unwrap_or_default();
            assert!(help.contains("Example"), "{typed} has no example");
            let joined = help.replace("\\\n", " ");
            let lines = joined
                .lines()
                .flat_map(|line| line.split(" && "))
                .map(str::trim);
            let examples: Vec<&str> = lines
                .filter(|line| line.starts_with("probecell "))
                .collect();
            assert!(!examples.is_empty(), "{typed} has no example");
            for example in examples {
                let example = example.split(" > ").next().expect("a command");
                let parsed = command.clone().try_get_matches_from(words(example));
                assert!(
                    parsed.is_ok(),
                    "{example}: {}",
                    parsed.expect_err("an error")
                );
            }
        }
    }
}
