//! The debug probe: chosen among those at this machine, attached to the controller, and an image written through it.

use probe_rs::flashing::{DownloadOptions, FlashProgress, ProgressEvent};
use probe_rs::probe::list::{Accessibility, Lister};
use probe_rs::probe::{DebugProbeInfo, DebugProbeSelector};
use probe_rs::{MemoryInterface, Permissions, Session};

use super::CHIP;
use super::image::Image;

/// How `--probe` is written.
const WRITTEN: &str = "VID:PID or VID:PID:SERIAL, the first two hexadecimal, as 0483:374e:0025003A3432510D31333430";

/// Why a probe was not chosen.
#[derive(Debug, PartialEq, Eq)]
pub enum NoProbe {
    /// There is none that could be: in words.
    Missing(String),
    /// It must be said which: in words.
    Ambiguous(String),
}

/// Reads the value of `--probe`.
///
/// # Errors
/// Says how it is written.
pub fn selector(text: &str) -> Result<DebugProbeSelector, String> {
    text.parse().map_err(|_| format!("must be {WRITTEN}"))
}

/// A probe as the choice sees it.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// What tells it from others.
    pub selector: DebugProbeSelector,
    /// Its name.
    pub name: String,
    /// Whether this user may open it.
    pub is_accessible: bool,
}

impl Candidate {
    fn line(&self) -> String {
        let locked = if self.is_accessible { "" } else { "   (no permission)" };
        format!("\n  --probe {}   {}{locked}", self.selector, self.name)
    }
}

/// The probes at this machine.
#[must_use]
pub fn candidates() -> Vec<Candidate> {
    let of = |info: &DebugProbeInfo| DebugProbeSelector { interface: None, ..DebugProbeSelector::from(info) };
    let mut all: Vec<Candidate> = Vec::new();
    for item in Lister::new().list_all_with_access() {
        let candidate = Candidate {
            selector: of(&item.info),
            name: item.info.identifier.clone(),
            is_accessible: item.accessibility == Accessibility::Accessible,
        };
        // A probe with several interfaces is one probe.
        if all.iter().all(|other| other.selector != candidate.selector) {
            all.push(candidate);
        }
    }
    all
}

/// The probe that is wanted, or the only one that there is.
///
/// # Errors
/// None, several, or no permission: with what to do.
pub fn choose(all: &[Candidate], wanted: Option<&DebugProbeSelector>) -> Result<Candidate, NoProbe> {
    let is_wanted = |candidate: &&Candidate| {
        wanted.is_none_or(|wanted| {
            let it = &candidate.selector;
            (it.vendor_id, it.product_id) == (wanted.vendor_id, wanted.product_id)
                && wanted
                    .serial_number
                    .as_ref()
                    .is_none_or(|number| it.serial_number.as_deref().unwrap_or_default().eq_ignore_ascii_case(number))
        })
    };
    let list = |some: &[&Candidate]| some.iter().map(|candidate| candidate.line()).collect::<String>();
    let fit: Vec<&Candidate> = all.iter().filter(is_wanted).collect();
    match (fit[..].as_ref(), wanted) {
        ([only], _) if only.is_accessible => Ok((*only).clone()),
        ([only], _) => Err(NoProbe::Missing(format!(
            "the debug probe {} ({}) is there, but this user may not open it{RULE}",
            only.selector, only.name
        ))),
        ([], Some(wanted)) if !all.is_empty() => Err(NoProbe::Missing(format!(
            "no debug probe {wanted}; there are:{}",
            list(&all.iter().collect::<Vec<_>>())
        ))),
        ([], _) => Err(NoProbe::Missing(format!(
            "no debug probe at this machine: the board's USB connector CN1 is its probe; is it plugged in, with a cable that carries data, and free of other programs?{LINUX}"
        ))),
        (several, _) => Err(NoProbe::Ambiguous(format!("{} debug probes; say which:{}", several.len(), list(several)))),
    }
}

const RULE: &str = if cfg!(target_os = "linux") {
    "; allow it with a rule for udev, as /etc/udev/rules.d/69-probe-rs.rules of https://probe.rs/docs/getting-started/probe-setup/, then `sudo udevadm control --reload && sudo udevadm trigger`"
} else {
    "; is another program using it?"
};

const LINUX: &str = if cfg!(target_os = "linux") {
    " `lsusb` must list it (an ST-LINK as 0483:374x); in a container the USB devices must be handed through"
} else {
    ""
};

/// The chip with a probe at it.
pub struct Attached {
    session: Session,
}

impl Attached {
    /// Attaches; the chip runs on.
    ///
    /// # Errors
    /// The probe does not open, or there is no such chip at it: with what to check.
    pub fn to(candidate: &Candidate) -> Result<Self, String> {
        let probe = Lister::new()
            .open(candidate.selector.clone())
            .map_err(|e| format!("cannot open the debug probe {}: {}", candidate.selector, chain(&e)))?;
        let session = probe.attach(CHIP, Permissions::default()).map_err(|e| {
            format!(
                "no {CHIP} answers at the debug probe {}: {}; is the board powered, and its jumpers to the probe in place?",
                candidate.selector,
                chain(&e)
            )
        })?;
        Ok(Self { session })
    }

    /// Writes an image and reads it back. What lies in other pages, as the settings in bank 2, stays.
    ///
    /// # Errors
    /// The flash does not take it, or holds something else afterwards.
    pub fn write(&mut self, image: &Image, progress: impl FnMut(ProgressEvent)) -> Result<(), String> {
        let mut loader = self.session.target().flash_loader();
        for (address, bytes) in &image.pieces {
            loader.add_data(*address, bytes).map_err(|e| format!("the image cannot be written: {}", chain(&e)))?;
        }
        let mut options = DownloadOptions::new();
        options.verify = true;
        options.progress = FlashProgress::new(progress);
        loader.commit(&mut self.session, options).map_err(|e| {
            format!("writing the image failed: {}; the board has no whole firmware now: flash it again", chain(&e))
        })
    }

    /// Resets the chip; its firmware begins anew.
    ///
    /// # Errors
    /// The probe's words.
    pub fn reset(&mut self) -> Result<(), String> {
        self.with_core("reset the board", |core| core.reset())
    }

    /// Whether the chip's flash holds the image. The firmware runs on meanwhile.
    ///
    /// # Errors
    /// The probe's words.
    pub fn holds(&mut self, image: &Image) -> Result<bool, String> {
        self.with_core("read the board's flash", |core| {
            for (address, bytes) in &image.pieces {
                let mut there = vec![0; bytes.len()];
                core.read(*address, &mut there)?;
                if there != *bytes {
                    return Ok(false);
                }
            }
            Ok::<_, probe_rs::Error>(true)
        })
    }

    /// Does something with the chip's core.
    ///
    /// # Errors
    /// "cannot `what`", and why.
    pub fn with_core<T, E>(
        &mut self,
        what: &str,
        action: impl FnOnce(&mut probe_rs::Core<'_>) -> Result<T, E>,
    ) -> Result<T, String>
    where
        E: std::error::Error + 'static,
    {
        let mut core = self.session.core(0).map_err(|e| format!("cannot {what}: {}", chain(&e)))?;
        action(&mut core).map_err(|e| format!("cannot {what}: {}", chain(&e)))
    }
}

/// An error and what caused it, in one line.
fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let words = error.to_string();
        if !text.contains(&words) {
            text = format!("{text}: {words}");
        }
        cause = error.source();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(serial_number: &str) -> Candidate {
        let selector = selector(&format!("0483:374e:{serial_number}")).expect("a selector");
        Candidate { selector, name: "STLINK-V3".into(), is_accessible: true }
    }

    fn wanted(text: &str) -> Option<DebugProbeSelector> {
        Some(selector(text).expect("a selector"))
    }

    fn chosen(all: &[Candidate], wanted: Option<DebugProbeSelector>) -> Result<String, NoProbe> {
        choose(all, wanted.as_ref()).map(|it| it.selector.to_string())
    }

    #[test]
    fn the_only_probe_is_taken_unsaid_and_another_by_its_serial_number() {
        let two = [candidate("0025A"), candidate("0031B")];
        assert_eq!(chosen(&two[..1], None).as_deref(), Ok("0483:374e:0025A"));
        assert_eq!(chosen(&two, wanted("0483:374e:0031b")).as_deref(), Ok("0483:374e:0031B"));
    }

    #[test]
    fn several_probes_are_listed_as_they_are_to_be_written() {
        let two = [candidate("0025A"), candidate("0031B")];
        for asked in [None, wanted("0483:374e")] {
            let Err(NoProbe::Ambiguous(text)) = chosen(&two, asked) else { panic!("one was chosen") };
            assert!(text.contains("2 debug probes") && text.contains("--probe 0483:374e:0031B   STLINK-V3"), "{text}");
        }
    }

    #[test]
    fn a_probe_that_is_not_there_is_answered_with_those_that_are() {
        for asked in ["0483:3748", "0483:374e:0025"] {
            let Err(NoProbe::Missing(text)) = chosen(&[candidate("0025A")], wanted(asked)) else { panic!("chosen") };
            assert!(text.contains(&format!("no debug probe {asked}")) && text.contains("0483:374e:0025A"), "{text}");
        }
        let Err(NoProbe::Missing(text)) = chosen(&[], None) else { panic!("chosen") };
        assert!(text.contains("no debug probe at this machine") && text.contains("plugged in"), "{text}");
    }

    #[test]
    fn a_probe_without_permission_says_so_with_its_remedy() {
        let locked = Candidate { is_accessible: false, ..candidate("0025A") };
        let Err(NoProbe::Missing(text)) = chosen(&[locked], None) else { panic!("chosen") };
        assert!(text.contains("may not open it"), "{text}");
        #[cfg(target_os = "linux")]
        assert!(text.contains("udev"), "{text}");
    }

    #[test]
    fn a_selector_that_is_none_says_how_one_is_written() {
        for text in ["", "stlink", "0483", "0483:xyz", "10483:374e"] {
            assert!(selector(text).expect_err(text).contains("VID:PID:SERIAL"));
        }
    }
}
