//! Compares the texts of two campaigns, value by value.

/// The values in which two campaigns differ, one a line; comments and layout are ignored. `then` is the campaign that the run
/// was started with.
#[must_use]
pub fn differences(then: &str, now: &str) -> Vec<String> {
    let mut list = Vec::new();
    match (toml::from_str::<toml::Table>(then), toml::from_str::<toml::Table>(now)) {
        (Ok(then), Ok(now)) => differ("", &toml::Value::Table(then), &toml::Value::Table(now), &mut list),
        _ if then != now => list.push("it is not TOML any more".into()),
        _ => {}
    }
    list
}

fn differ(place: &str, then: &toml::Value, now: &toml::Value, list: &mut Vec<String>) {
    use toml::Value::{Array, Table};
    match (then, now) {
        (Table(a), Table(b)) => {
            let keys = a.keys().chain(b.keys().filter(|k| !a.contains_key(*k)));
            for key in keys {
                let inner = if place.is_empty() { key.clone() } else { format!("{place}.{key}") };
                match (a.get(key), b.get(key)) {
                    (Some(a), Some(b)) => differ(&inner, a, b, list),
                    (Some(a), None) => list.push(format!("{inner}: {a} when it was started, absent now")),
                    (None, Some(b)) => list.push(format!("{inner}: absent when it was started, {b} now")),
                    (None, None) => {}
                }
            }
        }
        (Array(a), Array(b)) if a.len() == b.len() => {
            a.iter().zip(b).enumerate().for_each(|(n, (a, b))| differ(&format!("{place}[{}]", n + 1), a, b, list));
        }
        _ if then != now => list.push(format!("{place}: {then} when it was started, {now} now")),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_difference_of_two_campaigns_is_named_and_comments_are_ignored() {
        let then = "a = 1\n[rig]\nseed = 7\n[[set_up]]\nz = 0.1\n[[set_up]]\nz = 0.2\n";
        assert!(differences(then, &format!("# later\n{then}")).is_empty());
        let now = "a = 1\nb = 2\n[rig]\n[[set_up]]\nz = 0.1\n[[set_up]]\nz = 0.3\n";
        let expected = [
            "rig.seed: 7 when it was started, absent now",
            "set_up[2].z: 0.2 when it was started, 0.3 now",
            "b: absent when it was started, 2 now",
        ];
        assert_eq!(differences(then, now), expected);
        assert_eq!(differences(then, "a = ").len(), 1);
    }
}
