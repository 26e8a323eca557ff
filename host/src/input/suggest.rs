//! Suggests near candidates for an unknown name.

/// Longest name that is compared, bytes: the comparison takes time in proportion to the product of two lengths.
const LONGEST: usize = 64;

/// Candidates that are compared at most.
const MAX: usize = 1000;

/// The candidates that look like `wanted`, best first: at most three, none when nothing is near. `wanted` itself is none.
pub fn near<'a>(wanted: &str, candidates: impl IntoIterator<Item = &'a str>) -> Vec<&'a str> {
    if wanted.len() > LONGEST {
        return Vec::new();
    }
    let mut scored: Vec<(f64, &str)> = candidates
        .into_iter()
        .filter(|c| c.len() <= LONGEST && *c != wanted)
        .take(MAX)
        .map(|c| (strsim::jaro_winkler(&wanted.to_lowercase(), &c.to_lowercase()), c))
        // Below this, two short names share only a letter or two.
        .filter(|(score, _)| *score > 0.75)
        .collect();
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    scored.into_iter().take(3).map(|(_, c)| c).collect()
}

/// Names in a message.
const MAX_LISTED: usize = 20;

/// Names for a message: the first ones, and how many more there are.
pub fn listed<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let mut names = names.into_iter();
    let mut text = names.by_ref().take(MAX_LISTED).collect::<Vec<_>>().join(", ");
    let more = names.count();
    if more > 0 {
        text.push_str(&format!(" and {more} more"));
    }
    text
}

/// Common unit mistakes: suffix written, suffix expected, factor between.
const CONVERSIONS: &[(&str, &str, f64)] = &[
    ("mm", "m", 1e-3),
    ("cm", "m", 1e-2),
    ("um", "m", 1e-6),
    ("g", "kg", 1e-3),
    ("ms", "s", 1e-3),
    ("min", "s", 60.0),
    ("khz", "hz", 1e3),
    ("mhz", "hz", 1e-3),
    ("kn", "n", 1e3),
    ("mn", "n", 1e-3),
    ("kn_per_m", "n_per_m", 1e3),
    ("n_per_mm", "n_per_m", 1e3),
];

/// Name without its unit: `mass_kg` → `mass`, `clearance_mm` → `clearance`.
fn stem(key: &str) -> &str {
    const UNITS: &[&str] = &[
        "_n_s_per_m",
        "_s_per_m",
        "_n_per_m15",
        "_kn_per_m",
        "_n_per_mm",
        "_n_per_m",
        "_rad_per_s",
        "_m_per_s2",
        "_m_per_s",
    ];
    const SHORT: &[&str] =
        &["_kg", "_g", "_mm", "_cm", "_um", "_m", "_khz", "_mhz", "_hz", "_ms", "_min", "_s", "_kn", "_mn", "_n"];
    for unit in UNITS.iter().chain(SHORT) {
        if let Some(stem) = key.strip_suffix(unit) {
            return stem;
        }
    }
    key
}

/// What to write instead of the unknown `key`, and why; `value` is the number written, if it is one.
pub fn replacement(key: &str, value: Option<f64>, known: &[&str]) -> Option<(String, String)> {
    let same_stem: Vec<&&str> = known.iter().filter(|k| stem(k) == stem(key)).collect();
    if let [right] = same_stem[..] {
        let (written, wanted) = (&key[stem(key).len()..], &right[stem(right).len()..]);
        let (written, wanted) = (written.trim_start_matches('_'), wanted.trim_start_matches('_'));
        if written.is_empty() {
            return Some((right.to_string(), format!("write `{right}`: every number carries its unit in its name")));
        }
        let factor = CONVERSIONS.iter().find(|(from, to, _)| *from == written && *to == wanted);
        let help = match (factor, value) {
            (Some((_, _, factor)), Some(value)) => {
                // Ten digits: the product of two decimals, without the rounding of their binary forms.
                let converted = format!("{:.10e}", value * factor).parse().unwrap_or(value * factor);
                format!("write `{right} = {converted}`")
            }
            _ => format!("write `{right}`: the value is in {}", wanted.replace("_per_", "/").replace('_', "·")),
        };
        return Some((right.to_string(), help));
    }
    let candidates = near(key, known.iter().copied());
    let first = candidates.first()?;
    let list: Vec<String> = candidates.iter().map(|c| format!("`{c}`")).collect();
    Some(((*first).to_string(), format!("did you mean {}?", list.join(", "))))
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNOWN: &[&str] =
        &["mass_kg", "mass_ratio", "clearance_m", "clearance_ratio", "base_amplitude_m", "coefficient"];

    #[test]
    fn a_missing_unit_is_answered_with_the_right_key() {
        let (key, help) = replacement("base_amplitude", Some(0.003), KNOWN).unwrap();
        assert_eq!(key, "base_amplitude_m");
        assert!(help.contains("carries its unit"), "{help}");
    }

    #[test]
    fn a_wrong_unit_is_answered_with_the_converted_value() {
        let (_, help) = replacement("clearance_mm", Some(7.5), KNOWN).unwrap();
        assert_eq!(help, "write `clearance_m = 0.0075`");
    }

    #[test]
    fn a_typing_mistake_finds_its_neighbour_and_nonsense_finds_none() {
        assert_eq!(replacement("coeficient", None, KNOWN).unwrap().0, "coefficient");
        assert_eq!(replacement("xyzzy", None, KNOWN), None);
    }
}
