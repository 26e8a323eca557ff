//! Makes a digest of the sources, `DAMPRIG_BUILD`: studies compare it, so that "the same version" is the same code.

use std::path::{Path, PathBuf};
use std::{fs, io};

/// What results follow from, beside this file.
const SOURCES: [&str; 4] = ["src", "../shared", "../numerics", "../Cargo.lock"];

/// The prime and the first value of FNV-1a, 64 bits.
const PRIME: u64 = 0x0100_0000_01b3;
const FIRST: u64 = 0xcbf2_9ce4_8422_2325;

fn main() -> io::Result<()> {
    let mut files = Vec::new();
    for source in SOURCES {
        add(Path::new(source), &mut files)?;
    }
    files.sort();
    let mut digest = FIRST;
    let mut take =
        |bytes: &[u8]| bytes.iter().for_each(|byte| digest = (digest ^ u64::from(*byte)).wrapping_mul(PRIME));
    for file in files {
        // A new file is named in another one, which changes then.
        println!("cargo:rerun-if-changed={}", file.display());
        // Names tell a moved text from one that stays.
        let name = file.to_string_lossy().replace('\\', "/");
        let content = fs::read(&file)?;
        take(name.as_bytes());
        take(&(content.len() as u64).to_le_bytes());
        take(&content);
    }
    println!("cargo:rustc-env=DAMPRIG_BUILD={digest:016x}");
    Ok(())
}

/// Lists the Rust sources at a path; a file that is named itself, whatever it is. A path that is not there has none.
fn add(path: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    if path.is_file() {
        files.push(path.to_path_buf());
        return Ok(());
    }
    if !path.is_dir() {
        return Ok(());
    }
    for entry in fs::read_dir(path)? {
        let path = entry?.path();
        let is_source = path.extension().is_some_and(|extension| extension == "rs");
        // Tests and examples are no part of the library.
        let is_other = ["tests", "examples", "benches"].iter().any(|name| path.ends_with(name));
        if path.is_dir() && !is_other || is_source {
            add(&path, files)?;
        }
    }
    Ok(())
}
