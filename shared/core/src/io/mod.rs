//! Input and output types of the control tick: sensors, actuators, channels, scales and calibration.
//!
//! This is the lowest layer of the crate. Every other module imports these types from here, by one path each.

mod actuators;
mod calibration;
mod counted_block;
mod drive_range;
mod invalid;
mod rail;
mod rate;
mod reading;
mod scale;
mod sensor;
mod sensors;

pub use actuators::{Actuators, Motor};
pub use calibration::{Calibration, SLOW_BLOCK, SLOW_CHANNELS, SlowBlock, WALL_BLOCK};
pub use counted_block::CountedBlock;
pub use drive_range::{AboveLimit, DriveRange};
pub use invalid::{Invalid, finite, not_negative, positive, require};
pub use rail::{RAIL_SHARE, Rail, Usable};
pub use rate::{SUBSAMPLES, TICK_HZ, WALL_SUBSAMPLES};
pub use reading::{Reading, Readings};
pub use scale::{
    DisplacementScale, DriveScale, ForceScale, OUTPUT_FULL_SCALE_COUNTS, SLOW_FULL_SCALE_COUNTS, SLOW_USABLE,
    WALL_FULL_SCALE_COUNTS, WALL_USABLE,
};
pub use sensor::{SENSORS, Sensor, SensorSet};
pub use sensors::{Sensors, WallCounts};
