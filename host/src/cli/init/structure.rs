//! Cases of structures with several places.

use std::path::{Path, PathBuf};

use clap::ValueEnum;

use super::{Args, write};
use crate::failure::{Failure, Outcome};
use crate::input::shipped::{ROOT, text};
use crate::input::{Source, listed, near};
use crate::report::numbers::significant;
use crate::signal_file::mode_shapes::ModalTest;
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

/// Degrees of freedom that are all taken as places when none is named.
const MOST_UNNAMED: usize = 12;

/// Digits of what is written: universal files have six.
const DIGITS: usize = 8;

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
pub(super) fn of_modal_test(test_file: &Path, args: &Args) -> Outcome {
    let file = args.file.clone().unwrap_or_else(|| PathBuf::from("case.toml"));
    args.force.check(&file)?;
    let test = ModalTest::read(test_file)?;
    let places = places(&test, &args.place, test_file)?;
    let text = case_of(&test, &places, test_file);
    let shown = file.display();
    Case::parse(&Source::new(shown.to_string(), text.clone()), "case")?;
    write(&file, &text, args.force)?;
    test.remarks.iter().for_each(|remark| say!("{remark}"));
    say!("Written to {shown}: {} modes at {} places. Next: damprig simulate {shown}", test.modes.len(), places.len());
    Ok(())
}

/// The places that are asked for, or all degrees of freedom.
fn places(test: &ModalTest, asked: &[TestedPlace], file: &Path) -> Result<Vec<TestedPlace>, Failure> {
    if asked.is_empty() {
        let all = &test.freedoms;
        if all.is_empty() || all.len() > MOST_UNNAMED {
            let some: Vec<&str> = all.iter().take(MOST_UNNAMED).map(String::as_str).collect();
            let more = if all.len() > MOST_UNNAMED { " …" } else { "" };
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
                near if near.is_empty() => names().take(MOST_UNNAMED).collect(),
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

fn case_of(test: &ModalTest, places: &[TestedPlace], file: &Path) -> String {
    let quoted: Vec<String> = places.iter().map(|place| format!("{:?}", place.name)).collect();
    let first = &test.modes[0];
    // A force at the first resonance for as long as its free vibration takes to decay to a hundredth.
    let decay_s = 4.6 / (first.damping_ratio.max(1e-3) * std::f64::consts::TAU * first.frequency_hz);
    let mut text = format!(
        "# The modes of {}: mass-normalised shapes at {} places. A force at the first resonance; add dampers below.\n\n\
         places = [{}]\nobserved_place = {}\nforce = {{ kind = \"sine\", amplitude_n = 1, frequency_hz = {} }}\n\
         run = {{ duration_s = {} }}\n",
        file.file_name().unwrap_or_default().to_string_lossy(),
        places.len(),
        quoted.join(", "),
        quoted[0],
        significant(first.frequency_hz, DIGITS),
        two_digits_up(decay_s)
    );
    for mode in &test.modes {
        let shape = places.iter().map(|place| {
            let phi = mode.shape_per_root_kg[&place.freedom];
            significant(if place.is_reversed { -phi } else { phi }, DIGITS)
        });
        let shape: Vec<String> = shape.collect();
        text += &format!(
            "\n[[mode]]\nfrequency_hz = {}\ndamping_ratio = {}\nshape_per_root_kg = [{}]\n",
            significant(mode.frequency_hz, DIGITS),
            significant(mode.damping_ratio, DIGITS),
            shape.join(", ")
        );
        if let Some(participation) = mode.participation_root_kg {
            text += &format!("participation_root_kg = {}\n", significant(participation, DIGITS));
        }
    }
    text + &format!(
        "\n# [[particle]]\n# place = {}\n# mass_ratio = 0.05                     # of the modal mass of the first mode there\n\
         # clearance_m = 0.0002\n# wall = {{ kind = \"restitution\", coefficient = 0.5 }}\n",
        quoted[0]
    )
}

/// Rounded up to two digits.
fn two_digits_up(value: f64) -> f64 {
    let step = 10_f64.powf(value.log10().floor() - 1.0);
    let rounded = (value / step).ceil() * step;
    // Of a step below 1 the product has digits that it should not have.
    format!("{rounded:.6}").parse().unwrap_or(rounded)
}
