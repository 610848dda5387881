//! libFuzzer's way into [`probecell_fuzz::report`].
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| probecell_fuzz::report::target(data));
