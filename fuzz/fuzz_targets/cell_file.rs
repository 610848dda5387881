//! libFuzzer's way into [`probecell_fuzz::cell_file`].
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| probecell_fuzz::cell_file::target(data));
