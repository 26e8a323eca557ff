//! Compiles the crate again when a file is added to the folder that it embeds.

fn main() {
    println!("cargo:rerun-if-changed=files");
}
