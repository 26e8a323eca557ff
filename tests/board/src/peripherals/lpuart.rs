//! LPUART1 (RM0440, section 38) with its FIFOs, bytes of eight bits without parity. Bytes take their time on the line: what the
//! host sends arrives at the baud rate, and what is sent is out when its stop bit is.

use std::collections::VecDeque;

use crate::register::{Access, bit, ensure, field, only, refuse, rule, unchanged, unknown};
use crate::time::{At, Time};

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const CR3: u32 = 0x08;
const BRR: u32 = 0x0c;
const RQR: u32 = 0x18;
const ISR: u32 = 0x1c;
const ICR: u32 = 0x20;
const RDR: u32 = 0x24;
const TDR: u32 = 0x28;
const PRESC: u32 = 0x2c;

const UE: u32 = 1 << 0;
const RE: u32 = 1 << 2;
const TE: u32 = 1 << 3;
const FIFOEN: u32 = 1 << 29;
/// What only a disabled UART takes.
const CR1_STATIC: u32 = FIFOEN;

const PEIE: u32 = 1 << 8;
const EIE: u32 = 1 << 0;
const DMAR: u32 = 1 << 6;
const DMAT: u32 = 1 << 7;

const ORE: u32 = 1 << 3;
const IDLE: u32 = 1 << 4;
const RXNE: u32 = 1 << 5;
const TC: u32 = 1 << 6;
const TXE: u32 = 1 << 7;
const TEACK: u32 = 1 << 21;
const REACK: u32 = 1 << 22;
const TXFE: u32 = 1 << 23;
const RXFF: u32 = 1 << 24;

/// Places of either FIFO.
const DEPTH: usize = 8;

/// Start bit, eight bits, stop bit.
const BITS: u64 = 10;

/// The UART.
#[derive(Clone, Debug, Default)]
pub struct Lpuart {
    cr1: u32,
    cr2: u32,
    cr3: u32,
    brr: u32,
    presc: u32,
    /// ORE, IDLE and TC; the other flags follow from the FIFOs.
    flags: u32,
    received: VecDeque<u8>,
    /// Received last, while the FIFO is full: the next byte takes its place.
    shifted_in: Option<u8>,
    to_send: VecDeque<u8>,
    /// On its way out, and when its stop bit ends.
    shifting_out: Option<(u8, Time)>,
    /// On its way in from the host, and when the first is there.
    arriving: VecDeque<u8>,
    next_arrival: Time,
    /// When the line counts as idle, if nothing arrives.
    idle_at: Time,
    /// Received while DMAR is set, for DMA to take.
    for_dma: VecDeque<u8>,
    /// What has been sent.
    pub sent: Vec<u8>,
    /// Bytes lost to overruns.
    pub lost: u64,
}

impl Lpuart {
    /// As after a power-on.
    #[must_use]
    pub fn new() -> Self {
        Self { flags: TC, next_arrival: Time::NEVER, idle_at: Time::NEVER, ..Self::default() }
    }

    /// As after a reset: what is on the line stays there.
    pub fn reset(&mut self) {
        let (arriving, sent) = (std::mem::take(&mut self.arriving), std::mem::take(&mut self.sent));
        *self = Self { arriving, sent, lost: self.lost, ..Self::new() };
    }

    /// The length of a byte on the line; none while the baud rate is not set.
    #[must_use]
    pub fn byte_length(&self, at: &At) -> Option<Time> {
        let divider = *[1, 2, 4, 6, 8, 10, 12, 16, 32, 64, 128, 256].get(self.presc as usize)?;
        // Baud rate = 256 · clock / BRR.
        (self.brr != 0).then(|| Time(at.clocks.lpuart1.0 * divider * u64::from(self.brr) * BITS / 256))
    }

    fn has_fifo(&self) -> bool {
        self.cr1 & FIFOEN != 0
    }

    fn depth(&self) -> usize {
        if self.has_fifo() { DEPTH } else { 1 }
    }

    fn receives(&self) -> bool {
        self.cr1 & (UE | RE) == UE | RE
    }

    /// The host sends bytes.
    pub fn host_sends(&mut self, bytes: &[u8], at: &At) {
        self.arriving.extend(bytes);
        self.expect(at);
    }

    /// Bytes that are still on their way to the board.
    #[must_use]
    pub fn arriving(&self) -> usize {
        self.arriving.len()
    }

    fn expect(&mut self, at: &At) {
        if self.next_arrival == Time::NEVER && !self.arriving.is_empty() {
            self.next_arrival = self.byte_length(at).map_or(Time::NEVER, |length| at.now + length);
        }
    }

    /// What has happened on the line up to now.
    pub fn sync(&mut self, at: &At) {
        let Some(length) = self.byte_length(at) else { return };
        self.expect(at);
        while self.next_arrival <= at.now {
            let arrived = self.next_arrival;
            let byte = self.arriving.pop_front();
            self.next_arrival = if self.arriving.is_empty() { Time::NEVER } else { arrived + length };
            if self.receives() {
                self.idle_at = arrived + length;
                byte.into_iter().for_each(|byte| self.receive(byte));
            }
        }
        if self.idle_at <= at.now {
            self.idle_at = Time::NEVER;
            self.flags |= IDLE;
        }
        while let Some((byte, end)) = self.shifting_out {
            if end > at.now {
                break;
            }
            self.sent.push(byte);
            self.shifting_out = self.to_send.pop_front().map(|next| (next, end + length));
            if self.shifting_out.is_none() {
                self.flags |= TC;
            }
        }
    }

    /// The next byte that DMA is asked to take from RDR.
    pub fn give_dma(&mut self) -> Option<u8> {
        self.for_dma.pop_front()
    }

    /// Whether DMA is asked to write a byte to TDR.
    #[must_use]
    pub fn wants_dma(&self) -> bool {
        let is_on = self.cr1 & (UE | TE) == UE | TE;
        is_on && self.cr3 & DMAT != 0 && self.to_send.len() < self.depth()
    }

    /// No channel took a byte: it stays in the FIFO.
    pub fn keep(&mut self, byte: u8) {
        if self.received.len() < self.depth() {
            self.received.push_back(byte);
            return;
        }
        // The shift register holds one more; the next one overwrites it.
        if self.shifted_in.replace(byte).is_some() {
            self.flags |= ORE;
            self.lost += 1;
        }
    }

    fn receive(&mut self, byte: u8) {
        if self.cr3 & DMAR != 0 {
            self.for_dma.push_back(byte);
        } else {
            self.keep(byte);
        }
    }

    /// When something next happens on the line.
    #[must_use]
    pub fn next_event(&self) -> Time {
        let out = self.shifting_out.map_or(Time::NEVER, |(_, end)| end);
        self.next_arrival.min(self.idle_at).min(out)
    }

    fn isr(&self) -> u32 {
        let mut isr = self.flags;
        let mut set = |flag: u32, is: bool| isr |= if is { flag } else { 0 };
        set(RXNE, !self.received.is_empty());
        set(TXE, self.to_send.len() < self.depth());
        set(TXFE, self.has_fifo() && self.to_send.is_empty());
        set(RXFF, self.has_fifo() && self.received.len() == DEPTH);
        set(TEACK, self.cr1 & (UE | TE) == UE | TE);
        set(REACK, self.receives());
        isr
    }

    /// Whether the interrupt is requested.
    #[must_use]
    pub fn interrupt(&self) -> bool {
        // IDLEIE, RXNEIE, TCIE and TXEIE have the places of their flags; an overrun is told with RXNEIE too.
        let isr = self.isr();
        let overrun = isr & ORE != 0 && (self.cr1 & RXNE != 0 || self.cr3 & EIE != 0);
        isr & self.cr1 & (IDLE | RXNE | TC | TXE) != 0 || overrun
    }

    /// Reads a register.
    ///
    /// # Errors
    /// It is not modelled.
    pub fn read(&mut self, offset: u32, at: &At) -> Access<u32> {
        self.sync(at);
        Ok(match offset {
            CR1 => self.cr1,
            CR2 => self.cr2,
            CR3 => self.cr3,
            BRR => self.brr,
            RQR => return unknown("LPUART1", offset),
            ISR => self.isr(),
            ICR => 0,
            RDR => {
                let Some(byte) = self.received.pop_front() else {
                    return refuse!("LPUART1_RDR is read while nothing has been received");
                };
                self.received.extend(self.shifted_in.take());
                byte.into()
            }
            PRESC => self.presc,
            _ => return unknown("LPUART1", offset),
        })
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The register or a bit is not modelled, or a rule of the reference manual is broken.
    pub fn write(&mut self, offset: u32, value: u32, at: &At) -> Access<()> {
        self.sync(at);
        let is_on = self.cr1 & UE != 0;
        let off_only = |register: &str| {
            ensure!(!is_on, "LPUART1_{register} is written while UE is set");
            Ok(())
        };
        match offset {
            CR1 => {
                only("LPUART1_CR1", value, UE | RE | TE | IDLE | RXNE | TC | TXE | PEIE | FIFOEN)?;
                if is_on && bit(value, 0) {
                    unchanged("LPUART1_CR1", self.cr1, value, CR1_STATIC, "which may only be written while UE = 0")?;
                }
                if value & UE == 0 {
                    self.received.clear();
                    self.to_send.clear();
                    (self.shifted_in, self.shifting_out) = (None, None);
                    self.flags = TC;
                }
                self.cr1 = value;
            }
            CR2 => {
                only("LPUART1_CR2", value, 0)?;
                self.cr2 = value;
            }
            CR3 => {
                only("LPUART1_CR3", value, EIE | DMAR | DMAT)?;
                if value & DMAR != 0 {
                    self.for_dma.extend(self.received.drain(..).chain(self.shifted_in.take()));
                }
                self.cr3 = value;
            }
            BRR => {
                off_only("BRR")?;
                rule((0x300..0x10_0000).contains(&value), "LPUART1_BRR is outside 0x300 to 0xfffff")?;
                self.brr = value;
            }
            PRESC => {
                off_only("PRESC")?;
                rule(field(value, 0, 4) < 12 && value < 16, "LPUART1_PRESC is reserved")?;
                self.presc = value;
            }
            ICR => {
                // PECF, FECF, NECF, ORECF, IDLECF, TCCF, CTSCF, CMCF, WUCF. The driver writes back what it has read from ISR,
                // of which the other bits have no effect here.
                only("LPUART1_ICR", value, 0x0012_025f | RXNE | TXE | TEACK | REACK | TXFE | RXFF)?;
                self.flags &= !(value & (ORE | IDLE | TC));
            }
            TDR => {
                rule(self.cr1 & (UE | TE) == UE | TE, "LPUART1_TDR is written while the transmitter is off")?;
                rule(self.to_send.len() < self.depth(), "LPUART1_TDR is written while the FIFO is full")?;
                self.send(value as u8, at)?;
            }
            RDR | ISR => return refuse!("LPUART1: a register at {offset:#04x} is only read"),
            _ => return unknown("LPUART1", offset),
        }
        Ok(())
    }

    /// A byte for the transmitter, which is on and has room.
    ///
    /// # Errors
    /// There is no baud rate.
    pub fn send(&mut self, byte: u8, at: &At) -> Access<()> {
        self.flags &= !TC;
        let Some(length) = self.byte_length(at) else {
            return refuse!("LPUART1_TDR is written without a baud rate");
        };
        match self.shifting_out {
            Some(_) => self.to_send.push_back(byte),
            None => self.shifting_out = Some((byte, at.now + length)),
        }
        Ok(())
    }
}
