//! Identifiers of what a document holds.

/// An identifier in the form of a UUID (version 8, RFC 9562) that follows from what it names, so that the same recording gives
/// the same document.
pub fn unique(names: &[&str]) -> String {
    // FNV-1a, 128 bits.
    let mut hash: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    for byte in names.join("\u{1f}").bytes() {
        hash = (hash ^ u128::from(byte)).wrapping_mul(0x0000_0000_0100_0000_0000_0000_0000_013b);
    }
    let bits = (hash & !(0xf << 76) & !(0b11 << 62)) | (0x8 << 76) | (0b10 << 62);
    let text = format!("{bits:032x}");
    let parts = [
        &text[..8],
        &text[8..12],
        &text[12..16],
        &text[16..20],
        &text[20..],
    ];
    parts.join("-")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_uuids_and_follow_from_their_names() {
        let one = unique(&["part", "a"]);
        assert_eq!(one, unique(&["part", "a"]));
        assert_ne!(one, unique(&["parta", ""]));
        let form = one.split('-').map(str::len).collect::<Vec<_>>();
        assert_eq!(form, [8, 4, 4, 4, 12]);
        assert_eq!(&one[14..15], "8");
        assert!(matches!(&one[19..20], "8" | "9" | "a" | "b"));
    }
}
