//! libFuzzer's way into [`probecell_fuzz::table`].
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| probecell_fuzz::table::target(data));
