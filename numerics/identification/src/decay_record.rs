//! Prepares the record of a free vibration: finds the release and the swings, and refuses a record that shows none.

use crate::Refused;

/// A record whose swings were found.
#[derive(Debug)]
pub(super) struct Swings {
    /// First sample after the release: the first crossing of the middle.
    pub(super) first: usize,
    /// First sample after the last swing that is used: a structure that sticks shows static friction, and only the sensor's
    /// zero.
    pub(super) end: usize,
    /// Middle of the swings, m.
    pub(super) centre_m: f64,
    /// Times at which the motion crosses the middle, s.
    pub(super) crossings_s: Vec<f64>,
    /// Time and displacement from the middle of each turning point between two crossings.
    pub(super) turnings: Vec<(f64, f64)>,
    /// Samples per period.
    pub(super) samples_per_period: f64,
}

/// Half periods that a decay needs at least.
const MIN_HALF_PERIODS: usize = 6;

/// Samples per period that the fit needs at least.
const MIN_SAMPLES: f64 = 8.0;

fn refuse<T>(text: impl Into<String>) -> Result<T, Refused> {
    Err(Refused(text.into()))
}

/// RMS noise of a record, from its second differences, m.
fn noise_rms_m(x_m: &[f64]) -> f64 {
    let mut second: Vec<f64> = x_m.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs()).collect();
    second.sort_by(f64::total_cmp);
    second.get(second.len() / 2).map_or(0.0, |median| median / 0.6745 / 6f64.sqrt())
}

/// Finds release and swings.
pub(super) fn swings(t_s: &[f64], x_m: &[f64]) -> Result<Swings, Refused> {
    if x_m.len() < 50 {
        return refuse(format!("{} samples are too few for a decay: record at least some periods", x_m.len()));
    }
    if let Some(n) = x_m.iter().position(|x| !x.is_finite()) {
        return refuse(format!("the displacement at {} s is no number: cut the record before or after it", t_s[n]));
    }
    // Without the hold before the release and the rest after the motion, where these have no noise.
    let moves = |n: &usize| x_m[*n] != x_m[n - 1];
    let from = (1..x_m.len()).find(moves).unwrap_or(0);
    let to = (1..x_m.len()).rev().find(moves).unwrap_or(x_m.len() - 1);
    let tail = &x_m[from + (to - from) * 2 / 3..=to];
    let (low, high) = tail.iter().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(*x), high.max(*x)));
    let centre_m = 0.5 * (low + high);
    let largest_m = x_m.iter().fold(0.0f64, |most, x| most.max((x - centre_m).abs()));
    let (lowest, highest) = x_m.iter().fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
    let noise_m = noise_rms_m(x_m);
    if highest - lowest <= 12.0 * noise_m || highest == lowest {
        return refuse(format!(
            "the structure does not swing: x stays between {lowest:.6} m and {highest:.6} m\n  was it released? the record \
             must begin before the release or at it, and show the swings after it"
        ));
    }
    let band_m = (0.05 * largest_m).max(4.0 * noise_m);
    let (crossings, sides) = crossings(t_s, x_m, centre_m, band_m);
    if crossings.len() < 2 {
        return refuse(format!(
            "the structure never swings back: x goes from {:.6} m to {:.6} m and crosses its middle {} times\n  was it \
             released? a free vibration crosses the middle twice in a period",
            x_m[0],
            x_m[x_m.len() - 1],
            crossings.len()
        ));
    }
    let period_s = 2.0 * (crossings[crossings.len() - 1].1 - crossings[0].1) / (crossings.len() - 1) as f64;
    let step_s = (t_s[t_s.len() - 1] - t_s[0]) / (t_s.len() - 1) as f64;
    let samples_per_period = period_s / step_s;
    if crossings.len() <= MIN_HALF_PERIODS {
        return refuse(format!(
            "the decay is too short: {:.1} periods of {period_s:.4} s after the release; at least {} are needed\n  record \
             longer, or release from farther out (the last {:.0} % of the first swing are not used)",
            (crossings.len() - 1) as f64 / 2.0,
            MIN_HALF_PERIODS / 2,
            100.0 * band_m / largest_m
        ));
    }
    if samples_per_period < MIN_SAMPLES {
        return refuse(format!(
            "{samples_per_period:.1} samples per period of {period_s:.4} s: at least {MIN_SAMPLES} are needed; record faster"
        ));
    }
    let turnings = turnings(t_s, x_m, centre_m, &crossings, &sides);
    let first = crossings[0].0;
    let end_s = crossings[crossings.len() - 1].1 + 0.25 * period_s;
    let end = t_s.partition_point(|t| *t <= end_s);
    check_stuck(t_s, x_m, first, samples_per_period, centre_m, &turnings)?;
    check_growth(&turnings)?;
    let crossings_s = crossings.iter().map(|c| c.1).collect();
    Ok(Swings { first, end, centre_m, crossings_s, turnings, samples_per_period })
}

/// Crossings of the middle by a motion that leaves a band on the other side: the sample after it and its time. Also the side of
/// the motion after each.
fn crossings(t_s: &[f64], x_m: &[f64], centre_m: f64, band_m: f64) -> (Vec<(usize, f64)>, Vec<f64>) {
    let (mut side, mut last) = (0.0, None);
    let (mut found, mut sides) = (Vec::new(), Vec::new());
    for n in 1..x_m.len() {
        let (before, now) = (x_m[n - 1] - centre_m, x_m[n] - centre_m);
        if before * now <= 0.0 && before != now {
            let share = before / (before - now);
            last = Some((n, t_s[n - 1] + share * (t_s[n] - t_s[n - 1])));
        }
        if now.abs() >= band_m {
            if side != 0.0
                && side != now.signum()
                && let Some(crossing) = last
            {
                found.push(crossing);
                sides.push(now.signum());
            }
            side = now.signum();
        }
    }
    (found, sides)
}

/// Time and displacement of the extremum between neighbouring crossings, by a parabola through the samples about it.
fn turnings(t_s: &[f64], x_m: &[f64], centre_m: f64, crossings: &[(usize, f64)], sides: &[f64]) -> Vec<(f64, f64)> {
    let mut found = Vec::new();
    for (pair, side) in crossings.windows(2).zip(sides) {
        let (from, to) = (pair[0].0, pair[1].0);
        let (middle_s, half_s) = (0.5 * (pair[0].1 + pair[1].1), 0.25 * (pair[1].1 - pair[0].1));
        let near: Vec<usize> = (from..to).filter(|n| (t_s[*n] - middle_s).abs() <= half_s).collect();
        // Sums of powers of the time in units of half the window.
        let mut sums = [0.0; 5];
        let mut moments = [0.0; 3];
        for n in &near {
            let u = (t_s[*n] - middle_s) / half_s;
            (0..5).for_each(|power| sums[power] += u.powi(power as i32));
            (0..3).for_each(|power| moments[power] += u.powi(power as i32) * (x_m[*n] - centre_m));
        }
        let normal = nalgebra::Matrix3::from_fn(|i, j| sums[i + j]);
        let Some(inverse) = normal.try_inverse() else { continue };
        let [a, b, c] = (inverse * nalgebra::Vector3::from(moments)).into();
        let at = if c == 0.0 { 0.0 } else { (-0.5 * b / c).clamp(-1.0, 1.0) };
        let value = a + b * at + c * at * at;
        if value * side > 0.0 {
            found.push((middle_s + at * half_s, value));
        }
    }
    found
}

/// Refuses a saturated or a frozen sensor.
fn check_stuck(
    t_s: &[f64],
    x_m: &[f64],
    first: usize,
    samples_per_period: f64,
    centre_m: f64,
    turnings: &[(f64, f64)],
) -> Result<(), Refused> {
    let (lowest, highest) = x_m.iter().fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
    let swing_m = turnings.first().map_or(0.0, |turning| turning.1.abs());
    let mut from = first;
    for n in first + 1..=x_m.len() {
        if n < x_m.len() && x_m[n] == x_m[from] {
            continue;
        }
        let (count, value) = ((n - from) as f64, x_m[from]);
        let is_extreme = value == lowest || value == highest;
        if is_extreme && count > 3.0 && count > samples_per_period / 25.0 {
            return refuse(format!(
                "the sensor is saturated: from {:.4} s x stays at {value:.6} m, the {} value of the record, for {count} \
                 samples\n  release from less far out, or use a sensor of larger range; or cut the record before the first \
                 swing that fits",
                t_s[from],
                if value == highest { "largest" } else { "smallest" }
            ));
        }
        let before = turnings.iter().rev().find(|turning| turning.0 <= t_s[from]).map_or(swing_m, |t| t.1.abs());
        let is_over = n == x_m.len() && before < 0.5 * swing_m && (value - centre_m).abs() < 0.5 * swing_m;
        if count > (samples_per_period / 8.0).max(5.0) && !is_over {
            return refuse(format!(
                "the sensor is frozen: from {:.4} s x stays at {value:.6} m for {:.4} s while the structure swings by {before:.6} m\n  \
                 check the sensor and its cable, and cut the record before this time",
                t_s[from],
                t_s[n - 1] - t_s[from]
            ));
        }
        from = n;
    }
    Ok(())
}

/// Refuses a motion that grows: it is driven.
fn check_growth(turnings: &[(f64, f64)]) -> Result<(), Refused> {
    let (Some(first), Some(last)) = (turnings.first(), turnings.last()) else {
        return refuse("no turning points were found: is this a free vibration?");
    };
    let most = turnings.iter().fold(first, |most, t| if t.1.abs() > most.1.abs() { t } else { most });
    if last.1.abs() > 1.05 * first.1.abs() || most.1.abs() > 1.2 * first.1.abs() {
        return refuse(format!(
            "the motion grows: the swing is {:.6} m at {:.3} s and {:.6} m at {:.3} s\n  a free vibration decays; switch off \
             the drive, and give the part of the record after the release",
            first.1.abs(),
            first.0,
            most.1.abs(),
            most.0
        ));
    }
    Ok(())
}
