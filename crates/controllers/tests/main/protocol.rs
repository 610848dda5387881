//! The parser of the remote shell against lines recorded from LinuxCNC 2.9, and against garbage.

use controllers::{
    linuxcnc::{
        log,
        protocol::{self, Get, Interpreter, Mode, Reply, RequestError, Set},
        tool_table,
    },
    text::{Lines, Words},
};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// A session as the server of LinuxCNC 2.9.0 sent it, with its line ends.
const RECORDED: &[u8] = b"HELLO ACK EMCNETSVR 1.1\r\nset echo off\r\nSET VERBOSE ACK\n\rSET ENABLE ACK\n\r\
SET ESTOP ACK\n\rSET MACHINE ACK\n\rESTOP OFF\r\nMACHINE ON\r\nMODE MDI\r\n\
ABS_CMD_POS 0.000000 -1.500000 19.537500 0.000000 0.000000 0.000000\r\n\
JOINT_POS 0.000000 -1.500000 19.536500 0.000000 0.000000 0.000000\r\n\
PROGRAM NONE\r\nPROGRAM_LINE 18\r\nPROGRAM_STATUS RUNNING\r\nERROR Probe tripped during non-probe move.\r\n\
TOOL 2\r\nPROBE_VALUE 1\r\nFEED_OVERRIDE 100\r\nSPINDLE 0 OFF\r\nGET FOO NAK\r\n\r\nSET FOO NAK\n\r\
PROGRAM_CODES G0 G17 G40 G21 G90 G94 G54 G49 G99 G61 G97 G91.1 G8 G92.2 F3000 S1200\r\n\
JOINT_HOMED YES YES NO NO NO NO\r\nERROR OK\r\n";

fn recorded() -> Vec<(u64, String)> {
    let mut lines = Lines::default();
    lines.push(RECORDED).expect("recorded text");
    std::iter::from_fn(|| lines.next_line()).collect()
}

/// Reads the recorded answer to `get`.
fn answer<T>(get: Get, read: impl Fn(Words) -> T) -> T {
    let lines = recorded();
    let begins = |text: &str| text.split_whitespace().next() == Some(get.subject());
    let (line, text) = lines
        .iter()
        .find(|(_, text)| begins(text))
        .expect("recorded");
    read(protocol::value(get, *line, text).expect("an answer to this request"))
}

#[test]
fn recorded_answers_are_understood() {
    let commanded = answer(Get::CommandedPosition, protocol::positions).unwrap();
    assert_eq!(commanded, [0.0, -1.5, 19.5375, 0.0, 0.0, 0.0]);
    assert_eq!(
        answer(Get::JointPositions, protocol::positions).unwrap()[2],
        19.5365
    );
    assert!(!answer(Get::EmergencyStop, protocol::on_or_off).unwrap());
    assert!(answer(Get::Machine, protocol::on_or_off).unwrap());
    assert_eq!(answer(Get::Mode, protocol::mode).unwrap(), Mode::Mdi);
    assert_eq!(
        answer(Get::ProgramStatus, protocol::interpreter).unwrap(),
        Interpreter::Running
    );
    assert_eq!(answer(Get::ProgramLine, protocol::count).unwrap(), 18);
    assert_eq!(answer(Get::Program, protocol::text), None);
    assert_eq!(
        answer(Get::Error, protocol::text).unwrap(),
        "Probe tripped during non-probe move."
    );
    assert_eq!(
        answer(Get::Spindle, protocol::spindle_direction).unwrap(),
        0.0
    );
    assert_eq!(
        answer(Get::ProgramCodes, protocol::programmed_speed).unwrap(),
        1200.0
    );
    assert_eq!(
        answer(Get::JointHomed, protocol::homed).unwrap(),
        [true, true, false, false, false, false]
    );
}

#[test]
fn acknowledgements_and_refusals_are_told_apart() {
    let replies: Vec<_> = recorded()
        .iter()
        .map(|(line, text)| protocol::parse(*line, text))
        .collect();
    assert_eq!(
        replies[0],
        Ok(Reply::Welcome {
            server: "EMCNETSVR 1.1".to_owned()
        })
    );
    let echo = replies[1].as_ref().unwrap_err();
    assert_eq!(
        (echo.line, echo.column),
        (2, 1),
        "an echoed request is no reply"
    );
    assert_eq!(replies[2], Ok(Reply::Accepted("VERBOSE".to_owned())));
    assert!(replies.contains(&Ok(Reply::Refused(Some("FOO".to_owned())))));
    assert_eq!(
        protocol::parse(1, "HELLO NAK"),
        Ok(Reply::Refused(Some("HELLO".to_owned())))
    );
    assert_eq!(protocol::parse(1, "SET NAK"), Ok(Reply::Refused(None)));
}

#[test]
fn a_wrong_reply_is_told_once_with_line_and_column() {
    let words = |text: &'static str| protocol::value(Get::JointPositions, 9, text);
    let error = protocol::positions(words("JOINT_POS 1 2 3 nan 5 6").unwrap()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "line 9, column 17: expected a finite number, found \"nan\""
    );
    let error = protocol::positions(words("JOINT_POS 1 2 3").unwrap()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "line 9, column 16: expected a finite number, found the end of the line"
    );
    let error = protocol::positions(words("JOINT_POS 1 2 3 4 5 6 7").unwrap()).unwrap_err();
    assert_eq!(
        (error.column, error.expected.as_str()),
        (23, "the end of the line")
    );
    assert_eq!(words("ABS_CMD_POS 1").unwrap_err().column, 1);
}

#[test]
fn requests_that_would_harm_the_server_are_not_made() {
    let long = Set::Mdi("X".repeat(300)).encode();
    assert!(matches!(long, Err(RequestError::TooLong(308))), "{long:?}");
    let two = Set::Open("/a.ngc\nset abort".to_owned()).encode();
    assert!(
        matches!(two, Err(RequestError::ControlCharacter(_))),
        "{two:?}"
    );
    assert_eq!(Set::HomeAll.encode().unwrap(), "set home -1");
    assert_eq!(
        Get::Spindle.encode(),
        "get spindle 0",
        "without a number the server ends"
    );
}

#[test]
fn logs_and_tool_tables_are_read_to_the_letter() {
    let touch = log::parse(4, "touch 2 17  1.500000 -22.000250 -5.000000", 3).unwrap();
    let position = vec![1.5, -22.00025, -5.0];
    assert_eq!(
        touch,
        log::Entry::Probed {
            number: 2,
            point_index: 17,
            fate: log::Fate::Touch,
            position
        }
    );
    let error = log::parse(4, "touch 2 17  1.500000 -22.000250", 3).unwrap_err();
    assert_eq!((error.line, error.column), (4, 32));
    let table =
        "T1   P1   D+6.000000 Z+10.000000 ;probe\n\nT2   P2   Z+49.999750 D+9.940000 ;endmill T9\n";
    let tools = tool_table::parse(table).unwrap();
    assert_eq!(
        tools.iter().map(|tool| tool.number).collect::<Vec<_>>(),
        [1, 2]
    );
    assert!((tools[1].diameter - 9.94e-3).abs() < 1e-15);
    let error = tool_table::parse("T1 P1 D6\nP2 Dx\n").unwrap_err();
    assert_eq!((error.line, error.column), (2, 4));
}

/// Two hundred thousand damaged inputs: each gives a value or one error that points into the input, and none panics.
#[test]
fn garbage_never_panics_and_errors_point_into_it() {
    let mut random = Pcg64::seed_from_u64(20_261_121);
    let seeds: Vec<Vec<u8>> = RECORDED
        .split_inclusive(|&byte| byte == b'\n')
        .map(<[u8]>::to_vec)
        .collect();
    let table =
        b"T1 P1 D+6.000000 Z+10.000000 ;probe\ntouch 1 2 3.0 4.0 5.0\noffset 1\nbegin a 3 0\n"
            .to_vec();
    let mut parsed = 0;
    for _ in 0..200_000 {
        let mut bytes = if random.random_bool(0.2) {
            table.clone()
        } else {
            seeds[random.random_range(0..seeds.len())].clone()
        };
        for _ in 0..random.random_range(0..4) {
            let at = random.random_range(0..bytes.len());
            match random.random_range(0..4) {
                0 => bytes[at] = random.random(),
                1 => bytes.insert(at, random.random()),
                2 => bytes.truncate(at.max(1)),
                _ => bytes[at] = b" \t\r\n-+.eN#"[random.random_range(0..10)],
            }
        }
        let mut lines = Lines::default();
        if let Err(error) = lines.push(&bytes) {
            assert!(error.line >= 1 && error.column >= 1);
        }
        while let Some((line, text)) = lines.next_line() {
            let mut errors = vec![
                protocol::parse(line, &text).err(),
                log::parse(line, &text, 3).err(),
            ];
            errors.push(tool_table::parse(&text).err());
            for get in [
                Get::JointPositions,
                Get::Mode,
                Get::Spindle,
                Get::ProgramCodes,
                Get::JointHomed,
            ] {
                if let Ok(words) = protocol::value(get, line, &text) {
                    errors.push(protocol::positions(words.clone()).err());
                    errors.push(protocol::mode(words.clone()).err());
                    errors.push(protocol::spindle_direction(words.clone()).err());
                    errors.push(protocol::programmed_speed(words.clone()).err());
                    errors.push(protocol::homed(words).err());
                }
            }
            for error in errors.into_iter().flatten() {
                assert!(
                    error.column >= 1 && error.column <= text.chars().count() + 1,
                    "{error} in {text:?}"
                );
                parsed += 1;
            }
        }
    }
    assert!(parsed > 100_000, "the damage was too small to try anything");
}
