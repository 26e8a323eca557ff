//! Claims 3 and 5: free vibration. The best clearance and restitution, and the impact damper beside the tuned mass.

use super::evidence::{Evidence, beside, number, percent, short};
use super::{Judged, Judgement, Number, Verdict};
use crate::results::{CaseResult, ResultError};

const CLEARANCE: &str = "particle.clearance_ratio";
const RESTITUTION: &str = "particle.wall.coefficient";

/// A place on a contour map counts as the same within this distance, in d/x0 and in e.
const SAME_PLACE: f64 = 0.1;

/// The best point of a map.
struct Best {
    words: &'static str,
    clearance: f64,
    restitution: f64,
    rms: f64,
    /// RMS at the published optimum.
    rms_there: Option<f64>,
}

fn best(
    evidence: &Evidence,
    (part, words): (&str, &'static str),
    metric: &str,
    there: (f64, f64),
) -> Result<Best, ResultError> {
    let map = evidence.study("fig-3-9", part)?;
    let row = map.least(metric)?;
    Ok(Best {
        words,
        clearance: map.column(CLEARANCE)?[row],
        restitution: map.column(RESTITUTION)?[row],
        rms: map.column(metric)?[row],
        rms_there: map.at(&[(CLEARANCE, there.0), (RESTITUTION, there.1)], metric).ok(),
    })
}

/// Claim 3.
pub fn best_clearance_and_restitution(evidence: &Evidence) -> Judged {
    let (clearance, restitution) = (evidence.printed("fig-3-9", "Best d/x0")?, evidence.printed("fig-3-9", "Best e")?);
    let there = (clearance, restitution);
    let mut all =
        vec![best(evidence, ("a", "the particle starts at the wall that moves away from it"), "rms_over_z", there)?];
    let others = [
        (("a-centre", "the particle starts in the middle"), "rms_over_z"),
        (("a-other-wall", "the particle starts at the wall that pushes it"), "rms_over_z"),
        (("a-starts", "the median over the starts is taken"), "rms_over_z_q50"),
    ];
    all.extend(others.into_iter().filter_map(|(part, metric)| best(evidence, part, metric, there).ok()));
    let is_there = |best: &&Best| {
        (best.clearance - clearance).abs() <= SAME_PLACE && (best.restitution - restitution).abs() <= SAME_PLACE
    };
    let verdict = match all.iter().find(is_there) {
        Some(_) if all.iter().all(|best| is_there(&best)) => Verdict::Holds,
        Some(best) => Verdict::HoldsOnlyIf(best.words.into()),
        None => Verdict::DoesNotHold,
    };
    let mut numbers = Vec::new();
    let mut reasons = Vec::new();
    for best in &all {
        numbers.push(beside(format!("best d/x0, if {}", best.words), best.clearance, "", clearance));
        numbers.push(beside(format!("best e, if {}", best.words), best.restitution, "", restitution));
        numbers.push(number(format!("its RMS over x0, if {}", best.words), best.rms, ""));
        let mut reason = format!(
            "if {}, the least RMS is at d/x0 = {}, e = {}",
            best.words,
            short(best.clearance),
            short(best.restitution)
        );
        if let Some(rms) = best.rms_there {
            reason += &format!(" ({} less than at the published place)", percent(1.0 - best.rms / rms));
        }
        reasons.push(reason);
    }
    Ok(Judgement {
        number: 3,
        not_computed: evidence.not_computed(),
        claim: "The RMS over 30 cycles of free vibration is least near d/x0 = 0.85 and e = 0.55 (figure 3-9).".into(),
        verdict,
        rule: format!(
            "The least value on the map lies within {SAME_PLACE} of the published d/x0 and e: from every start of the particle (holds), \
             from one of them (holds only if)."
        ),
        numbers,
        reason: format!("{}.", sentence(&reasons.join("; "))),
    })
}

/// Cycles after which no later cycle maximum reaches `share` of the first displacement; `None` if the record ends before.
fn cycles_to(case: &CaseResult, share: f64) -> Option<usize> {
    let limit_m = share * case.reference_m?;
    let last = case.cycle_max_m.iter().rposition(|max_m| *max_m > limit_m).map_or(0, |place| place + 1);
    (last < case.cycle_max_m.len()).then_some(last)
}

/// Claim 5.
pub fn faster_than_the_tuned_mass(evidence: &Evidence) -> Judged {
    let case = |name: &str| evidence.results.case("fig-3-7", "histories", name);
    let tmd = case("free-tmd")?;
    let measures = |case: &CaseResult| {
        let x0_m = case.reference_m.unwrap_or(f64::NAN);
        let cycles = |share| cycles_to(case, share).map_or(f64::INFINITY, |cycles| cycles as f64);
        [case.summary.rms_x_m / x0_m, cycles(0.05), cycles(0.02)]
    };
    let words = ["the RMS over 30 cycles", "cycles to 5 %", "cycles to 2 %"];
    let of_tmd = measures(&tmd);
    let mut numbers: Vec<Number> = labelled("TMD", words, of_tmd);
    let mut won = [true; 3];
    let mut reasons = Vec::new();
    for (name, label) in [
        ("free-spid", "SPID, d/x0 = 0.85, e = 0.55"),
        ("free-soft-085", "SPID, d/x0 = 0.85, e = 0.47"),
        ("free-hard-085", "SPID, d/x0 = 0.85, e = 0.82"),
    ] {
        let of_spid = measures(&case(name)?);
        numbers.extend(labelled(label, words, of_spid));
        for place in 0..3 {
            won[place] &= of_spid[place] < of_tmd[place];
        }
        reasons.push(format!("{label}: {}", in_words(words, of_spid)));
    }
    let by: Vec<&str> = words.iter().zip(won).filter_map(|(word, won)| won.then_some(*word)).collect();
    let verdict = match by.len() {
        3 => Verdict::Holds,
        0 => Verdict::DoesNotHold,
        _ => Verdict::HoldsOnlyIf(format!("\"faster\" means {}", by.join(" and "))),
    };
    Ok(Judgement {
        number: 5,
        not_computed: evidence.not_computed(),
        claim: "The impact damper damps free vibration faster than the optimal tuned mass of equal mass (section 3.3).".into(),
        verdict,
        rule: "Three measures of speed, with the published best damper and with the two measured restitutions: RMS over 30 cycles, and \
               cycles after which no maximum reaches 5 % and 2 % of x0. The claim holds if the impact damper is better in all."
            .into(),
        numbers,
        reason: format!("TMD: {}. {}.", in_words(words, of_tmd), reasons.join("; ")),
    })
}

fn labelled(label: &str, words: [&str; 3], values: [f64; 3]) -> Vec<Number> {
    let of = |(word, value): (&&str, f64)| match value.is_finite() {
        true => number(format!("{label}: {word}"), value, ""),
        false => number(format!("{label}: {word} (more than 30)"), f64::NAN, ""),
    };
    words.iter().zip(values).map(of).collect()
}

fn in_words(words: [&str; 3], values: [f64; 3]) -> String {
    let cycles = |value: f64| if value.is_finite() { value.to_string() } else { "more than 30".into() };
    let [rms, five, two] = values;
    format!("{} {}, {} {}, {} {}", words[0], short(rms), words[1], cycles(five), words[2], cycles(two))
}

/// With a capital at the start.
pub(super) fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
