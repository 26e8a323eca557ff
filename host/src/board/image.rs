//! Finds and checks a firmware image before a board is touched: right chip, memory layout of `memory.x`, same protocol.

use std::ops::Range;
use std::path::{Path, PathBuf};

use damprig_protocol::{Identity, SCHEMA, VERSION, image};
use object::elf::PT_LOAD;
use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Architecture, Endianness, Object, ObjectSection};

use super::{BOARD, CHIP};
use crate::client::session::hex;
use crate::input::regular;

/// Bank 1 of the flash holds the image, bank 2 the settings.
const BANK_1: Range<u64> = 0x0800_0000..0x0804_0000;

/// The contiguous RAM: SRAM1, SRAM2 and the alias of CCM.
const RAM: Range<u64> = 0x2000_0000..0x2002_0000;

/// Path of the built image in the project.
pub const BUILT: &str = "firmware/target/images/nucleo-g474re.elf";

const BUILD: &str = "`tests/firmware` builds the images into firmware/target/images/";

/// A checked image.
pub struct Image {
    /// Path of the file.
    pub path: PathBuf,
    /// Board, firmware version and protocol.
    pub identity: Identity,
    /// Revision of its source; empty if the build did not state it.
    pub revision: String,
    /// Flash contents: addresses and bytes.
    pub pieces: Vec<(u64, Vec<u8>)>,
}

/// Path of the image in an installation, from the folder above that of the command.
const INSTALLED: &str = "share/damprig/firmware/nucleo-g474re.elf";

/// Finds the image in the project that contains `from`, or that which was installed with this program.
///
/// # Errors
/// No image there; says how to build it.
pub fn find(from: &Path) -> Result<PathBuf, String> {
    let built = |folder: &Path| folder.join(BUILT);
    let program = std::env::current_exe().and_then(|program| program.canonicalize()).unwrap_or_default();
    let installed = program.parent().and_then(Path::parent).map(|above| above.join(INSTALLED));
    from.ancestors().map(built).chain(installed).find(|path| path.is_file()).ok_or_else(|| {
        format!(
            "no image {BUILT} in {} or a parent folder, and none was installed with this program; {BUILD}; or give one: `damprig flash IMAGE.elf`",
            from.display()
        )
    })
}

impl Image {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// The file cannot be read, is not for this chip, or has another protocol.
    pub fn read(path: &Path) -> Result<Self, String> {
        let file =
            regular::read_input(path).map_err(|e| format!("cannot read the image {}: {e}; {BUILD}", path.display()))?;
        Self::check(path, &file).map_err(|why| format!("{}: {why}", path.display()))
    }

    fn check(path: &Path, file: &[u8]) -> Result<Self, String> {
        let any = object::File::parse(file).map_err(|e| {
            format!("not an ELF file ({e}); give the linker's output, as {BUILT}, not .bin, .hex or .uf2")
        })?;
        if any.architecture() != Architecture::Arm {
            return Err(format!(
                "this is for {:?}; the controller is an ARM Cortex-M4 ({CHIP}); {BUILD}",
                any.architecture()
            ));
        }
        let elf = ElfFile32::<Endianness>::parse(file).map_err(|e| format!("not a 32-bit ELF file: {e}"))?;
        let known = identity(&elf)?;
        let pieces = pieces(&elf).map_err(|why| match &known {
            Some((it, _)) if *it.board != *BOARD => {
                format!("this is the image of the board {}, not of {BOARD}: {why}; {BUILD}", it.board)
            }
            _ => format!("not an image for the {CHIP}: {why}; {BUILD}"),
        })?;
        let (identity, revision) = known.ok_or_else(|| {
            format!(
                "the image has no identity (section {}): it is not damprig firmware, or too old; {BUILD}",
                image::SECTION
            )
        })?;
        belongs(&identity)?;
        Ok(Self { path: path.into(), identity, revision, pieces })
    }

    /// Bytes of flash.
    #[must_use]
    pub fn length(&self) -> usize {
        self.pieces.iter().map(|(_, bytes)| bytes.len()).sum()
    }
}

fn identity(elf: &ElfFile32<'_, Endianness>) -> Result<Option<(Identity, String)>, String> {
    let Some(section) = elf.section_by_name(image::SECTION) else { return Ok(None) };
    let bytes = section.data().map_err(|e| format!("its section {} cannot be read: {e}", image::SECTION))?;
    let unknown =
        || format!("its section {} has another layout: it belongs to another version of this program", image::SECTION);
    let (identity, revision) = image::from_bytes(bytes).ok_or_else(unknown)?;
    Ok(Some((identity, revision.as_str().to_string())))
}

fn belongs(it: &Identity) -> Result<(), String> {
    if *it.board != *BOARD {
        return Err(format!("this is the image of the board {}, not of {BOARD}; {BUILD}", it.board));
    }
    if it.protocol == VERSION && it.schema == SCHEMA {
        return Ok(());
    }
    Err(format!(
        "the image has another protocol: image version {} (schema {}, firmware {} on {}), this program version {VERSION} (schema {}, damprig {}); build the image and the program from the same source",
        it.protocol,
        hex(&it.schema),
        it.firmware,
        it.board,
        hex(&SCHEMA),
        env!("CARGO_PKG_VERSION")
    ))
}

/// Flash contents, checked against the chip's memory.
fn pieces(elf: &ElfFile32<'_, Endianness>) -> Result<Vec<(u64, Vec<u8>)>, String> {
    let mut pieces = Vec::new();
    let endian = elf.endian();
    for header in elf.elf_program_headers().iter().filter(|header| header.p_type(endian) == PT_LOAD) {
        let (loaded, lives) = (u64::from(header.p_paddr(endian)), u64::from(header.p_vaddr(endian)));
        let (length, size) = (u64::from(header.p_filesz(endian)), u64::from(header.p_memsz(endian)));
        if length > 0 {
            within("is loaded to", loaded..loaded + length, &[("bank 1 of the flash", BANK_1)])?;
            let bytes = header.data(endian, elf.data()).map_err(|()| "a segment lies outside the file".to_string())?;
            pieces.push((loaded, bytes.to_vec()));
        }
        if size > 0 {
            within("is at", lives..lives + size, &[("bank 1 of the flash", BANK_1), ("the RAM", RAM)])?;
        }
    }
    match pieces.iter().map(|(address, _)| *address).min() {
        Some(first) if first == BANK_1.start => Ok(pieces),
        Some(first) => Err(format!("it begins at {first:#010x}, the flash at {:#010x}", BANK_1.start)),
        None => Err("it has no loadable segment".into()),
    }
}

fn within(what: &str, range: Range<u64>, places: &[(&str, Range<u64>)]) -> Result<(), String> {
    if places.iter().any(|(_, place)| place.start <= range.start && range.end <= place.end) {
        return Ok(());
    }
    let places: Vec<String> =
        places.iter().map(|(name, place)| format!("{name} {:#010x}..{:#010x}", place.start, place.end)).collect();
    Err(format!("a segment {what} {:#010x}..{:#010x}, outside {}", range.start, range.end, places.join(" and ")))
}
