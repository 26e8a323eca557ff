//! Writes the generated seeds to `fuzz/seeds` in place of earlier generated ones; inputs added by the fuzzer stay.

use damprig_fuzzing::seeds::{device, folder, host, kept};

fn main() -> std::io::Result<()> {
    for (target, seeds) in [("device", device()), ("host", host())] {
        let folder = folder().join(target);
        std::fs::create_dir_all(&folder)?;
        for (name, _) in kept(target)?.iter().filter(|(name, _)| !name.starts_with("found-")) {
            std::fs::remove_file(folder.join(name))?;
        }
        let bytes: usize = seeds.iter().map(|(_, bytes)| bytes.len()).sum();
        println!("{target}: {} seeds, {bytes} bytes", seeds.len());
        for (name, bytes) in seeds {
            std::fs::write(folder.join(name), bytes)?;
        }
    }
    Ok(())
}
