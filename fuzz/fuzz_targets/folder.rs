//! libFuzzer's way into [`probecell_fuzz::folder`].
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| probecell_fuzz::folder::target(data));
