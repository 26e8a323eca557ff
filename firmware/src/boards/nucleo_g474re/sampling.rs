//! The converters: x, z and spring force at 10 kHz on ADC1, oversampled; both wall forces at 50 kHz on ADC2, as they are.
//!
//! TIM3 starts ADC1's sequence every 100 µs, TIM4 ADC2's every 20 µs; DMA fills rings of two ticks each, and ADC1's half
//! ring wakes the control tick. The timers share one clock, so the rings stay in step; ADC2's is started first, so its
//! block is there when the tick asks for it.

use damprig_core::io::{
    Calibration, SLOW_BLOCK, SUBSAMPLES, Sensors, SlowBlock, TICK_HZ, WALL_BLOCK, WALL_SUBSAMPLES, WallCounts,
};
use embassy_stm32::adc::{self, Adc, AdcConfig, AnyAdcChannel, RingBufferedAdc, SampleTime};
use embassy_stm32::timer::CoreInstance;
use embassy_stm32::timer::low_level::{MasterMode, Timer};
use embassy_stm32::{Peri, peripherals, triggers};
use static_cell::StaticCell;

use super::Interrupts;

/// The peripherals that sampling takes.
pub struct SamplingParts {
    /// The slow converter, its DMA channel and its timer.
    pub slow:
        (Peri<'static, peripherals::ADC1>, Peri<'static, peripherals::DMA1_CH1>, Peri<'static, peripherals::TIM3>),
    /// x, z and spring force.
    pub slow_pins: [AnyAdcChannel<'static, peripherals::ADC1>; 3],
    /// The walls' converter, its DMA channel and its timer.
    pub walls:
        (Peri<'static, peripherals::ADC2>, Peri<'static, peripherals::DMA1_CH2>, Peri<'static, peripherals::TIM4>),
    /// The wall at −d, the wall at +d.
    pub wall_pins: [AnyAdcChannel<'static, peripherals::ADC2>; 2],
}

/// Both converters.
pub struct Sampling {
    slow: RingBufferedAdc<'static, peripherals::ADC1>,
    walls: RingBufferedAdc<'static, peripherals::ADC2>,
    slow_trigger: Timer<'static, peripherals::TIM3>,
    wall_trigger: Timer<'static, peripherals::TIM4>,
    slow_block: SlowBlock,
    wall_block: [WallCounts; WALL_SUBSAMPLES],
    /// The blocks came too late to be read.
    is_lost: bool,
    overruns: u32,
}

impl Sampling {
    /// Sets the converters up; nothing is converted yet.
    pub fn new(parts: SamplingParts) -> Self {
        let slow_trigger = Timer::new(parts.slow.2);
        set_rate(&slow_trigger, TICK_HZ as u32 * SUBSAMPLES as u32);
        slow_trigger.set_master_mode(MasterMode::UPDATE);
        let wall_trigger = Timer::new(parts.walls.2);
        set_rate(&wall_trigger, TICK_HZ as u32 * WALL_SUBSAMPLES as u32);
        wall_trigger.set_master_mode(MasterMode::UPDATE);

        let oversampling = AdcConfig {
            oversampling_ratio: Some(3), // 16 conversions …
            oversampling_shift: Some(0), // … added up
            oversampling_mode: Some((adc::Rovsm::RESUMED, adc::Trovs::AUTOMATIC, true)),
            ..AdcConfig::default()
        };
        static SLOW_RING: StaticCell<[u16; 2 * SLOW_BLOCK]> = StaticCell::new();
        let slow = Adc::new(parts.slow.0, oversampling).into_ring_buffered(
            parts.slow.1,
            SLOW_RING.init([0; 2 * SLOW_BLOCK]),
            Interrupts,
            parts.slow_pins.into_iter().map(|pin| (pin, SampleTime::CYCLES47_5)),
            triggers::TIM3_TRGO,
            adc::Exten::RISING_EDGE,
        );
        static WALL_RING: StaticCell<[u16; 2 * WALL_BLOCK]> = StaticCell::new();
        let walls = Adc::new(parts.walls.0, AdcConfig::default()).into_ring_buffered(
            parts.walls.1,
            WALL_RING.init([0; 2 * WALL_BLOCK]),
            Interrupts,
            parts.wall_pins.into_iter().map(|pin| (pin, SampleTime::CYCLES24_5)),
            triggers::TIM4_TRGO,
            adc::Exten::RISING_EDGE,
        );
        Self {
            slow,
            walls,
            slow_trigger,
            wall_trigger,
            slow_block: SlowBlock::default(),
            wall_block: Sensors::default().walls,
            is_lost: true,
            overruns: 0,
        }
    }

    /// Starts both.
    pub fn start(&mut self) {
        self.walls.start();
        self.slow.start();
        self.wall_trigger.start();
        self.slow_trigger.start();
    }

    /// Waits for a tick's blocks.
    pub async fn next_block(&mut self) {
        let slow_read = self.slow.read(self.slow_block.as_flattened_mut()).await;
        let walls_read = self.walls.read(counts(&mut self.wall_block)).await;
        self.is_lost = slow_read.is_err() || walls_read.is_err();
        self.overruns = self.overruns.saturating_add(u32::from(self.is_lost));
    }

    /// The blocks on their scales; NaN if they came too late to be read.
    pub fn sensors(&self, calibration: &Calibration) -> Sensors {
        if self.is_lost {
            return Sensors::lost();
        }
        let readings = calibration.readings(&self.slow_block);
        Sensors { readings, walls: self.wall_block, at_limit: false, emergency_stop: false }
    }

    /// Blocks lost so far.
    pub fn overruns(&self) -> u32 {
        self.overruns
    }
}

/// Lets a timer come round so often a second. At 170 MHz that is every 17 000 or 3 400 clocks, which it counts undivided;
/// `Timer::set_frequency` would bring the division of long numbers with it.
fn set_rate<T: CoreInstance>(timer: &Timer<'static, T>, rate_hz: u32) {
    let registers = timer.regs_core();
    registers.psc().write_value(0);
    registers.arr().write(|r| r.set_arr((timer.get_clock_frequency().0 / rate_hz - 1) as u16));
}

/// Pairs as the converter's readings, one wall after the other.
fn counts(pairs: &mut [WallCounts; WALL_SUBSAMPLES]) -> &mut [u16; WALL_BLOCK] {
    const {
        assert!(
            cfg!(target_endian = "little")
                && size_of::<[WallCounts; WALL_SUBSAMPLES]>() == size_of::<[u16; WALL_BLOCK]>()
        )
    };
    // SAFETY: a pair is one word, so it lies as two readings must and has room for them; any bits are a pair.
    unsafe { &mut *core::ptr::from_mut(pairs).cast() }
}
