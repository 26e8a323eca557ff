//! Selects a debug probe, attaches it to the controller, and writes an image through it.

use probe_rs::flashing::{DownloadOptions, FlashProgress, ProgressEvent};
use probe_rs::probe::list::{Accessibility, Lister};
use probe_rs::probe::{DebugProbeInfo, DebugProbeSelector};
use probe_rs::{MemoryInterface, Permissions, Session};

use super::CHIP;
use super::image::Image;

/// Format of `--probe`.
const WRITTEN: &str = "VID:PID or VID:PID:SERIAL, the first two hexadecimal, as 0483:374e:0025003A3432510D31333430";

/// Why no probe was selected.
#[derive(Debug, PartialEq, Eq)]
pub enum NoProbe {
    /// No suitable probe; the message.
    Missing(String),
    /// Several probes; the message.
    Ambiguous(String),
}

/// Parses the value of `--probe`.
///
/// # Errors
/// Describes the format.
pub fn selector(text: &str) -> Result<DebugProbeSelector, String> {
    text.parse().map_err(|_| format!("must be {WRITTEN}"))
}

/// A connected probe.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// USB ids and serial number.
    pub selector: DebugProbeSelector,
    /// Name.
    pub name: String,
    /// Whether the user has permission to open it.
    pub is_accessible: bool,
}

impl Candidate {
    fn line(&self) -> String {
        let locked = if self.is_accessible { "" } else { "   (no permission)" };
        format!("\n  --probe {}   {}{locked}", self.selector, self.name)
    }
}

/// The connected probes.
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
        // List a probe with several interfaces once.
        if all.iter().all(|other| other.selector != candidate.selector) {
            all.push(candidate);
        }
    }
    all
}

/// Selects the requested probe, or the only one.
///
/// # Errors
/// No probe, several probes, or no permission; the message says what to do.
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
            "no permission to open the debug probe {} ({}){RULE}",
            only.selector, only.name
        ))),
        ([], Some(wanted)) if !all.is_empty() => Err(NoProbe::Missing(format!(
            "no debug probe {wanted}; connected are:{}",
            list(&all.iter().collect::<Vec<_>>())
        ))),
        ([], _) => Err(NoProbe::Missing(format!(
            "no debug probe found: connect the board's USB connector CN1 with a data cable, and close other programs that use it{LINUX}"
        ))),
        (several, _) => {
            Err(NoProbe::Ambiguous(format!("{} debug probes; select one:{}", several.len(), list(several))))
        }
    }
}

const RULE: &str = if cfg!(target_os = "linux") {
    "; add a udev rule, /etc/udev/rules.d/69-probe-rs.rules from https://probe.rs/docs/getting-started/probe-setup/, then `sudo udevadm control --reload && sudo udevadm trigger`"
} else {
    "; is another program using it?"
};

const LINUX: &str = if cfg!(target_os = "linux") {
    "; `lsusb` must list it (an ST-LINK as 0483:374x); a container needs access to the USB devices"
} else {
    ""
};

/// A probe attached to the chip.
pub struct AttachedProbe {
    session: Session,
}

impl AttachedProbe {
    /// Attaches to the running chip without stopping it.
    ///
    /// # Errors
    /// The probe cannot be opened, or no such chip answers.
    pub fn to(candidate: &Candidate) -> Result<Self, String> {
        let probe = Lister::new()
            .open(candidate.selector.clone())
            .map_err(|e| format!("cannot open the debug probe {}: {}", candidate.selector, chain(&e)))?;
        let session = probe.attach(CHIP, Permissions::default()).map_err(|e| {
            format!(
                "no {CHIP} answers at the debug probe {}: {}; check the power of the board and its debug jumpers",
                candidate.selector,
                chain(&e)
            )
        })?;
        Ok(Self { session })
    }

    /// Writes an image and verifies it. Other pages, such as the settings in bank 2, are kept.
    ///
    /// # Errors
    /// Writing or verifying failed.
    pub fn write(&mut self, image: &Image, progress: impl FnMut(ProgressEvent)) -> Result<(), String> {
        let mut loader = self.session.target().flash_loader();
        for (address, bytes) in &image.pieces {
            loader.add_data(*address, bytes).map_err(|e| format!("the image cannot be written: {}", chain(&e)))?;
        }
        let mut options = DownloadOptions::new();
        options.verify = true;
        options.progress = FlashProgress::new(progress);
        loader.commit(&mut self.session, options).map_err(|e| {
            format!("writing the image failed: {}; the firmware on the board is incomplete: flash it again", chain(&e))
        })
    }

    /// Resets the chip.
    ///
    /// # Errors
    /// The probe's error.
    pub fn reset(&mut self) -> Result<(), String> {
        self.with_core("reset the board", |core| core.reset())
    }

    /// Whether the chip's flash holds the image. Does not stop the firmware.
    ///
    /// # Errors
    /// The probe's error.
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

    /// Runs `action` on the chip's core.
    ///
    /// # Errors
    /// "cannot `what`", with the cause.
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

/// An error with its causes, in one line.
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
    fn the_only_probe_is_selected_and_one_of_several_by_serial_number() {
        let two = [candidate("0025A"), candidate("0031B")];
        assert_eq!(chosen(&two[..1], None).as_deref(), Ok("0483:374e:0025A"));
        assert_eq!(chosen(&two, wanted("0483:374e:0031b")).as_deref(), Ok("0483:374e:0031B"));
    }

    #[test]
    fn several_probes_are_listed_in_the_format_of_the_option() {
        let two = [candidate("0025A"), candidate("0031B")];
        for asked in [None, wanted("0483:374e")] {
            let Err(NoProbe::Ambiguous(text)) = chosen(&two, asked) else { panic!("one was chosen") };
            assert!(text.contains("2 debug probes") && text.contains("--probe 0483:374e:0031B   STLINK-V3"), "{text}");
        }
    }

    #[test]
    fn a_missing_probe_is_reported_with_the_connected_ones() {
        for asked in ["0483:3748", "0483:374e:0025"] {
            let Err(NoProbe::Missing(text)) = chosen(&[candidate("0025A")], wanted(asked)) else { panic!("chosen") };
            assert!(text.contains(&format!("no debug probe {asked}")) && text.contains("0483:374e:0025A"), "{text}");
        }
        let Err(NoProbe::Missing(text)) = chosen(&[], None) else { panic!("chosen") };
        assert!(text.contains("no debug probe found") && text.contains("connect the board"), "{text}");
    }

    #[test]
    fn a_probe_without_permission_is_reported_with_the_remedy() {
        let locked = Candidate { is_accessible: false, ..candidate("0025A") };
        let Err(NoProbe::Missing(text)) = chosen(&[locked], None) else { panic!("chosen") };
        assert!(text.contains("no permission to open"), "{text}");
        #[cfg(target_os = "linux")]
        assert!(text.contains("udev"), "{text}");
    }

    #[test]
    fn an_invalid_selector_is_answered_with_the_format() {
        for text in ["", "stlink", "0483", "0483:xyz", "10483:374e"] {
            assert!(selector(text).expect_err(text).contains("VID:PID:SERIAL"));
        }
    }
}
