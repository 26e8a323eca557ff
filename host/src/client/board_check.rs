//! Checks what a board reports of its hardware: its option bytes, the supply of its converters, and whether its channels are
//! calibrated.

use damprig_core::settings::{Calibrated, Period};
use damprig_protocol::{Description, PlantKind};

use crate::client::session::Session;
use crate::host_time;

/// Supply for which the calibration's scales hold, V.
const NOMINAL_SUPPLY_V: f32 = 3.3;

/// Deviation of the supply from which on it is reported, as a share: more than the 0.7 % by which the board's own measurement can
/// be off.
const SUPPLY_TOLERANCE: f32 = 0.01;

/// A field of the option bytes (FLASH_OPTR of the STM32G474, RM0440, section 3.7.8).
struct OptionByte {
    name: &'static str,
    low_bit: u32,
    bits: u32,
    wanted: u32,
    /// What a board with another value does.
    otherwise: &'static str,
}

/// The wanted option bytes; docs/LAB_GUIDE.md has the same table.
const OPTION_BYTES: [OptionByte; 6] = [
    OptionByte {
        name: "BOR_LEV",
        low_bit: 8,
        bits: 3,
        wanted: 4,
        otherwise: "the processor is not reset by a supply below 2.8 V; only the firmware's own supply watch opens the relay",
    },
    OptionByte {
        name: "BFB2",
        low_bit: 20,
        bits: 1,
        wanted: 0,
        otherwise: "the board may start from bank 2 of the flash, where the settings are",
    },
    OptionByte {
        name: "DBANK",
        low_bit: 22,
        bits: 1,
        wanted: 1,
        otherwise: "the flash is a single bank: the board runs on default settings and cannot save any",
    },
    OptionByte {
        name: "nSWBOOT0",
        low_bit: 26,
        bits: 1,
        wanted: 0,
        otherwise: "a high level at PB8 during a reset starts the boot loader instead of the firmware",
    },
    OptionByte {
        name: "nBOOT0",
        low_bit: 27,
        bits: 1,
        wanted: 1,
        otherwise: "with nSWBOOT0 = 0 the board starts the boot loader instead of the firmware",
    },
    OptionByte { name: "NRST_MODE", low_bit: 28, bits: 2, wanted: 3, otherwise: "the reset button may have no effect" },
];

/// What is not as it should be with the board, in words: its hardware, and calibrations that are missing or have expired.
#[must_use]
pub fn warnings(session: &Session) -> Vec<String> {
    let Description { option_bytes, supply_v, plant, .. } = session.description;
    let mut list = of(option_bytes, supply_v);
    list.extend(session.consent_warning());
    list.extend(uncalibrated(&session.settings.calibrated, plant, host_time::today_days()));
    list
}

/// The channels that were never calibrated, and those whose calibration has expired, on one line. The sensors of a simulated
/// plant need no calibration; a record of them can expire.
fn uncalibrated(calibrated: &Calibrated, plant: PlantKind, today_days: f32) -> Option<String> {
    let names = |is_one: &dyn Fn(&Period) -> bool| {
        let those = calibrated.periods().into_iter().filter(|(_, period)| is_one(period)).map(|(name, _)| name);
        those.collect::<Vec<_>>().join(", ")
    };
    let never = if plant == PlantKind::Real { names(&Period::is_never) } else { String::new() };
    let expired = names(&|period| period.has_expired(today_days));
    let parts = [("never calibrated", never), ("calibration expired", expired)];
    let told: Vec<String> =
        parts.iter().filter(|(_, names)| !names.is_empty()).map(|(what, names)| format!("{what}: {names}")).collect();
    (!told.is_empty()).then(|| format!("{} (`damprig calibrate`, docs/LAB_GUIDE.md)", told.join("; ")))
}

fn of(option_bytes: Option<u32>, supply_v: Option<f32>) -> Vec<String> {
    let mut list = Vec::new();
    if let Some(optr) = option_bytes {
        for byte in &OPTION_BYTES {
            let value = optr >> byte.low_bit & ((1 << byte.bits) - 1);
            if value != byte.wanted {
                list.push(format!(
                    "option byte {} is {value}, wanted is {}: {} (docs/LAB_GUIDE.md says how to set it)",
                    byte.name, byte.wanted, byte.otherwise
                ));
            }
        }
    }
    if let Some(supply_v) = supply_v {
        let off = supply_v / NOMINAL_SUPPLY_V - 1.0;
        if off.is_nan() || off.abs() > SUPPLY_TOLERANCE {
            list.push(format!(
                "the supply of the board's converters is {supply_v:.2} V instead of {NOMINAL_SUPPLY_V} V: every displacement, force and \
                 drive is off by {:.1} %; check the board's supply, or calibrate at this voltage",
                100.0 * off.abs()
            ));
        }
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    /// BOR_LEV = 4 and nSWBOOT0 = 0, the rest as delivered (0xffef_f8aa).
    const WANTED: u32 = 0xfbef_fcaa;

    #[test]
    fn a_board_with_the_wanted_option_bytes_and_supply_gives_no_warning() {
        assert_eq!(of(Some(WANTED), Some(3.3)), Vec::<String>::new());
        assert_eq!(of(None, None), Vec::<String>::new());
    }

    #[test]
    fn each_wrong_option_byte_is_named_with_both_values() {
        for (optr, words) in [
            (WANTED & !(7 << 8), "BOR_LEV is 0, wanted is 4"),
            (WANTED | 1 << 20, "BFB2 is 1, wanted is 0"),
            (WANTED & !(1 << 22), "DBANK is 0, wanted is 1"),
            (WANTED | 1 << 26, "nSWBOOT0 is 1, wanted is 0"),
            (WANTED & !(1 << 27), "nBOOT0 is 0, wanted is 1"),
            (WANTED & !(1 << 29), "NRST_MODE is 1, wanted is 3"),
        ] {
            let list = of(Some(optr), None);
            assert!(list.len() == 1 && list[0].contains(words), "{list:?}");
        }
        // As delivered.
        assert_eq!(of(Some(0xffef_f8aa), Some(3.3)).len(), 2);
    }

    #[test]
    fn channels_without_a_valid_calibration_are_named_on_one_line() {
        let told = |calibrated: &Calibrated, plant| uncalibrated(calibrated, plant, 20_500.0);
        let mut calibrated = Calibrated::default();
        assert_eq!(told(&calibrated, PlantKind::SimulatedF64), None);
        calibrated.x.date_days = 20_100.0;
        calibrated.x.valid_days = 365.0;
        calibrated.z = calibrated.x;
        calibrated.z.date_days = 20_200.0;
        let real = told(&calibrated, PlantKind::Real).unwrap();
        let expected = "never calibrated: match, spring, walls, drive, friction-spring; calibration expired: x (";
        assert!(real.starts_with(expected) && !real.contains('\n'), "{real}");
        let simulated = told(&calibrated, PlantKind::SimulatedF32).unwrap();
        assert!(simulated.starts_with("calibration expired: x ("), "{simulated}");
    }

    #[test]
    fn a_supply_more_than_one_percent_off_is_reported() {
        for (supply_v, is_reported) in [(3.268, false), (3.332, false), (3.26, true), (3.34, true), (f32::NAN, true)] {
            assert_eq!(!of(Some(WANTED), Some(supply_v)).is_empty(), is_reported, "{supply_v} V");
        }
        assert!(of(None, Some(3.2))[0].contains("3.20 V instead of 3.3 V"));
    }
}
