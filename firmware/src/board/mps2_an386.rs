//! The emulated board: QEMU's mps2-an386, a Cortex-M4F with a CMSDK UART and no rig attached.
//!
//! Only pins and peripherals: the serial line, the instruction counter and the exit. The plant that stands
//! in for the rig, and the credit under which its time advances, are the shared device code's and
//! `tasks::granted`'s.

use core::future::poll_fn;
use core::task::Poll;

use cortex_m_rt::exception;
use cortex_m_semihosting::debug;
use embassy_sync::waitqueue::AtomicWaker;

#[cfg(feature = "count-instructions")]
pub use crate::board::instructions::InstructionCounter;

/// The board's name in the protocol.
pub const NAME: &str = "mps2-an386";

/// What the board has, each part ready for the task that will own it.
pub struct Board {
    /// The serial line to the host.
    pub line: Line,
    /// The emulator's instruction counter.
    #[cfg(feature = "count-instructions")]
    pub instructions: InstructionCounter,
}

/// Takes the peripherals and switches the serial line on. To be called once.
pub fn init() -> Board {
    let core = cortex_m::Peripherals::take().expect("the board is initialised once");
    #[cfg(not(feature = "count-instructions"))]
    let _ = core;
    Board {
        line: Line::new(),
        #[cfg(feature = "count-instructions")]
        instructions: InstructionCounter::start(core.SYST),
    }
}

/// CMSDK UART 0 (ARM DDI 0479, section 4.3), whose interrupt wakes the reader.
pub struct Line {
    _private: (),
}

const UART: *mut UartRegisters = 0x4000_4000 as *mut UartRegisters;
const STATE_TRANSMIT_FULL: u32 = 1 << 0;
const STATE_RECEIVE_FULL: u32 = 1 << 1;
const CONTROL_TRANSMIT: u32 = 1 << 0;
const CONTROL_RECEIVE: u32 = 1 << 1;
const CONTROL_RECEIVE_INTERRUPT: u32 = 1 << 3;
const INTERRUPT_RECEIVE: u32 = 1 << 1;

#[repr(C)]
struct UartRegisters {
    data: u32,
    state: u32,
    control: u32,
    interrupt: u32,
    baud_divisor: u32,
}

macro_rules! read_register {
    ($register:ident) => {
        // SAFETY: `UART` is this board's UART; its registers are 32 bits wide, aligned and always mapped.
        unsafe { core::ptr::addr_of!((*UART).$register).read_volatile() }
    };
}

macro_rules! write_register {
    ($register:ident, $value:expr) => {
        // SAFETY: as in `read_register`; no register of this UART reaches memory.
        unsafe { core::ptr::addr_of_mut!((*UART).$register).write_volatile($value) }
    };
}

static RECEIVED: AtomicWaker = AtomicWaker::new();

impl Line {
    fn new() -> Self {
        // The emulated line has no rate, but the model stays off until the divisor is at least 16.
        write_register!(baud_divisor, 27); // 25 MHz / 921 600
        write_register!(control, CONTROL_TRANSMIT | CONTROL_RECEIVE);
        // SAFETY: the handler below takes it, and no critical section relies on this mask.
        unsafe { cortex_m::peripheral::NVIC::unmask(Interrupt::Uart0Receive) };
        Self { _private: () }
    }

    /// The next byte, if one has come.
    pub fn try_read(&mut self) -> Option<u8> {
        (read_register!(state) & STATE_RECEIVE_FULL != 0).then(|| read_register!(data) as u8)
    }

    /// Waits for the next byte, asleep.
    pub async fn read(&mut self) -> u8 {
        poll_fn(|context| {
            RECEIVED.register(context.waker());
            match self.try_read() {
                Some(byte) => Poll::Ready(byte),
                None => {
                    // A byte that comes from here on raises the interrupt; one that came in between already has.
                    write_register!(control, CONTROL_TRANSMIT | CONTROL_RECEIVE | CONTROL_RECEIVE_INTERRUPT);
                    match self.try_read() {
                        Some(byte) => Poll::Ready(byte),
                        None => Poll::Pending,
                    }
                }
            }
        })
        .await
    }

    /// Sends `bytes`; waits, busy, while the host takes none.
    pub fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            while read_register!(state) & STATE_TRANSMIT_FULL != 0 {}
            write_register!(data, u32::from(byte));
        }
    }
}

/// The interrupt lines used, by their numbers in the vector table.
#[derive(Clone, Copy)]
enum Interrupt {
    Uart0Receive = 0,
}

// SAFETY: the numbers are the board's (ARM DAI 0386, table 4-1).
unsafe impl cortex_m::interrupt::InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

/// Every device interrupt; the only one unmasked is the UART's. It wakes the reader and masks itself: the
/// reader takes the bytes and asks again when it finds none.
#[exception]
unsafe fn DefaultHandler(_number: i16) {
    write_register!(control, CONTROL_TRANSMIT | CONTROL_RECEIVE);
    write_register!(interrupt, INTERRUPT_RECEIVE);
    RECEIVED.wake();
}

/// Ends the emulator, with success or failure as its exit status. Needs its semihosting switched on.
pub fn exit(success: bool) -> ! {
    debug::exit(if success { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    loop {
        cortex_m::asm::wfi();
    }
}

/// A panic ends the emulator: the host sees the line closed, a test its exit status.
#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    defmt::error!("{}", defmt::Display2Format(info));
    #[cfg(feature = "count-instructions")]
    cortex_m_semihosting::hprintln!("{}, called by {:#010x?}", info, crate::callers::of_here());
    exit(false)
}
