//! Reads a frequency response from a file of any kind that `damprig inspect` knows. What the file does not state is asked for by the option that states it.

use std::path::Path;

use damprig_fourier::Complex;

use super::quantity::Quantity;
use super::unit::quantity_of;
use super::{FrequencyResponse, ResponseLine, Wish};
use crate::failure::Failure;
use crate::signal_file::unit::UnitKind;
use crate::signal_file::{self, Contents, FREQUENCY_RESPONSE, Selector, Signal, SignalAxis, TRANSMISSIBILITY};

/// A frequency response in a file, and what the file does not state.
#[derive(Clone, Copy, Debug)]
pub struct ModalSource<'a> {
    /// The file, and which of its signals: `FILE`, `FILE#3`, `FILE#name`.
    pub file: &'a Path,
    /// Unit of a motion per excitation (`--unit`).
    pub unit: Option<&'a str>,
    /// Signal of the frequencies in Hz (`--frequencies-hz`).
    pub frequencies_hz: Option<&'a str>,
    /// Signal of the coherence (`--coherence`).
    pub coherence: Option<&'a str>,
    /// Averages of the coherence (`--averages`).
    pub averages: Option<f64>,
    /// The band (`--from-hz`, `--to-hz`): a value outside of it may be no number.
    pub band: Wish,
}

/// Coherence that rounding to single precision may give.
const ROUNDED: f64 = 1.0 + 1e-6;

/// A signal that an option names: of its own file (`FILE#name`), or of the file of the frequency response.
///
/// # Errors
/// As [`Selector::read`], with the option.
pub(super) fn named(option: &str, text: &str, file: &Path, contents: &Contents) -> Result<Signal, Failure> {
    let of_text = Selector::of(Path::new(text));
    let found = match (&of_text.which, of_text.path.is_file()) {
        (None, false) => Selector { path: file.into(), which: Some(text.into()) }.choose(contents.clone()),
        _ => of_text.read(),
    };
    found.map_err(|error| Failure::Input(format!("{option} {text}: {error}")))
}

/// Whether a signal may be a frequency response, by what the file calls it.
fn may_be(signal: &Signal) -> bool {
    signal.imaginary.is_some()
        && signal.function.is_none_or(|name| [FREQUENCY_RESPONSE, TRANSMISSIBILITY].contains(&name))
}

/// Whether a file has a single frequency response: one complex signal that is not of another kind.
#[must_use]
pub fn has_one(contents: &Contents) -> bool {
    contents.signals.iter().filter(|signal| may_be(signal)).count() == 1
}

impl ModalSource<'_> {
    /// Reads the frequency response.
    ///
    /// # Errors
    /// A file or a signal that is not there; a signal that is no frequency response; frequencies or a unit that neither file nor option states,
    /// or both; values that are no numbers, frequencies that do not rise, a coherence of another length.
    pub fn read(&self) -> Result<FrequencyResponse, Failure> {
        let selector = Selector::of(self.file);
        let contents = signal_file::read(&selector.path)?;
        let signal = chosen(&selector, &contents)?;
        let taken_from = match (&selector.which, contents.signals.len()) {
            (None, 2..) => format!("{}#{}", selector.path.display(), signal.name),
            _ => self.file.display().to_string(),
        };
        let refuse = |text: String| Failure::Input(format!("{taken_from}: {text}"));
        let imaginary = check_kind(&signal).map_err(refuse)?;
        let frequencies = self.frequencies(&signal, &selector, &contents, &taken_from)?;
        let quantity = quantity(&signal.unit_text, self.unit, &signal.name).map_err(refuse)?;
        let coherence = self.coherence(&frequencies, &selector, &contents)?;
        let mut remarks = Vec::new();
        let is_within =
            |hz: f64| self.band.from_hz.is_none_or(|from| hz >= from) && self.band.to_hz.is_none_or(|to| hz <= to);
        let mut lines = Vec::new();
        let mut impossible: Vec<(f64, f64)> = Vec::new();
        for (n, frequency_hz) in frequencies.into_iter().enumerate() {
            if frequency_hz == 0.0 {
                continue;
            }
            let of_file = Complex::new(signal.values[n], imaginary[n]);
            let h = quantity.in_si(of_file);
            if !h.is_finite() && !is_within(frequency_hz) {
                continue;
            }
            if !h.is_finite() {
                return Err(refuse(format!(
                    "value {} of {:?}, at {frequency_hz} Hz, is {of_file}: it must be a finite number{}\n  choose a band without it with --from-hz \
                     and --to-hz",
                    n + 1,
                    signal.name,
                    if of_file.is_finite() { " other than 0" } else { "" }
                )));
            }
            let coherence = match coherence.as_ref().map(|values| values[n]) {
                Some(value) if !(value > 0.0 && value <= ROUNDED) => {
                    impossible.extend(Some((frequency_hz, value)).filter(|_| is_within(frequency_hz)));
                    continue;
                }
                own => own.map(|value| value.min(1.0)),
            };
            lines.push(ResponseLine { frequency_hz, h, coherence });
        }
        if lines.is_empty() && !impossible.is_empty() {
            return Err(Failure::Input(format!(
                "--coherence {}: no line has a coherence above 0 and up to 1",
                self.coherence.unwrap_or_default()
            )));
        }
        if let Some((hz, value)) =
            impossible.iter().copied().max_by(|a, b| (a.1 - 1.0).abs().total_cmp(&(b.1 - 1.0).abs()))
        {
            remarks.push(format!(
                "{} lines are left out, where the coherence is not above 0 and up to 1: it is {value:.4} at {hz:.4} Hz",
                impossible.len()
            ));
        }
        Ok(FrequencyResponse { taken_from, quantity, lines, averages: self.averages, window_hz: None, remarks })
    }

    fn frequencies(
        &self,
        signal: &Signal,
        selector: &Selector,
        contents: &Contents,
        taken_from: &str,
    ) -> Result<Vec<f64>, Failure> {
        let refuse = |text: String| Failure::Input(format!("{taken_from}: {text}"));
        let count = signal.values.len();
        let (from, places) = match (&signal.axis, self.frequencies_hz) {
            (SignalAxis::Unknown(_), None) => {
                return Err(refuse(format!(
                    "the file does not state the frequencies of {:?}\n  name the signal that has them, in Hz: --frequencies-hz SIGNAL; or state Hz \
                     in its name, for example f_hz",
                    signal.name
                )));
            }
            (SignalAxis::Unknown(_), Some(name)) => {
                let other = named("--frequencies-hz", name, &selector.path, contents)?;
                let refuse = |text: String| Failure::Input(format!("--frequencies-hz {name}: {text}"));
                let si = match other.unit {
                    None => 1.0,
                    Some(unit) if unit.kind == UnitKind::Frequency => unit.si,
                    Some(unit) => {
                        return Err(refuse(format!("{:?} is a {}, not a frequency", other.name, unit.kind.text())));
                    }
                };
                if other.values.len() != count || other.imaginary.is_some() {
                    return Err(refuse(format!(
                        "{:?} has {} {} values, {:?} has {count}: there must be a real frequency for each",
                        other.name,
                        other.values.len(),
                        if other.imaginary.is_some() { "complex" } else { "real" },
                        signal.name
                    )));
                }
                (format!("--frequencies-hz {name}"), other.values.iter().map(|value| value * si).collect())
            }
            (_, Some(name)) => {
                return Err(refuse(format!(
                    "the file states the frequencies of {:?}: leave out --frequencies-hz {name}",
                    signal.name
                )));
            }
            (axis, None) => (taken_from.into(), (0..count).map(|n| axis.at(n)).collect::<Vec<f64>>()),
        };
        let refuse = |text: String| Err(Failure::Input(format!("{from}: {text}")));
        if let Some(n) = places.iter().position(|hz| !(hz.is_finite() && *hz >= 0.0)) {
            return refuse(format!("frequency {} is {} Hz: it must be a number of at least 0", n + 1, places[n]));
        }
        if let Some(n) = places.windows(2).position(|pair| pair[1] <= pair[0]) {
            return refuse(format!(
                "frequency {} is {} Hz, the one before {} Hz: frequencies must rise\n  sort the lines by frequency, and give each sweep a file of \
                 its own",
                n + 2,
                places[n + 1],
                places[n]
            ));
        }
        Ok(places)
    }

    fn coherence(
        &self,
        frequencies: &[f64],
        selector: &Selector,
        contents: &Contents,
    ) -> Result<Option<Vec<f64>>, Failure> {
        let Some(name) = self.coherence else {
            if self.averages.is_some() {
                return Err(Failure::Input("--averages is for a coherence: name its signal with --coherence".into()));
            }
            return Ok(None);
        };
        let signal = named("--coherence", name, &selector.path, contents)?;
        let refuse = |text: String| Err(Failure::Input(format!("--coherence {name}: {text}")));
        if signal.imaginary.is_some() || signal.unit.is_some() || signal.axis.is_time() {
            let what = match (&signal.imaginary, signal.unit) {
                (Some(_), _) => "complex".into(),
                (None, Some(unit)) => format!("a {}", unit.kind.text()),
                (None, None) => "over time".into(),
            };
            return refuse(format!(
                "{:?} is {what}: a coherence is a real number from 0 to 1 over frequency",
                signal.name
            ));
        }
        let count = signal.values.len();
        let is_other = |(n, hz): (usize, &f64)| (signal.axis.at(n) - hz).abs() > 1e-3 * hz.abs().max(1e-9);
        let has_frequencies = !matches!(signal.axis, SignalAxis::Unknown(_));
        if count != frequencies.len() || (has_frequencies && frequencies.iter().enumerate().any(is_other)) {
            return refuse(format!(
                "{:?} has {count} values{}, the frequency response {}: a coherence has the same frequencies",
                signal.name,
                if has_frequencies {
                    format!(" from {} Hz to {} Hz", signal.axis.at(0), signal.axis.at(count - 1))
                } else {
                    String::new()
                },
                frequencies.len()
            ));
        }
        Ok(Some(signal.values))
    }
}

/// The signal of the frequency response.
fn chosen(selector: &Selector, contents: &Contents) -> Result<Signal, Failure> {
    let only = || contents.signals.iter().find(|signal| may_be(signal)).cloned();
    if selector.which.is_none()
        && has_one(contents)
        && let Some(signal) = only()
    {
        return Ok(signal);
    }
    if selector.which.is_none()
        && !contents.signals.is_empty()
        && contents.signals.iter().all(|signal| signal.imaginary.is_none())
    {
        return Err(Failure::Input(format!(
            "{}: there is no complex signal in it\n  a frequency response has real and imaginary parts (columns h_real, h_imag), or a magnitude and a phase \
             (h, phase_deg); two signals over time are FILE#response with --drive",
            selector.path.display()
        )));
    }
    selector.choose(contents.clone())
}

/// The imaginary parts of a signal that may be a frequency response.
fn check_kind(signal: &Signal) -> Result<&[f64], String> {
    let name = &signal.name;
    if signal.axis.is_time() {
        return Err(format!(
            "{name:?} is over time: a frequency response is over frequency\n  for the signals of motion and excitation give --drive, the excitation"
        ));
    }
    let Some(imaginary) = &signal.imaginary else {
        return Err(format!(
            "{name:?} is real: a frequency response is complex, with real and imaginary part or with a phase"
        ));
    };
    if !may_be(signal) {
        let function = signal.function.unwrap_or_default();
        return Err(format!(
            "the file calls {name:?} a {function}: a frequency response or a transmissibility is needed"
        ));
    }
    Ok(imaginary)
}

/// The quantity that a file or `--unit` states.
pub(super) fn quantity(of_file: &str, option: Option<&str>, name: &str) -> Result<Quantity, String> {
    match (quantity_of(of_file), option) {
        (Ok(quantity), None) => Ok(quantity),
        (Ok(_), Some(option)) => {
            Err(format!("the file states the unit {of_file:?} of {name:?}: leave out --unit {option}"))
        }
        (Err(_), Some(option)) => quantity_of(option).map_err(|error| format!("--unit {option}: {error}")),
        (Err(error), None) if of_file.is_empty() => {
            let allowed = error.rsplit_once("allowed are ").map_or("", |(_, units)| units);
            Err(format!("the file does not state the unit of {name:?}\n  state it with --unit: {allowed}"))
        }
        (Err(error), None) => Err(format!("{error}\n  state the unit of {name:?} with --unit")),
    }
}
