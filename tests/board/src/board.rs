//! Emulated board: runs Unicorn's Cortex-M4F in slices over the [`Chip`] and takes exceptions between the slices.
//!
//! # Time
//! An instruction takes one cycle of HCLK, exception entry [`ENTRY_CYCLES`], exception return [`EXIT_CYCLES`]. Wait
//! states and caches are not modelled. A slice ends at the next event of the chip, at the instruction after a register
//! access that changes pending work, or where interrupts are unmasked while one is pending. An interrupt is therefore
//! taken between the same two instructions in every run. `WFE` advances the time to the next event.
//!
//! # Exceptions
//! Unicorn does not model exceptions. This module pushes and pops their frames, always with the floating-point
//! registers. A handler's return appears either as an exception of the emulator or as an instruction fetch from a
//! reserved page.

use std::collections::{BTreeMap, HashMap};

use unicorn_engine::{Arch, ArmCpuModel, HookType, Mode, Prot, RegisterARM, Unicorn, uc_error};

use crate::chip::{BANK2_BASE, CCM_BASE, CCM_BYTES, Chip, Config, FLASH_BASE, RAM_BASE, RAM_BYTES};
use crate::image::Image;
use crate::peripherals::flash::BANK_BYTES;
use crate::peripherals::nvic::{HARD_FAULT, Masks};
use crate::peripherals::rcc::ResetCause;
use crate::register::Refused;
use crate::time::Time;

/// Cycles from an interrupt to the first instruction of its handler (Cortex-M4 TRM, without wait states).
pub const ENTRY_CYCLES: u64 = 12;

/// Cycles from the last instruction of a handler back to the interrupted code.
pub const EXIT_CYCLES: u64 = 10;

/// Page that contains the return addresses of exceptions.
const RETURN_PAGE: u32 = 0xffff_f000;

/// EXC_RETURN with a floating-point frame on the main stack, to a handler and to a thread.
const TO_HANDLER: u32 = 0xffff_ffe1;
const TO_THREAD: u32 = 0xffff_ffe9;

/// Words of a frame with floating-point registers.
const FRAME_WORDS: usize = 26;

/// xPSR: the Thumb bit, and the bit that marks a stack that was already aligned.
const XPSR_T: u32 = 1 << 24;
const XPSR_ALIGNED: u32 = 1 << 9;

/// An address that no program reaches; the hooks decide where a slice ends.
const NOWHERE: u64 = 0xffff_fffe;

/// Unicorn's exception number for a return from an exception.
const EXCEPTION_EXIT: u32 = 8;

/// Memory ranges of the peripherals: first address and length.
const DEVICES: [(u32, u32); 6] = [
    (BANK2_BASE, BANK_BYTES),
    (0x1fff_0000, 0x1_0000),
    (0x4000_0000, 0x3_0000),
    (0x4800_0000, 0x2000),
    (0x5000_0000, 0x1000),
    (0xe000_0000, 0x10_0000),
];

/// A failed run: the program did something that is not modelled or not allowed.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{message}\n  {:.6} s after power-on, at {place}", time.s())]
pub struct Failure {
    /// Description of the failure.
    pub message: String,
    /// Address of the instruction.
    pub address: u32,
    /// Source location of the instruction.
    pub place: String,
    /// Time of the failure.
    pub time: Time,
}

/// Why a slice ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stop {
    /// The deadline is reached, or pending work needs attention.
    Due,
    /// The core waits for an event.
    Wait,
    /// A hint without effect.
    Hint,
    /// An exception returns.
    Return,
    /// IPSR is to be read into this register.
    ReadIpsr(u8),
    /// An access below the stack, where nothing is.
    BusFault,
    /// The program did something that is not modelled.
    Failed,
}

/// Data of the emulator hooks.
struct Machine {
    chip: Chip,
    /// Contents of the first bank, for decoding instructions.
    code: Vec<u8>,
    /// End of the slice.
    deadline: Time,
    cycle: Time,
    stop: Stop,
    pc: u32,
    /// Instructions after the first and before the second address belong to an IT block, in which a slice cannot end.
    it_block: (u32, u32),
    /// The core's event register.
    event: bool,
    instructions: u64,
    failure: Option<Refused>,
    /// Address of the instruction that failed.
    failed_at: u32,
    /// The last register access: the instruction count at that time, and the address.
    accessed: (u64, u32),
    /// Executions by halfword of the first bank, if profiling is on.
    profile: Option<Vec<u32>>,
}

impl Machine {
    fn opcode(&self, address: u32) -> Option<u16> {
        let place = address.checked_sub(FLASH_BASE)? as usize;
        let bytes = self.code.get(place..place + 2)?;
        Some(u16::from_le_bytes([bytes[0], bytes[1]]))
    }

    fn fail(&mut self, refused: Refused) {
        if self.failure.is_none() {
            (self.failure, self.failed_at) = (Some(refused), self.pc);
        }
        self.deadline = Time(0);
    }

    /// Called before each instruction: whether the slice continues with it.
    fn goes_on(&mut self, address: u32) -> bool {
        self.pc = address;
        if self.chip.now >= self.deadline && !(self.it_block.0 < address && address < self.it_block.1) {
            self.stop = if self.failure.is_some() { Stop::Failed } else { Stop::Due };
            return false;
        }
        let Some(opcode) = self.opcode(address) else {
            self.stop = if address >= RETURN_PAGE { Stop::Return } else { Stop::Failed };
            if self.stop == Stop::Failed {
                self.fail(Refused(format!("the program runs at {address:#010x}, outside the first bank of the flash")));
            }
            return false;
        };
        // Hints, IT, CPS; BKPT, SVC and permanently undefined; MSR and MRS.
        if matches!(opcode >> 8, 0xb6 | 0xbe | 0xbf | 0xde | 0xdf | 0xf3)
            && let Some(stop) = self.look_at(address, opcode)
        {
            self.stop = stop;
            return false;
        }
        self.chip.now += self.cycle;
        self.instructions += 1;
        if let Some(profile) = &mut self.profile {
            profile[(address - FLASH_BASE) as usize / 2] += 1;
        }
        true
    }

    /// Decodes an instruction with effects outside the registers. Returns the reason if the slice must end before it.
    fn look_at(&mut self, address: u32, opcode: u16) -> Option<Stop> {
        let second = self.opcode(address + 2).unwrap_or(0);
        match opcode {
            0xbf20 => return Some(Stop::Wait),
            0xbf30 => {
                self.fail(Refused("WFI is not modelled".into()));
                return Some(Stop::Failed);
            }
            0xbf10 => return Some(Stop::Hint),
            0xbf40 => self.event = true,
            0xbf00 => {}
            0xbf01..=0xbfff => {
                // One to four instructions, given by the lowest set bit of the mask.
                let count = 4 - (opcode & 0xf).trailing_zeros();
                let mut end = address + 2;
                for _ in 0..count {
                    let is_wide = self.opcode(end).is_some_and(|first| first >> 11 >= 0b11101);
                    end += if is_wide { 4 } else { 2 };
                }
                self.it_block = (address, end);
            }
            0xb660..=0xb67f => self.look_after(),
            0xbe00..=0xbeff | 0xde00..=0xdfff => {
                self.fail(Refused(format!("the instruction {opcode:#06x} (BKPT, SVC or UDF) is not modelled")));
                return Some(Stop::Failed);
            }
            0xf380..=0xf38f if second & 0xff00 == 0x8800 => match second & 0xff {
                16..=19 => self.look_after(),
                8 => {}
                other => {
                    self.fail(Refused(format!("MSR to special register {other} is not modelled")));
                    return Some(Stop::Failed);
                }
            },
            0xf3ef => match second & 0xff {
                8 | 16..=19 => {}
                5 => return Some(Stop::ReadIpsr((second >> 8 & 0xf) as u8)),
                other => {
                    self.fail(Refused(format!("MRS from special register {other} is not modelled")));
                    return Some(Stop::Failed);
                }
            },
            _ => {}
        }
        None
    }

    /// Ends the slice after this instruction if an exception is pending.
    fn look_after(&mut self) {
        if self.chip.nvic.has_pending() {
            self.deadline = Time(0);
        }
    }

    /// Called before a register access. The emulator splits an unaligned access into two aligned ones; an instruction
    /// that moves one word then appears twice.
    fn begin_access(&mut self, address: u32) -> Result<(), Refused> {
        let before = std::mem::replace(&mut self.accessed, (self.instructions, address));
        let moves_one = self.opcode(self.pc).is_some_and(|opcode| {
            // LDR, STR and their variants, 16-bit and 32-bit.
            matches!(opcode >> 12, 5..=9) || opcode >> 9 == 0b111_1100
        });
        if before.0 == self.instructions && moves_one {
            return Err(Refused(format!("a misaligned access between {:#010x} and {address:#010x}", before.1)));
        }
        Ok(())
    }

    /// Called after an access: carries out its memory transfers, and ends the slice if an exception may be due.
    fn after_access(uc: &mut Unicorn<'_, Machine>) {
        let machine = uc.get_data_mut();
        if let Some(refused) = machine.chip.failure.take() {
            machine.fail(refused);
        }
        if machine.chip.stalled_until > machine.chip.now {
            machine.chip.now = machine.chip.stalled_until;
        }
        let next = machine.chip.next_event();
        machine.deadline = machine.deadline.min(next);
        machine.cycle = machine.chip.cycle();
        if machine.chip.nvic.has_pending() || machine.chip.wants_reset().is_some() {
            machine.deadline = Time(0);
        }
        if let Some((address, bytes)) = machine.chip.source_wanted() {
            let bytes = uc.mem_read_as_vec(address.into(), bytes as usize).expect("DMA reads mapped memory");
            uc.get_data_mut().chip.give_source(bytes);
        }
        let machine = uc.get_data_mut();
        for (address, bytes) in std::mem::take(&mut machine.chip.memory) {
            uc.mem_write(address.into(), &bytes).expect("DMA writes to mapped memory");
        }
    }
}

/// Cost of the handlers of an exception so far, excluding handlers that interrupted them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Number of times the exception was taken.
    pub count: u64,
    /// Total instructions.
    pub instructions: u64,
    /// Instructions of the longest execution.
    pub most: u64,
}

impl Cost {
    /// Mean instructions per execution.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.instructions as f64 / self.count.max(1) as f64
    }
}

/// An exception that is being handled.
#[derive(Clone, Copy, Debug)]
struct Handled {
    exception: u16,
    begun: u64,
    /// Instructions of handlers that interrupted this one.
    others: u64,
}

/// The emulated board.
pub struct Board {
    uc: Unicorn<'static, Machine>,
    image: Image,
    is_waiting: bool,
    handled: Vec<Handled>,
    costs: BTreeMap<u16, Cost>,
    /// The core is halted until this time.
    halted_until: Time,
    /// The exception whose handler must loop for ever; 0 for code outside handlers.
    hangs_in: Option<u16>,
    /// Place in the log's ring up to which it was read.
    log_read: usize,
    /// The exception whose handler must find no stack left.
    overflows_in: Option<u16>,
    /// A low supply holds the chip in reset.
    is_held: bool,
}

impl Board {
    /// A board that has just been powered on, with this image in its flash.
    ///
    /// # Errors
    /// The rig's configuration is invalid, or the emulator reports an error.
    pub fn new(image: Image, config: &Config) -> Result<Self, String> {
        let chip = Chip::new(config).map_err(|invalid| format!("{invalid:?}"))?;
        let code = image.flash[..BANK_BYTES as usize].to_vec();
        let machine = Machine {
            cycle: chip.cycle(),
            chip,
            code,
            deadline: Time(0),
            stop: Stop::Due,
            pc: 0,
            it_block: (0, 0),
            event: false,
            instructions: 0,
            failure: None,
            failed_at: 0,
            accessed: (0, 0),
            profile: None,
        };
        let mut uc = Unicorn::new_with_data(Arch::ARM, Mode::THUMB | Mode::MCLASS, machine).map_err(says)?;
        uc.ctl_set_cpu_model(ArmCpuModel::CORTEX_M4 as i32).map_err(says)?;
        map(&mut uc)?;
        let mut board = Self {
            uc,
            image,
            is_waiting: false,
            handled: Vec::new(),
            costs: BTreeMap::new(),
            halted_until: Time(0),
            hangs_in: None,
            overflows_in: None,
            log_read: 0,
            is_held: false,
        };
        board.start_core();
        Ok(board)
    }

    fn machine(&self) -> &Machine {
        self.uc.get_data()
    }

    /// The chip.
    #[must_use]
    pub fn chip(&self) -> &Chip {
        &self.machine().chip
    }

    /// The chip, for access to its pins and its serial line.
    pub fn chip_mut(&mut self) -> &mut Chip {
        &mut self.uc.get_data_mut().chip
    }

    /// The image.
    #[must_use]
    pub fn image(&self) -> &Image {
        &self.image
    }

    /// The present device time.
    #[must_use]
    pub fn now(&self) -> Time {
        self.chip().now
    }

    /// Instructions executed so far.
    #[must_use]
    pub fn instructions(&self) -> u64 {
        self.machine().instructions
    }

    /// Cost of each exception since [`Board::forget_costs`], by exception number (interrupt number plus 16).
    #[must_use]
    pub fn costs(&self) -> &BTreeMap<u16, Cost> {
        &self.costs
    }

    /// Resets the costs.
    pub fn forget_costs(&mut self) {
        self.costs.clear();
    }

    /// Bytes of the stack that were ever written: memory from the end of the CCM down that differs from its contents at power-on.
    ///
    /// # Panics
    /// The image has its stack elsewhere.
    #[must_use]
    pub fn stack_used(&self) -> u32 {
        assert_eq!(
            self.code_word(self.chip().vectors()),
            CCM_BASE + CCM_BYTES,
            "the stack begins at the end of the CCM"
        );
        let now = self.uc.mem_read_as_vec(CCM_BASE.into(), CCM_BYTES as usize).expect("the CCM is mapped");
        let before = memory_at_power_on(CCM_BYTES);
        CCM_BYTES - now.iter().zip(before).take_while(|(now, before)| **now == *before).count() as u32
    }

    /// What the program has written to its log since the last call, as a debug probe reads it from memory: nothing if the image
    /// has no log. Call often enough that the ring does not overtake itself.
    ///
    /// # Panics
    /// The ring is outside the memory.
    pub fn read_log(&mut self) -> Vec<u8> {
        let Some(block) = self.image.log() else { return Vec::new() };
        // Behind the identification and the numbers of channels: name, buffer, size, place of the next byte.
        let word = |n: u32| {
            let bytes =
                self.uc.mem_read_as_vec(u64::from(block + 24 + 4 * n), 4).expect("the control block is in memory");
            u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
        };
        let (buffer, size, next) = (word(1), word(2) as usize, word(3) as usize);
        let ring = self.uc.mem_read_as_vec(buffer.into(), size).expect("the ring is in memory");
        let from = std::mem::replace(&mut self.log_read, next);
        if from <= next { ring[from..next].to_vec() } else { [&ring[from..], &ring[..next]].concat() }
    }

    /// Bytes of static memory.
    #[must_use]
    pub fn static_memory(&self) -> u32 {
        self.image.static_end().map_or(0, |end| end - RAM_BASE)
    }

    /// Starts to count instructions by address.
    pub fn start_profile(&mut self) {
        self.uc.get_data_mut().profile = Some(vec![0; BANK_BYTES as usize / 2]);
    }

    /// Instructions by function since [`Board::start_profile`], highest count first.
    #[must_use]
    pub fn profile(&self) -> Vec<(String, u64)> {
        let mut functions = HashMap::<&str, u64>::new();
        for (n, &count) in self.machine().profile.iter().flatten().enumerate() {
            if count > 0 {
                let name = self.image.function(FLASH_BASE + 2 * n as u32).unwrap_or("?");
                *functions.entry(name).or_default() += u64::from(count);
            }
        }
        let mut functions: Vec<_> = functions.into_iter().map(|(name, count)| (name.to_string(), count)).collect();
        functions.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        functions
    }

    fn register(&self, register: RegisterARM) -> u32 {
        self.uc.reg_read(register).expect("the core has this register") as u32
    }

    fn set_register(&mut self, register: RegisterARM, value: u32) {
        self.uc.reg_write(register, value.into()).expect("the core has this register");
    }

    /// Starts the core at the reset vector.
    fn start_core(&mut self) {
        let vectors = self.chip().vectors();
        let (stack, reset) = (self.code_word(vectors), self.code_word(vectors + 4));
        for mask in [RegisterARM::PRIMASK, RegisterARM::BASEPRI, RegisterARM::FAULTMASK, RegisterARM::CONTROL] {
            self.set_register(mask, 0);
        }
        self.set_register(RegisterARM::SP, stack);
        self.set_register(RegisterARM::LR, u32::MAX);
        self.set_register(RegisterARM::PC, reset | 1);
        self.is_waiting = false;
        self.halted_until = Time(0);
        self.handled.clear();
        let machine = self.uc.get_data_mut();
        machine.event = false;
        machine.cycle = machine.chip.cycle();
    }

    fn code_word(&self, address: u32) -> u32 {
        let place = (address - FLASH_BASE) as usize;
        let bytes = self.machine().code.get(place..place + 4).expect("the vectors lie in the first bank");
        u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
    }

    /// Halts the core for this time, as a debugger does. The peripherals continue, except those that the program lets a
    /// debugger freeze.
    pub fn halt(&mut self, time: Time) {
        let now = self.now();
        self.halted_until = now + time;
        let chip = self.chip_mut();
        if chip.freezes_watchdog() {
            chip.postpone_watchdog(time);
        }
    }

    /// Whether the program has masked all interrupts.
    #[must_use]
    pub fn masks_interrupts(&self) -> bool {
        self.masks().primask
    }

    /// The exception that is being handled; 0 for code outside handlers.
    #[must_use]
    pub fn handles(&self) -> u16 {
        self.chip().nvic.current()
    }

    /// Makes the handler of `exception` loop for ever the next time it runs; 0 selects the code outside handlers.
    pub fn hang_in(&mut self, exception: u16) {
        self.hangs_in = Some(exception);
    }

    /// Leaves no stack to the handler of `exception` the next time it runs, as a chain of calls that is too deep does; 0 selects
    /// the code outside handlers.
    pub fn overflow_in(&mut self, exception: u16) {
        self.overflows_in = Some(exception);
    }

    /// Puts the core into an endless loop: an instruction of the image that branches to itself.
    fn hang(&mut self) {
        let code = &self.machine().code;
        let place = code.chunks_exact(2).position(|halfword| halfword == [0xfe, 0xe7]);
        let place = place.expect("every image has an endless loop for unhandled exceptions");
        self.set_register(RegisterARM::PC, (FLASH_BASE + 2 * place as u32) | 1);
        self.hangs_in = None;
    }

    /// Applies an external reset: the button or the supply. Memory keeps its contents.
    pub fn reset(&mut self, cause: ResetCause) {
        self.chip_mut().reset(cause);
        self.start_core();
    }

    /// Runs until `end`.
    ///
    /// # Errors
    /// The program did something that is not modelled or not allowed.
    pub fn run_until(&mut self, end: Time) -> Result<(), Failure> {
        loop {
            let machine = self.uc.get_data_mut();
            machine.chip.settle();
            Machine::after_access(&mut self.uc);
            let machine = self.uc.get_data_mut();
            if machine.failure.is_some() {
                return Err(self.failure());
            }
            if let Some(cause) = machine.chip.wants_reset() {
                self.reset(cause);
                continue;
            }
            if machine.chip.is_browned_out() {
                if !self.is_held {
                    self.is_held = true;
                    self.reset(ResetCause::Power);
                }
                self.chip_mut().now = end;
                return Ok(());
            }
            self.is_held = false;
            let machine = self.uc.get_data_mut();
            if machine.chip.now >= end {
                return Ok(());
            }
            if machine.chip.has_no_supply() {
                machine.chip.now = end;
                return Ok(());
            }
            if machine.chip.now < self.halted_until {
                let next = machine.chip.next_event().min(end).min(self.halted_until);
                // An event that waits for the core stays due.
                machine.chip.now = if next > machine.chip.now { next } else { machine.chip.now + machine.cycle };
                continue;
            }
            if machine.chip.nvic.has_pending()
                && let Some(exception) = self.chip().nvic.to_take(&self.masks())
            {
                self.enter(exception)?;
                continue;
            }
            let machine = self.uc.get_data_mut();
            if self.is_waiting {
                if std::mem::take(&mut machine.event) {
                    self.is_waiting = false;
                } else {
                    machine.chip.now = machine.chip.next_event().min(end).max(machine.chip.now);
                }
                continue;
            }
            machine.deadline = machine.chip.next_event().min(end);
            if self.hangs_in == Some(self.chip().nvic.current()) {
                self.hang();
            }
            if self.overflows_in == Some(self.chip().nvic.current()) {
                self.overflows_in = None;
                self.set_register(RegisterARM::SP, CCM_BASE);
            }
            self.slice()?;
        }
    }

    fn masks(&self) -> Masks {
        Masks {
            primask: self.register(RegisterARM::PRIMASK) & 1 != 0,
            faultmask: self.register(RegisterARM::FAULTMASK) & 1 != 0,
            basepri: self.register(RegisterARM::BASEPRI) as u8,
        }
    }

    /// Runs up to the deadline.
    fn slice(&mut self) -> Result<(), Failure> {
        let pc = self.register(RegisterARM::PC);
        self.uc.get_data_mut().stop = Stop::Due;
        let outcome = self.uc.emu_start(u64::from(pc | 1), NOWHERE, 0, 0);
        let machine = self.uc.get_data_mut();
        if machine.stop == Stop::BusFault {
            return self.fault();
        }
        if let Err(error) = outcome {
            machine.fail(Refused(format!("the core stopped: {error:?}")));
        }
        let pc = machine.pc;
        match machine.stop {
            _ if machine.failure.is_some() => Err(self.failure()),
            Stop::Due => Ok(()),
            Stop::Wait => {
                machine.chip.now += machine.cycle;
                machine.instructions += 1;
                if !std::mem::take(&mut machine.event) {
                    self.is_waiting = true;
                }
                self.set_register(RegisterARM::PC, (pc + 2) | 1);
                Ok(())
            }
            Stop::Hint => {
                machine.chip.now += machine.cycle;
                self.set_register(RegisterARM::PC, (pc + 2) | 1);
                Ok(())
            }
            Stop::ReadIpsr(register) => {
                machine.chip.now += machine.cycle;
                let current = machine.chip.nvic.current();
                let registers = [
                    RegisterARM::R0,
                    RegisterARM::R1,
                    RegisterARM::R2,
                    RegisterARM::R3,
                    RegisterARM::R4,
                    RegisterARM::R5,
                    RegisterARM::R6,
                    RegisterARM::R7,
                    RegisterARM::R8,
                    RegisterARM::R9,
                    RegisterARM::R10,
                    RegisterARM::R11,
                    RegisterARM::R12,
                ];
                if let Some(register) = registers.get(usize::from(register)) {
                    self.set_register(*register, current.into());
                }
                self.set_register(RegisterARM::PC, (pc + 4) | 1);
                Ok(())
            }
            Stop::Return => self.leave(),
            Stop::BusFault => self.fault(),
            Stop::Failed => Err(self.failure()),
        }
    }

    fn failure(&mut self) -> Failure {
        let machine = self.uc.get_data_mut();
        let message = machine.failure.as_ref().map_or_else(|| "the run has failed".into(), |refused| refused.0.clone());
        let (address, time) = (machine.failed_at, machine.chip.now);
        Failure { message, address, place: self.image.place(address), time }
    }

    fn refuse(&mut self, message: String) -> Failure {
        self.uc.get_data_mut().fail(Refused(message));
        self.failure()
    }

    /// A fault of the bus, which the program has not enabled as an exception of its own: HardFault, or the end if in HardFault.
    fn fault(&mut self) -> Result<(), Failure> {
        if self.chip().nvic.current() == HARD_FAULT {
            return Err(self.refuse("the core locks up: a fault in HardFault".into()));
        }
        self.enter(HARD_FAULT)
    }

    /// Takes an exception. If there is no memory for its frame, takes HardFault instead, whose frame is lost too (Armv7-M, section
    /// B1.5.14).
    fn enter(&mut self, exception: u16) -> Result<(), Failure> {
        let sp = self.register(RegisterARM::SP);
        let is_aligned = sp & 4 == 0;
        let frame_at = (sp - 4 * FRAME_WORDS as u32) & !7;
        let is_lost = is_below_stack(frame_at);
        if !is_lost && !is_memory(frame_at, sp) {
            return Err(self.refuse(format!("the stack pointer {sp:#010x} is outside the memory")));
        }
        if is_lost && exception != HARD_FAULT {
            return self.fault();
        }
        let current = self.chip().nvic.current();
        let flags = self.register(RegisterARM::APSR) & 0xf80f_0000;
        let xpsr = flags | XPSR_T | u32::from(current) | if is_aligned { 0 } else { XPSR_ALIGNED };
        let mut frame = [0; FRAME_WORDS];
        for (word, register) in frame.iter_mut().zip(INTEGER) {
            *word = self.register(register);
        }
        frame[6] = self.register(RegisterARM::PC) & !1;
        frame[7] = xpsr;
        for (n, register) in FLOATING.into_iter().enumerate() {
            let double = self.uc.reg_read(register).expect("the core has this register");
            (frame[8 + 2 * n], frame[9 + 2 * n]) = (double as u32, (double >> 32) as u32);
        }
        frame[24] = self.register(RegisterARM::FPSCR);
        let bytes: Vec<u8> = frame.iter().flat_map(|word| word.to_le_bytes()).collect();
        if !is_lost {
            self.uc.mem_write(frame_at.into(), &bytes).expect("the stack lies in memory");
        }
        let to_thread = self.chip().nvic.depth() == 0;
        let vector = self.code_word(self.chip().vectors() + 4 * u32::from(exception));
        self.set_register(RegisterARM::SP, frame_at);
        self.set_register(RegisterARM::LR, if to_thread { TO_THREAD } else { TO_HANDLER });
        self.set_register(RegisterARM::PC, vector | 1);
        let machine = self.uc.get_data_mut();
        machine.chip.nvic.enter(exception);
        machine.chip.now += machine.cycle * ENTRY_CYCLES;
        machine.event = true;
        let begun = machine.instructions;
        self.is_waiting = false;
        self.handled.push(Handled { exception, begun, others: 0 });
        Ok(())
    }

    /// Returns from an exception.
    fn leave(&mut self) -> Result<(), Failure> {
        let to_thread = self.chip().nvic.depth() == 1;
        let expected = if to_thread { TO_THREAD } else { TO_HANDLER };
        let pc = self.machine().pc;
        if pc != expected & !1 || self.chip().nvic.depth() == 0 {
            return Err(self.refuse(format!("a return to {pc:#010x} out of turn")));
        }
        let sp = self.register(RegisterARM::SP);
        let mut bytes = [0; 4 * FRAME_WORDS];
        if self.uc.mem_read(sp.into(), &mut bytes).is_err() {
            return Err(self.refuse(format!("the stack pointer {sp:#010x} is outside the memory")));
        }
        let word = |n: usize| u32::from_le_bytes(std::array::from_fn(|byte| bytes[4 * n + byte]));
        let frame: [u32; FRAME_WORDS] = std::array::from_fn(word);
        for (value, register) in frame.into_iter().zip(INTEGER) {
            self.set_register(register, value);
        }
        for (n, register) in FLOATING.into_iter().enumerate() {
            let double = u64::from(frame[9 + 2 * n]) << 32 | u64::from(frame[8 + 2 * n]);
            self.uc.reg_write(register, double).expect("the core has this register");
        }
        self.set_register(RegisterARM::FPSCR, frame[24]);
        self.set_register(RegisterARM::APSR_NZCVQG, frame[7]);
        let padding = if frame[7] & XPSR_ALIGNED != 0 { 4 } else { 0 };
        self.set_register(RegisterARM::SP, sp + 4 * FRAME_WORDS as u32 + padding);
        self.set_register(RegisterARM::PC, frame[6] | 1);
        let machine = self.uc.get_data_mut();
        machine.chip.nvic.leave();
        let back_in = machine.chip.nvic.current();
        machine.chip.now += machine.cycle * EXIT_CYCLES;
        machine.event = true;
        let now = machine.instructions;
        if let Some(handled) = self.handled.pop() {
            let whole = now - handled.begun;
            let own = whole - handled.others;
            if let Some(outer) = self.handled.last_mut() {
                outer.others += whole;
            }
            let cost = self.costs.entry(handled.exception).or_default();
            (cost.count, cost.instructions) = (cost.count + 1, cost.instructions + own);
            cost.most = cost.most.max(own);
        }
        if u32::from(back_in) != frame[7] & 0x1ff {
            return Err(self.refuse(format!("the frame at {sp:#010x} belongs to another exception")));
        }
        Ok(())
    }
}

/// R0 to R3, R12 and LR: the first words of a frame.
const INTEGER: [RegisterARM; 6] =
    [RegisterARM::R0, RegisterARM::R1, RegisterARM::R2, RegisterARM::R3, RegisterARM::R12, RegisterARM::LR];

/// S0 to S15, in pairs.
const FLOATING: [RegisterARM; 8] = [
    RegisterARM::D0,
    RegisterARM::D1,
    RegisterARM::D2,
    RegisterARM::D3,
    RegisterARM::D4,
    RegisterARM::D5,
    RegisterARM::D6,
    RegisterARM::D7,
];

fn says(error: uc_error) -> String {
    format!("the emulator refuses: {error:?}")
}

/// Maps memory and peripherals, and sets the hooks.
fn map(uc: &mut Unicorn<'static, Machine>) -> Result<(), String> {
    let code = uc.get_data().code.clone();
    uc.mem_map(FLASH_BASE.into(), BANK_BYTES.into(), Prot::READ | Prot::EXEC).map_err(says)?;
    uc.mem_write(FLASH_BASE.into(), &code).map_err(says)?;
    for (base, length) in [(RAM_BASE, RAM_BYTES), (CCM_BASE, CCM_BYTES)] {
        uc.mem_map(base.into(), length.into(), Prot::READ | Prot::WRITE).map_err(says)?;
        uc.mem_write(base.into(), &memory_at_power_on(length)).map_err(says)?;
    }
    uc.mem_map(RETURN_PAGE.into(), 0x1000, Prot::READ | Prot::EXEC).map_err(says)?;
    for (base, length) in DEVICES {
        uc.mmio_map(
            base.into(),
            length.into(),
            Some(move |uc: &mut Unicorn<'_, Machine>, offset: u64, bytes: usize| {
                let machine = uc.get_data_mut();
                let address = base + offset as u32;
                let value = match machine.begin_access(address).and_then(|()| machine.chip.read(address, bytes as u32))
                {
                    Ok(value) => value,
                    Err(refused) => {
                        machine.fail(refused);
                        0
                    }
                };
                Machine::after_access(uc);
                value.into()
            }),
            Some(move |uc: &mut Unicorn<'_, Machine>, offset: u64, bytes: usize, value: u64| {
                let machine = uc.get_data_mut();
                let address = base + offset as u32;
                let written = machine
                    .begin_access(address)
                    .and_then(|()| machine.chip.write(address, bytes as u32, value as u32));
                if let Err(refused) = written {
                    machine.fail(refused);
                }
                Machine::after_access(uc);
            }),
        )
        .map_err(says)?;
    }
    uc.add_code_hook(1, 0, |uc, address, _| {
        if !uc.get_data_mut().goes_on(address as u32) {
            uc.emu_stop().expect("a running core can be stopped");
        }
    })
    .map_err(says)?;
    uc.add_mem_hook(HookType::MEM_INVALID, 1, 0, |uc, kind, address, bytes, _| {
        if is_below_stack(address as u32) {
            uc.get_data_mut().stop = Stop::BusFault;
            return false;
        }
        uc.get_data_mut().fail(Refused(format!("{kind:?} of {bytes} bytes at {address:#010x}: nothing is there")));
        false
    })
    .map_err(says)?;
    uc.add_intr_hook(|uc, number| {
        if number == EXCEPTION_EXIT {
            let pc = uc.reg_read(RegisterARM::PC).expect("the core has this register") as u32;
            let machine = uc.get_data_mut();
            (machine.stop, machine.pc) = (Stop::Return, pc);
            uc.emu_stop().expect("a running core can be stopped");
            return;
        }
        uc.get_data_mut().fail(Refused(format!("the core raises exception {number}, which is not modelled")));
        uc.emu_stop().expect("a running core can be stopped");
    })
    .map_err(says)?;
    Ok(())
}

/// The reserved range below the CCM, where an overflowing stack arrives.
fn is_below_stack(address: u32) -> bool {
    (CCM_BASE - CCM_BYTES..CCM_BASE).contains(&address)
}

fn is_memory(from: u32, to: u32) -> bool {
    [(RAM_BASE, RAM_BYTES), (CCM_BASE, CCM_BYTES)].iter().any(|&(base, length)| base <= from && to <= base + length)
}

/// Contents of memory at power-on: pseudo-random.
fn memory_at_power_on(length: u32) -> Vec<u8> {
    let mut state = 0x2545_f491u32;
    (0..length)
        .map(|_| {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            (state >> 24) as u8
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use damprig_core::model::{SetUp, Structure};
    use damprig_simulator::plant::PlantConfig;

    use super::*;

    /// Runs a program for one millisecond.
    fn run(code: &[u16], handler: u32) -> (Board, Result<(), Failure>) {
        let structure = Structure::from_modal(1.6, 2.5, 0.0038);
        let set_up = SetUp::bare(structure);
        let config = Config::new(PlantConfig::ideal(set_up));
        let mut board = Board::new(Image::of_code(code, handler), &config).unwrap();
        let outcome = board.run_until(Time::from_ms(100));
        (board, outcome)
    }

    fn failure(code: &[u16]) -> Failure {
        run(code, 0).1.expect_err("the program does what is not allowed")
    }

    #[test]
    fn an_access_that_is_not_modelled_or_not_allowed_ends_the_run_at_its_instruction() {
        // ldr r0, [pc, #4]; the access; b .; the address.
        let access =
            |instruction: u16, address: u32| [0x4801, instruction, 0xe7fe, 0, address as u16, (address >> 16) as u16];
        const READ: u16 = 0x6801;
        const WRITE: u16 = 0x6001;
        for (instruction, address, words) in [
            (READ, 0x4000_6400, "nothing is modelled at 0x40006400"),
            (READ, 0x4002_1098 + 0x20, "RCC has no modelled register at offset 0x0b8"),
            (READ, 0x4000_0400, "TIM3 is accessed while its clock is off"),
            (READ, 0x4002_1002, "a misaligned access between 0x40021000 and 0x40021004"),
            // strb r1, [r0]
            (0x7001, 0x4002_1000, "RCC is written by 1 bytes"),
            (WRITE, 0x4002_2008, "FLASH_KEYR: 0x00000000 is not key 1"),
            (WRITE, 0x0804_0000, "the flash is written to while PG is not set"),
            (READ, 0x2002_0000, "READ_UNMAPPED of 4 bytes at 0x20020000"),
            (WRITE, 0x0800_0000, "WRITE_PROT of 4 bytes at 0x08000000"),
        ] {
            let failure = failure(&access(instruction, address));
            assert!(failure.message.contains(words), "{address:#010x}: {}", failure.message);
            assert_eq!(failure.address, FLASH_BASE + 0x202, "{address:#010x}");
        }
    }

    #[test]
    fn an_interrupt_that_was_masked_is_taken_before_the_instruction_after_the_unmasking() {
        // movs r4, #0; cpsid i; enables and pends interrupt 1; mov r6, r4; cpsie i; mov r5, r4; wfe; b .
        // handler: adds r4, #1; bx lr
        let code = [
            0x2400, 0xb672, 0x4a05, 0x2102, 0x6011, 0xf8c2, 0x1100, 0x4626, 0xb662, 0x4625, 0xbf20, 0xe7fe, 0x3401,
            0x4770, 0xe100, 0xe000,
        ];
        let (board, outcome) = run(&code, 12);
        outcome.unwrap();
        let [r4, r5, r6] = [RegisterARM::R4, RegisterARM::R5, RegisterARM::R6].map(|r| board.register(r));
        assert_eq!((r6, r5, r4), (0, 1, 1));
    }

    #[test]
    fn a_higher_interrupt_nests_and_floating_point_registers_survive_both() {
        // Enables interrupts 1 (priority 0x80) and 6 (0x40); s0 = 1, s15 = 2; pends 1; nop; r6 = s0; r7 = s15; b .
        // handler: of 1, pends 6, then mov r5, r4; s0 = s15 = 3. Of 6 (distinguished by IPSR), adds r4, #1; s0 = 4.
        let code = [
            0x4a14, 0xf04f, 0x0142, 0x6011, 0x4b13, 0x2180, 0x7019, 0x4b13, 0x2140, 0x7019, 0x2400, 0x2500, 0xeeb7,
            0x0a00, 0xeef0, 0x7a00, 0x2102, 0xf8c2, 0x1100, 0xbf00, 0xee10, 0x6a10, 0xee17, 0x7a90, 0xe7fe, 0xf3ef,
            0x8005, 0x2816, 0xd008, 0x2140, 0x4a08, 0x6011, 0x4625, 0xeeb0, 0x0a08, 0xeef0, 0x7a08, 0x4770, 0x3401,
            0xeeb1, 0x0a00, 0x4770, 0xe100, 0xe000, 0xe401, 0xe000, 0xe406, 0xe000, 0xe200, 0xe000,
        ];
        let (board, outcome) = run(&code, 25);
        outcome.unwrap();
        let registers = [RegisterARM::R4, RegisterARM::R5, RegisterARM::R6, RegisterARM::R7];
        let expected = [1, 1, 1f32.to_bits(), 2f32.to_bits()];
        assert_eq!(registers.map(|register| board.register(register)), expected);
    }

    #[test]
    fn interrupts_at_every_instruction_preserve_flags_and_conditional_execution() {
        // TIM7 interrupts every 37 cycles. 2000 times: tst r7, #1; itete eq; addeq r4, #1; addne r5, #1; moveq; movne;
        // subs r7, #1; bne. The handler clears the flag, counts in r9 and compares.
        let code = [
            0x4812, 0x2120, 0x6581, 0x4812, 0x2124, 0x62c1, 0x2101, 0x60c1, 0x4a10, 0xf44f, 0x0100, 0x6011, 0x2101,
            0x6001, 0xf44f, 0x67fa, 0xf04f, 0x0900, 0x2400, 0x2500, 0x2601, 0x4237, 0xbf0b, 0x3401, 0x3501, 0x2603,
            0x2604, 0x3f01, 0xd1f6, 0xe7fe, 0x4806, 0x2100, 0x6001, 0xf109, 0x0901, 0x4589, 0x4770, 0x0000, 0x1000,
            0x4002, 0x1400, 0x4000, 0xe104, 0xe000, 0x1410, 0x4000,
        ];
        let (board, outcome) = run(&code, 30);
        outcome.unwrap();
        let [r9, r4, r5, r7] =
            [RegisterARM::R9, RegisterARM::R4, RegisterARM::R5, RegisterARM::R7].map(|r| board.register(r));
        assert_eq!((r4, r5, r7), (1_000, 1_000, 0), "after {r9} interrupts");
        assert!(r9 > 1_000, "{r9} interrupts");
    }
}
