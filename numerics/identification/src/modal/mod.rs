//! Natural frequency, damping ratio and modal constant of one mode from a frequency response H of a laboratory's file.
//!
//! [`identify`] takes a band about a peak and fits one mode with residual terms (`fit`), compares it with a line through the lines of
//! the peak (`line_fit`), and tests what the mode does not explain (`misfit`).

mod band;
mod fit;
mod line_fit;
mod linear;
mod misfit;
pub mod quantity;

use std::f64::consts::{PI, TAU};

use damprig_fourier::Complex;

use super::Estimate;
use super::lack_of_fit::LackOfFit;
use super::statistics::Value;
use super::time_response::{HANN_WIDTH_LINES, RESOLVED_LINES};
use crate::Refused;
pub use band::Wish;
use fit::{Band, FittedMode};
pub use line_fit::ByLine;
pub use misfit::ModalMisfit;
use quantity::Quantity;

/// A measured frequency response.
#[derive(Clone, Debug, PartialEq)]
pub struct FrequencyResponse {
    /// The file and its signals.
    pub taken_from: String,
    /// What it is of.
    pub quantity: Quantity,
    /// Its lines, by rising frequencies above 0.
    pub lines: Vec<ResponseLine>,
    /// Independent averages that the coherence is of, if they are known.
    pub averages: Option<f64>,
    /// Width of a line of the window, Hz, if it is known.
    pub window_hz: Option<f64>,
    /// What a person has to know of it.
    pub remarks: Vec<String>,
}

/// A line of a frequency response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResponseLine {
    /// Frequency, Hz; greater than 0.
    pub frequency_hz: f64,
    /// Motion per excitation, SI units.
    pub h: Complex<f64>,
    /// γ², above 0 and at most 1, if it was measured.
    pub coherence: Option<f64>,
}

/// A mode and how it was found.
#[derive(Clone, Debug)]
pub struct Modal {
    /// What H is of.
    pub quantity: Quantity,
    /// The lines that were fitted.
    pub lines: Vec<ResponseLine>,
    /// Measured less fitted H of each, SI units.
    pub residuals: Vec<Complex<f64>>,
    /// Standard uncertainty of the real and of the imaginary part of each.
    pub uncertainties: Vec<f64>,
    /// fn, Hz.
    pub natural_frequency_hz: Value,
    /// ζ.
    pub damping_ratio: Value,
    /// A of A/(ωn² − ω² + 2ζωnωj), as displacement per excitation: 1/kg, or the participation (1 for a single mass) of a transmissibility.
    pub constant: Complex<f64>,
    /// |A|.
    pub size: Value,
    /// By the lines about the peak alone, where there are enough.
    pub by_line: Option<ByLine>,
    /// What does not fit.
    pub misfits: Vec<ModalMisfit>,
    /// Share of |H| at fn that is of other modes.
    pub of_others: f64,
    mode: FittedMode,
}

/// Deviation that is refused, RMS over the RMS of H.
const MAX_DEVIATION: f64 = 0.3;

/// Uncertainty of ζ relative to ζ that is refused.
const MAX_UNCERTAIN: f64 = 0.5;

/// Identifies a mode: within the band that is wished, or about the highest peak.
///
/// # Errors
/// A band without lines, a response without a peak, one that is not that of a mode: what was seen, and what to do.
pub fn identify(response: &FrequencyResponse, wish: Wish) -> Result<Modal, Refused> {
    let refuse = |text: String| Refused(format!("{}: {text}", response.taken_from));
    let within = band::wished(&response.lines, wish).map_err(refuse)?;
    let peak = within.start + band::peak(&response.lines[within.clone()]).map_err(refuse)?;
    let not_a_mode = || {
        refuse(format!(
            "the lines about the peak at {:.4} Hz are not the response of a mode with viscous damping\n  choose another band with --from-hz and \
             --to-hz; is H complex, with the right sign and unit?",
            response.lines[peak].frequency_hz
        ))
    };
    let fit = |range: std::ops::Range<usize>| {
        let band = of_lines(response, &response.lines[range.clone()]);
        band.fit(peak - range.start).and_then(|mode| result(&band, mode)).ok_or_else(not_a_mode)
    };
    if wish.from_hz.is_some() && wish.to_hz.is_some() {
        return fit(within)?.checked().map_err(refuse);
    }
    let all = &response.lines;
    let rough = fit(band::about(all, &within, peak, None))?;
    let of_widths = |widths: f64| fit(band::about(all, &within, peak, Some(widths * rough.width_hz())));
    let widest = of_widths(band::WIDTHS)?;
    // The other modes bend the flanks: nearer to the peak they do so less.
    let narrower = std::iter::successors(Some(band::NARROWER * band::WIDTHS), |widths| Some(band::NARROWER * widths));
    let narrower = narrower.take_while(|widths| *widths > band::MIN_WIDTHS).filter_map(|widths| of_widths(widths).ok());
    let is_of_others = matches!(widest.misfits.first(), Some(ModalMisfit::Background | ModalMisfit::Mode(_)));
    let found = if is_of_others { narrower.into_iter().find(|found| found.misfits.is_empty()) } else { None };
    found.unwrap_or(widest).checked().map_err(refuse)
}

fn of_lines<'a>(response: &FrequencyResponse, lines: &'a [ResponseLine]) -> Band<'a> {
    Band { lines, quantity: response.quantity, averages: response.averages, window_hz: response.window_hz }
}

fn result(band: &Band, mode: FittedMode) -> Option<Modal> {
    let of_mode = band.sensitivities(&mode)?;
    let lack = misfit::test(band, &mode, &of_mode);
    // What coherence and averages state is not less than what the fit leaves.
    let (inflation, known) = (lack.inflation * lack.scatter, band.known());
    let value = |parameter: usize, value: f64| of_mode.value(parameter, value, &mode, inflation, known);
    // Hann's window lowers the peak by a third of the square of the widths' ratio; as an uncertainty, that over √3.
    let width_hz = 2.0 * mode.place[1] * mode.place[0];
    let bias = band.window_hz.map_or(0.0, |window_hz| (window_hz / width_hz).powi(2) / 3.0 / 3f64.sqrt());
    let of_window = [bias * width_hz, bias * mode.place[1]];
    let widened_by = |value: Value, place: usize| LackOfFit::widened(&value, lack.shift[place]);
    let widened = |value: Value, place: usize| widened_by(value.widened(of_window[place]), place);
    let constant = mode.factors[0];
    let size = widened_by(of_mode.size(constant, &mode, inflation, known), 2);
    let [natural_hz, zeta] = mode.place;
    let others = [Complex::new(0.0, 0.0), mode.factors[1], mode.factors[2]];
    let fixed = band.quantity.of_receptance(TAU * natural_hz).0;
    let of_others = (band.fitted(mode.place, others, natural_hz) - fixed).norm()
        / (band.fitted(mode.place, mode.factors, natural_hz) - fixed).norm();
    Some(Modal {
        quantity: band.quantity,
        lines: band.lines.to_vec(),
        residuals: mode.residuals.clone(),
        uncertainties: mode.variances.iter().map(|v| v.sqrt()).collect(),
        natural_frequency_hz: widened(value(0, natural_hz), 0),
        damping_ratio: widened(value(1, zeta), 1),
        constant,
        size,
        by_line: lack.by_line,
        misfits: lack.misfits,
        of_others,
        mode,
    })
}

/// Lines in the half-power width below which a stored response may show the window in place of the mode: twice the width of Hann's window, which
/// makes ζ too large by up to a twelfth there.
const MIN_LINES: f64 = 2.0 * HANN_WIDTH_LINES;

/// How the values were found.
const METHOD: &str = "fit of a mode with residual terms";
const BY_LINE: &str = "line through 1/H about the peak";

impl Modal {
    fn checked(self) -> Result<Self, String> {
        let (natural, zeta) = (self.natural_frequency_hz.value, &self.damping_ratio);
        let rms = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>().sqrt();
        let deviation = rms(&mut self.residuals.iter().map(Complex::norm_sqr))
            / rms(&mut self.lines.iter().map(|line| line.h.norm_sqr()));
        let (from, to) = (self.lines[0].frequency_hz, self.lines[self.lines.len() - 1].frequency_hz);
        if deviation > MAX_DEVIATION {
            return Err(format!(
                "H from {from:.4} Hz to {to:.4} Hz is not that of a mode with viscous damping: it deviates by {:.0} % RMS\n  choose a band about \
                 one peak with --from-hz and --to-hz",
                100.0 * deviation
            ));
        }
        if !(from..=to).contains(&natural) {
            return Err(format!(
                "the mode that fits best has {natural:.4} Hz, outside of the band from {from:.4} Hz to {to:.4} Hz\n  choose a band about one peak \
                 with --from-hz and --to-hz"
            ));
        }
        if zeta.standard_uncertainty > MAX_UNCERTAIN * zeta.value {
            return Err(format!(
                "the damping ratio {:.3e} has the uncertainty {:.3e}: the lines do not resolve the resonance at {natural:.4} Hz\n  measure with a \
                 finer resolution there",
                zeta.value, zeta.standard_uncertainty
            ));
        }
        Ok(self)
    }

    /// The estimates. At a drive point the modal constant is the inverse of the modal mass of the mode shape that is 1 there; elsewhere it has the
    /// mode shapes of both places, so that there is no mass.
    #[must_use]
    pub fn estimates(&self, is_drive_point: bool) -> Vec<Estimate> {
        let mut all = vec![
            Estimate::new("natural frequency", "Hz", METHOD, &self.natural_frequency_hz)
                .of_key("structure.natural_frequency_hz"),
            Estimate::new("damping ratio", "", METHOD, &self.damping_ratio).of_key("structure.damping_ratio"),
        ];
        if let Some(line) = &self.by_line {
            all.push(Estimate::new("natural frequency", "Hz", BY_LINE, &line.natural_frequency_hz));
            all.push(Estimate::new("damping ratio", "", BY_LINE, &line.damping_ratio));
        }
        if !self.quantity.is_per_force() {
            all.push(Estimate::new("modal participation", "", METHOD, &self.size));
            return all;
        }
        all.push(Estimate::new("modal constant", "1/kg", METHOD, &self.size));
        if is_drive_point {
            let mass = self.size.value.recip();
            let square = (TAU * self.natural_frequency_hz.value).powi(2);
            let of_size = |factor: f64| self.size.mapped(factor * mass, factor * mass * mass);
            all.push(Estimate::new("modal mass at the drive point", "kg", METHOD, &of_size(1.0)));
            // fn is known so much better than the constant that its share does not count.
            all.push(Estimate::new("modal stiffness at the drive point", "N/m", METHOD, &of_size(square)));
        }
        all
    }

    /// H of the fitted mode with its residual terms, SI units.
    #[must_use]
    pub fn fitted(&self, frequency_hz: f64) -> Complex<f64> {
        let band = Band { lines: &[], quantity: self.quantity, averages: None, window_hz: None };
        band.fitted(self.mode.place, self.mode.factors, frequency_hz)
    }

    /// Half-power width, Hz.
    #[must_use]
    pub fn width_hz(&self) -> f64 {
        2.0 * self.damping_ratio.value * self.natural_frequency_hz.value
    }

    /// Mean distance of the lines, Hz.
    #[must_use]
    pub fn spacing_hz(&self) -> f64 {
        let ends = self.lines.first().zip(self.lines.last());
        ends.map_or(0.0, |(first, last)| {
            (last.frequency_hz - first.frequency_hz) / (self.lines.len() - 1).max(1) as f64
        })
    }

    /// What does not fit, a sentence each.
    #[must_use]
    pub fn sentences(&self) -> Vec<String> {
        let unresolved = (self.lines_in_width() < MIN_LINES).then(|| {
            format!(
                "the peak is {:.1} lines wide, less than {:.1}: ζ may be that of the analyser's window, and its interval does not include that; measure with \
                 finer lines",
                self.lines_in_width(),
                MIN_LINES
            )
        });
        self.misfits.iter().map(ModalMisfit::sentence).chain(unresolved).collect()
    }

    /// Lines in the half-power width.
    fn lines_in_width(&self) -> f64 {
        self.width_hz() / self.spacing_hz()
    }

    /// What a person has to know of the values.
    #[must_use]
    pub fn remarks(&self, is_drive_point: bool) -> Vec<String> {
        let (first, last) = (self.lines[0], self.lines[self.lines.len() - 1]);
        let rms = |values: Vec<f64>| (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
        let peak = self.fitted(self.natural_frequency_hz.value).norm();
        let mut remarks = vec![
            format!(
                "the {} is fitted from {:.4} Hz to {:.4} Hz, {} lines; it deviates by {:.2} % of the peak RMS, and other modes add {:.1} % at fn",
                self.quantity.name(),
                first.frequency_hz,
                last.frequency_hz,
                self.lines.len(),
                100.0 * rms(self.residuals.iter().map(|r| r.norm()).collect()) / peak,
                100.0 * self.of_others
            ),
            format!(
                "the half-power width is {:.4} Hz, {:.1} lines of {:.4} Hz{}",
                self.width_hz(),
                self.lines_in_width(),
                self.spacing_hz(),
                if self.lines_in_width() >= RESOLVED_LINES {
                    ""
                } else {
                    ": under Hann's window the peak would be as wide as the window, and ζ too large; a stepped sine, or a free vibration that ends \
                     within the record under a rectangular window, is not widened; an exponential window adds its own damping"
                }
            ),
        ];
        let phase = self.constant.arg() * 180.0 / PI;
        let fold = phase.abs().min(180.0 - phase.abs());
        let sign = match (self.quantity.is_per_force(), is_drive_point) {
            (false, _) => {
                "of a structure with proportional damping it is 0° or 180°; of a single mass the participation is 1"
            }
            (_, true) => "at a drive point it is 0°: otherwise a sign, a delay or the place is wrong",
            (_, false) => {
                "with proportional damping it is 0° or 180°; --drive-point gives the modal mass where force and motion are at one place"
            }
        };
        remarks.push(format!("the phase of the modal constant is {phase:.1}°, {fold:.1}° from real: {sign}"));
        if self.by_line.is_none() {
            remarks.push("fewer than 4 lines are about the peak: there is no second method".into());
        }
        remarks
    }

    /// Why the values are not to be written: what contradicts them.
    #[must_use]
    pub fn contradiction(&self) -> Option<String> {
        let sentences = self.sentences();
        (!sentences.is_empty()).then(|| sentences.join("; "))
    }
}
