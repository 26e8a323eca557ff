//! Claims 10 to 13: the friction damper, and both dampers together.

use super::evidence::{Evidence, Numbers, beside, median, number, percent, quantile, range, short};
use super::free::sentence;
use super::{Judged, Judgement, Verdict};
use crate::results::ResultError;

const CLEARANCE: &str = "particle.clearance_ratio";
const FRICTION_RATIO: &str = "friction_damper.friction_ratio";

/// "About 20" has two digits at most.
const ABOUT: f64 = 0.1;

/// Records without viscous damping: part, length (s).
const RECORDS: [(&str, f64); 5] =
    [("peak-8-s", 8.0), ("peak-16-s", 16.0), ("peak-32-s", 32.0), ("peak-64-s", 64.0), ("peak-128-s", 128.0)];

/// Claim 10.
pub fn friction_alone(evidence: &Evidence) -> Judged {
    let printed = evidence.printed("fig-5-9", "Peak at γF = 0.6")?;
    let peak = |part: &str, ratio: f64| evidence.study("fig-5-9", part)?.at(&[(FRICTION_RATIO, ratio)], "x_over_z");
    let (damped, steady) = (peak("damped", 0.6)?, peak("steady", 0.6)?);
    let mut numbers = vec![
        beside("peak at γF = 0.6, ζ = 0.0038, records of 32 s", damped, "", printed),
        beside("peak at γF = 0.6, ζ = 0.0038, steady", steady, "", printed),
    ];
    // A quick run leaves the shortest and the longest record out.
    let grown: Vec<(f64, f64)> =
        RECORDS.iter().filter_map(|&(part, length_s)| Some((length_s, peak(part, 0.6).ok()?))).collect();
    for &(length_s, value) in &grown {
        numbers.push(beside(
            format!("peak at γF = 0.6 without viscous damping, records of {length_s} s"),
            value,
            "",
            printed,
        ));
    }
    // The peak grows by the same amount in each cycle.
    let around = grown.windows(2).find(|pair| pair[0].1 <= printed && printed <= pair[1].1);
    let length_s =
        around.map(|pair| pair[0].0 + (pair[1].0 - pair[0].0) * (printed - pair[0].1) / (pair[1].1 - pair[0].1));
    if let Some(length_s) = length_s {
        numbers.push(number(
            "length of the records that gives the printed peak, without viscous damping",
            length_s,
            "s",
        ));
    }
    let above = [peak("peak-16-s", 0.8)?, peak("peak-64-s", 0.8)?];
    numbers.push(number("peak at γF = 0.8, above π/4, without viscous damping, 16 s", above[0], ""));
    numbers.push(number("the same, 64 s", above[1], ""));
    let verdict = match length_s {
        _ if (steady / printed - 1.0).abs() <= ABOUT => Verdict::Holds,
        Some(length_s) => Verdict::HoldsOnlyIf(format!(
            "the records are about {length_s:.0} s long (no viscous damping, as in equation 5.16)"
        )),
        None => Verdict::DoesNotHold,
    };
    let listed: Vec<String> =
        grown.iter().map(|(length_s, value)| format!("{} ({length_s} s)", short(*value))).collect();
    Ok(Judgement {
        number: 10,
        not_computed: evidence.not_computed(),
        claim: "The friction damper alone at γF = 0.6, near the limit π/4, still has a peak of about 20 (figure 5-9).".into(),
        verdict,
        rule: "The steady peak over 2 to 3 Hz is within 10 % of the printed one (holds); a record of some length gives it, interpolated \
               between the computed lengths (holds only if)."
            .into(),
        numbers,
        reason: format!(
            "With ζ = 0.0038 the peak is {} in records of 32 s and {} when steady. Without viscous damping it grows with the record: {}. \
             Above π/4 it hardly does: {} in 16 s and {} in 64 s at γF = 0.8.",
            short(damped),
            short(steady),
            listed.join(", "),
            short(above[0]),
            short(above[1])
        ),
    })
}

/// "About four" cycles.
const ABOUT_FOUR: std::ops::RangeInclusive<usize> = 3..=5;

/// Less than this share of the largest cycle maximum counts as removed.
const REMOVED: f64 = 0.02;

/// A free vibration: cycles after its largest one until the printed share of it is gone, the share that is gone after four, and the
/// share that is left at the end.
struct Decay {
    cycles: usize,
    gone_after_four: f64,
    left_at_end: f64,
}

impl Decay {
    fn of(evidence: &Evidence, (item, part, case): (&str, &str, &str), share: f64) -> Result<Self, ResultError> {
        let maxima_m = evidence.results.case(item, part, case)?.cycle_max_m;
        let wrong = || ResultError::Wrong(format!("{item}/{part}: {case} has too few cycles"));
        let largest = maxima_m.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).ok_or_else(wrong)?;
        let after: Vec<f64> = maxima_m[largest.0..].iter().map(|max_m| max_m / largest.1).collect();
        let cycles = after.iter().position(|left| *left <= 1.0 - share).ok_or_else(wrong)?;
        Ok(Self {
            cycles,
            gone_after_four: 1.0 - after.get(4).ok_or_else(wrong)?,
            left_at_end: *after.last().ok_or_else(wrong)?,
        })
    }
}

/// Claim 11.
pub fn four_strong_cycles(evidence: &Evidence) -> Judged {
    let printed = evidence.printed("fig-5-4", "Amplitude that the first four cycles take away, %")? / 100.0;
    let decay = |item, part, case| Decay::of(evidence, (item, part, case), printed);
    let (velocity, impulse) = (decay("fig-5-4", "a", "velocity-spid")?, decay("fig-5-4", "b", "impulse-spid")?);
    let (damped, damped_impulse) =
        (decay("fig-5-5", "a", "velocity-hybrid")?, decay("fig-5-5", "b", "impulse-hybrid")?);
    let mut numbers = Vec::new();
    for (decay, words) in [(&velocity, "initial velocity"), (&impulse, "impulse")] {
        numbers.push(beside(format!("share that four cycles take away, {words}"), decay.gone_after_four, "", printed));
        numbers.push(beside(format!("cycles that take away 85 %, {words}"), decay.cycles as f64, "", 4.0));
        numbers.push(number(format!("share that is left at the end, {words}"), decay.left_at_end, ""));
    }
    numbers.push(number("share left at the end with μe = 0.01, initial velocity", damped.left_at_end, ""));
    numbers.push(number("share left at the end with μe = 0.01, impulse", damped_impulse.left_at_end, ""));
    let holds = |alone: &Decay, damped: &Decay| ABOUT_FOUR.contains(&alone.cycles) && damped.left_at_end < REMOVED;
    let verdict = match (holds(&velocity, &damped), holds(&impulse, &damped_impulse)) {
        (true, true) => Verdict::Holds,
        (true, false) => Verdict::HoldsOnlyIf("an initial velocity starts the vibration".into()),
        (false, true) => Verdict::HoldsOnlyIf("an impulse of the base (half sine, 0.2 s) starts the vibration".into()),
        (false, false) => Verdict::DoesNotHold,
    };
    Ok(Judgement {
        number: 11,
        not_computed: evidence.not_computed(),
        claim: "About four strongly damped cycles take away 85 % of a free vibration; a little external friction removes the rest \
                (figures 5-4, 5-5)."
            .into(),
        verdict,
        rule: format!(
            "85 % of the largest cycle maximum are gone after three to five cycles, and with μe = 0.01 less than {} is left at the end: \
             after the initial velocity and after the impulse.",
            percent(REMOVED)
        ),
        numbers,
        reason: format!(
            "After the initial velocity four cycles take away {}, and {} cycles 85 %; after the impulse four take away {}, and {} cycles \
             85 %. At the end {} and {} are left, with friction {} and {}.",
            percent(velocity.gone_after_four),
            velocity.cycles,
            percent(impulse.gone_after_four),
            impulse.cycles,
            percent(velocity.left_at_end),
            percent(impulse.left_at_end),
            percent(damped.left_at_end),
            percent(damped_impulse.left_at_end)
        ),
    })
}

/// A hybrid damper comes close to the tuned mass if its peak is at most this much higher.
const CLOSE: f64 = 0.1;

/// A reduction in per cent is reached within this many points.
const POINTS: f64 = 5.0;

/// Claim 12.
pub fn close_to_the_tuned_mass(evidence: &Evidence) -> Judged {
    let below_fd = evidence.printed("table-5-1", "Hybrid damper below friction damper, %")?;
    let below_spid = evidence.printed("table-5-1", "Hybrid damper below impact damper, d = 22.5 mm, %")?;
    let (hybrid, fd) = (evidence.study("table-5-1", "hybrid")?, evidence.study("table-5-1", "fd")?);
    let spids = evidence.study("table-5-1", "spid")?;
    let best_spid = spids.least("x_over_z")?;
    let (spid, best_clearance) = (spids.column("x_over_z")?[best_spid], spids.column(CLEARANCE)?[best_spid]);
    let tmd = range(evidence.study("fig-5-14", "tmd")?.column("x_over_z")?).1;
    let mut numbers = vec![number("peak of the tuned mass damper", tmd, "")];
    let mut reasons = vec![format!(
        "the tuned mass has a peak of {}, the best of the impact damper's three clearances, d/Z = {best_clearance}, one of {}",
        short(tmd),
        short(spid)
    )];
    let mut fitting = Vec::new();
    for ratio in [0.4, 0.5, 0.6, 0.7, 0.8] {
        let peak = hybrid.at(&[(CLEARANCE, 5.0), (FRICTION_RATIO, ratio)], "x_over_z")?;
        let friction = fd.at(&[(FRICTION_RATIO, ratio)], "x_over_z")?;
        let (less_than_fd, less_than_spid) = (100.0 * (1.0 - peak / friction), 100.0 * (1.0 - peak / spid));
        numbers.push(number(format!("peak of the hybrid damper at d/Z = 5, γF = {ratio}"), peak, ""));
        numbers.push(beside(format!("below the friction damper, γF = {ratio}"), less_than_fd, "%", below_fd));
        numbers.push(beside(
            format!("below the best impact damper (d/Z = {best_clearance}), γF = {ratio}"),
            less_than_spid,
            "%",
            below_spid,
        ));
        reasons.push(format!(
            "γF = {ratio}: hybrid at d/Z = 5 has {}, {} % below friction alone, {} % below the best impact damper",
            short(peak),
            short(less_than_fd),
            short(less_than_spid)
        ));
        let reduces = less_than_fd >= below_fd - POINTS && less_than_spid >= below_spid - POINTS;
        if peak <= (1.0 + CLOSE) * tmd && reduces {
            fitting.push(ratio.to_string());
        }
    }
    let map = evidence.study("fig-5-11", "r1")?;
    let (clearances, ratios, peaks) = (map.column(CLEARANCE)?, map.column(FRICTION_RATIO)?, map.column("x_over_z")?);
    for (words, limit) in [("of all", f64::INFINITY), ("with γF below π/4", std::f64::consts::FRAC_PI_4)] {
        let within = (0..peaks.len()).filter(|&row| ratios[row] < limit);
        let Some(best) = within.min_by(|&a, &b| peaks[a].total_cmp(&peaks[b])) else { continue };
        numbers.push(number(format!("best hybrid damper on the map, {words}: d/Z"), clearances[best], ""));
        numbers.push(number(format!("best hybrid damper on the map, {words}: γF"), ratios[best], ""));
        numbers.push(number(format!("its peak, {words}"), peaks[best], ""));
        reasons.push(format!(
            "the best hybrid damper on the map, {words}, is at d/Z = {}, γF = {} with {}",
            short(clearances[best]),
            short(ratios[best]),
            short(peaks[best])
        ));
    }
    let verdict = match fitting.len() {
        0 => Verdict::DoesNotHold,
        5 => Verdict::Holds,
        _ => Verdict::HoldsOnlyIf(format!("γF is {}", fitting.join(" or "))),
    };
    Ok(Judgement {
        number: 12,
        not_computed: evidence.not_computed(),
        claim: "The hybrid damper at d/Z = 5 comes close to the tuned mass of equal mass: 66 % below friction alone, 43 % below the best \
                impact damper (Tables 5-1, 5-2, figures 5-11, 5-14)."
            .into(),
        verdict,
        rule: format!(
            "For each γF from 0.4 to 0.8: the hybrid damper's peak at d/Z = 5 is at most {} above that of the tuned mass, and both \
             reductions are at least the printed ones less {POINTS} points. The claim holds for the γF where that is so.",
            percent(CLOSE)
        ),
        numbers,
        reason: format!("{}.", sentence(&reasons.join("; "))),
    })
}

/// Share of the motions in which an order must hold.
const MOSTLY: f64 = 0.95;

/// Largest |x| in each motion, by seed, at one choice of the other keys.
fn over_motions(table: &Numbers, keys: &[(&str, f64)]) -> Result<Vec<(f64, f64)>, ResultError> {
    let (seeds, values) = (table.column("base.noise.seed")?, table.column("max_abs_x_m")?);
    let mut motions: Vec<(f64, f64)> = table.rows(keys)?.into_iter().map(|row| (seeds[row], values[row])).collect();
    motions.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(motions)
}

/// Claim 13.
pub fn best_in_an_earthquake(evidence: &Evidence) -> Judged {
    let label = "Hybrid damper below tuned mass damper, largest |x|, %";
    let printed = evidence.printed("table-5-3", label)?;
    let study = |part: &str| evidence.study("table-5-3", part);
    let (hybrid, spid, fd) = (study("hybrid")?, study("spid")?, study("fd")?);
    let (bare, tmd) = (over_motions(&study("bare")?, &[])?, over_motions(&study("tmd")?, &[])?);
    let mut numbers = Vec::new();
    let mut fitting = Vec::new();
    let mut best = (f64::NEG_INFINITY, String::new());
    let mut largest = (f64::NEG_INFINITY, String::new());
    for &clearance in &hybrid.values("particle.clearance_m")? {
        for &force in &hybrid.values("friction_damper.force_n")? {
            let (d, f) = (("particle.clearance_m", clearance), ("friction_damper.force_n", force));
            let of_hybrid = over_motions(&hybrid, &[d, f])?;
            let (of_spid, of_fd) = (over_motions(&spid, &[d])?, over_motions(&fd, &[f])?);
            let others = [&bare, &tmd, &of_spid, &of_fd];
            let seeds = |motions: &[(f64, f64)]| motions.iter().map(|motion| motion.0).collect::<Vec<f64>>();
            if others.iter().any(|other| seeds(other) != seeds(&of_hybrid)) {
                return Err(hybrid.wrong("the studies of the dampers have not the same motions"));
            }
            let wins = |place: &usize| others.iter().all(|other| of_hybrid[*place].1 < other[*place].1);
            let share = (0..of_hybrid.len()).filter(wins).count() as f64 / of_hybrid.len() as f64;
            let reductions: Vec<f64> =
                of_hybrid.iter().zip(&tmd).map(|(hybrid, tmd)| 100.0 * (1.0 - hybrid.1 / tmd.1)).collect();
            let (low, high) = (quantile(reductions.clone(), 0.05), quantile(reductions.clone(), 0.95));
            let words = format!("d = {} mm, {force} N", 1e3 * clearance);
            numbers.push(number(format!("share of motions in which the hybrid damper is best, {words}"), share, ""));
            numbers.push(beside(
                format!("median below the tuned mass, {words}"),
                median(reductions.clone()),
                "%",
                printed,
            ));
            let middle = median(reductions);
            let in_words = format!(
                "{words}, best in {} of the motions, {} % below the tuned mass (median; 5 to 95 %: {} to {} %)",
                percent(share),
                short(middle),
                short(low),
                short(high)
            );
            if share > best.0 {
                best = (share, in_words.clone());
            }
            if middle > largest.0 {
                largest = (middle, in_words);
            }
            if share >= MOSTLY && (low..=high).contains(&printed) {
                fitting.push(words);
            }
        }
    }
    let verdict = if fitting.is_empty() {
        Verdict::DoesNotHold
    } else if fitting.len() * 2 == numbers.len() {
        Verdict::Holds
    } else {
        Verdict::HoldsOnlyIf(format!("clearance and friction force suit the motion: {}", fitting.join("; ")))
    };
    Ok(Judgement {
        number: 13,
        not_computed: evidence.not_computed(),
        claim: "In an earthquake the hybrid damper is the best, with a largest displacement 46 % below that of the tuned mass (Table 5-3)."
            .into(),
        verdict,
        rule: format!(
            "The record is not to be had, and neither d nor the force is printed: {} synthetic motions, with every clearance and force. The \
             hybrid damper is best if its largest |x| is below that of the structure alone, the tuned mass, the impact damper of the same \
             clearance and the friction damper of the same force. The claim holds where it is best in at least {} of the motions, and the printed {printed} % lie between the 5 and 95 % \
             quantiles of its distance from the tuned mass.",
            tmd.len(),
            percent(MOSTLY)
        ),
        numbers,
        reason: format!("Best most often: {}. Furthest below the tuned mass: {}.", best.1, largest.1),
    })
}
