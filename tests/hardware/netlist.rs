//! Reads firmware/hardware/netlist.toml: parts with values and nets, dividers and channels.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use damprig_tests::support::images::project;
use serde::Deserialize;

use super::nodal::Network;

/// The netlist as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Netlist {
    /// Pins that the NUCLEO board connects itself.
    pub board: BTreeMap<String, String>,
    pub part: Vec<Part>,
    pub divider: Vec<Divider>,
    pub channel: Vec<Channel>,
}

/// A part outside the dividers.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    #[serde(rename = "ref")]
    pub reference: String,
    pub value: String,
    #[serde(default)]
    pub tolerance: f64,
    pub nets: Option<[String; 2]>,
    #[serde(default)]
    pub pins: BTreeMap<String, String>,
    #[serde(rename = "use")]
    pub purpose: String,
}

/// A network between a sensor and a pin.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Divider {
    pub name: String,
    pub sensor: String,
    pub span_v: Option<[f64; 2]>,
    pub span_a: Option<[f64; 2]>,
    pub source_ohm: f64,
    pub overvoltage_v: f64,
    /// Voltage behind the follower when nothing is connected; 0 V without a follower.
    #[serde(default)]
    pub open_v: f64,
    pub series: String,
    pub to_ground: Option<String>,
    pub to_supply: Option<String>,
    pub shunt: Option<String>,
    pub filter: String,
    pub clamp: String,
    pub follower: Option<String>,
    pub follower_series: Option<String>,
    pub pull_down: Option<String>,
    pub fuse: Option<String>,
}

/// An analogue input.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Channel {
    pub pin: String,
    pub n: u32,
    pub signal: String,
    pub divider: String,
    pub allowed: Vec<String>,
}

impl Netlist {
    pub fn read() -> Self {
        let path = project().join("firmware/hardware/netlist.toml");
        toml::from_str(&fs::read_to_string(&path).unwrap())
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    }

    pub fn part(&self, reference: &str) -> &Part {
        let part = self.part.iter().find(|part| part.reference == reference);
        part.unwrap_or_else(|| panic!("no part {reference} in the netlist"))
    }

    pub fn divider(&self, name: &str) -> &Divider {
        let divider = self.divider.iter().find(|divider| divider.name == name);
        divider.unwrap_or_else(|| panic!("no divider {name} in the netlist"))
    }

    /// The controller's pins that the netlist uses.
    pub fn mcu_pins(&self) -> BTreeSet<String> {
        let nets = self.part.iter().flat_map(Part::connected);
        let others = self.channel.iter().map(|channel| &channel.pin).chain(self.board.keys());
        nets.chain(others).filter(|net| is_mcu_pin(net)).cloned().collect()
    }

    /// Value of every part by its reference; sections of one chip count as one.
    pub fn values(&self) -> BTreeMap<String, String> {
        let mut values = BTreeMap::new();
        for part in &self.part {
            // U1A is a section of U1, S1.1 a contact of S1.
            let whole = part.reference.split('.').next().unwrap_or_default();
            let whole = whole.trim_end_matches(['A', 'B', 'C', 'D']);
            values.insert(whole.to_string(), part.value.clone());
        }
        for channel in &self.channel {
            values.extend(self.divider(&channel.divider).values(channel.n));
        }
        values
    }

    /// The drive from PA4 to the amplifier's input with the relay closed; `resistor` gives each resistor its value.
    pub fn drive(&self, supply_v: f64, resistor: impl Fn(&Part) -> f64) -> Network {
        let mut network = Network::default();
        network.source(supply_v, "3V3");
        let nets = ["PA4", "BUF", "HALF", "MID", "SUM", "INV", "DIFF", "FILT", "OUT", "AMP"];
        for part in &self.part {
            match (&part.nets, part.reference.chars().next()) {
                (Some([from, to]), Some(kind @ ('R' | 'C')))
                    if [from, to].iter().any(|net| nets.contains(&net.as_str())) =>
                {
                    if kind == 'R' {
                        network.resistor(resistor(part), from, to);
                    } else {
                        network.capacitor(quantity(&part.value, "F"), from, to);
                    }
                }
                (None, Some('U')) if part.pins.contains_key("plus") => {
                    network.amplifier(&part.pins["plus"], &part.pins["minus"], &part.pins["out"]);
                }
                _ => {}
            }
        }
        let relay = self.part("K1");
        network.short(&relay.pins["common"], &relay.pins["normally_open"]);
        // The amplifier's own input.
        network.resistor(10e3, "AMP", "GND");
        network
    }
}

impl Part {
    pub fn ohm(&self) -> f64 {
        quantity(&self.value, "Ω")
    }

    /// All nets of the part.
    pub fn connected(&self) -> impl Iterator<Item = &String> {
        self.nets.iter().flatten().chain(self.pins.values())
    }
}

impl Divider {
    /// The parts of channel `n`.
    pub fn values(&self, n: u32) -> BTreeMap<String, String> {
        let parts = [
            ('R', 1, Some(&self.series)),
            ('R', 2, self.to_ground.as_ref()),
            ('R', 3, self.to_supply.as_ref()),
            ('R', 4, self.shunt.as_ref()),
            ('R', 5, self.follower_series.as_ref()),
            ('R', 6, self.pull_down.as_ref()),
            ('C', 1, Some(&self.filter)),
            ('D', 1, Some(&self.clamp)),
            ('U', 1, self.follower.as_ref()),
            ('F', 1, self.fuse.as_ref()),
        ];
        let present = parts.into_iter().filter_map(|(kind, k, value)| Some((format!("{kind}{n}{k}"), value?.clone())));
        present.collect()
    }

    /// The network at the pin `PIN`, for a source at `SOURCE` with the resistance `source_ohm`. A shunt is a source of its voltage
    /// and resistance.
    pub fn network(&self, supply_v: f64, source_ohm: f64) -> Network {
        let mut network = Network::default();
        network.source(supply_v, "3V3");
        let ohm = |value: &String| quantity(value, "Ω");
        network.resistor(ohm(&self.series) + source_ohm, "SOURCE", "PIN");
        for (value, to) in [(&self.to_ground, "GND"), (&self.to_supply, "3V3")] {
            if let Some(value) = value {
                network.resistor(ohm(value), "PIN", to);
            }
        }
        network.capacitor(quantity(&self.filter, "F"), "PIN", "GND");
        network
    }

    /// The voltages at the sensor's side of the divider over the sensor's span.
    pub fn span(&self) -> [f64; 2] {
        match (self.span_v, self.span_a, &self.shunt) {
            (Some(volts), None, None) => volts,
            (None, Some(amperes), Some(shunt)) => amperes.map(|current| current * quantity(shunt, "Ω")),
            _ => panic!("divider {}: a span of volts, or of amperes with a shunt", self.name),
        }
    }
}

pub fn is_mcu_pin(net: &str) -> bool {
    let mut characters = net.chars();
    characters.next() == Some('P')
        && characters.next().is_some_and(|port| port.is_ascii_uppercase())
        && net.len() > 2
        && characters.all(|digit| digit.is_ascii_digit())
}

/// Reads a value with its unit, as `5.1 kΩ`.
///
/// # Panics
/// Another unit, or no number.
pub fn quantity(value: &str, unit: &str) -> f64 {
    let parts = value.split_once(' ').and_then(|(number, prefix)| Some((number, prefix.strip_suffix(unit)?)));
    let (number, prefix) = parts.unwrap_or_else(|| panic!("{value} is not a number of {unit}"));
    let factor = match prefix {
        "" => 1.0,
        "k" => 1e3,
        "M" => 1e6,
        "µ" => 1e-6,
        "n" => 1e-9,
        "p" => 1e-12,
        _ => panic!("{value}: unknown prefix {prefix}"),
    };
    number.parse::<f64>().unwrap_or_else(|error| panic!("{value}: {error}")) * factor
}
