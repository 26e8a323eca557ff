//! Passes the memory map of the selected board and the identity section's script to the linker.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    let nucleo = env::var_os("CARGO_FEATURE_BOARD_NUCLEO_G474RE").is_some();
    let mps2 = env::var_os("CARGO_FEATURE_BOARD_MPS2_AN386").is_some();
    let without_fpu = env::var_os("CARGO_FEATURE_BOARD_MPS2_AN385").is_some();
    let map = match (nucleo, mps2, without_fpu) {
        (true, false, false) => "../memory.x",
        (false, true, false) | (false, false, true) => "src/boards/mps2.x",
        _ => panic!(
            "choose one board: --features board-nucleo-g474re, board-mps2-an386 or board-mps2-an385 (`tests/firmware` builds all)"
        ),
    };
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    for (script, name) in [(map, "memory.x"), ("identity.x", "identity.x")] {
        fs::copy(script, out.join(name))
            .unwrap_or_else(|error| panic!("cannot copy {script} to {}: {error}", out.display()));
        println!("cargo:rerun-if-changed={script}");
    }
    println!("cargo:rustc-link-search={}", out.display());
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x", "-Tidentity.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}
