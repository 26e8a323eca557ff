//! Chooses the next message to send: replies and events first, then telemetry rows in batches.

use crate::queues::{Row, StreamItem, Waiting};
use damprig_protocol::{FromDevice, MAX_VALUES, Telemetry};
use heapless::{Deque, Vec};

/// Baud rate of the serial line, bits per second.
pub const BAUD: u32 = 921_600;

/// Builds messages from the outgoing queues.
#[derive(Clone, Debug, Default)]
pub struct Outbox {
    batch: Batch,
    stands_before: Option<u32>,
}

impl Outbox {
    /// Returns the next message; `None` until more is queued.
    pub fn next(&mut self, waiting: &mut impl Waiting) -> Option<FromDevice> {
        loop {
            if let Some(message) = waiting.pop_message() {
                return Some(message);
            }
            if let Some(telemetry) = self.batch.pop() {
                return Some(FromDevice::Telemetry(telemetry));
            }
            if let Some(tick) = self.stands_before.take() {
                return Some(FromDevice::Clock { tick });
            }
            match waiting.pop_stream()? {
                StreamItem::Row(row) => self.batch.push(&row),
                StreamItem::Started => *self = Self::default(),
                StreamItem::ClockStands { tick } => {
                    self.batch.close();
                    self.stands_before = Some(tick);
                }
            }
        }
    }
}

/// Collects rows into telemetry messages.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    open: Option<Telemetry>,
    done: Deque<Telemetry, 2>,
    seq: u32,
}

impl Batch {
    /// Takes a row. Call [`Batch::pop`] until it returns `None` before the next push.
    ///
    /// A row that does not continue the batch at its spacing begins a new batch, so a dropped row shows as a gap in
    /// the ticks.
    pub fn push(&mut self, row: &Row) {
        let places = row.chosen.places();
        let width = places.len();
        let continues = self.open.as_ref().is_some_and(|open| {
            let rows = (open.values.len() / width.max(1)) as u32;
            let next_tick = open.first_tick.wrapping_add(rows * u32::from(open.every_ticks));
            open.every_ticks == row.every_ticks && usize::from(open.width) == width && next_tick == row.tick
        });
        if !continues {
            self.close();
        }
        if row.tick == 0 {
            self.seq = 0;
        }
        let open = self.open.get_or_insert_with(|| Telemetry {
            seq: self.seq,
            first_tick: row.tick,
            every_ticks: row.every_ticks,
            width: width as u8,
            values: Vec::new(),
        });
        // A full batch is closed below, so there is room for a row.
        let values = row.values.values();
        for place in places {
            let _ = open.values.push(values.get(usize::from(*place)).copied().unwrap_or_default());
        }
        if open.values.len() + width > MAX_VALUES || row.last {
            self.close();
        }
    }

    /// Closes the open batch.
    pub fn close(&mut self) {
        if let Some(open) = self.open.take() {
            self.seq = self.seq.wrapping_add(1);
            // A push closes at most two batches, and they are popped before the next push.
            let _ = self.done.push_back(open);
        }
    }

    /// Removes and returns the next closed batch.
    pub fn pop(&mut self) -> Option<Telemetry> {
        self.done.pop_front()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::queues::Chosen;
    use damprig_core::rig::Signals;

    const WIDTH: usize = 6;
    /// Rows in a full message.
    const ROWS: usize = MAX_VALUES / WIDTH;

    fn row(tick: u32) -> Row {
        let chosen = Chosen::new(&(0..WIDTH as u8).collect());
        let at = tick as f32;
        let signals =
            Signals { x: at, z: at, drive: at, frequency: at, x_peak: at, base_amplitude: at, ..Signals::default() };
        Row { tick, every_ticks: 5, chosen, values: signals, last: false }
    }

    fn batches(rows: &[Row]) -> std::vec::Vec<Telemetry> {
        let mut batch = Batch::default();
        let mut out = std::vec::Vec::new();
        for row in rows {
            batch.push(row);
            out.extend(core::iter::from_fn(|| batch.pop()));
        }
        batch.close();
        out.extend(core::iter::from_fn(|| batch.pop()));
        out
    }

    extern crate std;

    #[test]
    fn consecutive_rows_share_a_message() {
        let rows: std::vec::Vec<_> = (0..ROWS as u32 + 1).map(|n| row(5 * n)).collect();
        let out = batches(&rows);
        assert_eq!(out.len(), 2);
        assert_eq!(out[0].values.len(), ROWS * WIDTH);
        assert_eq!((out[1].seq, out[1].first_tick), (1, 5 * ROWS as u32));
    }

    #[test]
    fn a_missing_row_begins_a_new_message() {
        let out = batches(&[row(5), row(10), row(20)]);
        assert_eq!(out.iter().map(|m| m.first_tick).collect::<std::vec::Vec<_>>(), [5, 20]);
    }

    #[test]
    fn a_last_row_that_does_not_continue_is_sent_too() {
        let out = batches(&[row(5), Row { last: true, ..row(20) }]);
        assert_eq!(out.len(), 2);
    }
}
