//! Natural frequency, damping ratio and Coulomb friction from a free vibration.
//!
//! [`identify`] fits the closed form of [`decay_motion`](super::decay_motion) to all samples after the release by least squares:
//! for white noise this is the estimate of least variance. The logarithmic decrement of the turning points is a check by other
//! means; it sees viscous and Coulomb damping together. Friction is never negative: where the best fit has a negative one, the motion is
//! fitted again without friction. `lack_of_fit` tests whether the model holds over the whole record.

use std::f64::consts::{PI, TAU};

use super::backbone::{Backbone, Window, backbone};
use super::decay_motion::DecayMotion;
use super::decay_record::{Swings, swings};
use super::lack_of_fit::{Compared, LackOfFit, lack_of_fit};
use super::statistics::{Fit, Value, fit, inflation, line};
use super::{Estimate, Sensors};
use crate::Refused;

/// What is fitted besides the linear motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecayModel {
    /// Coulomb friction; without it all damping counts as viscous.
    pub coulomb: bool,
    /// The sensor. Its third-order error is fitted where it has one: it changes the scale with the amplitude, as damping does. Its
    /// scale acts on F/k and F only.
    pub sensors: Sensors,
}

/// Natural frequency and damping ratio by one method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecayEstimate {
    /// fn = √(k/M)/2π, Hz.
    pub natural_frequency_hz: Value,
    /// ζ = c/(2√(kM)).
    pub damping_ratio: Value,
}

/// What a free vibration shows.
#[derive(Clone, Debug)]
pub struct Decay {
    /// By least squares.
    pub fitted: DecayEstimate,
    /// By the logarithmic decrement; its damping includes the friction's.
    pub by_decrement: DecayEstimate,
    /// F/k, m, of the fit with friction, in which it may be negative; none if it was not fitted.
    pub coulomb_m: Option<Value>,
    /// Third-order error of the sensor, 1/m²; none if it was not fitted.
    pub cubic_per_m2: Option<Value>,
    /// Periods used.
    pub periods: f64,
    /// First and last swing, m.
    pub swings_m: [f64; 2],
    /// RMS of the residuals, m.
    pub residual_rms_m: f64,
    /// By how much correlation of neighbouring residuals raises the variance of a mean: 1 for white noise. The uncertainties include its square root.
    pub inflation: f64,
    /// The fitted motion; its friction is at least 0.
    pub motion: DecayMotion,
    /// Times of the samples that are fitted, s.
    pub times_s: Vec<f64>,
    /// What the fit leaves of each, m.
    pub residuals_m: Vec<f64>,
    /// Damping ratio and frequency over the amplitude; none for a record of too few cycles.
    pub backbone: Option<Backbone>,
    /// What does not fit; none where the model holds, and where there is no backbone.
    pub lack_of_fit: Option<LackOfFit>,
}

/// Uncertainty of ζ relative to ζ above which a decay is too short.
const MAX_UNCERTAIN: f64 = 0.5;

/// Identifies a free vibration: displacements at times that rise.
///
/// # Errors
/// A record without release or swings, too short, growing, saturated or frozen: what was seen, and what to do.
pub fn identify(t_s: &[f64], x_m: &[f64], model: DecayModel) -> Result<Decay, Refused> {
    let swings = swings(t_s, x_m)?;
    let by_decrement = decrement(&swings)?;
    let used = swings.first..swings.end;
    let (times, readings) = (&t_s[used.clone()], &x_m[used]);
    let start = start(&swings, &by_decrement);
    let friction = friction_start(&swings, 0.0).filter(|_| model.coulomb);
    let fit_with = |model, friction| {
        fit_motion(times, readings, &start, model, friction).ok_or_else(|| {
            Refused(
                "the motion cannot be fitted by a free vibration with viscous and Coulomb damping\n  is the particle or another \
                 damper on the structure? the record must be of the structure alone"
                    .into(),
            )
        })
    };
    let (free, indices) = fit_with(model, friction)?;
    let block = (swings.samples_per_period / 8.0).round() as usize;
    let inflation = inflation(&free.residuals, block);
    let variance = free.variance() * inflation;
    let coulomb_m = indices.coulomb.map(|index| free.value(index, variance));
    let (fitted, indices) = match coulomb_m.filter(|coulomb| coulomb.value < 0.0) {
        Some(_) => fit_with(DecayModel { coulomb: false, ..model }, None)?,
        None => (free.clone(), indices),
    };
    // Friction may be there though the best fit has none: the uncertainties stay those of the fit with friction.
    let value = |index: usize| Value { value: fitted.parameters[index], ..free.value(index, variance) };
    let omega = value(0);
    let motion = motion_of(&fitted.parameters, indices);
    let swings_m = [swings.turnings[0].1.abs(), swings.turnings[swings.turnings.len() - 1].1.abs()];
    let periods = (swings.crossings_s.len() - 1) as f64 / 2.0;
    let by_cubic =
        model.sensors.share_of_cubic(swings_m[0], swings_m[0]) - model.sensors.share_of_cubic(swings_m[1], swings_m[0]);
    let by_decrement = DecayEstimate {
        damping_ratio: by_decrement.damping_ratio.widened(model.sensors.scale * by_cubic / (TAU * periods)),
        ..by_decrement
    };
    let mut decay = Decay {
        fitted: DecayEstimate {
            natural_frequency_hz: omega.mapped(omega.value / TAU, 1.0 / TAU),
            damping_ratio: value(1),
        },
        by_decrement,
        coulomb_m: coulomb_m.map(|coulomb| coulomb.widened(model.sensors.scale * coulomb.value)),
        cubic_per_m2: indices.cubic.map(|index| {
            let variance = fitted.variance() * inflation;
            fitted.value(index, variance)
        }),
        periods,
        swings_m,
        residual_rms_m: fitted.variance().sqrt(),
        inflation,
        motion,
        times_s: times.to_vec(),
        residuals_m: fitted.residuals,
        backbone: backbone(t_s, x_m, &swings, by_decrement.damping_ratio.value),
        lack_of_fit: None,
    };
    check_result(&decay)?;
    decay.test_fit(t_s, &swings);
    Ok(decay)
}

impl Decay {
    /// Compares the record with the readings of the fitted motion, and widens the intervals by what does not fit.
    fn test_fit(&mut self, t_s: &[f64], swings: &Swings) {
        let mut expected = Vec::with_capacity(t_s.len());
        self.motion.readings(t_s, &mut expected);
        let start = self.by_decrement.damping_ratio.value;
        let Some((record, model)) = self.backbone.as_ref().zip(backbone(t_s, &expected, swings, start)) else { return };
        let of_model =
            self::swings(&self.times_s, &expected[swings.first..swings.end]).and_then(|s| decrement(&s)).ok();
        let compared = Compared {
            record,
            model: &model,
            decrements: of_model.map(|modal| [self.by_decrement.damping_ratio, modal.damping_ratio]),
            coulomb: self.coulomb_m,
            frequency_hz: self.fitted.natural_frequency_hz.value,
            swing_m: self.swings_m[0],
            step_s: (t_s[t_s.len() - 1] - t_s[0]) / (t_s.len() - 1) as f64,
        };
        self.lack_of_fit = lack_of_fit(&compared);
        if let Some(lack) = self.lack_of_fit.as_ref().filter(|lack| lack.contradicts()) {
            let windows = &record.windows;
            // The decrement is one value for all windows, the fit a model of them.
            let from = |modal: &DecayEstimate| {
                let largest = |of: fn(&Window) -> f64, value: &Value| {
                    windows.iter().map(|window| (of(window) - value.value).abs()).fold(0.0, f64::max)
                };
                let damping_ratio = largest(|window| window.damping_ratio.value, &modal.damping_ratio);
                (damping_ratio, largest(|window| window.natural_frequency_hz.value, &modal.natural_frequency_hz))
            };
            let of_decrement = from(&self.by_decrement);
            let of_fit = (lack.damping_ratio, lack.natural_frequency_hz);
            for (modal, (damping_ratio, frequency_hz)) in
                [(&mut self.fitted, of_fit), (&mut self.by_decrement, of_decrement)]
            {
                modal.damping_ratio = LackOfFit::widened(&modal.damping_ratio, damping_ratio);
                modal.natural_frequency_hz = LackOfFit::widened(&modal.natural_frequency_hz, frequency_hz);
            }
        }
    }
}

fn check_result(decay: &Decay) -> Result<(), Refused> {
    let zeta = &decay.fitted.damping_ratio;
    if decay.residual_rms_m > 0.1 * decay.swings_m[0] {
        return Err(Refused(format!(
            "the record is not a free vibration of one mass: the fit leaves {:.6} m RMS of a swing of {:.6} m\n  is a damper \
             mounted, or does the base move? the record must be of the structure alone on a base at rest",
            decay.residual_rms_m, decay.swings_m[0]
        )));
    }
    if zeta.standard_uncertainty > MAX_UNCERTAIN * zeta.value.abs()
        && decay.coulomb_m.is_none_or(|c| c.value < 2.0 * c.standard_uncertainty)
    {
        return Err(Refused(format!(
            "the decay is too short: the swing goes from {:.6} m to {:.6} m in {:.1} periods, and the damping ratio {:.3e} has \
             the uncertainty {:.3e}\n  record longer or release from farther out; without friction in the structure, fit \
             viscous damping alone (--viscous)",
            decay.swings_m[0], decay.swings_m[1], decay.periods, zeta.value, zeta.standard_uncertainty
        )));
    }
    Ok(())
}

/// By the turning points: ln|x| falls by δ/2 from one to the next, and the crossings are half a period apart.
fn decrement(swings: &Swings) -> Result<DecayEstimate, Refused> {
    let all: Vec<f64> = swings.turnings.iter().map(|t| t.1).collect();
    let offsets: Vec<f64> = all.windows(3).map(|w| 0.25 * (w[0] + 2.0 * w[1] + w[2])).collect();
    let offset = offsets.iter().sum::<f64>() / offsets.len().max(1) as f64;
    let sizes: Vec<f64> = all.iter().map(|x| (x - offset).abs()).collect();
    let places: Vec<f64> = (0..sizes.len()).map(|n| n as f64).collect();
    let logs: Vec<f64> = sizes.iter().map(|size| size.max(f64::MIN_POSITIVE).ln()).collect();
    let half_periods: Vec<f64> = (0..swings.crossings_s.len()).map(|n| n as f64).collect();
    let lines = line(&places, &logs, |n| sizes[n] * sizes[n]).zip(line(&half_periods, &swings.crossings_s, |_| 1.0));
    let Some((fall, time)) = lines else {
        return Err(Refused("too few turning points for a decrement: record longer".into()));
    };
    let decrement = -2.0 * fall.slope.value;
    let length = (TAU * TAU + decrement * decrement).sqrt();
    let zeta = decrement / length;
    // dζ/dδ = 4π²/(4π² + δ²)^(3/2), and δ is twice the slope.
    let damping_ratio = fall.slope.mapped(zeta, 2.0 * TAU * TAU / length.powi(3));
    let half_s = time.slope.value;
    let natural = 0.5 / half_s / (1.0 - zeta * zeta).sqrt();
    Ok(DecayEstimate { natural_frequency_hz: time.slope.mapped(natural, natural / half_s), damping_ratio })
}

/// Where the fit starts.
fn start(swings: &Swings, modal: &DecayEstimate) -> DecayMotion {
    let (turning_s, turning_m) = swings.turnings[0];
    DecayMotion {
        angular_frequency_rad_per_s: TAU * modal.natural_frequency_hz.value,
        damping_ratio: modal.damping_ratio.value.clamp(-0.5, 0.9),
        turning_m,
        turning_s,
        offset_m: swings.centre_m,
        coulomb_m: 0.0,
        lag_m: 0.0,
        cubic_per_m2: 0.0,
    }
}

/// Damping ratio and F/k from the sizes of the turning points: each is |x| − 2F/k − … of the one before, in a line.
fn friction_start(swings: &Swings, offset_m: f64) -> Option<(f64, f64)> {
    let sizes: Vec<f64> = swings.turnings.iter().map(|turning| (turning.1 - offset_m).abs()).collect();
    let (before, after) = (&sizes[..sizes.len() - 1], &sizes[1..]);
    let line = line(before, after, |_| 1.0)?;
    let decay = line.slope.value.clamp(0.1, 1.0);
    let exponent = -decay.ln() / PI;
    Some((exponent / (1.0 + exponent * exponent).sqrt(), -line.intercept.value / (1.0 + decay)))
}

/// Places of the Coulomb friction, which that of the sensor's lag follows, and of the sensor's third-order error among the parameters.
#[derive(Clone, Copy, Debug, Default)]
struct Indices {
    coulomb: Option<usize>,
    cubic: Option<usize>,
}

fn motion_of(parameters: &[f64], indices: Indices) -> DecayMotion {
    DecayMotion {
        angular_frequency_rad_per_s: parameters[0],
        damping_ratio: parameters[1].clamp(-0.9, 0.99),
        turning_m: parameters[2],
        turning_s: parameters[3],
        offset_m: parameters[4],
        coulomb_m: indices.coulomb.map_or(0.0, |index| parameters[index]),
        lag_m: indices.coulomb.map_or(0.0, |index| parameters[index + 1]),
        cubic_per_m2: indices.cubic.map_or(0.0, |index| parameters[index]),
    }
}

/// Fits the linear motion first, then with the other parameters; damping and friction start from `friction`.
fn fit_motion(
    t_s: &[f64],
    x_m: &[f64],
    start: &DecayMotion,
    model: DecayModel,
    friction: Option<(f64, f64)>,
) -> Option<(Fit, Indices)> {
    let size = start.turning_m.abs();
    let mut parameters =
        vec![start.angular_frequency_rad_per_s, start.damping_ratio, start.turning_m, start.turning_s, start.offset_m];
    let mut steps = vec![
        1e-7 * start.angular_frequency_rad_per_s,
        1e-6,
        1e-5 * size,
        1e-5 * PI / start.angular_frequency_rad_per_s,
        1e-5 * size,
    ];
    let linear = |p: &[f64], out: &mut Vec<f64>| motion_of(p, Indices::default()).readings(t_s, out);
    let first = fit(x_m, &parameters, &steps, linear)?;
    let mut indices = Indices::default();
    if !model.coulomb && !model.sensors.has_cubic() {
        return Some((first, indices));
    }
    parameters = first.parameters;
    if model.coulomb {
        indices.coulomb = Some(parameters.len());
        let (damping_ratio, coulomb_m) = friction.unwrap_or((parameters[1], 0.0));
        (parameters[1], parameters[2]) = (damping_ratio, start.turning_m);
        parameters.extend([coulomb_m, 0.0]);
        steps.extend([1e-6 * size; 2]);
    }
    if model.sensors.has_cubic() {
        indices.cubic = Some(parameters.len());
        parameters.push(0.0);
        steps.push(1e-5 / (size * size));
    }
    let whole = fit(x_m, &parameters, &steps, |p, out| motion_of(p, indices).readings(t_s, out))?;
    Some((whole, indices))
}

const FITTED: &str = "least-squares fit of the motion";
const DECREMENT: &str = "logarithmic decrement of the turning points";

impl Decay {
    /// The estimates: those of the fit are the values of a set-up's keys. `mass_kg` of the structure makes a force of the
    /// friction.
    #[must_use]
    pub fn estimates(&self, mass_kg: Option<f64>) -> Vec<Estimate> {
        let frequency = |modal: &DecayEstimate, method| {
            Estimate::new("natural frequency", "Hz", method, &modal.natural_frequency_hz)
        };
        let damping = |modal: &DecayEstimate, name, method| Estimate::new(name, "", method, &modal.damping_ratio);
        let viscous = if self.coulomb_m.is_some() { "viscous damping ratio" } else { "damping ratio" };
        let mut all = vec![
            frequency(&self.fitted, FITTED).of_key("structure.natural_frequency_hz"),
            damping(&self.fitted, viscous, FITTED).of_key("structure.damping_ratio"),
        ];
        // Without a model that holds, friction and the sensor's error have no meaning.
        let holds = self.contradiction().is_none();
        if let Some(coulomb) = self.coulomb_m.as_ref().filter(|_| holds) {
            all.push(Estimate::not_negative("Coulomb friction over stiffness, F/k", "m", FITTED, coulomb, None));
            if let Some(mass_kg) = mass_kg {
                let stiffness = mass_kg * self.motion.angular_frequency_rad_per_s.powi(2);
                let force = coulomb.mapped(coulomb.value * stiffness, stiffness);
                let key = Some("friction_damper.force_n");
                all.push(Estimate::not_negative("Coulomb friction force", "N", FITTED, &force, key));
            }
        }
        if let Some(cubic) = self.cubic_per_m2.as_ref().filter(|_| holds) {
            all.push(Estimate::new("third-order sensor error", "1/m²", FITTED, cubic));
        }
        all.push(frequency(&self.by_decrement, DECREMENT));
        all.push(damping(&self.by_decrement, "damping ratio, friction included", DECREMENT));
        all
    }

    /// What does not fit, a sentence each; none where the record was too short to test.
    #[must_use]
    pub fn misfits(&self) -> Option<Vec<String>> {
        self.backbone.as_ref()?;
        let sentences = |lack: &LackOfFit| lack.sentences(self.coulomb_m.is_some());
        Some(self.lack_of_fit.as_ref().map(sentences).unwrap_or_default())
    }

    /// Why the fitted values are not those of the whole record: another method contradicts them.
    #[must_use]
    pub fn contradiction(&self) -> Option<String> {
        let lack = self.lack_of_fit.as_ref().filter(|lack| lack.contradicts())?;
        let [first, second] = lack.halves;
        Some(format!(
            "the fit gives the damping ratio {:.5}, the windows of the first half of the record {first:.5} and those of the second {second:.5}",
            self.fitted.damping_ratio.value
        ))
    }

    /// What a person has to know about the estimates.
    #[must_use]
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = vec![format!(
            "{:.1} periods, swing from {:.4} mm to {:.4} mm; the fit leaves {:.2} µm RMS",
            self.periods,
            self.swings_m[0] * 1e3,
            self.swings_m[1] * 1e3,
            self.residual_rms_m * 1e6
        )];
        match &self.backbone {
            Some(backbone) => remarks[0] += &format!(", fits of {} cycles {:.2} µm RMS", backbone.cycles, backbone.noise_rms_m() * 1e6),
            None => remarks.push(
                "whether the model holds over the record was not tested: that needs three windows of two cycles and 40 samples or more"
                    .into(),
            ),
        }
        if let Some(contradiction) = self.contradiction() {
            remarks.push(format!(
                "{contradiction}. The intervals of fit and decrement are widened to cover all windows, so they are no measure of one constant \
                 damping ratio; friction and the sensor's error are withheld. Take damping ratio and frequency from the table, at the amplitude \
                 of interest; a single decay does not tell amplitude from time"
            ));
            return remarks;
        }
        if self.inflation > 1.5 {
            remarks.push(format!(
                "neighbouring residuals are correlated: the uncertainties are widened by {:.1}; the motion has something that \
                 the model does not, or the noise is not white",
                self.inflation.sqrt()
            ));
        }
        if self.coulomb_m.is_some_and(|coulomb| !coulomb.is_found()) {
            remarks.push(
                "no Coulomb friction is found; if there is none, --viscous gives a narrower damping ratio".into(),
            );
        }
        remarks.push(
            match self.coulomb_m {
                Some(_) => {
                    "report the viscous damping ratio of the fit: it does not depend on the amplitude, since friction and the sensor's \
                     third-order error are fitted apart from it. The decrement, and a frequency response, count friction as damping"
                }
                None => {
                    "report the damping ratio of the fit if the structure has no friction: all friction counts as damping here, and then \
                     ζ depends on the amplitude. The decrement also counts the sensor's third-order error"
                }
            }
            .into(),
        );
        remarks
    }
}
