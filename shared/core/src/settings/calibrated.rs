//! When each channel was calibrated, for how long that holds, and what the fit left over. The controller keeps these values for
//! the host; no decision depends on them.

use crate::io::{Invalid, not_negative, require};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Largest date: 31 December 9999, in days since 1 January 1970.
const LAST_DAY: f32 = 2_932_896.0;

const WHOLE_DAYS: &str = "whole days since 1970-01-01 up to the year 9999; 0 for never";

macro_rules! records {
    ($($(#[doc = $doc:literal])+ $record:ident: $residual:ident,)+) => {$(
        $(#[doc = $doc])+
        #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
        #[serde(default)]
        pub struct $record {
            /// Day of the calibration, whole days since 1970-01-01; 0 for never.
            pub date_days: f32,
            /// Days for which it is valid; 0 for ever.
            pub valid_days: f32,
            /// RMS residual of the fit.
            pub $residual: f32,
        }

        impl $record {
            /// Date and validity without the residual.
            #[must_use]
            pub fn period(&self) -> Period {
                Period { date_days: self.date_days, valid_days: self.valid_days }
            }

            fn validate(&self, names: [&'static str; 3]) -> Result<(), Invalid> {
                let is_date = (0.0..=LAST_DAY).contains(&self.date_days) && self.date_days == self.date_days as u32 as f32;
                require(is_date, names[0], f64::from(self.date_days), WHOLE_DAYS)?;
                not_negative(names[1], f64::from(self.valid_days))?;
                not_negative(names[2], f64::from(self.$residual))
            }
        }
    )+};
}

records! {
    /// The calibration of a displacement.
    LengthRecord: residual_m,
    /// The calibration of a force.
    ForceRecord: residual_n,
    /// The calibration of impulses.
    ImpulseRecord: residual_n_s,
}

/// When a channel was calibrated, and for how long that is valid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Period {
    /// Day of the calibration, whole days since 1970-01-01; 0 for never.
    pub date_days: f32,
    /// Days for which it is valid; 0 for ever.
    pub valid_days: f32,
}

impl Period {
    /// The channel was never calibrated.
    #[must_use]
    pub fn is_never(&self) -> bool {
        self.date_days <= 0.0
    }

    /// The calibration is no longer valid on this day.
    #[must_use]
    pub fn has_expired(&self, today_days: f32) -> bool {
        !self.is_never() && self.valid_days > 0.0 && today_days > self.date_days + self.valid_days
    }
}

/// The latest calibration of every channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
#[serde(default)]
pub struct Calibrated {
    /// Structure displacement x.
    pub x: LengthRecord,
    /// Base displacement z.
    pub z: LengthRecord,
    /// Gain ratio and time difference of x and z.
    pub r#match: LengthRecord,
    /// Force sensor of the friction damper's spring.
    pub spring: ForceRecord,
    /// Force sensors of the walls.
    pub walls: ImpulseRecord,
    /// The drive.
    pub drive: LengthRecord,
    /// Stiffness of the friction damper's spring.
    pub friction_spring: ForceRecord,
}

impl Calibrated {
    /// Name and period of every channel, in the order of the settings.
    #[must_use]
    pub fn periods(&self) -> [(&'static str, Period); 7] {
        let Self { x, z, r#match, spring, walls, drive, friction_spring } = self;
        [
            ("x", x.period()),
            ("z", z.period()),
            ("match", r#match.period()),
            ("spring", spring.period()),
            ("walls", walls.period()),
            ("drive", drive.period()),
            ("friction-spring", friction_spring.period()),
        ]
    }

    /// Checks every value.
    ///
    /// # Errors
    /// Names the first value out of range.
    pub fn validate(&self) -> Result<(), Invalid> {
        macro_rules! names {
            ($channel:literal, $residual:literal) => {
                [
                    concat!("calibrated.", $channel, ".date_days"),
                    concat!("calibrated.", $channel, ".valid_days"),
                    concat!("calibrated.", $channel, ".", $residual),
                ]
            };
        }
        self.x.validate(names!("x", "residual_m"))?;
        self.z.validate(names!("z", "residual_m"))?;
        self.r#match.validate(names!("match", "residual_m"))?;
        self.spring.validate(names!("spring", "residual_n"))?;
        self.walls.validate(names!("walls", "residual_n_s"))?;
        self.drive.validate(names!("drive", "residual_m"))?;
        self.friction_spring.validate(names!("friction_spring", "residual_n"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_calibration_expires_the_day_after_its_last_valid_one() {
        let period = Period { date_days: 20_000.0, valid_days: 365.0 };
        assert!(!period.has_expired(20_365.0) && period.has_expired(20_366.0) && !period.is_never());
        assert!(!Period { valid_days: 0.0, ..period }.has_expired(90_000.0), "valid for ever");
        let never = Period { date_days: 0.0, valid_days: 1.0 };
        assert!(never.is_never() && !never.has_expired(20_000.0));
    }

    #[test]
    fn a_value_out_of_range_is_refused_by_name() {
        let with = |record| Calibrated { walls: record, ..Calibrated::default() }.validate().unwrap_err().parameter;
        let good = ImpulseRecord { date_days: 20_000.0, valid_days: 365.0, residual_n_s: 1e-3 };
        assert!(Calibrated { walls: good, ..Calibrated::default() }.validate().is_ok());
        assert_eq!(with(ImpulseRecord { date_days: 20_000.5, ..good }), "calibrated.walls.date_days");
        assert_eq!(with(ImpulseRecord { date_days: -1.0, ..good }), "calibrated.walls.date_days");
        assert_eq!(with(ImpulseRecord { valid_days: f32::NAN, ..good }), "calibrated.walls.valid_days");
        assert_eq!(with(ImpulseRecord { residual_n_s: -1.0, ..good }), "calibrated.walls.residual_n_s");
    }
}
