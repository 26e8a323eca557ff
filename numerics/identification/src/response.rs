//! Natural frequency and damping ratio from a frequency response: amplitudes of structure and base, or of structure and force, and
//! their phase.
//!
//! On a moved base X/Z = (1 + 2ζrj)/(1 − r² + 2ζrj) with r = f/fn, for absolute displacements of a structure with viscous damping. Under
//! a force on the structure the receptance X/P = 1/(k·(1 − r² + 2ζrj)), which also gives the stiffness k and the mass k/ω². The
//! relative deviations are fitted by least squares: of the complex ratio where there is a phase, else of its logarithm.

use std::f64::consts::TAU;

use super::statistics::{Fit, fit};
use super::{Estimate, Sensors};
use crate::Refused;

/// What moves the structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DrivenBy {
    /// Its base, by z.
    Base,
    /// A force on the structure, over a base at rest.
    Force,
}

/// Points of a response, and what they were taken from.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// Run, set-up and experiment, or a file, in words.
    pub taken_from: String,
    /// What moves the structure.
    pub driven_by: DrivenBy,
    /// The points.
    pub points: Vec<Point>,
    /// The sensors of x and z, or of x and the force.
    pub sensors: Sensors,
    /// What has to be known about them.
    pub remarks: Vec<String>,
}

/// A measured point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Drive frequency, Hz.
    pub frequency_hz: f64,
    /// Amplitude of x over that of z, or over that of the force, m/N.
    pub ratio: f64,
    /// Phase of x relative to z or to the force, rad.
    pub phase_rad: Option<f64>,
    /// Standard uncertainty of the ratio, relative, if it is known; only the relation of the points' values counts, and the
    /// result's uncertainty is not smaller than they make it.
    pub uncertainty: Option<f64>,
    /// Amplitude of x, m.
    pub x_m: f64,
}

/// Real and imaginary part of X/Z, of the parameters fn and ζ, or of X/P, m/N, of fn, ζ and k; of four, of X/Z = 1 + Γφ r²/(1 − r² +
/// 2ζrj) + B, a mode that takes part otherwise (Γφ, 1 for one degree of freedom) and what other modes leave (B, 0 for none).
fn response(frequency_hz: f64, parameters: &[f64]) -> (f64, f64) {
    let r = frequency_hz / parameters[0];
    let (stiff, loss) = (1.0 - r * r, 2.0 * parameters[1] * r);
    let square = stiff * stiff + loss * loss;
    let (real, imaginary) = (stiff / square, -loss / square);
    match parameters[2..] {
        [stiffness] => (real / stiffness, imaginary / stiffness),
        [participation, others] => (1.0 + participation * r * r * real + others, participation * r * r * imaginary),
        _ => (1.0 + r * r * real, r * r * imaginary),
    }
}

/// Natural frequency (Hz) and damping ratio of the linear structure on a moved base that responds with this ratio X/Z and this phase of x
/// relative to z (rad) at a frequency (Hz): (ωn² + 2jζωnΩ)(x − z) = Ω² x. Not numbers where no such structure does.
///
/// Of a nonlinear damper they are the equivalents at the amplitude of the point.
#[must_use]
pub fn equivalent(frequency_hz: f64, ratio: f64, phase_rad: f64) -> (f64, f64) {
    let (x_re, x_im) = (ratio * phase_rad.cos(), ratio * phase_rad.sin());
    // x/(x − z).
    let (re, im) = (x_re - 1.0, x_im);
    let square = re * re + im * im;
    let (stiff, loss) = ((x_re * re + x_im * im) / square, (x_im * re - x_re * im) / square);
    (frequency_hz * stiff.sqrt(), 0.5 * loss / stiff.sqrt())
}

/// Least relative uncertainty of a point: of sensors and calibration.
pub const MIN_UNCERTAINTY: f64 = 1e-4;

/// Points that a fit needs at least.
pub const MIN: usize = 5;

/// Fits the parameters from the best of some starts: of the complex ratio if all points have a phase. Points are weighted if all have
/// an uncertainty.
struct Fitting {
    has_phase: bool,
    is_weighted: bool,
}

impl Fitting {
    fn of(points: &[Point]) -> Self {
        let has_phase = points.iter().all(|point| point.phase_rad.is_some());
        Self { has_phase, is_weighted: points.iter().all(|point| point.uncertainty.is_some()) }
    }

    fn weight(&self, point: &Point) -> f64 {
        1.0 / point.uncertainty.filter(|_| self.is_weighted).unwrap_or(1.0).max(MIN_UNCERTAINTY)
    }

    fn best(&self, points: &[Point], starts: &[Vec<f64>]) -> Option<Fit> {
        let mut measured = Vec::new();
        for point in points {
            let w = self.weight(point);
            match point.phase_rad.filter(|_| self.has_phase) {
                Some(phase) => measured.extend([w * phase.cos(), w * phase.sin()]),
                None => measured.push(w * point.ratio.ln()),
            }
        }
        let model = |p: &[f64], out: &mut Vec<f64>| {
            for point in points {
                let (real, imaginary) = response(point.frequency_hz, p);
                let w = self.weight(point);
                if self.has_phase {
                    out.extend([w * real / point.ratio, w * imaginary / point.ratio]);
                } else {
                    out.push(w * real.hypot(imaginary).ln());
                }
            }
        };
        let step = |(value, part): (&f64, f64)| part * if *value == 0.0 { 1.0 } else { *value };
        let steps = |start: &[f64]| -> Vec<f64> { start.iter().zip([1e-7, 1e-4, 1e-4, 1e-4]).map(step).collect() };
        let fits = starts.iter().filter_map(|start| fit(&measured, start, &steps(start), model));
        let positive = |fit: &Fit| if fit.parameters.len() == 3 { 3 } else { 2 };
        fits.filter(|fit| fit.parameters[..positive(fit)].iter().all(|value| *value > 0.0))
            .min_by(|a, b| a.variance().total_cmp(&b.variance()))
    }

    /// Variance of the fit's residuals, and the RMS of the relative deviations.
    fn deviation(&self, points: &[Point], fit: &Fit) -> (f64, f64) {
        let variance = if self.is_weighted { fit.variance().max(1.0) } else { fit.variance() };
        let mean_weight = points.iter().map(|point| self.weight(point)).sum::<f64>() / points.len() as f64;
        (variance, variance.sqrt() / mean_weight)
    }
}

/// What to report of the damping ratios that different tests give.
pub const REPORT: &str = "report the damping ratio of a free vibration (`damprig identify decay`) where there is one: it fits \
                                 friction apart from it, which counts as damping here, so that ζ depends on the amplitude";

/// Identifies fn and ζ; under a force also the stiffness and the mass. An error of the scale of x, which falls with the amplitude where
/// the sensor has a third-order error, and one of z or of the force act on all points together: the fit is repeated with each.
///
/// # Errors
/// Too few points, none near the resonance, a response of another kind.
pub fn identify(points: &[Point], driven_by: DrivenBy, sensors: &Sensors) -> Result<Vec<Estimate>, Refused> {
    let refuse = |text: String| Err(Refused(text));
    if points.len() < MIN {
        return refuse(format!("too few points ({}): at least {MIN} about the resonance are needed", points.len()));
    }
    let Some(peak) = points.iter().max_by(|a, b| a.ratio.total_cmp(&b.ratio)) else {
        return refuse("there are no points".into());
    };
    let is_forced = driven_by == DrivenBy::Force;
    let lowest = points.iter().map(|point| point.ratio).fold(f64::INFINITY, f64::min);
    if is_forced && peak.ratio < 1.5 * lowest {
        return refuse(format!(
            "the largest X/P is {:.3} times the smallest: there is no resonance among the points\n  sweep over the natural frequency",
            peak.ratio / lowest
        ));
    }
    if !is_forced && peak.ratio < 1.5 {
        return refuse(format!(
            "the largest X/Z is {:.3}, at {} Hz: there is no resonance among the points\n  sweep over the natural frequency",
            peak.ratio, peak.frequency_hz
        ));
    }
    // The peak between two points is missed: several starts, the best fit.
    let shares = [0.0, -0.02, 0.02, -0.005, 0.005];
    let starts: Vec<Vec<f64>> = if is_forced {
        // The peak is 1/(2ζk).
        let of = |zeta: f64| shares.map(|share| vec![peak.frequency_hz * (1.0 + share), zeta, 0.5 / zeta / peak.ratio]);
        [0.002, 0.01, 0.05].into_iter().flat_map(of).collect()
    } else {
        shares.map(|share| vec![peak.frequency_hz * (1.0 + share), 0.5 / peak.ratio]).to_vec()
    };
    let fitting = Fitting::of(points);
    let Some(best) = fitting.best(points, &starts) else {
        return refuse(
            "the points cannot be fitted by the response of one mass on a spring with viscous damping".into(),
        );
    };
    let (variance, deviation) = fitting.deviation(points, &best);
    if deviation > 0.2 {
        return refuse(format!(
            "the points are not the response of one mass with viscous damping: they deviate from it by {:.0} %\n  is a damper \
             mounted, or were the points not steady? the phase is that of x relative to z, negative for a lag",
            100.0 * deviation
        ));
    }
    let largest_m = points.iter().map(|point| point.x_m).fold(0.0, f64::max);
    let moved = |by: &dyn Fn(&Point) -> f64| {
        let moved = points.iter().map(|point| Point { ratio: point.ratio * (1.0 + by(point)), ..*point });
        fitting.best(&moved.collect::<Vec<_>>(), std::slice::from_ref(&best.parameters))
    };
    let by_x = moved(&|point| sensors.scale * (1.0 - sensors.share_of_cubic(point.x_m, largest_m)));
    let by_drive = moved(&|_| sensors.scale);
    let of_sensors = |place: usize| {
        let by = |moved: &Option<Fit>| moved.as_ref().map_or(0.0, |fit| fit.parameters[place] - best.parameters[place]);
        by(&by_x).hypot(by(&by_drive))
    };
    let value = |place: usize| best.value(place, variance).widened(of_sensors(place));
    let (natural, zeta) = (value(0), value(1));
    if zeta.standard_uncertainty > 0.5 * zeta.value {
        return refuse(format!(
            "the damping ratio {:.3e} has the uncertainty {:.3e}: no point is near enough to the resonance at {:.4} Hz\n  add \
             points within {:.4} Hz of it",
            zeta.value,
            zeta.standard_uncertainty,
            natural.value,
            2.0 * zeta.value * natural.value
        ));
    }
    let method = match (is_forced, fitting.has_phase) {
        (false, true) => "fit of the complex frequency response",
        (false, false) => "fit of the amplitude response",
        (true, true) => "fit of the complex receptance",
        (true, false) => "fit of the receptance's amplitude",
    };
    let mut estimates = vec![
        Estimate::new("natural frequency", "Hz", method, &natural).of_key("structure.natural_frequency_hz"),
        Estimate::new("damping ratio", "", method, &zeta).of_key("structure.damping_ratio"),
    ];
    if is_forced {
        let stiffness = value(2);
        let of_stiffness = 1.0 / (TAU * natural.value).powi(2);
        let value = stiffness.value * of_stiffness;
        // fn is known so much better than k that its share and the correlation do not count.
        let mass = stiffness.mapped(value, of_stiffness);
        estimates.push(Estimate::new("mass", "kg", method, &mass).of_key("structure.mass_kg"));
        estimates.push(Estimate::new("stiffness", "N/m", method, &stiffness));
    }
    Ok(estimates)
}

/// Why fn and ζ that [`identify`] found on a moved base are not those of a mode: with Γφ free, which is 1 for one degree of freedom, the
/// points give others, by more than the 95 % intervals of both, and Γφ is off by more than its own and the scales.
#[must_use]
pub fn contradiction(points: &[Point], sensors: &Sensors, found: &[Estimate]) -> Option<String> {
    let fitting = Fitting::of(points);
    let (natural, zeta) = (found.first()?, found.get(1)?);
    let peak = points.iter().max_by(|a, b| a.ratio.total_cmp(&b.ratio))?;
    let mut starts = Vec::new();
    for frequency_hz in [natural.value, peak.frequency_hz] {
        for damping_ratio in [zeta.value, 0.5 * zeta.value, 2.0 * zeta.value] {
            let participation = 2.0 * damping_ratio * peak.ratio;
            starts.extend([1.0, -1.0].map(|sign| vec![frequency_hz, damping_ratio, sign * participation, 0.0]));
        }
    }
    let free = fitting.best(points, &starts)?;
    let (variance, deviation) = fitting.deviation(points, &free);
    let half = |[low, high]: [f64; 2]| 0.5 * (high - low);
    let differs = |place: usize, estimate: &Estimate| {
        let value = free.value(place, variance);
        (value.value - estimate.value).abs() > half(value.interval_95()).hypot(half(estimate.interval_95))
    };
    let participation = free.value(2, variance).widened(sensors.scale.hypot(sensors.scale));
    let is_one = (participation.value - 1.0).abs() <= half(participation.interval_95());
    if is_one || !(differs(0, natural) || differs(1, zeta)) {
        return None;
    }
    let as_one = fitting.best(points, &[vec![natural.value, zeta.value]])?;
    Some(format!(
        "a mode that takes part {:.3} times (Γφ; 1 for one degree of freedom) fits the points with deviations of {:.2} % in place of {:.2} %, and \
         gives fn = {:.5} Hz and ζ = {:.4}: the structure has more modes, or the scale of x or z is off by as much; `damprig identify decay` \
         needs neither",
        participation.value,
        100.0 * deviation,
        100.0 * fitting.deviation(points, &as_one).1,
        free.parameters[0],
        free.parameters[1]
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_two_modes(second: f64) -> Vec<Point> {
        // Two modes on a moved base: Γφ 1 + second and −second, fn 2.5 and 7 Hz.
        let at = |i: i32| {
            let frequency_hz = 2.5 + 0.01 * f64::from(i);
            let first = response(frequency_hz, &[2.5, 0.015, 1.0 + second, 0.0]);
            let other = response(frequency_hz, &[7.0, 0.03, -second, 0.0]);
            let (real, imaginary) = (first.0 + other.0 - 1.0, first.1 + other.1);
            let (ratio, phase) = (real.hypot(imaginary), imaginary.atan2(real));
            Point { frequency_hz, ratio, phase_rad: Some(phase), uncertainty: None, x_m: 1e-3 }
        };
        (-20..=20).map(at).collect()
    }

    /// A floor of a frame: its mode is not taken for one degree of freedom, and its own values are said.
    #[test]
    fn points_of_a_structure_with_several_modes_contradict_one_degree_of_freedom() {
        for has_phase in [true, false] {
            let mut points = of_two_modes(0.25);
            points.iter_mut().for_each(|point| point.phase_rad = point.phase_rad.filter(|_| has_phase));
            let found = identify(&points, DrivenBy::Base, &Sensors::EXACT).unwrap();
            let said = contradiction(&points, &Sensors::EXACT, &found).expect("a contradiction");
            assert!(said.contains("1.25") && said.contains("fn = 2.5") && said.contains("ζ = 0.0150"), "{said}");
        }
        let points = of_two_modes(0.0);
        let found = identify(&points, DrivenBy::Base, &Sensors::EXACT).unwrap();
        assert_eq!(contradiction(&points, &Sensors::EXACT, &found), None);
    }

    /// Noise alone: of one degree of freedom with 0.5 % of it, few draws are told to contradict that.
    #[test]
    fn noise_seldom_contradicts_one_degree_of_freedom() {
        for has_phase in [true, false] {
            let draws = 400;
            let mut random = fastrand::Rng::with_seed(5);
            let mut told = 0;
            for _ in 0..draws {
                let mut noise = || 5e-3 * (0..12).map(|_| random.f64() - 0.5).sum::<f64>();
                let mut points = of_two_modes(0.0);
                for point in &mut points {
                    point.ratio *= 1.0 + noise();
                    point.phase_rad = point.phase_rad.map(|phase| phase + noise()).filter(|_| has_phase);
                }
                let found = identify(&points, DrivenBy::Base, &Sensors::EXACT).unwrap();
                told += u32::from(contradiction(&points, &Sensors::EXACT, &found).is_some());
            }
            println!("with phases: {has_phase}: {told} of {draws}");
            assert!(told <= draws / 50, "{told} of {draws}");
        }
    }

    /// Closed form: |X/Z|² = (1 + (2ζr)²)/((1 − r²)² + (2ζr)²), and x lags.
    #[test]
    fn the_response_is_that_of_a_moved_base() {
        let (real, imaginary) = response(2.6, &[2.5, 0.01]);
        let (r, d): (f64, f64) = (2.6 / 2.5, 2.0 * 0.01 * 2.6 / 2.5);
        let expected = ((1.0 + d * d) / ((1.0 - r * r).powi(2) + d * d)).sqrt();
        assert!((real.hypot(imaginary) / expected - 1.0).abs() < 1e-12);
        assert!(imaginary < 0.0);
        // H·(1 − r² + dj) = 1 + dj.
        let (a, b) = (1.0 - r * r, d);
        assert!((real * a - imaginary * b - 1.0).abs() < 1e-12 && (real * b + imaginary * a - d).abs() < 1e-12);
    }

    #[test]
    fn a_point_of_a_linear_structure_gives_the_structure() {
        for (frequency_hz, natural_hz, zeta) in [(2.5, 2.5, 0.0038), (2.3, 2.5, 0.02), (3.1, 2.5, 0.3)] {
            let (re, im) = response(frequency_hz, &[natural_hz, zeta]);
            let (found_hz, found) = equivalent(frequency_hz, re.hypot(im), im.atan2(re));
            assert!((found_hz / natural_hz - 1.0).abs() < 1e-12 && (found / zeta - 1.0).abs() < 1e-9);
        }
        assert!(equivalent(2.5, 0.5, 0.0).0.is_nan(), "in phase and smaller than the base");
    }

    /// X/P = 1/(k − MΩ² + cΩj), from mass, dashpot and spring.
    #[test]
    fn the_receptance_is_that_of_mass_dashpot_and_spring() {
        let (mass, natural_hz, zeta, hz): (f64, f64, f64, f64) = (1.6, 2.5, 0.01, 2.6);
        let (omega, drive) = (TAU * natural_hz, TAU * hz);
        let (stiff, loss) = (mass * omega * omega - mass * drive * drive, 2.0 * zeta * mass * omega * drive);
        let (real, imaginary) = response(hz, &[natural_hz, zeta, mass * omega * omega]);
        assert!(
            (real * stiff - imaginary * loss - 1.0).abs() < 1e-12 && (real * loss + imaginary * stiff).abs() < 1e-12
        );
    }
}
