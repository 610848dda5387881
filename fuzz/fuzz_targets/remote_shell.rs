//! libFuzzer's way into [`probecell_fuzz::remote_shell`].
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| probecell_fuzz::remote_shell::target(data));
