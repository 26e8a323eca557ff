//! LPUART1 (RM0440, section 38) with its FIFOs: eight data bits, no parity, real line timing. Bytes from the host
//! arrive at the baud rate; a byte is sent when its stop bit ends.

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
/// Bits that are writable only while the UART is disabled.
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

/// Number of entries in each FIFO.
const DEPTH: usize = 8;

/// Bits per byte on the line: start bit, eight data bits, stop bit.
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
    /// Last byte received while the FIFO is full; the next byte overwrites it.
    shifted_in: Option<u8>,
    to_send: VecDeque<u8>,
    /// The byte being sent, and the time at which its stop bit ends.
    shifting_out: Option<(u8, Time)>,
    /// Bytes arriving from the host, and the arrival time of the first.
    arriving: VecDeque<u8>,
    next_arrival: Time,
    /// Time at which the line becomes idle if nothing arrives.
    idle_at: Time,
    /// Bytes received while DMAR is set, to be taken by DMA.
    for_dma: VecDeque<u8>,
    /// Bytes sent.
    pub sent: Vec<u8>,
    /// Number of bytes lost to overruns.
    pub lost: u64,
}

impl Lpuart {
    /// The state after a power-on.
    #[must_use]
    pub fn new() -> Self {
        Self { flags: TC, next_arrival: Time::NEVER, idle_at: Time::NEVER, ..Self::default() }
    }

    /// The state after a reset; bytes on the line are kept.
    pub fn reset(&mut self) {
        let (arriving, sent) = (std::mem::take(&mut self.arriving), std::mem::take(&mut self.sent));
        *self = Self { arriving, sent, lost: self.lost, ..Self::new() };
    }

    /// Duration of a byte on the line; `None` while the baud rate is not set.
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

    /// Queues bytes from the host.
    pub fn host_sends(&mut self, bytes: &[u8], at: &At) {
        self.arriving.extend(bytes);
        self.expect(at);
    }

    /// Number of bytes still on their way to the board.
    #[must_use]
    pub fn arriving(&self) -> usize {
        self.arriving.len()
    }

    fn expect(&mut self, at: &At) {
        if self.next_arrival == Time::NEVER && !self.arriving.is_empty() {
            self.next_arrival = self.byte_length(at).map_or(Time::NEVER, |length| at.now + length);
        }
    }

    /// Processes the line up to now.
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

    /// The next byte for DMA to read from RDR.
    pub fn give_dma(&mut self) -> Option<u8> {
        self.for_dma.pop_front()
    }

    /// Whether DMA is requested to write a byte to TDR.
    #[must_use]
    pub fn wants_dma(&self) -> bool {
        let is_on = self.cr1 & (UE | TE) == UE | TE;
        is_on && self.cr3 & DMAT != 0 && self.to_send.len() < self.depth()
    }

    /// Returns a byte to the FIFO that no DMA channel took.
    pub fn keep(&mut self, byte: u8) {
        if self.received.len() < self.depth() {
            self.received.push_back(byte);
            return;
        }
        // The shift register holds one more byte; the next byte overwrites it.
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

    /// Time of the next event on the line.
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
        // IDLEIE, RXNEIE, TCIE and TXEIE have the same bit positions as their flags; RXNEIE also covers an overrun.
        let isr = self.isr();
        let overrun = isr & ORE != 0 && (self.cr1 & RXNE != 0 || self.cr3 & EIE != 0);
        isr & self.cr1 & (IDLE | RXNE | TC | TXE) != 0 || overrun
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The register is not modelled.
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
                // PECF, FECF, NECF, ORECF, IDLECF, TCCF, CTSCF, CMCF, WUCF. The driver writes back the value read from
                // ISR; its other bits have no effect here.
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

    /// Sends a byte; the transmitter must be on and have room.
    ///
    /// # Errors
    /// The baud rate is not set.
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
