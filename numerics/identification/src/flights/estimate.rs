//! Fits e, the clearance and the time from pulse to kink to all usable impacts.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::kink::{ImpactWindow, Kink, PARAMETERS};
use super::usable::{LeftOut, Sorted, Usable, usual_step_s};
use super::{KnownSetUp, Record};
use crate::Refused;
use crate::restitution::law::{APART, Law, Power, two_digits};
use crate::statistics::{Fit, Value, fit, inflation};

/// What the flights of the particle show.
#[derive(Clone, Debug)]
pub struct Flights {
    /// Coefficient of restitution.
    pub restitution: Value,
    /// d, m; none if it was held, or cannot be told from the record.
    pub clearance_m: Option<Value>,
    /// μi·g, m/s²; none if there is no friction, or it was held.
    pub friction_m_per_s2: Option<Value>,
    /// Mean contact time of the pulses, s; none without two of them.
    pub contact_s: Option<Value>,
    /// From the centre of a pulse to the kink of x: half the contact of a pulse that begins with the impact, and the lag of the
    /// sensor, s.
    pub late_s: Value,
    /// Least and largest approach velocity, m/s.
    pub approach_m_per_s: [f64; 2],
    /// e over the approach velocity, by the same fit with an exponent; none where all approaches are alike.
    pub law: Option<Law>,
    /// RMS of the residuals of x, m.
    pub residual_rms_m: f64,
    /// Change of e and of d for a mass ratio that is greater by a share, each relative, over that share.
    pub by_mass_ratio: [f64; 2],
    /// d that was taken, m, as fitted or held.
    pub used_clearance_m: f64,
    /// Impacts used.
    pub used: usize,
    /// Impacts left out, by reason.
    pub left_out: BTreeMap<LeftOut, usize>,
}

/// Impacts that a fit needs at least.
const MIN: usize = 8;

/// Relative standard uncertainty of d above which it cannot be told from a record.
const MAX_UNCERTAIN: f64 = 0.025;

/// Deviation of an impact from the fit, in its standard deviations, above which it is left out.
const MISFIT: f64 = 5.0;

/// Rounds in which impacts are left out and taken again, at most.
const MAX_ROUNDS: usize = 20;

/// Least relative standard uncertainty: of the polynomial, of the pulses' times and of single precision.
const MIN_UNCERTAINTY: f64 = 1e-5;

/// Share of misfits above which the records are not those of the set-up.
const MAX_MISFITS: f64 = 0.2;

/// Identifies e and d.
///
/// # Errors
/// Too few usable impacts, by reason; impacts that are not those of a particle between two hard walls.
pub fn identify(records: &[Record], known: &KnownSetUp) -> Result<Flights, Refused> {
    check_rate(records, known)?;
    let mut sorted = Sorted::new(records, known);
    enough(&sorted)?;
    let mut solved = solve(&sorted, known).ok_or_else(|| no_fit(&sorted))?;
    let candidates = sorted.usable.clone();
    for _ in 0..MAX_ROUNDS {
        // An impact that was left out beside a gross error may fit once that is gone.
        let kept: Vec<Usable> = solved.fitting(&candidates, known);
        let is_settled = kept.iter().map(|usable| usable.places).eq(sorted.usable.iter().map(|usable| usable.places));
        sorted.usable = kept;
        sorted.left_out.insert(LeftOut::Misfit, candidates.len() - sorted.usable.len());
        if is_settled {
            break;
        }
        enough(&sorted)?;
        solved = go_on(&sorted, known, solved.at, solved.kinks).ok_or_else(|| no_fit(&sorted))?;
    }
    sorted.left_out.retain(|_, count| *count > 0);
    if (sorted.usable.len() as f64) < (1.0 - MAX_MISFITS) * candidates.len() as f64 {
        return Err(no_fit(&sorted));
    }
    let is_clear = |clearance: Value| clearance.standard_uncertainty < MAX_UNCERTAIN * clearance.value;
    if known.is_clearance_held || is_clear(solved.value(CLEARANCE)) {
        return flights(&sorted, known, &solved);
    }
    let held = KnownSetUp { is_clearance_held: true, ..*known };
    let solved = go_on(&sorted, &held, solved.at, solved.kinks).ok_or_else(|| no_fit(&sorted))?;
    flights(&sorted, &held, &solved)
}

/// Refuses samples that are too few for a fit around an impact.
fn check_rate(records: &[Record], known: &KnownSetUp) -> Result<(), Refused> {
    let step_s = records.iter().map(|record| usual_step_s(&record.t_s)).fold(f64::MAX, f64::min);
    let period_s = std::f64::consts::TAU / known.angular_frequency_rad_per_s;
    let around = 2.0 * super::kink::HALF_WIDTH_PERIODS * period_s / step_s;
    if around < 5.0 * PARAMETERS as f64 {
        return Err(Refused(format!(
            "x has {:.0} samples per second; that is {around:.0} around an impact, at least {} are needed\n  record with rate_hz = \
             1000 in the campaign's [telemetry]",
            1.0 / step_s,
            5 * PARAMETERS
        )));
    }
    Ok(())
}

/// Refuses too few impacts, with the reasons.
fn enough(sorted: &Sorted) -> Result<(), Refused> {
    if sorted.usable.len() >= MIN {
        return Ok(());
    }
    let all = sorted.windows.len();
    let reasons: Vec<String> =
        sorted.left_out.iter().map(|(reason, count)| format!("{count} {}", reason.words())).collect();
    Err(Refused(format!(
        "{} of {all} impacts are usable; at least {MIN} are needed. Left out: {}\n  drive so that the particle flies from wall to \
         wall, near the natural frequency, and longer",
        sorted.usable.len(),
        if reasons.is_empty() { "none".into() } else { reasons.join("; ") }
    )))
}

fn no_fit(sorted: &Sorted) -> Refused {
    let misfits = sorted.left_out.get(&LeftOut::Misfit).copied().unwrap_or(0);
    Refused(format!(
        "the impacts are not those of a particle between two hard walls: {misfits} of {} do not fit\n  check the set-up (mass ratio, \
         clearance, natural frequency, friction), and whether weak impacts were missed",
        sorted.usable.len() + misfits
    ))
}

/// The parameters of the fit.
#[derive(Clone, Copy, Debug)]
struct Parameters {
    /// At the reference speed.
    e: f64,
    /// e falls with this power of the approach speed.
    exponent: f64,
    /// Logarithm of the reference speed in m/s.
    ln_reference: f64,
    clearance_m: f64,
    late_s: f64,
    /// μi·g, m/s².
    friction: f64,
    /// Third-order error of the sensor at the largest |x|, as a share of it.
    cubic: f64,
}

/// Which of the parameters are fitted; the others stay.
#[derive(Clone, Copy, Debug)]
struct FittedParameters {
    clearance: bool,
    friction: bool,
    cubic: bool,
    exponent: bool,
}

impl Parameters {
    /// e of an impact with this approach speed, m/s.
    fn e_at(&self, speed: f64) -> f64 {
        if self.exponent == 0.0 { self.e } else { self.e * (-self.exponent * (speed.ln() - self.ln_reference)).exp() }
    }

    /// The fitted ones.
    fn pack(&self, fitted: FittedParameters) -> Vec<f64> {
        let mut all = vec![self.e, self.late_s];
        all.extend(fitted.clearance.then_some(self.clearance_m));
        all.extend(fitted.friction.then_some(self.friction));
        all.extend(fitted.cubic.then_some(self.cubic));
        all.extend(fitted.exponent.then_some(self.exponent));
        all
    }

    /// With other values of the fitted ones.
    fn unpack(&self, fitted: FittedParameters, values: &[f64]) -> Self {
        let mut rest = values[2..].iter().copied();
        let mut next = |is_fitted: bool, fixed: f64| if is_fitted { rest.next().unwrap_or(fixed) } else { fixed };
        Self {
            e: values[0],
            late_s: values[1],
            clearance_m: next(fitted.clearance, self.clearance_m),
            friction: next(fitted.friction, self.friction),
            cubic: next(fitted.cubic, self.cubic),
            exponent: next(fitted.exponent, self.exponent),
            ln_reference: self.ln_reference,
        }
    }
}

/// A fit of all usable impacts.
struct Solved {
    fit: Fit,
    at: Parameters,
    fitted: FittedParameters,
    variance: f64,
    kinks: Kinks,
}

/// Residuals of an impact: velocity, jump and step.
const PER_IMPACT: usize = 3;

/// Places of the first parameters among the fitted ones.
const RESTITUTION: usize = 0;
const LATE: usize = 1;
const CLEARANCE: usize = 2;

impl Solved {
    /// The friction, m/s², if it was fitted.
    fn friction(&self) -> Option<Value> {
        self.fitted.friction.then(|| self.value(CLEARANCE + usize::from(self.fitted.clearance)))
    }

    fn value(&self, place: usize) -> Value {
        self.fit.value(place, self.variance)
    }

    /// The candidates that fit. The scale is the median of the deviations: misfits do not widen it.
    fn fitting(&self, candidates: &[Usable], known: &KnownSetUp) -> Vec<Usable> {
        let size = |usable: &Usable| {
            let three = deviations(usable, &self.kinks, &self.at, known);
            three.map_or(f64::MAX, |three| three.iter().map(|r| r * r).sum::<f64>().sqrt())
        };
        let sizes: Vec<f64> = candidates.iter().map(size).collect();
        let mut ordered = sizes.clone();
        ordered.sort_by(f64::total_cmp);
        // Median of the length of a vector of three normal numbers: 1.538 standard deviations.
        let deviation = ordered[ordered.len() / 2] / 1.538;
        let fits = |n: &usize| sizes[*n] <= MISFIT * deviation.max(f64::MIN_POSITIVE);
        (0..sizes.len()).filter(fits).map(|n| candidates[n].clone()).collect()
    }
}

/// Velocities of the particle just before and after an impact, m/s.
fn particle(usable: &Usable, x_m: [f64; 3], clearance_m: f64, friction: f64) -> [f64; 2] {
    let side = usable.side;
    let [before_s, after_s] = usable.flights_s;
    // The walls alternate, and friction acts towards the wall that the particle left.
    let mean = |travel_m: f64, length_s: f64| travel_m / length_s;
    let before = mean(x_m[1] - x_m[0] + 2.0 * side * clearance_m, before_s) - 0.5 * side * friction * before_s;
    let after = mean(x_m[2] - x_m[1] - 2.0 * side * clearance_m, after_s) - 0.5 * side * friction * after_s;
    [before, after]
}

/// Shift of the kinks' time for their derivative, s.
const SHIFT_S: f64 = 1e-5;

/// All kinks, as functions of the time from pulse to kink, to first order, and of the sensor's third-order error.
struct Kinks {
    late_s: f64,
    here: Vec<Option<Kink>>,
    shifted: Vec<Option<Kink>>,
    friction: Option<Vec<Option<Kink>>>,
    cubed: Option<Vec<Option<Kink>>>,
}

impl Kinks {
    fn new(sorted: &Sorted, late_s: f64, known: &KnownSetUp) -> Self {
        let all = |change: &dyn Fn(&ImpactWindow) -> Option<Kink>| {
            sorted.windows.iter().map(|window| window.as_ref().and_then(change)).collect()
        };
        let readings = sorted.windows.iter().flatten().flat_map(|window| &window.x_m);
        let largest_m = readings.fold(f64::MIN_POSITIVE, |most, x| most.max(x.abs()));
        Self {
            late_s,
            here: all(&|window| window.kink(late_s, known)),
            shifted: all(&|window| window.kink(late_s + SHIFT_S, known)),
            friction: (known.friction_m_per_s2 > 0.0)
                .then(|| all(&|window| window.friction(late_s, known).kink(late_s, known))),
            cubed: known.sensors.has_cubic().then(|| all(&|window| window.cubed(largest_m).kink(late_s, known))),
        }
    }

    /// Measured quantities of an impact, and its place, x.
    fn at(&self, place: usize, at: &Parameters) -> Option<(Vector3<f64>, f64)> {
        let (here, shifted) = (self.here[place].as_ref()?, self.shifted[place].as_ref()?);
        let share = (at.late_s - self.late_s) / SHIFT_S;
        let mut measured = here.measured + (shifted.measured - here.measured) * share;
        let mut x_m = here.x_m + (shifted.x_m - here.x_m) * share;
        for (parts, amount) in [(&self.friction, at.friction), (&self.cubed, at.cubic)] {
            if let Some(parts) = parts {
                let part = parts[place].as_ref()?;
                measured -= part.measured * amount;
                x_m -= part.x_m * amount;
            }
        }
        Some((measured, x_m))
    }
}

/// Fits the parameters.
fn solve(sorted: &Sorted, known: &KnownSetUp) -> Option<Solved> {
    let kinks = Kinks::new(sorted, 0.0, known);
    let at = start(sorted, &kinks, known)?;
    go_on(sorted, known, at, kinks)
}

/// Fits the parameters from a fit of nearly the same impacts, with its kinks.
fn go_on(sorted: &Sorted, known: &KnownSetUp, mut at: Parameters, mut kinks: Kinks) -> Option<Solved> {
    let fitted = FittedParameters {
        clearance: !known.is_clearance_held,
        friction: known.friction_m_per_s2 > 0.0 && !known.is_friction_held,
        cubic: known.sensors.has_cubic(),
        exponent: at.exponent != 0.0,
    };
    if known.is_clearance_held {
        at.clearance_m = known.clearance_m;
    }
    let steps = Parameters {
        e: 1e-5,
        exponent: 1e-5,
        ln_reference: 0.0,
        clearance_m: 1e-5 * known.clearance_m,
        late_s: 1e-6,
        friction: 1e-4,
        cubic: 1e-5,
    };
    let steps = steps.pack(fitted);
    // The kinks are linear in their time over a few milliseconds only.
    for _ in 0..10 {
        let residuals = |values: &[f64], out: &mut Vec<f64>| {
            let at = at.unpack(fitted, values);
            for usable in &sorted.usable {
                // The fit is to zeros.
                let three = deviations(usable, &kinks, &at, known);
                out.extend(three.map_or([f64::NAN; PER_IMPACT], |three| three.map(|r| -r)));
            }
        };
        let fit = fit(&vec![0.0; PER_IMPACT * sorted.usable.len()], &at.pack(fitted), &steps, residuals)?;
        at = at.unpack(fitted, &fit.parameters);
        if (at.late_s - kinks.late_s).abs() < 0.1 * SHIFT_S {
            // Neighbouring impacts share a flight.
            let correlated = (0..PER_IMPACT).map(|place| {
                let own: Vec<f64> = fit.residuals.iter().skip(place).step_by(PER_IMPACT).copied().collect();
                inflation(&own, 4)
            });
            let variance = fit.variance() * correlated.fold(1.0, f64::max);
            return Some(Solved { fit, at, fitted, variance, kinks });
        }
        if at.late_s.abs() > MAX_LATE_S {
            return None;
        }
        kinks = Kinks::new(sorted, at.late_s, known);
    }
    None
}

/// Most time from a pulse to the kink of x that a contact and a sensor can cause, s.
const MAX_LATE_S: f64 = 0.05;

/// Measured less predicted velocity, jump and step of an impact, whitened.
fn deviations(usable: &Usable, kinks: &Kinks, at: &Parameters, known: &KnownSetUp) -> Option<[f64; PER_IMPACT]> {
    let (measured, [before, after]) = velocities(usable, kinks, at)?;
    let change = before - after;
    let e = at.e_at((before - measured[0]).abs());
    let velocity = before - change * (1.0 + known.mass_ratio) / (1.0 + e);
    let predicted = Vector3::new(velocity, known.mass_ratio * change, 0.0);
    let white = kinks.here[usable.places[1]].as_ref()?.whitening * (measured - predicted);
    Some([white[0], white[1], white[2]])
}

/// Measured quantities of an impact, and the particle's velocities before and after it, m/s.
fn velocities(usable: &Usable, kinks: &Kinks, at: &Parameters) -> Option<(Vector3<f64>, [f64; 2])> {
    let [first, middle, last] = usable.places.map(|place| kinks.at(place, at));
    let (measured, x_m) = middle?;
    let particle = particle(usable, [first?.1, x_m, last?.1], at.clearance_m, at.friction);
    Some((measured, particle))
}

/// The start of the fit: the stated clearance, and the median of e over the impacts with it.
fn start(sorted: &Sorted, kinks: &Kinks, known: &KnownSetUp) -> Option<Parameters> {
    let at = Parameters {
        e: 0.5,
        exponent: 0.0,
        ln_reference: 0.0,
        clearance_m: known.clearance_m,
        late_s: 0.0,
        friction: known.friction_m_per_s2,
        cubic: 0.0,
    };
    let of = |usable: &Usable| {
        let (measured, [before, after]) = velocities(usable, kinks, &at)?;
        let e = (after - measured[0] - measured[1]) / (measured[0] - before);
        e.is_finite().then_some(e)
    };
    let mut all: Vec<f64> = sorted.usable.iter().filter_map(of).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).map(|e| Parameters { e: e.clamp(0.0, 1.0), ..at })
}

/// The results of a fit, with the uncertainties that its residuals do not show.
fn flights(sorted: &Sorted, known: &KnownSetUp, solved: &Solved) -> Result<Flights, Refused> {
    let with = |changed: &KnownSetUp, scale: f64| {
        let mut moved = sorted.clone();
        for window in moved.windows.iter_mut().flatten() {
            window.x_m.iter_mut().for_each(|x| *x *= scale);
        }
        let kinks = Kinks::new(&moved, solved.at.late_s, changed);
        go_on(&moved, changed, solved.at, kinks).map(|solved| solved.at)
    };
    let Parameters { e, clearance_m, .. } = solved.at;
    const SHARE: f64 = 1e-3;
    let relative = |moved: Parameters| [(moved.e / e - 1.0) / SHARE, (moved.clearance_m / clearance_m - 1.0) / SHARE];
    let heavier = KnownSetUp { mass_ratio: known.mass_ratio * (1.0 + SHARE), ..*known };
    let by_mass_ratio = with(&heavier, 1.0).map_or([f64::NAN; 2], relative);
    let by_scale = with(known, 1.0 + SHARE).map_or([f64::NAN; 2], relative);
    let widened = |value: Value, which: usize| {
        let scale = known.sensors.scale * by_scale[which] * value.value;
        let mass = known.mass_ratio_uncertainty * by_mass_ratio[which] * value.value;
        let known = |u: f64| if u.is_finite() { u } else { 0.0 };
        value.widened((MIN_UNCERTAINTY * value.value).hypot(known(scale)).hypot(known(mass)))
    };
    if !(-0.05..=1.05).contains(&e) {
        return Err(Refused(format!(
            "a coefficient of restitution of {e:.3} is not possible: it is 0 to 1\n  check mass ratio and clearance of the set-up; are \
             impacts missing?"
        )));
    }
    let approach = |usable: &Usable| {
        let (measured, [before, _]) = velocities(usable, &solved.kinks, &solved.at)?;
        Some((before - measured[0]).abs())
    };
    let approaches: Vec<f64> = sorted.usable.iter().filter_map(approach).collect();
    let ends = approaches.iter().fold([f64::MAX, 0.0f64], |[low, high], v| [low.min(*v), high.max(*v)]);
    let (mut squares, mut freedom) = (0.0, 0.0);
    for usable in &sorted.usable {
        let place = usable.places[1];
        if let (Some(kink), Some(window)) = (&solved.kinks.here[place], &sorted.windows[place]) {
            squares += kink.residual_m2;
            freedom += (window.t_s.len() - PARAMETERS) as f64;
        }
    }
    let restitution = widened(solved.value(RESTITUTION), 0);
    Ok(Flights {
        law: law(sorted, known, solved, &approaches, restitution),
        restitution,
        clearance_m: solved.fitted.clearance.then(|| widened(solved.value(CLEARANCE), 1)),
        friction_m_per_s2: solved.friction().map(|friction| friction.widened(known.sensors.scale * friction.value)),
        contact_s: Value::mean(&sorted.contacts_s),
        late_s: solved.value(LATE),
        approach_m_per_s: ends,
        residual_rms_m: (squares / freedom).sqrt(),
        by_mass_ratio,
        used_clearance_m: clearance_m,
        used: sorted.usable.len(),
        left_out: sorted.left_out.clone(),
    })
}

/// e over the approach speed: the fit with an exponent. The start of the exponent is its smallest step from 0, so that it is fitted.
fn law(sorted: &Sorted, known: &KnownSetUp, solved: &Solved, approaches: &[f64], constant: Value) -> Option<Law> {
    let slowest = approaches.iter().copied().fold(f64::MAX, f64::min);
    let fastest = approaches.iter().copied().fold(0.0, f64::max);
    if slowest <= 0.0 || fastest < APART * slowest {
        return None;
    }
    let reference = two_digits((approaches.iter().map(|v| v.ln()).sum::<f64>() / approaches.len() as f64).exp());
    let start = Parameters { exponent: 1e-5, ln_reference: reference.ln(), ..solved.at };
    // The kinks of the fit with one e are those of this one to first order.
    let kinks = Kinks::new(sorted, solved.at.late_s, known);
    let held = KnownSetUp { is_clearance_held: !solved.fitted.clearance, clearance_m: solved.at.clearance_m, ..*known };
    let with = go_on(sorted, &held, start, kinks)?;
    let place = with.fit.parameters.len() - 1;
    let covariance = with.fit.shape[(RESTITUTION, place)] * with.variance;
    let power = Power::of(with.value(RESTITUTION), reference, with.value(place), covariance, [slowest, fastest]);
    Some(Law::of_fit(constant, power, [slowest, fastest], approaches.len()))
}
