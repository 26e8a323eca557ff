//! The debug probe of `damprig flash` and `damprig log`: selects it, writes an image through it with progress bars.

use std::cell::RefCell;
use std::path::PathBuf;

use clap::Args;
use indicatif::ProgressBar;
use probe_rs::flashing::{ProgressEvent, ProgressOperation};
pub(super) use probe_rs::probe::DebugProbeSelector as Selector;

use crate::board::image::Image;
use crate::board::probe::{AttachedProbe, NoProbe, candidates};
pub(super) use crate::board::probe::{Candidate, selector};
use crate::failure::{Failure, Outcome};

/// Which image and which probe, as `damprig log` takes them.
#[derive(Debug, Args)]
pub(super) struct ImageAndProbe {
    /// Firmware image [default: firmware/target/images/nucleo-g474re.elf, here or in a parent folder, else the installed one]
    #[arg(value_name = "IMAGE")]
    image: Option<PathBuf>,

    /// Debug probe, needed if several are connected: VID:PID or VID:PID:SERIAL, as the error message lists them
    #[arg(long, value_name = "VID:PID[:SERIAL]", value_parser = selector)]
    probe: Option<Selector>,
}

impl ImageAndProbe {
    /// The image, checked before any probe is touched.
    ///
    /// # Errors
    /// No image, or one for another board or protocol.
    pub(super) fn image(&self) -> Result<Image, Failure> {
        super::flash::image(self.image.as_deref())
    }

    /// The selected probe.
    ///
    /// # Errors
    /// No probe, or several probes.
    pub(super) fn choose(&self) -> Result<Candidate, Failure> {
        choose(self.probe.as_ref())
    }

    /// The selected probe, attached to the chip.
    ///
    /// # Errors
    /// No probe, several probes, or no chip.
    pub(super) fn attach(&self) -> Result<(Candidate, AttachedProbe), Failure> {
        let probe = self.choose()?;
        let attached = AttachedProbe::to(&probe).map_err(Failure::Failed)?;
        Ok((probe, attached))
    }
}

/// The selected probe, or the only one.
///
/// # Errors
/// No probe, or several probes.
pub(super) fn choose(wanted: Option<&Selector>) -> Result<Candidate, Failure> {
    crate::board::probe::choose(&candidates(), wanted).map_err(|none| match none {
        NoProbe::Missing(why) => Failure::Failed(why),
        NoProbe::Ambiguous(why) => Failure::Input(why),
    })
}

/// Writes an image, reads it back and resets the board.
///
/// # Errors
/// No chip; a flash error.
pub(super) fn write(probe: &Candidate, image: &Image) -> Outcome {
    let mut attached = AttachedProbe::to(probe).map_err(Failure::Failed)?;
    let bars = RefCell::new(Bars::default());
    attached.write(image, |event| bars.borrow_mut().show(event)).map_err(Failure::Failed)?;
    attached.reset().map_err(Failure::Failed)
}

/// A progress bar for each operation.
#[derive(Default)]
struct Bars(Option<ProgressBar>, Vec<(&'static str, u64)>);

impl Bars {
    fn show(&mut self, event: ProgressEvent) {
        match event {
            ProgressEvent::AddProgressBar { operation, total } => self.1.push((name(operation), total.unwrap_or(0))),
            ProgressEvent::Started(operation) => {
                let total = self.1.iter().filter(|(of, _)| *of == name(operation)).map(|(_, total)| total).sum();
                let bar = super::progress::bar(total);
                bar.set_message(name(operation));
                self.0 = Some(bar);
            }
            ProgressEvent::Progress { size, .. } => {
                if let Some(bar) = &self.0 {
                    bar.inc(size);
                }
            }
            ProgressEvent::Finished(_) | ProgressEvent::Failed(_) => {
                if let Some(bar) = self.0.take() {
                    bar.finish_and_clear();
                }
            }
            _ => {}
        }
    }
}

fn name(operation: ProgressOperation) -> &'static str {
    match operation {
        ProgressOperation::Fill => "reading",
        ProgressOperation::Erase => "erasing",
        ProgressOperation::Program => "writing",
        ProgressOperation::Verify => "reading back",
    }
}
