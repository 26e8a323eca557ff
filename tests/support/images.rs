//! Finds the controller images that `tests/firmware` builds, and measures their flash and RAM use.

use std::path::{Path, PathBuf};

use object::{Object, ObjectSection, ObjectSegment, SectionFlags, elf};

/// Root directory of the project.
#[must_use]
pub fn project() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the package lies in the project")
}

/// The image called `name`, if it has been built; prints a message if not.
///
/// # Panics
/// The image has not been built and `DAMPRIG_IMAGES=required`.
#[must_use]
pub fn find(name: &str) -> Option<PathBuf> {
    let path = project().join(format!("firmware/target/images/{name}.elf"));
    if path.is_file() {
        return Some(path);
    }
    let absent = format!("no image {}: `tests/firmware` builds it", path.display());
    assert!(std::env::var_os("DAMPRIG_IMAGES").is_none_or(|value| value != "required"), "{absent}");
    eprintln!("not tested: {absent}");
    None
}

/// Memory use of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Bytes written to flash.
    pub flash_bytes: u64,
    /// Static variables, bytes: all RAM except the stack.
    pub static_ram_bytes: u64,
}

/// Measures an image.
///
/// # Panics
/// The file is not an ELF file.
#[must_use]
pub fn size(image: &Path) -> Size {
    let bytes = std::fs::read(image).unwrap_or_else(|error| panic!("{}: {error}", image.display()));
    let file = object::File::parse(&*bytes).unwrap_or_else(|error| panic!("{}: {error}", image.display()));
    let flash_bytes = file.segments().map(|segment| segment.file_range().1).sum();
    let writable = u64::from(elf::SHF_ALLOC | elf::SHF_WRITE);
    let in_ram = |section: &object::Section<'_, '_>| match section.flags() {
        SectionFlags::Elf { sh_flags } => sh_flags & writable == writable,
        _ => false,
    };
    let static_ram_bytes = file.sections().filter(in_ram).map(|section| section.size()).sum();
    Size { flash_bytes, static_ram_bytes }
}
