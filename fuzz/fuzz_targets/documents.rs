//! libFuzzer's way into [`probecell_fuzz::documents`].
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| probecell_fuzz::documents::target(data));
