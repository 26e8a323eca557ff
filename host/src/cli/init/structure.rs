//! Cases of structures with several places.

use std::path::{Path, PathBuf};

use clap::ValueEnum;

use super::{Args, write};
use crate::failure::{Failure, Outcome};
use crate::input::shipped::{ROOT, text};

/// Structures with several places, as arguments.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub(super) enum StructureArg {
    /// A beam with an impact damper
    Beam,
    /// A frame of storeys with an impact and a friction damper
    Storeys,
    /// A part with measured modes and an impact damper
    Modes,
}

impl StructureArg {
    /// Name of the shipped case.
    fn example(self) -> &'static str {
        match self {
            Self::Beam => "boring-bar",
            Self::Storeys => "frame",
            Self::Modes => "modal-test",
        }
    }

    /// Writes its case, whose comments name the file.
    pub(super) fn write(self, args: &Args) -> Outcome {
        let file = args.file.clone().unwrap_or_else(|| PathBuf::from("case.toml"));
        args.force.check(&file)?;
        let (name, shown) = (self.example(), file.display());
        let shipped = Path::new(ROOT).join(format!("cases/{name}.toml"));
        let text = text(&shipped).ok_or_else(|| Failure::Input(format!("--structure: no example {name}")))?;
        let text = text.replace(&format!("simulate {name} "), &format!("simulate {shown} "));
        write(&file, &text, args.force)?;
        say!("Written to {shown}. Next: damprig simulate {shown}");
        Ok(())
    }
}
