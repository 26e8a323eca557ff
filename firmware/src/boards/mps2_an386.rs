//! The emulated board: QEMU's mps2-an386, a Cortex-M4F with a CMSDK UART and a rig that is simulated on the board
//! itself.
//!
//! Ticks run back to back while the host's credit lasts, without a timer: an interrupt costs the emulator more than a
//! tick. The line sends at the rate of a real line in device time, and without delay while the clock is stopped. The
//! board therefore sends the same bytes as the virtual rig.

use core::cell::RefCell;
use core::convert::Infallible;
use core::future::poll_fn;
use core::task::Poll;

use cortex_m_rt::exception;
use cortex_m_semihosting::debug;
use damprig_core::io::{Actuators, Sensors};
use damprig_core::rig::{Rejected, Rig};
use damprig_core::settings::{Settings, Source};
use damprig_device::board::{Board, Saving, Simulated};
use damprig_device::control_loop::Step;
use damprig_device::controller::BootInfo;
use damprig_device::queues::StreamItem;
use damprig_device::settings_store::SettingsStore;
use damprig_protocol::{Clock, NumberedRequest, PlantKind, StoredPart};
use damprig_simulator::board::SimulatedBoard;
use damprig_simulator::line_pace::LinePace;
use embassy_executor::{SpawnToken, Spawner};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_sync::waitqueue::AtomicWaker;
use embedded_io_async::Read;
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use static_cell::StaticCell;

#[cfg(feature = "count-instructions")]
pub use crate::boards::instructions::InstructionCounter;
use crate::boards::{Receiver, TaskBoard, Transmitter};
use crate::tasks::queues::Queues;
use crate::tasks::{let_others_run, settings};
use crate::tick;

/// Name of the board in the protocol.
pub const NAME: &str = "mps2-an386";

/// The parts of the board, one for each task.
pub struct Parts {
    /// The simulated rig and its clock.
    pub board: ControlBoard,
    /// State in which the board started.
    pub boot: BootInfo,
    /// Receives from the host.
    pub receiver: LineReceiver,
    /// Sends to the host.
    pub transmitter: LineTransmitter,
    /// The settings memory.
    pub store: Option<SettingsStore<SettingsFlash>>,
    /// The default settings.
    pub stored: &'static (Settings, Source),
    /// The emulator's instruction counter.
    #[cfg(feature = "count-instructions")]
    pub instructions: InstructionCounter,
}

/// Takes the peripherals and switches the serial line on. Call once.
pub fn init() -> Parts {
    let core = cortex_m::Peripherals::take().expect("the board is initialised once");
    #[cfg(not(feature = "count-instructions"))]
    let _ = core;
    start_uart();
    let mut store = SettingsStore::new(SettingsFlash::default(), 0..SettingsFlash::SIZE as u32);
    static STORED: StaticCell<(Settings, Source)> = StaticCell::new();
    let stored = STORED.init_with(|| store.as_mut().map(SettingsStore::load).unwrap_or_default());
    Parts {
        board: ControlBoard::default(),
        boot: BootInfo::default(),
        receiver: LineReceiver { _private: () },
        transmitter: LineTransmitter { _private: () },
        store,
        stored,
        #[cfg(feature = "count-instructions")]
        instructions: InstructionCounter::start(core.SYST),
    }
}

/// Spawns the control task in the executor of the other tasks.
pub fn spawn_control<S>(spawner: &Spawner, control: SpawnToken<S>) {
    spawner.spawn(control);
}

/// Tick credit that the host has granted and the board has not taken yet.
static GRANTED: Signal<CriticalSectionRawMutex, u32> = Signal::new();

/// Signalled when something was received: a stopped clock may continue, or serve a request.
static RECEIVED: Signal<CriticalSectionRawMutex, ()> = Signal::new();

/// State of the line in device time. All tasks run in one executor, so only one holds the lock at a time.
static LINE: Mutex<CriticalSectionRawMutex, RefCell<Line>> =
    Mutex::new(RefCell::new(Line { pace: LinePace::new(), stands: true }));

/// Signalled when the line may have become free.
static LINE_CHANGED: Signal<CriticalSectionRawMutex, ()> = Signal::new();

struct Line {
    pace: LinePace,
    /// The clock is stopped, so the line sends without delay.
    stands: bool,
}

/// The simulated rig and its clock.
#[derive(Default)]
pub struct ControlBoard {
    simulated: SimulatedBoard<f32>,
}

impl Board for ControlBoard {
    const PLANT: PlantKind = <SimulatedBoard<f32> as Board>::PLANT;

    fn clock(&self) -> Clock {
        self.simulated.clock()
    }

    fn samples(&mut self, rig: &Rig) -> Option<Sensors> {
        if let Some(until_tick) = GRANTED.try_take() {
            self.simulated.grant(until_tick);
        }
        self.simulated.samples(rig)
    }

    fn set(&mut self, actuators: &Actuators, rig: &Rig) {
        self.simulated.set(actuators, rig);
    }

    fn save(&mut self, to_save: &Settings) -> Result<Saving, Rejected> {
        settings::save(to_save)
    }

    fn saved(&mut self) -> Option<Result<(), Rejected>> {
        settings::saved()
    }

    fn stored_settings(&mut self, page: u8, from: u16) -> StoredPart {
        settings::stored(page, from)
    }

    fn can_start(&self) -> Result<(), Rejected> {
        self.simulated.can_start()
    }

    fn started(&mut self) {
        self.simulated.started();
    }

    fn simulate(&mut self, message: &[u8], rig: &Rig) -> Result<Simulated, Rejected> {
        self.simulated.simulate(message, rig)
    }

    fn defer(&mut self, request: &NumberedRequest) -> Result<(), Rejected> {
        self.simulated.defer(request)
    }

    fn due(&mut self, next_tick: u32) -> Option<NumberedRequest> {
        self.simulated.due(next_tick)
    }
}

impl TaskBoard for ControlBoard {
    fn start(&mut self) {}

    async fn wait(&mut self, last: Step, rig: &Rig) {
        LINE.lock(|line| {
            let mut line = line.borrow_mut();
            line.pace.follow(last, rig.next_tick());
            line.stands = last != Step::Ticked;
        });
        LINE_CHANGED.signal(());
        let_others_run().await;
        if last == Step::Idle && !settings::is_saving() && !GRANTED.signaled() {
            if self.simulated.tells_clock() {
                Queues.stream_when_free(StreamItem::ClockStands { tick: rig.next_tick() }).await;
            }
            RECEIVED.wait().await;
        }
    }

    fn end_step(&mut self, next_tick: u32) {
        tick::note(next_tick);
    }

    fn feed_watchdog(&mut self) {}

    fn communication_stalled(&mut self) {
        panic!("the line's tasks do not run");
    }
}

/// Two flash pages in memory, which exist as long as the emulator runs.
pub struct SettingsFlash {
    bytes: [u8; Self::SIZE],
}

impl SettingsFlash {
    const SIZE: usize = 2 * Self::ERASE_SIZE;
}

impl Default for SettingsFlash {
    fn default() -> Self {
        Self { bytes: [0xff; Self::SIZE] }
    }
}

impl ErrorType for SettingsFlash {
    type Error = Infallible;
}

impl ReadNorFlash for SettingsFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Infallible> {
        bytes.copy_from_slice(&self.bytes[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        Self::SIZE
    }
}

impl NorFlash for SettingsFlash {
    const WRITE_SIZE: usize = 8;
    const ERASE_SIZE: usize = 512;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Infallible> {
        self.bytes[from as usize..to as usize].fill(0xff);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Infallible> {
        self.bytes[offset as usize..][..bytes.len()].copy_from_slice(bytes);
        Ok(())
    }
}

const UART: *mut UartRegisters = 0x4000_4000 as *mut UartRegisters;
const STATE_TRANSMIT_FULL: u32 = 1 << 0;
const STATE_RECEIVE_FULL: u32 = 1 << 1;
const CONTROL_TRANSMIT: u32 = 1 << 0;
const CONTROL_RECEIVE: u32 = 1 << 1;
const CONTROL_RECEIVE_INTERRUPT: u32 = 1 << 3;
const INTERRUPT_RECEIVE: u32 = 1 << 1;

/// CMSDK UART 0 (ARM DDI 0479, section 4.3).
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

fn start_uart() {
    // The emulated line has no rate, but the UART model is off while the divisor is below 16.
    write_register!(baud_divisor, 27); // 25 MHz / 921 600
    write_register!(control, CONTROL_TRANSMIT | CONTROL_RECEIVE);
    // SAFETY: the handler below is ready, and no critical section relies on this mask.
    unsafe { cortex_m::peripheral::NVIC::unmask(Interrupt::Uart0Receive) };
}

/// The receiving side of the UART. Its interrupt wakes the reader.
pub struct LineReceiver {
    _private: (),
}

static BYTE_RECEIVED: AtomicWaker = AtomicWaker::new();

impl LineReceiver {
    fn try_read(&mut self) -> Option<u8> {
        (read_register!(state) & STATE_RECEIVE_FULL != 0).then(|| read_register!(data) as u8)
    }

    /// Sleeps until the next byte arrives.
    async fn read_byte(&mut self) -> u8 {
        poll_fn(|context| {
            BYTE_RECEIVED.register(context.waker());
            match self.try_read() {
                Some(byte) => Poll::Ready(byte),
                None => {
                    // A byte that arrives after this raises the interrupt. One that arrived before has raised it
                    // already.
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
}

impl embedded_io_async::ErrorType for LineReceiver {
    type Error = Infallible;
}

impl Read for LineReceiver {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        let Some((first, rest)) = bytes.split_first_mut() else { return Ok(0) };
        *first = self.read_byte().await;
        let mut length = 1;
        for place in rest {
            let Some(byte) = self.try_read() else { break };
            *place = byte;
            length += 1;
        }
        Ok(length)
    }
}

impl Receiver for LineReceiver {
    fn granted(&mut self, until_tick: u32) {
        GRANTED.signal(until_tick);
        RECEIVED.signal(());
    }

    fn request_queued(&mut self) {
        RECEIVED.signal(());
    }
}

/// The sending side of the UART.
pub struct LineTransmitter {
    _private: (),
}

impl Transmitter for LineTransmitter {
    async fn ready(&mut self) {
        while !LINE.lock(|line| line.borrow().stands || line.borrow().pace.is_clear()) {
            LINE_CHANGED.wait().await;
        }
    }

    /// Busy-waits while the host accepts no bytes.
    async fn send(&mut self, frame: &[u8]) {
        for &byte in frame {
            while read_register!(state) & STATE_TRANSMIT_FULL != 0 {}
            write_register!(data, u32::from(byte));
        }
        LINE.lock(|line| {
            let mut line = line.borrow_mut();
            if !line.stands {
                line.pace.charge(frame.len());
            }
        });
    }
}

/// The used interrupts, by their numbers in the vector table.
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

/// Handles every device interrupt; only the UART's is unmasked. The handler wakes the reader and masks the interrupt.
/// The reader takes the bytes, and unmasks the interrupt when there are no more.
#[exception]
unsafe fn DefaultHandler(_number: i16) {
    write_register!(control, CONTROL_TRANSMIT | CONTROL_RECEIVE);
    write_register!(interrupt, INTERRUPT_RECEIVE);
    BYTE_RECEIVED.wake();
}

/// Ends the emulator with an exit status of success or failure. Needs semihosting.
pub fn exit(success: bool) -> ! {
    debug::exit(if success { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    loop {
        cortex_m::asm::wfi();
    }
}

/// A panic ends the emulator: the host sees the line closed, a test sees the exit status.
#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    defmt::error!("{}", defmt::Display2Format(info));
    #[cfg(feature = "count-instructions")]
    cortex_m_semihosting::hprintln!("{}, called by {:#010x?}", info, crate::callers::of_here());
    exit(false)
}
