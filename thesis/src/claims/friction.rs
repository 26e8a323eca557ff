//! Claim 4: internal friction only harms.

use super::evidence::{Evidence, NOTABLE, median, number, percent, short};
use super::free::sentence;
use super::{Judged, Judgement, Verdict};
use crate::results::ResultError;

/// A map over internal friction, and the same without friction.
struct Map {
    item: &'static str,
    parts: [&'static str; 2],
    without: &'static str,
    key: &'static str,
    metric: &'static str,
    words: &'static str,
}

const RESTITUTION: &str = "particle.wall.coefficient";
const CLEARANCE: &str = "particle.clearance_ratio";
const FRICTION: &str = "particle.friction_coefficient";

const MAPS: [Map; 4] = [
    Map {
        item: "fig-3-9",
        parts: ["b", "b-small-friction"],
        without: "b-no-friction",
        key: CLEARANCE,
        metric: "rms_over_z",
        words: "free vibration over d/x0",
    },
    Map {
        item: "fig-3-9",
        parts: ["c", "c-small-friction"],
        without: "c-no-friction",
        key: RESTITUTION,
        metric: "rms_over_z",
        words: "free vibration over e",
    },
    Map {
        item: "fig-3-16",
        parts: ["a", "a-small-friction"],
        without: "a-no-friction",
        key: RESTITUTION,
        metric: "x_over_z",
        words: "peak of the sweep over e",
    },
    Map {
        item: "fig-3-16",
        parts: ["b", "b-small-friction"],
        without: "b-no-friction",
        key: CLEARANCE,
        metric: "x_over_z",
        words: "peak of the sweep over d/Z",
    },
];

/// Response with friction over that without, and the friction, at each point of a map.
fn ratios(evidence: &Evidence, map: &Map) -> Result<Vec<(f64, f64)>, ResultError> {
    let without = evidence.study(map.item, map.without)?;
    let (places, base) = (without.column(map.key)?, without.column(map.metric)?);
    let mut ratios = Vec::new();
    for part in map.parts {
        let Ok(with) = evidence.study(map.item, part) else { continue };
        let (keys, frictions, values) = (with.column(map.key)?, with.column(FRICTION)?, with.column(map.metric)?);
        for ((key, friction), value) in keys.iter().zip(&frictions).zip(&values) {
            let place = places.iter().position(|place| (place - key).abs() < 1e-9);
            if let Some(place) = place.filter(|_| *friction > 0.0) {
                ratios.push((*friction, value / base[place]));
            }
        }
    }
    if ratios.is_empty() {
        return Err(without.wrong("no point with internal friction has one without to compare it with"));
    }
    Ok(ratios)
}

/// Claim 4.
pub fn only_harms(evidence: &Evidence) -> Judged {
    let mut numbers = Vec::new();
    let mut reasons = Vec::new();
    let (mut better, mut all) = (0, 0);
    for map in &MAPS {
        let ratios = ratios(evidence, map)?;
        let helped: Vec<&(f64, f64)> = ratios.iter().filter(|(_, ratio)| *ratio < 1.0 - NOTABLE).collect();
        (better, all) = (better + helped.len(), all + ratios.len());
        let share = helped.len() as f64 / ratios.len() as f64;
        let best = helped.iter().min_by(|a, b| a.1.total_cmp(&b.1)).map_or((f64::NAN, f64::NAN), |best| **best);
        let harmful = harmful_from(&ratios);
        numbers.push(number(format!("{}: share of points that friction improves", map.words), share, ""));
        numbers.push(number(format!("{}: best ratio to no friction", map.words), best.1, ""));
        numbers.push(number(format!("{}: at μi", map.words), best.0, ""));
        numbers.push(number(format!("{}: the median is harmed from μi", map.words), harmful, ""));
        let harm = if harmful.is_nan() { "at no μi".into() } else { format!("from μi = {} on", short(harmful)) };
        reasons.push(format!(
            "{}: {} of the points are better with friction, by up to {} (μi = {}), and the median is worse {harm}",
            map.words,
            percent(share),
            percent(1.0 - best.1),
            short(best.0)
        ));
    }
    if let Some((gain, friction)) = best_of_medians(evidence) {
        numbers.push(number("fall of the median RMS over 41 starts, d/x0 = 0.8, e = 0.4", gain, ""));
        numbers.push(number("at μi", friction, ""));
        reasons.push(format!(
            "over 41 starts the median RMS at d/x0 = 0.8 falls by up to {} (μi = {})",
            percent(gain),
            short(friction)
        ));
    }
    let share = better as f64 / all as f64;
    let verdict = if better == 0 { Verdict::Holds } else { Verdict::DoesNotHold };
    Ok(Judgement {
        number: 4,
        not_computed: evidence.not_computed(),
        claim: "Internal friction between particle and structure only harms (figures 3-8, 3-9, 3-16).".into(),
        verdict,
        rule: format!(
            "Each point of the maps with μi > 0 is compared with the same point without friction. The claim holds if none is better by \
             more than {}.",
            percent(NOTABLE)
        ),
        numbers,
        reason: format!(
            "{} of all points are better with friction. {}.",
            percent(share),
            sentence(&reasons.join("; "))
        ),
    })
}

/// The largest fall of the median over the starts of the particle against no friction, and its friction: a fall that is not that of one
/// irregular motion.
fn best_of_medians(evidence: &Evidence) -> Option<(f64, f64)> {
    let at = [(CLEARANCE, 0.8)];
    let without = evidence.study("fig-3-8", "no-friction").ok()?.at(&at, "rms_over_z_q50").ok()?;
    let with = evidence.study("fig-3-8", "small-friction").ok()?;
    let (frictions, medians) = (with.column(FRICTION).ok()?, with.column("rms_over_z_q50").ok()?);
    let falls = with.rows(&at).ok()?.into_iter().map(|row| (1.0 - medians[row] / without, frictions[row]));
    falls.max_by(|a, b| a.0.total_cmp(&b.0))
}

/// The friction from which on the median over the map is worse than without it.
fn harmful_from(ratios: &[(f64, f64)]) -> f64 {
    let mut frictions: Vec<f64> = ratios.iter().map(|(friction, _)| *friction).collect();
    frictions.sort_by(f64::total_cmp);
    frictions.dedup();
    let is_worse = |friction: f64| {
        let there = ratios.iter().filter(|(other, _)| *other == friction).map(|(_, ratio)| *ratio).collect();
        median(there) > 1.0 + NOTABLE
    };
    let harmless = frictions.iter().rposition(|friction| !is_worse(*friction));
    harmless.map_or(frictions.first(), |place| frictions.get(place + 1)).copied().unwrap_or(f64::NAN)
}
