//! What other implementations check: types, hashes and bytes, as text.
//!
//! `dump_types types` lists `message NAME HASH` and `service NAME HASH`. `dump_types definition NAME` prints a schema.
//! `dump_types echo` reads lines `NAME HEX` of CDR and answers each with a line `HEX` of the message encoded again,
//! or `refused: WHY`; then its leaves, `PATH=VALUE`, and an empty line.

use std::{
    env,
    error::Error,
    fmt::Write as _,
    io::{self, BufRead, Write},
};

use probecell_msgs::{MessageType, all, by_name, services};

fn main() -> Result<(), Box<dyn Error>> {
    let mut out = io::BufWriter::new(io::stdout().lock());
    let arguments: Vec<String> = env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["types"] => {
            for ty in all() {
                writeln!(out, "message {} {}", ty.name, ty.type_hash)?;
            }
            for ty in services() {
                writeln!(out, "service {} {}", ty.name, ty.type_hash)?;
            }
        }
        ["definition", name] => write!(out, "{}", known(name)?.definition)?,
        ["echo"] => {
            for line in io::stdin().lock().lines() {
                let line = line?;
                let (name, hex) = line.split_once(' ').ok_or("a line is NAME HEX")?;
                echo(&mut out, known(name)?, &bytes(hex)?)?;
            }
        }
        _ => return Err("usage: dump_types types | definition NAME | echo".into()),
    }
    Ok(out.flush()?)
}

fn echo(out: &mut impl Write, ty: &MessageType, cdr: &[u8]) -> Result<(), Box<dyn Error>> {
    match (ty.canonical(cdr), ty.describe(cdr)) {
        (Ok(again), Ok(value)) => {
            writeln!(out, "{}", hex(&again))?;
            for (path, leaf) in value.leaves() {
                writeln!(out, "{path}={leaf}")?;
            }
        }
        (Err(error), _) | (_, Err(error)) => writeln!(out, "refused: {error}")?,
    }
    Ok(writeln!(out)?)
}

fn known(name: &str) -> Result<&'static MessageType, String> {
    by_name(name).ok_or_else(|| format!("no message type {name}"))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").expect("a string takes any text");
        text
    })
}

fn bytes(hex: &str) -> Result<Vec<u8>, String> {
    let digits: Option<Vec<u8>> = hex
        .chars()
        .map(|digit| digit.to_digit(16).map(|digit| digit as u8))
        .collect();
    match digits {
        Some(digits) if digits.len() % 2 == 0 => Ok(digits
            .chunks(2)
            .map(|pair| pair[0] << 4 | pair[1])
            .collect()),
        _ => Err(format!("not hexadecimal: {hex}")),
    }
}
