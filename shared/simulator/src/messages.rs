//! The messages from a host to the simulator, carried inside a request: see [`Request::Simulator`].

use damprig_core::rig::Rejected;
use damprig_protocol::{Request, SIMULATOR_BYTES};
use heapless::Vec;
use postcard_schema::Schema;
use postcard_schema::key::Key;
use serde::{Deserialize, Serialize};

use crate::plant::{Bench, Blow, InjectedFault, PlantConfig};

/// A message to the simulator.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant)] // There is no allocator, so a variant cannot be boxed.
pub enum ToSimulator {
    /// Replace the plant. The friction spring's drive must be homed again.
    SetPlant(PlantConfig),
    /// Inject a fault into the plant, or repair it.
    Inject(InjectedFault),
    /// Put targets before the displacement sensors and weights on the force sensor.
    Place(Bench),
    /// Hit a wall.
    Blow(Blow),
}

/// Hash of the layout of [`ToSimulator`], names included. It precedes every message, because the protocol's own
/// schema hash does not cover this type.
const SCHEMA: [u8; 8] = Key::for_path::<ToSimulator>("to_simulator").to_bytes();

impl ToSimulator {
    /// Makes the request that carries this message.
    #[must_use]
    pub fn request(&self) -> Request {
        let mut bytes = Vec::new();
        // Cannot fail: a test encodes the longest message.
        let _ = bytes.resize_default(SIMULATOR_BYTES);
        let (schema, body) = bytes.split_at_mut(SCHEMA.len());
        schema.copy_from_slice(&SCHEMA);
        let length = postcard::to_slice(self, body).map_or(0, |body| body.len());
        bytes.truncate(SCHEMA.len() + length);
        Request::Simulator(bytes)
    }

    /// Decodes the message that a request carries.
    ///
    /// # Errors
    /// The message is of another version of the simulator, or damaged.
    pub fn decode(bytes: &[u8]) -> Result<Self, Rejected> {
        let body = bytes.strip_prefix(&SCHEMA);
        let body = body.ok_or(Rejected::not_here("the message is for another version of the simulator"))?;
        match postcard::take_from_bytes(body) {
            Ok((message, [])) => Ok(message),
            _ => Err(Rejected::not_here("the message to the simulator is damaged")),
        }
    }
}

/// Makes the request that sets the plant.
#[must_use]
pub fn set_plant(config: PlantConfig) -> Request {
    ToSimulator::SetPlant(config).request()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::spring::SpringPlant;
    use crate::plant::walls::WallSensors;
    use crate::plant::{Base, DataSheet, Shaker, TrueScales};
    use damprig_core::io::Calibration;
    use damprig_core::model::{Cavity, FrictionDamper, Particle, SetUp, SpeedTable, Structure, Tmd, Wall};

    fn longest() -> PlantConfig {
        let mut set_up = SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038));
        let table = SpeedTable::new(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0].map(|speed| [speed, 0.6])).expect("six points");
        let wall = Wall::TableRestitution(table);
        set_up.particle = Some(Particle {
            mass_kg: 0.16,
            clearance_m: 0.0075,
            friction_coefficient: 0.08,
            wall,
            cavity: Cavity { positive_wall: Some(wall), offset_m: 0.001, inclination_deg: 30.0 },
        });
        set_up.friction_damper = Some(FrictionDamper { force_n: 0.2 });
        set_up.tmd = Some(Tmd { mass_kg: 0.16, stiffness_n_per_m: 32.8, damping_n_s_per_m: 0.7 });
        PlantConfig {
            base: Base::Shaker(Shaker::default()),
            data_sheet: Some(DataSheet::default()),
            walls: Some(WallSensors::default()),
            spring: Some(SpringPlant { seed: u64::MAX, ..SpringPlant::default() }),
            scales: Some(TrueScales::as_set(&Calibration::default())),
            ..PlantConfig::ideal(set_up)
        }
    }

    #[test]
    fn the_longest_plant_decodes_to_what_was_encoded() {
        let Request::Simulator(bytes) = set_plant(longest()) else { panic!("another request") };
        assert!(bytes.len() + 16 < SIMULATOR_BYTES, "{} bytes", bytes.len());
        assert_eq!(ToSimulator::decode(&bytes), Ok(ToSimulator::SetPlant(longest())));
    }

    #[test]
    fn another_version_and_a_damaged_message_are_rejected() {
        let Request::Simulator(mut bytes) = set_plant(longest()) else { panic!("another request") };
        assert!(ToSimulator::decode(&bytes[..bytes.len() - 1]).is_err());
        bytes[0] ^= 1;
        let Err(Rejected::NotHere { why }) = ToSimulator::decode(&bytes) else { panic!("accepted") };
        assert!(why.contains("another version"), "{why}");
    }
}
