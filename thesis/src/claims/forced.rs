//! Claims 6 to 9: forced vibration. What the response depends on, where it is steady, and where it is least.

use super::evidence::{Evidence, NOTABLE, beside, median, number, percent, range, short};
use super::{Judged, Judgement, Verdict};
use crate::results::ResultError;

const CLEARANCE: &str = "particle.clearance_ratio";
const RESTITUTION: &str = "particle.wall.coefficient";
const AMPLITUDE: &str = "base.amplitude_m";
const FRICTION: &str = "particle.friction_coefficient";
const FREQUENCY: &str = "base.frequency_hz";

/// Claim 6.
pub fn only_the_ratio_matters(evidence: &Evidence) -> Judged {
    let table = evidence.study("fig-3-13", "friction")?;
    let x_over_z = table.column("x_over_z")?;
    let (amplitudes, frictions) = (table.values(AMPLITUDE)?, table.values(FRICTION)?);
    let (&[small, .., large], &[0.0, .., friction]) = (&amplitudes[..], &frictions[..]) else {
        return Err(table.wrong("it must have two base amplitudes, and internal friction 0 and more"));
    };
    let (clearances, frequencies) = (table.values(CLEARANCE)?, table.values(FREQUENCY)?);
    let differences = |friction: f64| -> Result<Vec<f64>, ResultError> {
        let mut differences = Vec::new();
        for &clearance in &clearances {
            for &frequency in &frequencies {
                let at = |amplitude: f64| {
                    let keys =
                        [(CLEARANCE, clearance), (FREQUENCY, frequency), (FRICTION, friction), (AMPLITUDE, amplitude)];
                    table.rows(&keys).map(|rows| x_over_z[rows[0]])
                };
                differences.push((at(large)? / at(small)? - 1.0).abs());
            }
        }
        Ok(differences)
    };
    let (without, with) = (differences(0.0)?, differences(friction)?);
    let largest = |values: &[f64]| range(values.iter().copied()).1;
    let numbers = vec![
        number("largest difference of X/Z, no internal friction", largest(&without), ""),
        number("median difference of X/Z, no internal friction", median(without.clone()), ""),
        number(format!("largest difference of X/Z, μi = {friction}"), largest(&with), ""),
        number(format!("median difference of X/Z, μi = {friction}"), median(with.clone()), ""),
    ];
    let verdict = match (largest(&without) <= NOTABLE, largest(&with) <= NOTABLE) {
        (true, true) => Verdict::Holds,
        (true, false) => Verdict::HoldsOnlyIf("there is no internal friction".into()),
        _ => Verdict::DoesNotHold,
    };
    Ok(Judgement {
        number: 6,
        not_computed: evidence.not_computed(),
        claim: "Only d/Z matters, not Z itself (figure 3-13: Z = 3 mm and 30 mm).".into(),
        verdict,
        rule: format!(
            "X/Z of both amplitudes is compared at every frequency and clearance, without friction and with that of the slider. They are \
             equal if no point differs by more than {}.",
            percent(NOTABLE)
        ),
        numbers,
        reason: format!(
            "Without friction the equations scale with Z: points differ by {} at most, by the growth of rounding where the motion is \
             irregular. The force of internal friction does not scale: with μi = {friction} points differ by up to {}, half of them by more than \
             {}.",
            percent(largest(&without)),
            percent(largest(&with)),
            percent(median(with.clone()))
        ),
    })
}

/// A response that differs by less than this over the restitution does not depend on it.
const SAME_RESPONSE: f64 = 0.1;

/// Claim 7.
pub fn restitution_at_small_clearance(evidence: &Evidence) -> Judged {
    let span = |part: &str, clearance: f64, up_to: f64| -> Result<f64, ResultError> {
        let table = evidence.study("fig-3-14", part)?;
        let (e, x_over_z) = (table.column(RESTITUTION)?, table.column("x_over_z")?);
        let rows = table.rows(&[(CLEARANCE, clearance)])?;
        let (low, high) = range(rows.into_iter().filter(|&row| e[row] <= up_to + 1e-9).map(|row| x_over_z[row]));
        Ok(high / low - 1.0)
    };
    let restitutions = evidence.study("fig-3-14", "peak")?.values(RESTITUTION)?;
    let mut limit = 0.0;
    for &e in &restitutions {
        if span("peak", 5.0, e)? > SAME_RESPONSE {
            break;
        }
        limit = e;
    }
    let measured = 0.82;
    let [five, fifteen] = [span("peak", 5.0, measured)?, span("peak", 15.0, measured)?];
    let mut numbers = vec![
        number("change of the peak at d/Z = 5, e from 0 to 0.82", five, ""),
        number("change of the peak at d/Z = 15, e from 0 to 0.82", fifteen, ""),
        number("change of the peak at d/Z = 5, all e", span("peak", 5.0, 1.0)?, ""),
        number("largest e up to which the peak at d/Z = 5 changes by less than 10 %", limit, ""),
    ];
    let mut reason = format!(
        "Records of 32 s: from e = 0 to 0.82 the peak changes by {} at d/Z = 5 and by {} at d/Z = 15; at d/Z = 5 it stays within 10 % up \
         to e = {}.",
        percent(five),
        percent(fifteen),
        short(limit)
    );
    if let Ok(converged) = span("peak-converged", 5.0, measured) {
        numbers.push(number("change of the converged peak at d/Z = 5, e from 0 to 0.82", converged, ""));
        reason += &format!(" Converged, it changes by {}.", percent(converged));
    }
    let verdict = if limit >= 1.0 - 1e-9 {
        Verdict::Holds
    } else if limit > 0.0 {
        Verdict::HoldsOnlyIf(format!("e is at most {}", short(limit)))
    } else {
        Verdict::DoesNotHold
    };
    Ok(Judgement {
        number: 7,
        not_computed: evidence.not_computed(),
        claim: "At d/Z = 5 the coefficient of restitution does not matter (figure 3-14).".into(),
        verdict,
        rule: "The peak over 2 to 3 Hz changes by less than 10 % from e = 0 up to an e: the claim holds if that is 1, and only up to it \
               otherwise."
            .into(),
        numbers,
        reason,
    })
}

/// Claim 8.
pub fn steady_at_fourteen(evidence: &Evidence) -> Judged {
    let printed = evidence.printed("fig-3-15", "Restitution up to which the response is steady, d/Z = 14")?;
    let starts = evidence.study("fig-3-15", "starts")?;
    let (e, spread) = (starts.column(RESTITUTION)?, starts.column("cycle_spread_max")?);
    let below: Vec<usize> = (0..e.len()).filter(|&row| e[row] < printed).collect();
    if below.is_empty() {
        return Err(starts.wrong("it has no restitution below the printed one"));
    }
    let unsteady: Vec<usize> = below.iter().copied().filter(|&row| spread[row] > NOTABLE).collect();
    let share = unsteady.len() as f64 / below.len() as f64;
    let first = range(unsteady.iter().map(|&row| e[row])).0;
    let branches = evidence.results.continuation("fig-3-15", "orbits-b")?;
    let all_points = branches["branches"].as_array().into_iter().flatten();
    let points = all_points.flat_map(|branch| branch["special_points"].as_array().into_iter().flatten());
    let found = points.filter_map(|point| Some((point["kind"].as_str()?, point["parameter"].as_f64()?)));
    let lost = found.filter(|(kind, _)| *kind != "grazing").min_by(|a, b| a.1.total_cmp(&b.1));
    let mut numbers = vec![
        number("share of e below 0.7 where cycles differ by more than 1 %, from any start", share, ""),
        beside("least e where they do", first, "", printed),
    ];
    let mut reason =
        format!("The cycles differ from each other in {} of the values of e below {printed}", percent(share));
    if let Some((kind, at)) = lost {
        numbers.push(number(
            format!("e at which the orbit with two impacts per period loses its stability ({kind})"),
            at,
            "",
        ));
        reason += &format!("; the periodic orbit with two impacts loses its stability at e = {at:.4} ({kind})");
    }
    let limit = lost.map_or(first, |(_, at)| at);
    let verdict = match unsteady.len() {
        0 => Verdict::Holds,
        _ if limit > 0.0 => Verdict::HoldsOnlyIf(format!("e is below {limit:.4}")),
        _ => Verdict::DoesNotHold,
    };
    Ok(Judgement {
        number: 8,
        not_computed: evidence.not_computed(),
        claim: "At d/Z = 14 the response is steady for e below 0.7 (figure 3-15).".into(),
        verdict,
        rule: format!(
            "Steady means that, after 300 cycles, the largest of 100 cycle maxima is at most {} above their mean, from every start. The \
             claim holds if that is so for every e below 0.7. Otherwise it holds below the e at which the continued periodic orbit loses \
             its stability.",
            percent(NOTABLE)
        ),
        numbers,
        reason: format!("{reason}."),
    })
}

/// Claim 9.
pub fn best_design(evidence: &Evidence) -> Judged {
    let low =
        evidence.printed("fig-3-16", "Best d/Z, lower end (14 to 17 in section 3.4.2, 14 to 18 in section 3.5)")?;
    let high = evidence.printed("fig-3-16", "Best d/Z, upper end")?;
    let most_e = evidence.printed("fig-3-16", "Best e, upper end (from 0)")?;
    let readings = [
        ("c", "x_over_z", "\"at resonance\" is the peak over 2 to 3 Hz in 32 s from rest"),
        ("c-resonance", "x_over_z", "\"at resonance\" is the steady response at f = fn"),
        ("c-starts", "x_over_z_q50", "it is the median over the starts of the steady response at f = fn"),
    ];
    let mut numbers = Vec::new();
    let mut reasons = Vec::new();
    let mut inside = Vec::new();
    for (part, metric, words) in readings {
        let map = match evidence.study("fig-3-16", part) {
            Ok(map) => map,
            Err(error) if part == "c" => return Err(error),
            // A quick run leaves other readings out.
            Err(_) => continue,
        };
        let (d, e, value) = (map.column(CLEARANCE)?, map.column(RESTITUTION)?, map.column(metric)?);
        let best = map.least(metric)?;
        let recommended = |row: &usize| (low..=high).contains(&d[*row]) && e[*row] <= most_e + 1e-9;
        if !(0..d.len()).any(|row| recommended(&row)) {
            return Err(map.wrong("it has no point in the recommended region"));
        }
        let (best_there, worst_there) = range((0..d.len()).filter(recommended).map(|row| value[row]));
        inside.push((recommended(&best), words));
        numbers.push(beside(format!("best d/Z, if {words}"), d[best], "", low));
        numbers.push(beside(format!("best e, if {words}"), e[best], "", most_e));
        numbers.push(number(format!("X/Z there, if {words}"), value[best], ""));
        numbers.push(number(format!("best X/Z in the recommended region, if {words}"), best_there, ""));
        numbers.push(number(format!("worst X/Z in the recommended region, if {words}"), worst_there, ""));
        reasons.push(format!(
            "if {words}: best at d/Z = {}, e = {} with X/Z = {}; in the recommended region X/Z is {} to {}",
            short(d[best]),
            short(e[best]),
            short(value[best]),
            short(best_there),
            short(worst_there)
        ));
    }
    let verdict = match inside.iter().find(|(inside, _)| *inside) {
        Some(_) if inside.iter().all(|(inside, _)| *inside) => Verdict::Holds,
        Some((_, words)) => Verdict::HoldsOnlyIf((*words).into()),
        None => Verdict::DoesNotHold,
    };
    Ok(Judgement {
        number: 9,
        not_computed: evidence.not_computed(),
        claim: "The best impact damper has d/Z from 14 to 18 and e from 0 to 0.5 (figure 3-16, section 3.5).".into(),
        verdict,
        rule: "The least X/Z on the map of 100 × 100 points lies in the recommended region: in every reading of \"at resonance\" (holds), \
               in one (holds only if)."
            .into(),
        numbers,
        reason: format!("{}.", super::free::sentence(&reasons.join("; "))),
    })
}
