//! General-purpose I/O port (RM0440, section 9).

use crate::register::{Access, bit, field, only, rule, unknown};

const MODER: u32 = 0x00;
const OTYPER: u32 = 0x04;
const OSPEEDR: u32 = 0x08;
const PUPDR: u32 = 0x0c;
const IDR: u32 = 0x10;
const ODR: u32 = 0x14;
const BSRR: u32 = 0x18;
const AFRL: u32 = 0x20;
const AFRH: u32 = 0x24;
const BRR: u32 = 0x28;

/// Mode of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Input.
    Input,
    /// Output; ODR gives its level.
    Output,
    /// This alternate function.
    Alternate(u8),
    /// Analogue.
    Analog,
}

/// A GPIO port.
#[derive(Clone, Debug)]
pub struct Gpio {
    name: char,
    moder: u32,
    otyper: u32,
    ospeedr: u32,
    pupdr: u32,
    odr: u32,
    afr: [u32; 2],
    /// Level applied to each pin from outside; `None` where nothing is connected or the circuit is open.
    outside: [Option<bool>; 16],
}

impl Gpio {
    /// A port after a reset; in A and B the debugger's pins have their alternate functions.
    #[must_use]
    pub fn new(name: char) -> Self {
        let (moder, ospeedr, pupdr) = match name {
            'A' => (0xabff_ffff, 0x0c00_0000, 0x6400_0000),
            'B' => (0xffff_febf, 0x0000_00c0, 0x0000_0100),
            _ => (0xffff_ffff, 0, 0),
        };
        Self { name, moder, otyper: 0, ospeedr, pupdr, odr: 0, afr: [0; 2], outside: [None; 16] }
    }

    /// Resets the registers; outside connections stay.
    pub fn reset(&mut self) {
        let outside = self.outside;
        *self = Self { outside, ..Self::new(self.name) };
    }

    /// The mode of a pin.
    #[must_use]
    pub fn mode(&self, pin: u8) -> Mode {
        match field(self.moder, 2 * u32::from(pin), 2) {
            0 => Mode::Input,
            1 => Mode::Output,
            2 => Mode::Alternate(field(self.afr[usize::from(pin / 8)], 4 * u32::from(pin % 8), 4) as u8),
            _ => Mode::Analog,
        }
    }

    /// The level to which the chip drives a pin; `None` if it does not drive the pin.
    #[must_use]
    pub fn output(&self, pin: u8) -> Option<bool> {
        (self.mode(pin) == Mode::Output).then(|| bit(self.odr, pin.into()))
    }

    /// Whether the internal pull-up of a pin is on.
    #[must_use]
    pub fn pulled_up(&self, pin: u8) -> bool {
        field(self.pupdr, 2 * u32::from(pin), 2) == 1
    }

    /// Applies a level to a pin from outside; `None` opens the circuit.
    pub fn connect(&mut self, pin: u8, level: Option<bool>) {
        self.outside[usize::from(pin)] = level;
    }

    /// Level of a pin in IDR. An open input without a pull-up or pull-down reads low.
    fn level(&self, pin: u8) -> bool {
        match self.mode(pin) {
            Mode::Output => bit(self.odr, pin.into()),
            Mode::Analog => false,
            _ => self.outside[usize::from(pin)].unwrap_or(self.pulled_up(pin)),
        }
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The register is not modelled.
    pub fn read(&self, offset: u32) -> Access<u32> {
        Ok(match offset {
            MODER => self.moder,
            OTYPER => self.otyper,
            OSPEEDR => self.ospeedr,
            PUPDR => self.pupdr,
            IDR => (0..16).filter(|&pin| self.level(pin)).fold(0, |levels, pin| levels | 1 << pin),
            ODR => self.odr,
            BSRR | BRR => 0,
            AFRL => self.afr[0],
            AFRH => self.afr[1],
            _ => return unknown(&format!("GPIO{}", self.name), offset),
        })
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The register is not modelled, or the debugger's pins lose their function.
    pub fn write(&mut self, offset: u32, value: u32) -> Access<()> {
        match offset {
            MODER => {
                let swd = if self.name == 'A' { 0x3c00_0000 } else { 0 };
                rule(
                    value & swd == 0x2800_0000 & swd,
                    "GPIOA_MODER: a pin of the debugger (PA13, PA14) is taken away",
                )?;
                self.moder = value;
            }
            OTYPER => {
                // The rig has no open-drain output.
                only("GPIO_OTYPER", value, 0)?;
                self.otyper = value;
            }
            OSPEEDR => self.ospeedr = value,
            PUPDR => self.pupdr = value,
            ODR => {
                only("GPIO_ODR", value, 0xffff)?;
                self.odr = value;
            }
            // Set bits have priority over reset bits.
            BSRR => self.odr = self.odr & !(value >> 16) | value & 0xffff,
            BRR => {
                only("GPIO_BRR", value, 0xffff)?;
                self.odr &= !value;
            }
            AFRL => self.afr[0] = value,
            AFRH => self.afr[1] = value,
            _ => return unknown(&format!("GPIO{}", self.name), offset),
        }
        Ok(())
    }
}
