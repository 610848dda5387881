//! `probecell-programs`: what goes to controllers that no driver reaches, and what comes back. `probecell program`, `results` and
//! `correct` start it.

mod commands;

use std::process::ExitCode;

use clap::Parser;

use commands::Command;

/// Writes programs for controllers, and reads their results.
#[derive(Parser)]
#[command(version, bin_name = "probecell")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

fn main() -> ExitCode {
    terminal::exit("probecell", Arguments::parse().command.run())
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn every_command_has_examples_and_each_of_them_is_understood() {
        let all = Arguments::command();
        for own in all.get_subcommands() {
            let help = own.get_after_help().expect("examples").to_string();
            let lines = help.lines().flat_map(|line| line.split(" && "));
            // What the core does with a session that was written is its own business.
            let begin = format!("probecell {} ", own.get_name());
            let examples = lines.map(str::trim).filter(|line| line.starts_with(&begin));
            let examples: Vec<&str> = examples.collect();
            assert!(!examples.is_empty(), "{} has no example", own.get_name());
            for example in examples {
                let parsed = Arguments::try_parse_from(example.split(' '));
                assert!(parsed.is_ok(), "{example}");
            }
        }
    }
}
