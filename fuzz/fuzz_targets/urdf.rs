//! libFuzzer's way into [`probecell_fuzz::urdf`].
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| probecell_fuzz::urdf::target(data));
