//! DMA controller and its request multiplexer (RM0440, sections 12 and 13), for transfers between a peripheral and
//! memory.

use crate::register::{Access, bit, field, only, refuse, rule, unchanged, unknown};

const ISR: u32 = 0x00;
const IFCR: u32 = 0x04;
const CCR1: u32 = 0x08;
/// Address distance between the registers of successive channels.
const STRIDE: u32 = 0x14;

const EN: u32 = 1 << 0;
const TCIE: u32 = 1 << 1;
const HTIE: u32 = 1 << 2;
const TEIE: u32 = 1 << 3;
const CIRC: u32 = 1 << 5;
/// Configuration bits that are writable only while the channel is disabled.
const CONFIGURATION: u32 = 0x7ff0;

const TCIF: u32 = 1 << 1;
const HTIF: u32 = 1 << 2;

/// Number of channels of one controller.
pub const CHANNELS: usize = 8;

/// A DMA channel.
#[derive(Clone, Copy, Debug, Default)]
struct Channel {
    ccr: u32,
    cndtr: u32,
    /// CNDTR as written; a circular channel reloads it.
    reload: u32,
    cpar: u32,
    cmar: u32,
}

/// A DMA controller.
#[derive(Clone, Debug, Default)]
pub struct Dma {
    isr: u32,
    channels: [Channel; CHANNELS],
}

impl Dma {
    /// Whether channel `n` (from 0) is enabled.
    #[must_use]
    pub fn is_enabled(&self, n: usize) -> bool {
        self.channels[n].ccr & EN != 0
    }

    /// The peripheral address of channel `n`.
    #[must_use]
    pub fn peripheral_address(&self, n: usize) -> u32 {
        self.channels[n].cpar
    }

    /// Whether channel `n` reads memory.
    #[must_use]
    pub fn reads_memory(&self, n: usize) -> bool {
        bit(self.channels[n].ccr, 4)
    }

    /// The memory range of channel `n`: first address and bytes.
    #[must_use]
    pub fn memory(&self, n: usize) -> (u32, u32) {
        let channel = &self.channels[n];
        (channel.cmar, channel.reload << field(channel.ccr, 10, 2))
    }

    /// Number of transfers of channel `n` until its next interrupt, if any.
    #[must_use]
    pub fn transfers_to_interrupt(&self, n: usize) -> Option<u32> {
        let channel = &self.channels[n];
        if channel.ccr & EN == 0 {
            return None;
        }
        let done = channel.reload - channel.cndtr;
        let half = channel.reload / 2;
        if channel.ccr & HTIE != 0 && done < half {
            Some(half - done)
        } else if channel.ccr & TCIE != 0 {
            Some(channel.cndtr)
        } else {
            (channel.ccr & HTIE != 0 && channel.ccr & CIRC != 0).then_some(channel.cndtr + half)
        }
    }

    /// Carries out one transfer of channel `n`. Returns the memory address and the number of bytes.
    pub fn transfer(&mut self, n: usize) -> (u32, u32) {
        let channel = &mut self.channels[n];
        let bytes = 1 << field(channel.ccr, 10, 2);
        let done = channel.reload - channel.cndtr;
        let address = channel.cmar + done * bytes;
        channel.cndtr -= 1;
        let flags = 4 * n as u32;
        if done + 1 == channel.reload / 2 {
            self.isr |= (HTIF | 1) << flags;
        }
        if channel.cndtr == 0 {
            self.isr |= (TCIF | 1) << flags;
            if channel.ccr & CIRC != 0 {
                channel.cndtr = channel.reload;
            }
        }
        (address, bytes)
    }

    /// Whether channel `n` waits for a request.
    #[must_use]
    pub fn is_ready(&self, n: usize) -> bool {
        self.is_enabled(n) && self.channels[n].cndtr > 0
    }

    /// Whether the interrupt of channel `n` is requested.
    #[must_use]
    pub fn interrupt(&self, n: usize) -> bool {
        // TCIE, HTIE and TEIE have the same bit positions as their flags.
        field(self.isr, 4 * n as u32, 4) & self.channels[n].ccr & (TCIE | HTIE | TEIE) != 0
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The register does not exist.
    pub fn read(&self, offset: u32) -> Access<u32> {
        match offset {
            ISR => return Ok(self.isr),
            IFCR => return Ok(0),
            _ => {}
        }
        let (n, register) = place(offset)?;
        let channel = &self.channels[n];
        Ok([channel.ccr, channel.cndtr, channel.cpar, channel.cmar][register])
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The register does not exist, a bit is not modelled, or an enabled channel is configured.
    pub fn write(&mut self, offset: u32, value: u32) -> Access<()> {
        if offset == IFCR {
            for n in 0..CHANNELS as u32 {
                let flags = field(value, 4 * n, 4);
                // CGIF clears all four flags; the global flag stays set while any other is.
                self.isr &= !(if bit(flags, 0) { 0xf } else { flags } << (4 * n));
                if field(self.isr, 4 * n, 4) == 1 {
                    self.isr &= !(1 << (4 * n));
                }
            }
            return Ok(());
        }
        let (n, register) = place(offset)?;
        let channel = &mut self.channels[n];
        let is_enabled = channel.ccr & EN != 0;
        match register {
            0 => {
                only("DMA_CCR", value, CONFIGURATION | EN | TCIE | HTIE | TEIE)?;
                if is_enabled && value & EN == 0 {
                    // The write that disables the channel changes no other bit.
                    let kept = channel.ccr & CONFIGURATION;
                    channel.ccr = kept | value & !CONFIGURATION;
                    return Ok(());
                }
                if is_enabled {
                    unchanged("DMA_CCR", channel.ccr, value, CONFIGURATION, "which an enabled channel does not take")?;
                }
                if value & EN != 0 {
                    rule(!bit(value, 14), "DMA_CCR: memory to memory is not modelled")?;
                    rule(!bit(value, 6) && bit(value, 7), "DMA_CCR: only a fixed peripheral address is modelled")?;
                    rule(field(value, 8, 2) == field(value, 10, 2), "DMA_CCR: PSIZE and MSIZE differ")?;
                    rule(channel.cndtr > 0, "DMA_CCR: a channel is enabled with CNDTR = 0")?;
                    let bytes = 1 << field(value, 10, 2);
                    rule(channel.cmar.is_multiple_of(bytes), "DMA_CMAR is not aligned to MSIZE")?;
                }
                channel.ccr = value;
            }
            1 => {
                only("DMA_CNDTR", value, 0xffff)?;
                rule(!is_enabled, "DMA_CNDTR is written while the channel is enabled")?;
                (channel.cndtr, channel.reload) = (value, value);
            }
            2 => {
                rule(!is_enabled, "DMA_CPAR is written while the channel is enabled")?;
                channel.cpar = value;
            }
            _ => {
                rule(!is_enabled, "DMA_CMAR is written while the channel is enabled")?;
                channel.cmar = value;
            }
        }
        Ok(())
    }
}

/// The channel and the register within it at an offset.
fn place(offset: u32) -> Access<(usize, usize)> {
    let Some(from) = offset.checked_sub(CCR1) else { return unknown("DMA", offset) };
    let (channel, register) = ((from / STRIDE) as usize, (from % STRIDE / 4) as usize);
    if channel >= CHANNELS || register > 3 { unknown("DMA", offset) } else { Ok((channel, register)) }
}

/// The request multiplexer.
#[derive(Clone, Debug, Default)]
pub struct Dmamux {
    ccr: [u32; 2 * CHANNELS],
}

impl Dmamux {
    /// The multiplexer channel that a request is routed to; the channels of DMA1 come first.
    #[must_use]
    pub fn channel_of(&self, request: u32) -> Option<usize> {
        self.ccr.iter().position(|&ccr| field(ccr, 0, 7) == request)
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The register is not modelled.
    pub fn read(&self, offset: u32) -> Access<u32> {
        self.ccr.get(offset as usize / 4).copied().map_or_else(|| unknown("DMAMUX", offset), Ok)
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The register or a bit is not modelled, or a request is routed to two channels.
    pub fn write(&mut self, offset: u32, value: u32) -> Access<()> {
        // DMAREQ_ID, EGE (event generation, unused).
        only("DMAMUX_CCR", value, 0x27f)?;
        let request = field(value, 0, 7);
        if request != 0 && self.channel_of(request).is_some_and(|other| other != offset as usize / 4) {
            return refuse!("DMAMUX_CCR: request {request} is routed to two channels");
        }
        match self.ccr.get_mut(offset as usize / 4) {
            Some(ccr) => *ccr = value,
            None => return unknown("DMAMUX", offset),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circular_channel_flags_each_half_and_restarts() {
        let mut dma = Dma::default();
        for (register, value) in [(0x0c, 4), (0x10, 0x5000_0040), (0x14, 0x2000_0100), (0x08, 0x05a7)] {
            dma.write(register, value).unwrap();
        }
        let mut seen = Vec::new();
        for _ in 0..5 {
            let (address, _) = dma.transfer(0);
            seen.push((address - 0x2000_0100, dma.read(ISR).unwrap()));
            dma.write(IFCR, 1).unwrap();
        }
        assert_eq!(seen, [(0, 0), (2, 5), (4, 0), (6, 3), (0, 0)]);
    }

    #[test]
    fn an_enabled_channel_cannot_be_configured() {
        let mut dma = Dma::default();
        dma.write(0x0c, 4).unwrap();
        dma.write(0x08, 0x0581).unwrap();
        for (register, value) in [(0x0c, 8), (0x10, 1), (0x14, 2), (0x08, 0x0501)] {
            assert!(dma.write(register, value).is_err(), "{register:#x}");
        }
        dma.write(0x08, 0x0580).unwrap();
        dma.write(0x0c, 8).unwrap();
    }
}
