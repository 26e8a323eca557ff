//! Cases of structures with several places.

use std::path::{Path, PathBuf};

use clap::ValueEnum;

use super::{InitArgs, write};
use crate::failure::{Failure, Outcome};
use crate::file_keys::modal_case::{self, WrittenMode};
use crate::input::shipped::{ROOT, text};
use crate::input::{Source, listed, near};
use crate::signal_file::mode_shapes::{ModalTest, TestedMode};
use crate::simulation::Case;

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
    pub(super) fn write(self, args: &InitArgs) -> Outcome {
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

/// Degrees of freedom that are all taken as places when none is named.
const MAX_UNNAMED: usize = 12;

/// A place of a modal test.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TestedPlace {
    name: String,
    freedom: String,
    /// Against the direction of the degree of freedom.
    is_reversed: bool,
}

/// Reads `NAME=FREEDOM`.
pub(super) fn place(text: &str) -> Result<TestedPlace, String> {
    let allowed = || "must be NAME=FREEDOM, as tip=12:z; with a minus against its direction, as tip=-12:z".to_string();
    let (name, freedom) = text.split_once('=').ok_or_else(allowed)?;
    let (is_reversed, freedom) = freedom.strip_prefix('-').map_or((false, freedom), |freedom| (true, freedom));
    if name.is_empty() || freedom.is_empty() {
        return Err(allowed());
    }
    Ok(TestedPlace { name: name.into(), freedom: freedom.into(), is_reversed })
}

/// Writes a case with the modes of a modal test.
pub(super) fn of_modal_test(test_file: &Path, args: &InitArgs) -> Outcome {
    let file = args.file.clone().unwrap_or_else(|| PathBuf::from("case.toml"));
    args.force.check(&file)?;
    let test = ModalTest::read(test_file)?;
    let places = places(&test, &args.place, test_file)?;
    let names: Vec<String> = places.iter().map(|place| place.name.clone()).collect();
    let modes: Vec<WrittenMode> = test.modes.iter().map(|mode| written(mode, &places)).collect();
    let from = test_file.file_name().unwrap_or_default().to_string_lossy();
    let text = modal_case::text(&from, &names, &modes);
    let shown = file.display();
    Case::parse(&Source::new(shown.to_string(), text.clone()), "case")?;
    write(&file, &text, args.force)?;
    test.remarks.iter().for_each(|remark| say!("{remark}"));
    say!("Written to {shown}: modes: {}, places: {}. Next: damprig simulate {shown}", test.modes.len(), places.len());
    Ok(())
}

fn written(mode: &TestedMode, places: &[TestedPlace]) -> WrittenMode {
    let phi = |place: &TestedPlace| {
        let phi = mode.shape_per_root_kg[&place.freedom];
        if place.is_reversed { -phi } else { phi }
    };
    WrittenMode {
        frequency_hz: mode.frequency_hz,
        damping_ratio: mode.damping_ratio,
        shape_per_root_kg: places.iter().map(phi).collect(),
        participation_root_kg: mode.participation_root_kg,
    }
}

/// The places that are asked for, or all degrees of freedom.
fn places(test: &ModalTest, asked: &[TestedPlace], file: &Path) -> Result<Vec<TestedPlace>, Failure> {
    if asked.is_empty() {
        let all = &test.freedoms;
        if all.is_empty() || all.len() > MAX_UNNAMED {
            let some: Vec<&str> = all.iter().take(MAX_UNNAMED).map(String::as_str).collect();
            let more = if all.len() > MAX_UNNAMED { " …" } else { "" };
            return Err(Failure::Input(format!(
                "{}: it has {} degrees of freedom: {}{more}\n  name those that are places: --place tip={}",
                file.display(),
                all.len(),
                some.join(", "),
                all.last().map_or("12:z", String::as_str)
            )));
        }
        let own =
            |freedom: &String| TestedPlace { name: freedom.clone(), freedom: freedom.clone(), is_reversed: false };
        return Ok(all.iter().map(own).collect());
    }
    for place in asked {
        if !test.freedoms.contains(&place.freedom) {
            let names = || test.freedoms.iter().map(String::as_str);
            let few: Vec<&str> = match near(&place.freedom, names()) {
                near if near.is_empty() => names().take(MAX_UNNAMED).collect(),
                near => near,
            };
            return Err(Failure::Input(format!(
                "--place {}={}: {} has no such degree of freedom in every mode; it has {}",
                place.name,
                place.freedom,
                file.display(),
                listed(few.into_iter())
            )));
        }
    }
    Ok(asked.to_vec())
}
