//! Telemetry messages back in the order of their numbers, each once.
//!
//! A line keeps the order; a network of radios or a relay may not. A message that is late is waited for a little, then
//! counted as missing.

use std::collections::BTreeMap;

use damprig_protocol::Telemetry;

/// Messages that may wait for one before them.
const MOST_WAITING: usize = 4;

/// The messages of one experiment.
#[derive(Clone, Debug, Default)]
pub(super) struct InOrder {
    next_seq: u32,
    waiting: BTreeMap<u32, Telemetry>,
    missing: u64,
}

impl InOrder {
    /// A message has arrived; those whose turn it is now.
    pub(super) fn take(&mut self, message: Telemetry) -> Vec<Telemetry> {
        if message.seq < self.next_seq {
            // It came twice, or so late that it was given up.
            return Vec::new();
        }
        self.waiting.insert(message.seq, message);
        let mut out = Vec::new();
        self.pass_on(&mut out);
        if self.waiting.len() > MOST_WAITING {
            self.skip();
            self.pass_on(&mut out);
        }
        out
    }

    /// Nothing before them will come any more: all that wait.
    pub(super) fn give_up(&mut self) -> Vec<Telemetry> {
        let mut out = Vec::new();
        while !self.waiting.is_empty() {
            self.skip();
            self.pass_on(&mut out);
        }
        out
    }

    fn pass_on(&mut self, out: &mut Vec<Telemetry>) {
        while let Some(message) = self.waiting.remove(&self.next_seq) {
            self.next_seq = self.next_seq.saturating_add(1);
            out.push(message);
        }
    }

    fn skip(&mut self) {
        if let Some(first) = self.waiting.keys().next() {
            self.missing += u64::from(first - self.next_seq);
            self.next_seq = *first;
        }
    }

    /// Messages given up.
    pub(super) fn missing(&self) -> u64 {
        self.missing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(seq: u32) -> Telemetry {
        Telemetry { seq, first_tick: seq, every_ticks: 1, width: 1, values: Default::default() }
    }

    fn order(seqs: &[u32]) -> (Vec<u32>, u64) {
        let mut sorter = InOrder::default();
        let mut out: Vec<u32> = seqs.iter().flat_map(|seq| sorter.take(message(*seq))).map(|m| m.seq).collect();
        out.extend(sorter.give_up().iter().map(|m| m.seq));
        (out, sorter.missing())
    }

    #[test]
    fn messages_that_overtook_each_other_or_came_twice_are_sorted_out() {
        assert_eq!(order(&[1, 0, 2, 2, 4, 3, 0]), (vec![0, 1, 2, 3, 4], 0));
    }

    #[test]
    fn a_lost_message_is_not_waited_for_for_ever_and_counts_as_missing() {
        assert_eq!(order(&[0, 2, 3, 4, 5, 6, 1]), (vec![0, 2, 3, 4, 5, 6], 1));
        assert_eq!(order(&[3]), (vec![3], 3));
    }
}
