//! libFuzzer's way into [`probecell_fuzz::mcap`].
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| probecell_fuzz::mcap::target(data));
