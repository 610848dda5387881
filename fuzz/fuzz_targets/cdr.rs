//! libFuzzer's way into [`probecell_fuzz::cdr`].
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| probecell_fuzz::cdr::target(data));
