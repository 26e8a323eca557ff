//! Restores the order of telemetry messages by their sequence numbers, and drops copies.
//!
//! A serial line keeps the order; a radio network or a relay may not. The buffer waits for a late message until a few
//! later ones have arrived, then counts it as missing.

use std::collections::BTreeMap;

use damprig_protocol::Telemetry;

/// Messages held while an earlier one is missing.
const MAX_WAITING: usize = 4;

/// The messages of one segment.
#[derive(Clone, Debug, Default)]
pub(super) struct ReorderBuffer {
    next_seq: u32,
    waiting: BTreeMap<u32, Telemetry>,
    missing: u64,
}

impl ReorderBuffer {
    /// Adds a message; returns the messages that are next in order.
    pub(super) fn push(&mut self, message: Telemetry) -> Vec<Telemetry> {
        if message.seq < self.next_seq {
            // A copy, or a message that has already been counted as missing.
            return Vec::new();
        }
        self.waiting.insert(message.seq, message);
        let mut out = Vec::new();
        self.release(&mut out);
        if self.waiting.len() > MAX_WAITING {
            self.skip();
            self.release(&mut out);
        }
        out
    }

    /// Returns all held messages and counts those missing between them.
    pub(super) fn flush(&mut self) -> Vec<Telemetry> {
        let mut out = Vec::new();
        while !self.waiting.is_empty() {
            self.skip();
            self.release(&mut out);
        }
        out
    }

    fn release(&mut self, out: &mut Vec<Telemetry>) {
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

    /// Messages counted as missing.
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
        let mut buffer = ReorderBuffer::default();
        let mut out: Vec<u32> = seqs.iter().flat_map(|seq| buffer.push(message(*seq))).map(|m| m.seq).collect();
        out.extend(buffer.flush().iter().map(|m| m.seq));
        (out, buffer.missing())
    }

    #[test]
    fn late_messages_are_put_in_order_and_copies_dropped() {
        assert_eq!(order(&[1, 0, 2, 2, 4, 3, 0]), (vec![0, 1, 2, 3, 4], 0));
    }

    #[test]
    fn a_lost_message_is_given_up_and_counted_as_missing() {
        assert_eq!(order(&[0, 2, 3, 4, 5, 6, 1]), (vec![0, 2, 3, 4, 5, 6], 1));
        assert_eq!(order(&[3]), (vec![3], 3));
    }
}
