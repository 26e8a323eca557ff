//! Controller image: reads an ELF file into flash contents, symbols and source locations.

use std::fs;
use std::path::Path;

use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Endianness, Object, ObjectSymbol};

use crate::chip::{FLASH_BASE, FLASH_BYTES, RAM_BASE, RAM_BYTES};

/// Register accessor functions, omitted from the reported source location.
const ACCESSORS: [&str; 3] = ["core::ptr::", "::read_volatile", "stm32_metapac::common"];

/// Maximum number of lines in the reported source location of an address.
const MAX_PLACES: usize = 8;

/// Path of a source file without its machine-specific part.
fn short(file: &str) -> &str {
    file.rsplit_once("/registry/src/").and_then(|(_, rest)| Some(rest.split_once('/')?.1)).unwrap_or(file)
}

/// An image that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {message}")]
pub struct BadImage {
    path: String,
    message: String,
}

/// A controller image.
pub struct Image {
    /// Flash contents; erased where the file has no data.
    pub flash: Vec<u8>,
    symbols: Vec<(u32, String)>,
    /// End of the static memory: the stack may grow down to here.
    static_end: Option<u32>,
    /// The control block of the log's ring (RTT).
    log: Option<u32>,
    lines: Option<addr2line::Loader>,
}

impl Image {
    /// Reads an ELF file. Segments are placed at their load addresses.
    ///
    /// # Errors
    /// The file cannot be read, is not a 32-bit ELF file, or has a segment outside the flash.
    pub fn read(path: &Path) -> Result<Self, BadImage> {
        let bad = |message: String| BadImage { path: path.display().to_string(), message };
        let bytes = fs::read(path).map_err(|error| bad(error.to_string()))?;
        let file = ElfFile32::<Endianness>::parse(&*bytes).map_err(|error| bad(error.to_string()))?;
        let endian = file.endian();
        let mut flash = vec![0xff; FLASH_BYTES as usize];
        for header in file.elf_program_headers() {
            let data = header.data(endian, &*bytes).map_err(|()| bad("a segment lies outside the file".into()))?;
            if header.p_type(endian) != object::elf::PT_LOAD || data.is_empty() {
                continue;
            }
            let address = header.p_paddr(endian);
            let place = address
                .checked_sub(FLASH_BASE)
                .map(|start| start as usize..start as usize + data.len())
                .filter(|place| place.end <= flash.len())
                .ok_or_else(|| bad(format!("the segment at {address:#010x} lies outside the flash")))?;
            flash[place].copy_from_slice(data);
        }
        let mut symbols: Vec<(u32, String)> = file
            .symbols()
            .filter(|symbol| symbol.kind() == object::SymbolKind::Text)
            .filter_map(|symbol| {
                let name = addr2line::demangle_auto(symbol.name().ok()?.into(), None).into_owned();
                Some((symbol.address() as u32 & !1, name))
            })
            .collect();
        symbols.sort();
        let static_end = file.symbols().find(|symbol| symbol.name() == Ok("__sheap")).map(|it| it.address() as u32);
        let log = file.symbols().find(|symbol| symbol.name() == Ok("_SEGGER_RTT")).map(|it| it.address() as u32);
        let lines = addr2line::Loader::new(path).map_err(|error| bad(error.to_string()))?;
        Ok(Self { flash, symbols, static_end, log, lines: Some(lines) })
    }

    /// An image of a few instructions, for tests. The stack pointer is the end of memory, every other vector is the
    /// same address (`handler` halfwords from the start of the code), and the code starts at 0x0800_0200.
    #[must_use]
    pub fn of_code(code: &[u16], handler: u32) -> Self {
        const CODE: u32 = 0x200;
        let mut flash = vec![0xff; FLASH_BYTES as usize];
        let mut put = |offset: u32, bytes: &[u8]| flash[offset as usize..][..bytes.len()].copy_from_slice(bytes);
        put(0, &(RAM_BASE + RAM_BYTES).to_le_bytes());
        put(4, &((FLASH_BASE + CODE) | 1).to_le_bytes());
        for vector in 2..CODE / 4 {
            put(4 * vector, &((FLASH_BASE + CODE + 2 * handler) | 1).to_le_bytes());
        }
        for (n, halfword) in code.iter().enumerate() {
            put(CODE + 2 * n as u32, &halfword.to_le_bytes());
        }
        Self { flash, symbols: Vec::new(), static_end: None, log: None, lines: None }
    }

    /// Functions and source lines of an address, innermost first, one per line, without register accessors. Returns the
    /// address alone where the image has no debug information.
    #[must_use]
    pub fn place(&self, address: u32) -> String {
        let mut places = vec![format!("{address:#010x}")];
        if let Some(Ok(mut frames)) = self.lines.as_ref().map(|lines| lines.find_frames(u64::from(address))) {
            while let Ok(Some(frame)) = frames.next() {
                let name = frame.function.as_ref().and_then(|f| f.demangle().ok().map(|name| name.to_string()));
                if name.as_ref().is_some_and(|name| ACCESSORS.iter().any(|accessor| name.contains(accessor))) {
                    continue;
                }
                let line = frame.location.and_then(|l| Some(format!("{}:{}", short(l.file?), l.line?)));
                places.extend(line.map(|line| format!("{line} {}", name.unwrap_or_default())));
            }
        }
        places.truncate(MAX_PLACES);
        places.join("\n     ")
    }

    /// End of the static memory, down to which the stack may grow; `None` if the image does not tell.
    #[must_use]
    pub fn static_end(&self) -> Option<u32> {
        self.static_end
    }

    /// Address of the control block of the log's ring; `None` if the image has no log.
    #[must_use]
    pub fn log(&self) -> Option<u32> {
        self.log
    }

    /// Name of the function at an address.
    #[must_use]
    pub fn function(&self, address: u32) -> Option<&str> {
        let after = self.symbols.partition_point(|(start, _)| *start <= address);
        self.symbols.get(after.checked_sub(1)?).map(|(_, name)| name.as_str())
    }
}
