//! Any bytes as what LinuxCNC sends: replies of its remote shell, the log of a program, its tool table.
//!
//! Where the bytes are cut on their way does not matter, and no number that is not finite gets through.

use controllers::{
    linuxcnc::{
        log::{self, Entry},
        protocol::{self, Get},
        tool_table,
    },
    text::Lines,
};

const GETS: [Get; 15] = [
    Get::JointPositions,
    Get::CommandedPosition,
    Get::EmergencyStop,
    Get::Machine,
    Get::Mode,
    Get::ProgramStatus,
    Get::ProgramLine,
    Get::Program,
    Get::ProgramCodes,
    Get::Tool,
    Get::FeedOverride,
    Get::Spindle,
    Get::ProbeValue,
    Get::JointHomed,
    Get::Error,
];

/// Reads the bytes in each way that there is.
pub fn target(data: &[u8]) {
    let whole = lines(&[data]);
    let (first, second) = data.split_at(data.len() / 2);
    assert_eq!(
        whole,
        lines(&[first, second]),
        "lines depend on where the stream is cut"
    );
    for (number, text) in whole.iter().flatten() {
        assert!(!text.contains('\n'));
        reply(*number, text);
        for axes in [1, 6] {
            if let Ok(Entry::Probed { position, .. }) = log::parse(*number, text, axes) {
                assert!(position.len() == axes && position.iter().all(|value| value.is_finite()));
            }
        }
    }
    if let Ok(text) = std::str::from_utf8(data)
        && let Ok(tools) = tool_table::parse(text)
    {
        assert!(tools.iter().all(|tool| tool.diameter.is_finite()));
    }
}

fn lines(pieces: &[&[u8]]) -> Option<Vec<(u64, String)>> {
    let mut lines = Lines::default();
    for piece in pieces {
        lines.push(piece).ok()?;
    }
    Some(std::iter::from_fn(|| lines.next_line()).collect())
}

fn reply(number: u64, text: &str) {
    if let Err(error) = protocol::parse(number, text) {
        assert!(
            error.line == number && error.column <= text.chars().count() + 1,
            "{error} in {text:?}"
        );
    }
    for get in GETS {
        let Ok(words) = protocol::value(get, number, text) else {
            continue;
        };
        if let Ok(positions) = protocol::positions(words.clone()) {
            assert!(positions.iter().all(|value| value.is_finite()));
        }
        if let Ok(speed) = protocol::programmed_speed(words.clone()) {
            assert!(speed.is_finite());
        }
        if let Ok(sign) = protocol::spindle_direction(words.clone()) {
            assert!([-1.0, 0.0, 1.0].contains(&sign));
        }
        let refused = [
            protocol::on_or_off(words.clone()).err(),
            protocol::mode(words.clone()).err(),
            protocol::interpreter(words.clone()).err(),
            protocol::count(words.clone()).err(),
            protocol::homed(words.clone()).err(),
        ];
        for error in refused.into_iter().flatten() {
            assert!(
                error.column <= text.chars().count() + 1,
                "{error} in {text:?}"
            );
        }
        assert_ne!(protocol::text(words).as_deref(), Some(""));
    }
}

/// What a server, a program and a tool table say.
pub fn seeds() -> Vec<Vec<u8>> {
    [
        "HELLO ACK EMCNETSVR 1.1\r\nSET VERBOSE ACK\n\rSET ENABLE ACK\n\rESTOP OFF\r\nMACHINE ON\r\nMODE MDI\r\n",
        "ABS_CMD_POS 0.000000 -1.500000 19.537500 0.000000 0.000000 0.000000\r\nPROGRAM_LINE 18\r\n",
        "JOINT_POS 0.0 -1.5 19.5 0.0 0.0 0.0\r\nPROGRAM NONE\r\nPROGRAM_STATUS RUNNING\r\nERROR OK\r\nTOOL 2\r\n",
        "PROGRAM_CODES G0 G17 G40 G21 G90 F3000 S1200\r\nJOINT_HOMED YES YES NO NO NO NO\r\nGET FOO NAK\r\n\r\n",
        "SPINDLE 0 FORWARD\r\nPROBE_VALUE 1\r\nFEED_OVERRIDE 100\r\nSET FOO NAK\n\rSET NAK\n\r",
        "begin token 2 0\nnext 1 0\ntouch 1 0 1.5 2.5 -3.25 0 0 0\nmiss 2 1 0 0 0 0 0 0\noffset 0.125\nend 2.0\n",
        "T1 P1 Z0.511 D3.175 ;1/8 end mill\nT2 P2 D+6.0\n;\n",
    ]
    .map(|text| text.as_bytes().to_vec())
    .to_vec()
}
