//! `[plan]`: who measures what, and in which order.

use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::{Deserialize, Serialize};

use super::keys::plan as keys;
use super::{CampaignSetUp, Experiment};
use crate::input::Section;

/// What a person states about a campaign, and its order.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Plan {
    /// Who runs the campaign.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub operator: Option<String>,
    /// What is measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub specimen: Option<String>,
    /// Anything else.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub notes: Option<String>,
    /// Seed of a random order; none for the order of the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub order_seed: Option<u32>,
}

impl Plan {
    /// Whether nothing is stated.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// The stated texts with their names.
    pub fn texts(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let all = [("operator", &self.operator), ("specimen", &self.specimen), ("notes", &self.notes)];
        all.into_iter().filter_map(|(name, text)| Some((name, text.as_deref()?)))
    }

    /// Puts a list into its order of running: unchanged, or shuffled. `place` tells several lists of a campaign apart.
    pub(super) fn order<T>(&self, list: &mut [T], place: u64) {
        let Some(seed) = self.order_seed else { return };
        let mut random = Xoshiro256PlusPlus::seed_from_u64(u64::from(seed) << 32 | place);
        // Fisher and Yates. Lists are short, so that the remainder favours no place by more than 2⁻⁵⁰.
        for last in (1..list.len()).rev() {
            list.swap(last, (random.next_u64() % (last as u64 + 1)) as usize);
        }
    }

    /// Positions of the set-ups in the order in which they are mounted, each with the positions of its experiments in their order.
    pub(super) fn run_order(&self, set_ups: &[CampaignSetUp], experiments: &[Experiment]) -> Vec<(usize, Vec<usize>)> {
        let mut order: Vec<usize> = (0..set_ups.len()).collect();
        self.order(&mut order, 0);
        let with_experiments = |set_up: usize| {
            let on_it = |n: &usize| experiments[*n].set_ups.contains(&set_up);
            let mut own: Vec<usize> = (0..experiments.len()).filter(on_it).collect();
            self.order(&mut own, 1 + set_up as u64);
            (set_up, own)
        };
        order.into_iter().map(with_experiments).collect()
    }
}

/// Reads `[plan]`; empty when it is left out.
pub(super) fn read(root: &Section) -> Option<Plan> {
    let Some(section) = root.table_of(&super::keys::campaign::PLAN, None) else {
        return (!root.is_given(&super::keys::campaign::PLAN)).then(Plan::default);
    };
    // An empty text is one that was not filled in.
    let text = |quantity| section.text_of(quantity).map(|text| text.value).filter(|text| !text.trim().is_empty());
    let (operator, specimen, notes) = (text(&keys::OPERATOR), text(&keys::SPECIMEN), text(&keys::NOTES));
    let is_random = section.word(&keys::ORDER)? == 1;
    let seed = section.scalar(&keys::ORDER_SEED);
    section.finish();
    Some(Plan { operator, specimen, notes, order_seed: if is_random { Some(seed? as u32) } else { None } })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_random_order_has_every_item_once_and_follows_from_its_seed() {
        let order = |seed, place| {
            let mut list: Vec<u32> = (0..20).collect();
            Plan { order_seed: seed, ..Plan::default() }.order(&mut list, place);
            list
        };
        let in_order: Vec<u32> = (0..20).collect();
        assert_eq!(order(None, 0), in_order);
        let shuffled = order(Some(1), 0);
        let mut sorted = shuffled.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, in_order);
        assert_eq!(shuffled, order(Some(1), 0));
        for other in [in_order, order(Some(2), 0), order(Some(1), 1)] {
            assert_ne!(shuffled, other);
        }
    }

    #[test]
    fn every_place_is_equally_likely() {
        // 6 000 shuffles of three items: each of the six orders 1 000 times, with a standard deviation of 29.
        let mut counts = std::collections::BTreeMap::new();
        for seed in 0..6_000 {
            let mut list = [0, 1, 2];
            Plan { order_seed: Some(seed), ..Plan::default() }.order(&mut list, 0);
            *counts.entry(list).or_insert(0_i32) += 1;
        }
        assert_eq!(counts.len(), 6);
        assert!(counts.values().all(|count| (count - 1_000).abs() < 130), "{counts:?}");
    }
}
