//! The rig controller board: ST NUCLEO-G474RE (STM32G474RE, 170 MHz). Pins and peripherals only.
//!
//! | pin | peripheral | what |
//! |---|---|---|
//! | PA0 (A0) | ADC1 IN1 | structure displacement x |
//! | PA1 (A1) | ADC1 IN2 | base displacement z |
//! | PA2, PA3 | LPUART1 | the line: the debugger's serial port, 921 600 baud |
//! | PA4 (A2) | DAC1 OUT1 | drive; the middle of its span is no drive |
//! | PA5 | GPIO | the board's LED |
//!
//! The clock is the board's 24 MHz crystal: the internal oscillator's ±1 % would be a sweep's worth of frequency.
//! TIM3 starts a conversion of both channels every 100 µs; DMA collects a tick's worth in each half of a ring, and the
//! half's interrupt is the control tick. The converter averages 16 conversions into one 16-bit sample, z 22.6 µs
//! after x (0.02° at 3 Hz).

use damprig_core::rig::{SUBSAMPLES, Sensors, TICK_HZ};
use damprig_device::calibration::{Calibration, LOST_BLOCK};
use embassy_stm32::adc::{self, Adc, AdcChannel, AdcConfig, RingBufferedAdc, SampleTime};
use embassy_stm32::dac::{DacChannel, Value};
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::interrupt::{self, InterruptExt, Priority};
use embassy_stm32::mode::Blocking;
use embassy_stm32::rcc;
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::{MasterMode, RoundTo, Timer};
use embassy_stm32::usart::{self, BufferedUart, BufferedUartRx, BufferedUartTx};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Config, bind_interrupts, dma, pac, peripherals, triggers};
use static_cell::{ConstStaticCell, StaticCell};

/// The board's name in the protocol.
pub const NAME: &str = "nucleo-g474re";

/// Bits per second of the line.
const BAUD: u32 = damprig_device::outbox::BAUD;

/// Sixteen 12-bit conversions added up.
const INPUT_FULL_SCALE_COUNTS: u16 = 16 * 4_095;

/// The output's 12 bits.
const OUTPUT_FULL_SCALE_COUNTS: u16 = 4_095;

/// The shaker's displacement at the ends of the output's span, ± m. Assumed.
const DRIVE_RANGE_M: f32 = 0.005;

const CALIBRATION: Calibration = Calibration::assumed(INPUT_FULL_SCALE_COUNTS, OUTPUT_FULL_SCALE_COUNTS, DRIVE_RANGE_M);

/// Without a tick for this long the watchdog resets the board: its output goes off. µs.
const WATCHDOG_US: u32 = 20_000;

/// x and z of every sub-sample of a tick.
const BLOCK: usize = 2 * SUBSAMPLES;

/// Room for 5 ms of received bytes while the thread executor is busy.
const RECEIVE_BUFFER: usize = 512;

/// Two telemetry messages.
const TRANSMIT_BUFFER: usize = 1024;

bind_interrupts!(struct Interrupts {
    DMA1_CHANNEL1 => dma::InterruptHandler<peripherals::DMA1_CH1>;
    LPUART1 => usart::BufferedInterruptHandler<peripherals::LPUART1>;
});

/// What the board has, each part ready for the task that will own it.
pub struct Board {
    /// The converters and outputs of the control tick.
    pub bench: Bench,
    /// From the host.
    pub receiver: BufferedUartRx<'static>,
    /// To the host.
    pub transmitter: BufferedUartTx<'static>,
    /// The board's LED.
    pub led: Output<'static>,
}

/// Sets the clocks, takes the peripherals and starts sampling. To be called once.
pub fn init() -> Board {
    let mut config = Config::default();
    config.rcc = clocks();
    let p = embassy_stm32::init(config);

    // A debugger that halts the core does not count as a stall.
    pac::DBGMCU.apb1lfzr().modify(|freeze| freeze.set_iwdg(true));

    // The line never delays the tick; the executor of the tick sits between them.
    interrupt::LPUART1.set_priority(Priority::P8);

    let drive = Drive::new(DacChannel::new_blocking(p.DAC1, p.PA4));
    let sampling = Sampling::new(p.ADC1, p.DMA1_CH1, p.TIM3, p.PA0.degrade_adc(), p.PA1.degrade_adc());

    static TRANSMIT: ConstStaticCell<[u8; TRANSMIT_BUFFER]> = ConstStaticCell::new([0; TRANSMIT_BUFFER]);
    static RECEIVE: ConstStaticCell<[u8; RECEIVE_BUFFER]> = ConstStaticCell::new([0; RECEIVE_BUFFER]);
    let mut line = usart::Config::default();
    line.baudrate = BAUD;
    let line = BufferedUart::new(p.LPUART1, p.PA3, p.PA2, TRANSMIT.take(), RECEIVE.take(), Interrupts, line)
        .expect("the LPUART's clock carries 921 600 baud");
    let (transmitter, receiver) = line.split();

    Board {
        bench: Bench { sampling, drive, watchdog: IndependentWatchdog::new(p.IWDG, WATCHDOG_US) },
        receiver,
        transmitter,
        led: Output::new(p.PA5, Level::Low, Speed::Low),
    }
}

/// 24 MHz crystal / 6 · 85 / 2 = 170 MHz for the core, the buses and the converters.
fn clocks() -> rcc::Config {
    let mut clocks = rcc::Config::new();
    clocks.hse = Some(rcc::Hse { freq: Hertz::mhz(24), mode: rcc::HseMode::Oscillator });
    clocks.pll = Some(rcc::Pll {
        source: rcc::PllSource::HSE,
        prediv: rcc::PllPreDiv::DIV6,
        mul: rcc::PllMul::MUL85,
        divp: None,
        divq: None,
        divr: Some(rcc::PllRDiv::DIV2),
    });
    clocks.sys = rcc::Sysclk::PLL1_R;
    clocks.boost = true;
    clocks.mux.adc12sel = rcc::mux::Adcsel::SYS;
    clocks
}

/// What the control tick reads and sets.
pub struct Bench {
    sampling: Sampling,
    drive: Drive,
    watchdog: IndependentWatchdog<'static, peripherals::IWDG>,
}

impl Bench {
    /// Starts sampling and the watchdog.
    pub fn start(&mut self) {
        self.sampling.start();
        self.watchdog.unleash();
    }

    /// Waits for a tick's block of samples. One that came too late to be read is [`LOST_BLOCK`].
    pub async fn next_block(&mut self) -> Sensors {
        let sensors = self.sampling.next_block().await;
        self.watchdog.pet();
        sensors
    }

    /// Sets the demanded base displacement, m.
    pub fn set_drive(&mut self, demand_m: f32) {
        self.drive.set(demand_m);
    }
}

/// Both displacement channels at 10 kHz.
struct Sampling {
    ring: RingBufferedAdc<'static, peripherals::ADC1>,
    trigger: Timer<'static, peripherals::TIM3>,
}

impl Sampling {
    fn new(
        adc: embassy_stm32::Peri<'static, peripherals::ADC1>,
        dma: embassy_stm32::Peri<'static, peripherals::DMA1_CH1>,
        timer: embassy_stm32::Peri<'static, peripherals::TIM3>,
        x: adc::AnyAdcChannel<'static, peripherals::ADC1>,
        z: adc::AnyAdcChannel<'static, peripherals::ADC1>,
    ) -> Self {
        let trigger = Timer::new(timer);
        trigger.set_frequency(Hertz((TICK_HZ * SUBSAMPLES as f32) as u32), RoundTo::Slower);
        trigger.set_master_mode(MasterMode::UPDATE);

        let oversampling = AdcConfig {
            oversampling_ratio: Some(3), // 16 conversions …
            oversampling_shift: Some(0), // … added up
            oversampling_mode: Some((adc::Rovsm::RESUMED, adc::Trovs::AUTOMATIC, true)),
            ..AdcConfig::default()
        };
        static RING: StaticCell<[u16; 2 * BLOCK]> = StaticCell::new();
        let ring = Adc::new(adc, oversampling).into_ring_buffered(
            dma,
            RING.init([0; 2 * BLOCK]),
            Interrupts,
            [(x, SampleTime::CYCLES47_5), (z, SampleTime::CYCLES47_5)].into_iter(),
            triggers::TIM3_TRGO,
            adc::Exten::RISING_EDGE,
        );
        Self { ring, trigger }
    }

    fn start(&mut self) {
        self.ring.start();
        self.trigger.start();
    }

    async fn next_block(&mut self) -> Sensors {
        let mut block = [0; BLOCK];
        match self.ring.read(&mut block).await {
            Ok(_) => CALIBRATION.sensors(&block),
            Err(_) => {
                defmt::error!("a block of samples was overwritten before it was read");
                LOST_BLOCK
            }
        }
    }
}

/// The analogue output of the drive.
struct Drive {
    output: DacChannel<'static, Blocking>,
}

impl Drive {
    /// The output comes on at 0 V, the negative end, and is set to no drive at once; the drive's relay, open until the
    /// program closes it, keeps that from the shaker.
    fn new(output: DacChannel<'static, Blocking>) -> Self {
        let mut drive = Self { output };
        drive.set(0.0);
        drive
    }

    fn set(&mut self, demand_m: f32) {
        self.output.set(Value::Bit12Right(CALIBRATION.drive.to_counts(demand_m, OUTPUT_FULL_SCALE_COUNTS)));
    }
}
