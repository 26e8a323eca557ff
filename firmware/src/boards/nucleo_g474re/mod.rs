//! The rig controller board: ST NUCLEO-G474RE (STM32G474RE, 170 MHz). Pins and peripherals only.
//!
//! | pin | peripheral | what |
//! |---|---|---|
//! | PA0 (A0) | ADC1 IN1 | structure displacement x |
//! | PA1 (A1) | ADC1 IN2 | base displacement z |
//! | PC0 (A5) | ADC1 IN6 | friction damper's spring force |
//! | PC1 (A4) | ADC2 IN7 | force on the wall at −d |
//! | PC2 (CN7-35) | ADC2 IN8 | force on the wall at +d |
//! | PA2, PA3 | LPUART1 | serial line: the debugger's serial port, 921 600 baud |
//! | PA4 (A2) | DAC1 OUT1 | drive; the middle of its span is zero drive |
//! | PA5 | GPIO | the board's LED |
//! | PC7 (D9) | GPIO | the drive's relay, high closes it |
//! | PB4 (D5) | TIM16 CH1 | step |
//! | PB5 (D4) | GPIO | direction, high towards the structure |
//! | PB10 (D6) | GPIO | motor off (low switches the motor on) |
//! | PA8 (D7) | GPIO, pull-up | limit switch, opens at the start of the travel |
//! | PA9 (D8) | GPIO, pull-up | emergency stop's contact 2, opens when pressed |
//!
//! Switches open to signal, so a broken wire signals too. [`clock`] selects the oscillator, [`sampling`] runs the
//! converters, [`stepper`] the motor. [`stall`] detects a missing control tick, [`supply`] a low supply.
//!
//! The watchdog keeps running while a debugger halts the core, so a halted core drives the rig for at most 50 ms.

mod clock;
mod sampling;
pub mod settings;
mod stall;
mod stepper;
mod supply;

use damprig_core::io::{Actuators, DriveScale, OUTPUT_FULL_SCALE_COUNTS, Sensors};
use damprig_core::rig::{Rejected, Rig};
use damprig_core::settings::{Settings, Source};
use damprig_device::board::{Board, Saving};
use damprig_device::control_loop::Step;
use damprig_device::controller::BootInfo;
use damprig_device::settings_store::SettingsStore;
use damprig_protocol::{CALLS_TOLD, CrashCause, Reset, StoredPart, Timing};
use embassy_executor::{InterruptExecutor, SpawnToken, Spawner};
use embassy_stm32::adc::AdcChannel;
use embassy_stm32::dac::{DacChannel, Value};
use embassy_stm32::gpio::{Input, Level, Output, Pull, Speed};
use embassy_stm32::interrupt::{self, InterruptExt, Priority};
use embassy_stm32::mode::{Async, Blocking};
use embassy_stm32::usart::{self, RingBufferedUartRx, Uart, UartTx};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Peri, bind_interrupts, dma, pac, peripherals};
use embedded_io_async::Write;
use sampling::{Sampling, SamplingParts};
use static_cell::ConstStaticCell;
use stepper::Stepper;

use crate::boards::{Receiver, TaskBoard, Transmitter};
use crate::{crash, critical_section, tasks};

/// Name of the board in the protocol.
pub const NAME: &str = "nucleo-g474re";

/// Baud rate of the serial line, bits per second.
const BAUD: u32 = damprig_device::outbox::BAUD;

/// Time-out of the watchdog, µs. When it expires the board is reset: relay open, motor off. It is longer than the
/// erase of a flash page (24.5 ms at most), which blocks accesses to the same bank. The watchdog's oscillator of
/// nominally 32 kHz runs at up to 34 kHz, which gives 47 ms.
const WATCHDOG_US: u32 = 50_000;

/// Size of the receive ring, bytes. DMA fills it; it holds 11 ms of bytes while the receive task waits for control.
const RECEIVE_RING: usize = 1024;

bind_interrupts!(struct Interrupts {
    DMA1_CHANNEL3 => dma::InterruptHandler<peripherals::DMA1_CH3>;
    DMA1_CHANNEL4 => dma::InterruptHandler<peripherals::DMA1_CH4>;
    LPUART1 => usart::InterruptHandler<peripherals::LPUART1>;
});

/// The flash that stores the settings.
pub use settings::SettingsFlash;

/// The receiving side of the serial line.
pub type LineReceiver = RingBufferedUartRx<'static>;

/// The parts of the board, one for each task.
pub struct Parts {
    /// The converters and outputs of the control tick.
    pub board: ControlBoard,
    /// State in which the board started.
    pub boot: BootInfo,
    /// Receives from the host.
    pub receiver: LineReceiver,
    /// Sends to the host.
    pub transmitter: LineTransmitter,
    /// The settings memory; `None` on a chip whose flash has one bank.
    pub store: Option<SettingsStore<SettingsFlash>>,
    /// The stored settings and their source.
    pub stored: &'static (Settings, Source),
}

/// Runs the control task above the thread executor, on an interrupt that is not used otherwise.
static CONTROL: InterruptExecutor = InterruptExecutor::new();

#[embassy_stm32::interrupt]
unsafe fn UART5() {
    // SAFETY: this is the interrupt that `CONTROL` was started on.
    unsafe { CONTROL.on_interrupt() }
}

/// Spawns the control task with the highest priority of all tasks.
pub fn spawn_control<S: Send>(_: &Spawner, control: SpawnToken<S>) {
    interrupt::UART5.set_priority(Priority::P6);
    CONTROL.start(interrupt::UART5).spawn(control);
}

/// Sets the clocks, takes the peripherals and starts sampling. Call once.
pub fn init() -> Parts {
    let reset = why_reset();
    let mut p = embassy_stm32::init(clock::at_start());
    // Open the relay before anything else.
    let relay = Output::new(p.PC7, Level::Low, Speed::Low);
    let clock_source = clock::start(&mut p.RCC);
    clock::watch(clock_source);

    supply::watch();

    // The line never delays the tick; the priority of the control executor is between the two.
    for interrupt in [interrupt::LPUART1, interrupt::DMA1_CHANNEL3, interrupt::DMA1_CHANNEL4] {
        interrupt.set_priority(Priority::P8);
    }

    let drive = Drive::new(DacChannel::new_blocking(p.DAC1, p.PA4), relay);
    let sampling = Sampling::new(SamplingParts {
        slow: (p.ADC1, p.DMA1_CH1, p.TIM3),
        slow_pins: [p.PA0.degrade_adc(), p.PA1.degrade_adc(), p.PC0.degrade_adc()],
        walls: (p.ADC2, p.DMA1_CH2, p.TIM4),
        wall_pins: [p.PC1.degrade_adc(), p.PC2.degrade_adc()],
    });

    static RECEIVE: ConstStaticCell<[u8; RECEIVE_RING]> = ConstStaticCell::new([0; RECEIVE_RING]);
    let mut line = usart::Config::default();
    line.baudrate = BAUD;
    let line = Uart::new(p.LPUART1, p.PA3, p.PA2, p.DMA1_CH3, p.DMA1_CH4, Interrupts, line)
        .expect("the LPUART's clock carries 921 600 baud");
    let (transmitter, receiver) = line.split();
    let mut receiver = receiver.into_ring_buffered(RECEIVE.take());
    receiver.start_uart();

    clock::speed_up();
    let option_bytes = pac::FLASH.optr().read().0;
    let (store, stored) = settings::open(p.FLASH);
    let boot = BootInfo {
        clock_source,
        reset,
        last_crash: crash::at_start(reset),
        option_bytes: Some(option_bytes),
        supply_v: Some(sampling.supply_v()),
    };
    Parts {
        board: ControlBoard {
            sampling,
            drive,
            stepper: Stepper::new(p.PB4, p.PB5, p.PB10, p.TIM16),
            limit: Input::new(p.PA8, Pull::Up),
            emergency_stop: Input::new(p.PA9, Pull::Up),
            watchdog: IndependentWatchdog::new(p.IWDG, WATCHDOG_US),
            timer: TickTimer::start(),
            stall_timer: Some(p.TIM7),
        },
        boot,
        receiver,
        transmitter: LineTransmitter { uart: transmitter, led: Output::new(p.PA5, Level::Low, Speed::Low) },
        store,
        stored,
    }
}

/// Reads the cause of the reset, and clears its flags for the next reset.
fn why_reset() -> Reset {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|flags| flags.set_rmvf(true));
    // Every reset also sets the pin's flag.
    if flags.borrstf() {
        Reset::Power
    } else if flags.iwdgrstf() {
        Reset::Watchdog
    } else if flags.sftrstf() {
        Reset::Software
    } else if flags.pinrstf() {
        Reset::Pin
    } else {
        Reset::Unknown
    }
}

/// Inputs and outputs of the control tick.
pub struct ControlBoard {
    sampling: Sampling,
    drive: Drive,
    stepper: Stepper,
    limit: Input<'static>,
    emergency_stop: Input<'static>,
    watchdog: IndependentWatchdog<'static, peripherals::IWDG>,
    timer: TickTimer,
    /// `None` once the ticks have started.
    stall_timer: Option<Peri<'static, peripherals::TIM7>>,
}

impl Board for ControlBoard {
    fn samples(&mut self, rig: &Rig) -> Option<Sensors> {
        let mut sensors = self.sampling.sensors(&rig.settings().calibration);
        sensors.at_limit = self.limit.is_high();
        sensors.emergency_stop = self.emergency_stop.is_high();
        Some(sensors)
    }

    fn set(&mut self, actuators: &Actuators, rig: &Rig) {
        self.drive.set(actuators.drive_m, actuators.drive_enabled, &rig.settings().calibration.drive);
        self.stepper.go(actuators.motor);
    }

    fn save(&mut self, settings: &Settings) -> Result<Saving, Rejected> {
        tasks::settings::save(settings)
    }

    fn saved(&mut self) -> Option<Result<(), Rejected>> {
        tasks::settings::saved()
    }

    fn stored_settings(&mut self, page: u8, from: u16) -> StoredPart {
        tasks::settings::stored(page, from)
    }

    fn timing(&self) -> Timing {
        let tenths_us = critical_section::longest_cycles() / (CYCLES_PER_US / 10);
        Timing {
            overruns: self.sampling.overruns(),
            longest_masked_tenths_us: tenths_us.min(u32::from(u16::MAX)) as u16,
            ..self.timer.timing
        }
    }
}

impl TaskBoard for ControlBoard {
    fn start(&mut self) {
        self.sampling.start();
        self.watchdog.unleash();
        if let Some(timer) = self.stall_timer.take() {
            stall::watch(timer);
        }
        critical_section::forget();
    }

    async fn wait(&mut self, _: Step, _: &Rig) {
        self.sampling.next_block().await;
        self.timer.begin();
    }

    fn end_step(&mut self, next_tick: u32) {
        self.timer.end();
        crash::note_tick(next_tick);
    }

    fn feed_watchdog(&mut self) {
        self.watchdog.pet();
    }

    /// Records the cause. The watchdog is no longer fed and resets the board.
    fn communication_stalled(&mut self) {
        crash::note(CrashCause::CommunicationStalled, [0; CALLS_TOLD]);
    }
}

impl Receiver for LineReceiver {}

/// The sending side of the serial line, and the LED, which toggles with every frame.
pub struct LineTransmitter {
    uart: UartTx<'static, Async>,
    led: Output<'static>,
}

impl Transmitter for LineTransmitter {
    /// Returns at once; [`Transmitter::send`] waits for space.
    async fn ready(&mut self) {}

    async fn send(&mut self, frame: &[u8]) {
        self.led.toggle();
        // DMA transfers the bytes and reports no error.
        let _ = self.uart.write_all(frame).await;
    }
}

/// The analogue output of the drive, and its relay.
struct Drive {
    output: DacChannel<'static, Blocking>,
    relay: Output<'static>,
}

impl Drive {
    /// Switches the output on. It starts at 0 V, the negative end, and is set to zero drive at once; the relay is
    /// open.
    fn new(output: DacChannel<'static, Blocking>, relay: Output<'static>) -> Self {
        let mut drive = Self { output, relay };
        // The middle, until the settings define the code of zero drive.
        drive.output.set(Value::Bit12Right(OUTPUT_FULL_SCALE_COUNTS.div_ceil(2)));
        drive
    }

    fn put(&mut self, demand_m: f32, scale: &DriveScale) {
        self.output.set(Value::Bit12Right(scale.to_counts(demand_m)));
    }

    /// Sets output and relay. The relay closes after the output has been at zero drive for a tick; it opens at once.
    fn set(&mut self, demand_m: f32, enabled: bool, scale: &DriveScale) {
        if !enabled {
            self.relay.set_low();
            self.put(0.0, scale);
        } else if self.relay.is_set_low() {
            self.put(0.0, scale);
            self.relay.set_high();
        } else {
            self.put(demand_m, scale);
        }
    }
}

/// Measures the ticks with the core's cycle counter.
struct TickTimer {
    begun: u32,
    is_running: bool,
    timing: Timing,
}

const CYCLES_PER_US: u32 = clock::CORE_HZ / 1_000_000;
const CYCLES_PER_TICK: u32 = clock::CORE_HZ / 1_000;

impl TickTimer {
    fn start() -> Self {
        // SAFETY: nothing else uses the core's trace unit, and this code runs once.
        let mut core = unsafe { cortex_m::Peripherals::steal() };
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
        Self { begun: 0, is_running: false, timing: Timing::default() }
    }

    fn begin(&mut self) {
        let now = cortex_m::peripheral::DWT::cycle_count();
        let between = now.wrapping_sub(self.begun);
        self.begun = now;
        if core::mem::replace(&mut self.is_running, true) {
            keep_most(&mut self.timing.largest_jitter_us, between.abs_diff(CYCLES_PER_TICK));
        }
    }

    fn end(&mut self) {
        let took = cortex_m::peripheral::DWT::cycle_count().wrapping_sub(self.begun);
        keep_most(&mut self.timing.longest_tick_us, took);
    }
}

fn keep_most(most_us: &mut u16, cycles: u32) {
    let us = (cycles / CYCLES_PER_US).min(u32::from(u16::MAX)) as u16;
    *most_us = us.max(*most_us);
}
