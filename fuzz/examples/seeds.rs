//! Writes the seeds of each target as `corpus/<target>/seed_<number>`, where cargo-fuzz looks for them.

use std::{fs, path::Path};

fn main() -> std::io::Result<()> {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    for target in probecell_fuzz::TARGETS {
        let folder = corpus.join(target.name);
        fs::create_dir_all(&folder)?;
        for (number, seed) in (target.seeds)().iter().enumerate() {
            fs::write(folder.join(format!("seed_{number:03}")), seed)?;
        }
    }
    Ok(())
}
