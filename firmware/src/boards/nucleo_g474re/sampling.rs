//! Samples the sensors: x, z and spring force at 10 kHz on ADC1, oversampled; both wall forces at 50 kHz on ADC2.
//!
//! TIM3 starts ADC1's sequence every 100 µs, TIM4 ADC2's every 20 µs. DMA fills a ring of two halves for each
//! converter, one half per tick. A full half of ADC1's ring wakes the control tick, which reads that half in place.
//! The timers share one clock, so the rings stay in step. ADC2 is started first and makes single conversions, so its
//! half is full when ADC1's is.
//!
//! After a lost block both timers, converters and DMA channels are stopped and restarted. Both rings then start again
//! with their first half, and the age of the next block is the usual one.

use core::future::poll_fn;
use core::sync::atomic::{AtomicU16, AtomicU32, Ordering};
use core::task::Poll;

use damprig_core::io::{
    Calibration, SLOW_BLOCK, SUBSAMPLES, Sensors, SlowBlock, TICK_HZ, WALL_BLOCK, WALL_SUBSAMPLES, WallCounts,
};
use embassy_stm32::adc::{self, Adc, AdcConfig, AnyAdcChannel};
use embassy_stm32::interrupt::{self, InterruptExt, Priority};
use embassy_stm32::pac::adc::regs::{Smpr, Sqr1};
use embassy_stm32::pac::adc::vals::{Adstp, Dmacfg, Dmaen, Exten, SampleTime};
use embassy_stm32::pac::bdma::vals::{Dir, Pl, Size};
use embassy_stm32::timer::CoreInstance;
use embassy_stm32::timer::low_level::{MasterMode, Timer};
use embassy_stm32::{Peri, pac, peripherals};
use embassy_sync::waitqueue::AtomicWaker;

use super::clock::CORE_HZ;
use super::supply;

/// Peripherals that sampling takes. The channels of the pins are [`SLOW_INPUTS`] and [`WALL_INPUTS`].
pub struct SamplingParts {
    /// ADC1, its DMA channel and its timer.
    pub slow:
        (Peri<'static, peripherals::ADC1>, Peri<'static, peripherals::DMA1_CH1>, Peri<'static, peripherals::TIM3>),
    /// Pins of x, z and spring force.
    pub slow_pins: [AnyAdcChannel<'static, peripherals::ADC1>; 3],
    /// ADC2, its DMA channel and its timer.
    pub walls:
        (Peri<'static, peripherals::ADC2>, Peri<'static, peripherals::DMA1_CH2>, Peri<'static, peripherals::TIM4>),
    /// Pins of the force sensors at −d and at +d.
    pub wall_pins: [AnyAdcChannel<'static, peripherals::ADC2>; 2],
}

/// Channels of ADC1: x, z, spring force.
const SLOW_INPUTS: [u8; 3] = [1, 2, 6];

/// Channels of ADC2: the wall at −d, the wall at +d.
const WALL_INPUTS: [u8; 2] = [7, 8];

/// ADC1's ring: each half has `SUBSAMPLES` readings of the three inputs. DMA writes the ring; the core only reads it,
/// through atomics.
static SLOW_RING: [[AtomicU16; SLOW_BLOCK]; 2] = [const { [const { AtomicU16::new(0) }; SLOW_BLOCK] }; 2];

/// ADC2's ring: a word has both wall forces, the wall at −d in its low half.
static WALL_RING: [[AtomicU32; WALL_SUBSAMPLES]; 2] = [const { [const { AtomicU32::new(0) }; WALL_SUBSAMPLES] }; 2];

/// Number of halves of ADC1's ring that have been filled since sampling was started.
static HALVES_FILLED: AtomicU32 = AtomicU32::new(0);

static TICK: AtomicWaker = AtomicWaker::new();

/// A converter and the DMA channel that stores its results.
struct Converter {
    adc: pac::adc::Adc,
    /// Channel of DMA1, from 0.
    channel: usize,
    ring: *const u16,
    ring_readings: u16,
}

// SAFETY: the ring is a static variable that only DMA writes.
unsafe impl Send for Converter {}

impl Converter {
    /// Sets a calibrated converter up to convert `inputs` in sequence at each rising edge of `trigger` (RM0440, table
    /// 163), and its DMA channel with the multiplexer's `request` (RM0440, table 91). Does not start it.
    fn new(
        adc: pac::adc::Adc,
        inputs: &[u8],
        sample_time: SampleTime,
        trigger: u8,
        (channel, request): (usize, u8),
        (ring, ring_readings): (*const u16, usize),
    ) -> Self {
        let (mut times, mut sequence) = (Smpr::default(), Sqr1::default());
        sequence.set_l(inputs.len() as u8 - 1);
        for (rank, input) in inputs.iter().enumerate() {
            sequence.set_sq(rank, *input);
            times.set_smp(usize::from(*input), sample_time);
        }
        adc.smpr().write_value(times);
        adc.sqr1().write_value(sequence);
        adc.cfgr().modify(|configuration| {
            configuration.set_dmaen(Dmaen::ENABLE);
            configuration.set_dmacfg(Dmacfg::CIRCULAR);
            configuration.set_extsel(trigger);
            configuration.set_exten(Exten::RISING_EDGE);
        });
        pac::DMAMUX1.ccr(channel).write(|multiplexer| multiplexer.set_dmareq_id(request));
        Self { adc, channel, ring, ring_readings: ring_readings as u16 }
    }

    /// Starts with the first half of the ring; with `interrupts`, each full half raises an interrupt.
    fn start(&self, interrupts: bool) {
        let dma = pac::DMA1.ch(self.channel);
        pac::DMA1.ifcr().write(|flags| flags.set_gif(self.channel, true));
        dma.par().write_value(self.adc.dr().as_ptr() as u32);
        dma.mar().write_value(self.ring as u32);
        dma.ndtr().write(|count| count.set_ndt(self.ring_readings));
        dma.cr().write(|control| {
            control.set_dir(Dir::FROM_PERIPHERAL);
            control.set_circ(true);
            control.set_minc(true);
            control.set_psize(Size::BITS16);
            control.set_msize(Size::BITS16);
            control.set_pl(Pl::VERY_HIGH);
            control.set_htie(interrupts);
            control.set_tcie(interrupts);
            control.set_en(true);
        });
        // A converter with an overrun no longer requests transfers.
        self.adc.isr().write(|flags| flags.set_ovr(true));
        self.adc.cr().modify(|control| control.set_adstart(true));
    }

    /// Stops the conversions and the transfers.
    fn stop(&self) {
        if self.adc.cr().read().adstart() {
            self.adc.cr().modify(|control| control.set_adstp(Adstp::STOP));
            while self.adc.cr().read().adstart() {}
        }
        pac::DMA1.ch(self.channel).cr().modify(|control| control.set_en(false));
    }

    /// Whether this half has been filled since the last call and the other half has not.
    fn takes_half(&self, half: usize) -> bool {
        let flags = pac::DMA1.isr().read();
        let filled = [flags.htif(self.channel), flags.tcif(self.channel)];
        pac::DMA1.ifcr().write(|flags| flags.set_gif(self.channel, true));
        filled[half] && !filled[1 - half]
    }
}

/// Counts full halves: two if the interrupt was late for one.
#[embassy_stm32::interrupt]
unsafe fn DMA1_CHANNEL1() {
    let flags = pac::DMA1.isr().read();
    pac::DMA1.ifcr().write(|cleared| cleared.set_gif(0, true));
    let filled = u32::from(flags.htif(0)) + u32::from(flags.tcif(0));
    HALVES_FILLED.store(HALVES_FILLED.load(Ordering::Relaxed).wrapping_add(filled), Ordering::Release);
    TICK.wake();
}

/// Both converters.
pub struct Sampling {
    slow: Converter,
    walls: Converter,
    slow_trigger: Timer<'static, peripherals::TIM3>,
    wall_trigger: Timer<'static, peripherals::TIM4>,
    /// Number of halves taken since sampling was started.
    taken: u32,
    slow_block: SlowBlock,
    wall_block: [WallCounts; WALL_SUBSAMPLES],
    /// The last blocks were overwritten before they could be read.
    is_lost: bool,
    overruns: u32,
    supply_v: f32,
    /// Nobody else gets them.
    _pins: ([AnyAdcChannel<'static, peripherals::ADC1>; 3], [AnyAdcChannel<'static, peripherals::ADC2>; 2]),
}

impl Sampling {
    /// Sets the converters up without starting them.
    pub fn new(parts: SamplingParts) -> Self {
        let slow_trigger = Timer::new(parts.slow.2);
        set_rate(&slow_trigger, TICK_HZ as u32 * SUBSAMPLES as u32);
        slow_trigger.set_master_mode(MasterMode::UPDATE);
        let wall_trigger = Timer::new(parts.walls.2);
        set_rate(&wall_trigger, TICK_HZ as u32 * WALL_SUBSAMPLES as u32);
        wall_trigger.set_master_mode(MasterMode::UPDATE);

        let oversampling = AdcConfig {
            oversampling_ratio: Some(3), // supply::ADDED_UP = 16 conversions …
            oversampling_shift: Some(0), // … added up
            oversampling_mode: Some((adc::Rovsm::RESUMED, adc::Trovs::AUTOMATIC, true)),
            ..AdcConfig::default()
        };
        let supply_v = supply::measure(Adc::new(parts.slow.0, oversampling));
        Adc::new(parts.walls.0, AdcConfig::default());
        let slow_ring = (SLOW_RING.as_ptr().cast(), 2 * SLOW_BLOCK);
        let wall_ring = (WALL_RING.as_ptr().cast(), 2 * WALL_BLOCK);
        Self {
            slow: Converter::new(pac::ADC1, &SLOW_INPUTS, SampleTime::CYCLES47_5, 4, (0, 5), slow_ring),
            walls: Converter::new(pac::ADC2, &WALL_INPUTS, SampleTime::CYCLES24_5, 12, (1, 36), wall_ring),
            slow_trigger,
            wall_trigger,
            taken: 0,
            slow_block: SlowBlock::default(),
            wall_block: Sensors::default().walls,
            is_lost: true,
            overruns: 0,
            supply_v,
            _pins: (parts.slow_pins, parts.wall_pins),
        }
    }

    /// Starts both converters. Call once.
    pub fn start(&mut self) {
        // The priority is below the stall watch and above the control tick.
        interrupt::DMA1_CHANNEL1.set_priority(Priority::P4);
        // SAFETY: the handler above is ready, and no critical section relies on this mask.
        unsafe { interrupt::DMA1_CHANNEL1.enable() };
        self.begin();
    }

    fn begin(&mut self) {
        self.taken = 0;
        HALVES_FILLED.store(0, Ordering::Relaxed);
        self.walls.start(false);
        self.slow.start(true);
        self.wall_trigger.start();
        self.slow_trigger.start();
    }

    fn restart(&mut self) {
        self.slow_trigger.stop();
        self.wall_trigger.stop();
        self.slow.stop();
        self.walls.stop();
        self.slow_trigger.reset();
        self.wall_trigger.reset();
        self.begin();
    }

    /// Waits for the blocks of a tick and reads them.
    pub async fn next_block(&mut self) {
        let filled = poll_fn(|context| {
            TICK.register(context.waker());
            let filled = HALVES_FILLED.load(Ordering::Acquire);
            if filled == self.taken { Poll::Pending } else { Poll::Ready(filled) }
        })
        .await;
        let half = (self.taken % 2) as usize;
        self.taken = self.taken.wrapping_add(1);
        self.is_lost = filled != self.taken || !self.walls.takes_half(half);
        for (to, from) in self.slow_block.as_flattened_mut().iter_mut().zip(&SLOW_RING[half]) {
            *to = from.load(Ordering::Relaxed);
        }
        for (to, from) in self.wall_block.iter_mut().zip(&WALL_RING[half]) {
            let word = from.load(Ordering::Relaxed);
            *to = WallCounts::new(word as u16, (word >> 16) as u16);
        }
        // Meanwhile DMA fills the other half; once that is full, it overwrites this one.
        self.is_lost |= HALVES_FILLED.load(Ordering::Acquire) != self.taken;
        if self.is_lost {
            self.overruns = self.overruns.saturating_add(1);
            self.restart();
        }
    }

    /// The blocks converted to physical units; NaN if they were overwritten before they could be read.
    pub fn sensors(&self, calibration: &Calibration) -> Sensors {
        if self.is_lost {
            return Sensors::lost();
        }
        let readings = calibration.readings(&self.slow_block);
        // The board adds the switches.
        Sensors { readings, walls: self.wall_block, at_limit: false, emergency_stop: false }
    }

    /// Supply of the converters, measured before sampling was set up, V.
    pub fn supply_v(&self) -> f32 {
        self.supply_v
    }

    /// Blocks lost so far.
    pub fn overruns(&self) -> u32 {
        self.overruns
    }
}

/// Sets the update rate of a timer: a period of 17 000 or 3 400 clock cycles, without prescaler.
fn set_rate<T: CoreInstance>(timer: &Timer<'static, T>, rate_hz: u32) {
    let registers = timer.regs_core();
    registers.psc().write_value(0);
    registers.arr().write(|r| r.set_arr((CORE_HZ / rate_hz - 1) as u16));
}
