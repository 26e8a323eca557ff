//! Claims 1 and 2: the tables of forced responses are reproduced.

use super::evidence::{Evidence, Pair, REPRODUCED, beside, percent, short};
use super::{Judged, Judgement, Number, Verdict};

/// Claim 1, Table 3-4.
pub fn peaks_of_the_impact_damper(evidence: &Evidence) -> Judged {
    let main = ("r1", "records of 32 s on a grid of 0.05 Hz");
    let others = [
        ("starts", "the start of the particle is open"),
        ("grid-01", "the grid is 0.1 Hz"),
        ("grid-0005", "the grid is 0.005 Hz"),
        ("64-s", "the records are 64 s long"),
        ("128-s", "the records are 128 s long"),
        ("whole-travel", "d is the whole free travel"),
        ("millimetres", "d is 7.5, 22.5 and 37.5 mm and Z 3 mm"),
        ("e-047", "e is 0.47, as measured on the foam"),
    ];
    let claim = "The peaks of X/Z for d/Z = 5, 10 and 15 are 35.6, 17.2 and 9.3 (Table 3-4).";
    by_readings(evidence, (1, claim), "table-3-4", main, &others, Some("converged"))
}

/// Claim 2, Table 4-6.
pub fn peaks_with_soft_walls(evidence: &Evidence) -> Judged {
    let main = ("r1", "records of 32 s on a grid of 0.05 Hz, c1 = k1 η/ω");
    let others = [
        ("starts", "the start of the particle is open"),
        ("grid-01", "the grid is 0.1 Hz"),
        ("zero-force", "the walls cannot pull"),
        ("contact", "the loss factor is that at the frequency of the contact"),
        ("natural-hz", "c1 is k1 η/f, with f in Hz"),
        ("whole-travel", "d is the whole free travel"),
        ("undamped", "the structure has no damping of its own"),
    ];
    let claim = "The simulated peaks of X/Z with four soft materials and three clearances are those of Table 4-6.";
    by_readings(evidence, (2, claim), "table-4-6", main, &others, Some("converged"))
}

/// Judges a table by how many of its values each reading reproduces.
fn by_readings(
    evidence: &Evidence,
    (number, claim): (u32, &str),
    item: &str,
    main: (&str, &str),
    others: &[(&str, &str)],
    converged: Option<&str>,
) -> Judged {
    let first = evidence.pairs(item, main.0)?;
    let mut numbers = listed(main.1, &first);
    let mut best = (reproduced(&first), None);
    let mut counts = vec![count_in_words(main.1, &first)];
    for &(part, condition) in others {
        // A quick run leaves the other readings out.
        let Ok(pairs) = evidence.pairs(item, part) else { continue };
        let count = reproduced(&pairs);
        counts.push(count_in_words(&format!("if {condition}"), &pairs));
        numbers.extend(listed(condition, &pairs));
        if count > best.0 {
            best = (count, Some(condition));
        }
    }
    let converged = converged.and_then(|part| evidence.pairs(item, part).ok()).unwrap_or_default();
    numbers.extend(listed("converged", &converged));
    let limited: Vec<&Pair> = converged.iter().filter(|pair| !pair.is_reproduced()).collect();
    let verdict = match best {
        (count, None) if count == first.len() && limited.is_empty() => Verdict::Holds,
        (count, None) if count == first.len() => Verdict::HoldsOnlyIf(format!("X is taken from {}", main.1)),
        (count, Some(condition)) if count == first.len() => Verdict::HoldsOnlyIf(condition.into()),
        _ => Verdict::DoesNotHold,
    };
    let mut reason = format!("Values reproduced: {}.", counts.join("; "));
    if let Some(far) = limited.iter().max_by(|a, b| off(a).total_cmp(&off(b))) {
        reason += &format!(
            " With long records on a fine grid {} becomes {} (printed {}): record and grid limit what is printed.",
            far.label,
            short(far.computed),
            short(far.printed)
        );
    }
    let rule = format!(
        "A value is reproduced within {}, or by the 5 to 95 % band over the starts of the particle. The claim holds if the main reading and the converged response reproduce all values; it holds \
         only under a reading that reproduces all.",
        percent(REPRODUCED)
    );
    Ok(Judgement { number, claim: claim.into(), verdict, rule, numbers, reason, not_computed: evidence.not_computed() })
}

fn reproduced(pairs: &[Pair]) -> usize {
    pairs.iter().filter(|pair| pair.is_reproduced()).count()
}

/// How many values are reproduced, and which if they are few.
fn count_in_words(reading: &str, pairs: &[Pair]) -> String {
    let labels: Vec<&str> = pairs.iter().filter(|pair| pair.is_reproduced()).map(|pair| pair.label.as_str()).collect();
    let which = if labels.is_empty() || labels.len() > 3 { String::new() } else { format!(" ({})", labels.join("; ")) };
    let squares = pairs.iter().map(|pair| pair.deviation().powi(2)).sum::<f64>();
    let rms = (squares / pairs.len() as f64).sqrt();
    format!("{reading}, {} of {}{which}, RMS deviation {}", labels.len(), pairs.len(), percent(rms))
}

fn off(pair: &Pair) -> f64 {
    (pair.computed / pair.printed).ln().abs()
}

fn listed(reading: &str, pairs: &[Pair]) -> Vec<Number> {
    pairs.iter().map(|pair| beside(format!("{}, {reading}", pair.label), pair.computed, "", pair.printed)).collect()
}
