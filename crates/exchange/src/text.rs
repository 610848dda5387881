//! The text of a file by its encoding: UTF-8, UTF-16 with its mark, or Latin-1.

use crate::ImportError;

/// The text of a table, and what had to be assumed to read it.
///
/// # Errors
/// Bytes that are no text of any of the three.
pub fn decode(bytes: Vec<u8>) -> Result<(String, Option<String>), ImportError> {
    let utf_16 = match bytes.get(..2) {
        Some([0xff, 0xfe]) => Some(u16::from_le_bytes as fn([u8; 2]) -> u16),
        Some([0xfe, 0xff]) => Some(u16::from_be_bytes as fn([u8; 2]) -> u16),
        _ => None,
    };
    if let Some(unit) = utf_16 {
        let pairs = bytes[2..].chunks_exact(2);
        let odd = !pairs.remainder().is_empty();
        let units: Vec<u16> = pairs.map(|pair| unit([pair[0], pair[1]])).collect();
        let text = String::from_utf16(&units).ok().filter(|_| !odd);
        let text =
            text.ok_or_else(|| ImportError::whole("the file begins as UTF-16 and is none"))?;
        return Ok((text, None));
    }
    if let Some(at) = bytes.iter().position(|&byte| byte == 0) {
        let (line, column) = place(&bytes, at);
        let what = "a byte of 0 is no text: UTF-16 without its mark is converted by iconv -f utf-16le -t utf8";
        return Err(ImportError::at(line, column, what));
    }
    match String::from_utf8(bytes) {
        Ok(text) => Ok((text, None)),
        Err(error) => latin_1(error.as_bytes(), error.utf8_error().valid_up_to()),
    }
}

/// The text by Latin-1, which has no letters between 0x80 and 0x9f.
fn latin_1(bytes: &[u8], first: usize) -> Result<(String, Option<String>), ImportError> {
    if let Some(at) = bytes.iter().position(|byte| (0x80..=0x9f).contains(byte)) {
        let (line, column) = place(bytes, at);
        return Err(ImportError::at(
            line,
            column,
            format!(
                "the byte {:#04x} is neither UTF-8 nor Latin-1 (iconv -f windows-1252 -t utf8 converts what Windows writes)",
                bytes[at]
            ),
        ));
    }
    let (line, _) = place(bytes, first);
    let remark = format!("line {line} is not UTF-8: the file is read as Latin-1");
    Ok((
        bytes.iter().map(|&byte| char::from(byte)).collect(),
        Some(remark),
    ))
}

/// Line and byte in it, from 1.
fn place(bytes: &[u8], at: usize) -> (u64, u64) {
    let before = &bytes[..at];
    let line = before.split(|&byte| byte == b'\n').count() as u64;
    let begin = before
        .iter()
        .rposition(|&byte| byte == b'\n')
        .map_or(0, |end| end + 1);
    (line, (at - begin) as u64 + 1)
}

#[cfg(test)]
mod tests {
    use super::decode;

    #[test]
    fn text_is_read_by_its_mark_or_as_latin_1_with_a_word() {
        let table = "X;Länge µm\n1;2\n";
        assert_eq!(decode(table.into()), Ok((table.to_owned(), None)));
        let units: Vec<u16> = [0xfeff].into_iter().chain(table.encode_utf16()).collect();
        for bytes in [
            units
                .iter()
                .flat_map(|unit| unit.to_le_bytes())
                .collect::<Vec<u8>>(),
            units.iter().flat_map(|unit| unit.to_be_bytes()).collect(),
        ] {
            assert_eq!(decode(bytes.clone()), Ok((table.to_owned(), None)));
            assert!(decode(bytes[..bytes.len() - 1].to_vec()).is_err());
            let bare = decode(bytes[2..].to_vec()).expect_err("no mark");
            assert!(
                bare.to_string().contains("UTF-16 without its mark"),
                "{bare}"
            );
        }
        let latin: Vec<u8> = table
            .chars()
            .map(|letter| u8::try_from(u32::from(letter)).expect("of Latin-1"))
            .collect();
        let remark = "line 1 is not UTF-8: the file is read as Latin-1".to_owned();
        assert_eq!(decode(latin), Ok((table.to_owned(), Some(remark))));
        let windows = decode(b"X\n1\x962\n".to_vec()).expect_err("Windows");
        assert!(
            windows
                .to_string()
                .starts_with("line 2, column 2: the byte 0x96"),
            "{windows}"
        );
    }
}
