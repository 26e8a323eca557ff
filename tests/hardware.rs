//! Solves the networks of firmware/hardware/netlist.toml and compares them with what the lab guide states; compares the netlist
//! with the firmware's pins, the bill of materials and the drawings. Needs no image.

mod netlist;
mod nodal;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use damprig_core::io::DriveScale;
use damprig_tests::support::images::project;
use netlist::{Divider, Netlist, Part, is_mcu_pin, quantity};
use nodal::Network;

/// Supply of the board, V.
const SUPPLY_V: f64 = 3.3;

/// Linear range of the drive's output, V (STM32G474, data sheet).
const LINEAR_V: [f64; 2] = [0.2, 3.1];

/// The frequency of the stated lag, Hz: that of the structure.
const LAG_HZ: f64 = 2.5;

/// The output changes once per tick, s.
const TICK_S: f64 = 1e-3;

/// Forward voltage of a clamp's Schottky diode, V.
const CLAMP_V: f64 = 0.35;

fn text(path: &str) -> String {
    fs::read_to_string(project().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Requires a line of a document.
fn states(path: &str, line: &str) {
    assert!(text(path).contains(line), "{path} does not state, as computed:\n{line}");
}

/// Voltage at the amplifier's input with PA4 at a voltage, or floating.
fn at_amplifier(network: &Network, pin_v: Option<f64>, hz: f64) -> nodal::Complex {
    let mut network = network.clone();
    if let Some(volts) = pin_v {
        network.source(volts, "PA4");
    }
    network.solve(hz)["AMP"]
}

/// Largest change of a figure when every resistor is at the end of its tolerance.
fn spread(netlist: &Netlist, figure: impl Fn(&Network) -> f64) -> f64 {
    let nominal = figure(&netlist.drive(SUPPLY_V, Part::ohm));
    let moved = netlist.part.iter().filter(|part| part.reference.starts_with('R')).map(|moved| {
        let ohm = |part: &Part| part.ohm() * if part.reference == moved.reference { 1.0 + part.tolerance } else { 1.0 };
        (figure(&netlist.drive(SUPPLY_V, ohm)) - nominal).abs()
    });
    moved.sum()
}

/// Volts per volt from PA4 to the amplifier's input.
fn gain(network: &Network) -> f64 {
    let [low, high] = LINEAR_V.map(|volts| at_amplifier(network, Some(volts), 0.0).re);
    (high - low) / (LINEAR_V[1] - LINEAR_V[0])
}

/// Response from PA4 to the amplifier's input at a frequency.
fn response(network: &Network, hz: f64) -> nodal::Complex {
    // Superposition: the supply alone gives the part that does not depend on PA4.
    let [zero, one] = [0.0, 1.0].map(|volts| at_amplifier(network, Some(volts), hz));
    one - zero
}

/// The frequency at which a falling response has lost 3 dB, Hz.
fn corner(response: impl Fn(f64) -> f64) -> f64 {
    let half_power = response(0.0) / 2.0_f64.sqrt();
    let (mut low, mut high) = (1.0, 1e6);
    for _ in 0..100 {
        let middle = f64::sqrt(low * high);
        if response(middle) > half_power { low = middle } else { high = middle }
    }
    low
}

#[test]
fn the_drive_has_the_stated_scale_lag_and_reset_level() {
    let netlist = Netlist::read();
    let network = netlist.drive(SUPPLY_V, Part::ohm);
    let [low, high] = LINEAR_V.map(|volts| at_amplifier(&network, Some(volts), 0.0).re);
    let in_reset = at_amplifier(&network, None, 0.0).re;
    assert!(in_reset.abs() < 1e-9, "{in_reset} V while PA4 floats");
    let gain_spread = 100.0 * spread(&netlist, gain);
    let reset_spread = 1e3 * spread(&netlist, |network| at_amplifier(network, None, 0.0).re);
    let filter = corner(|hz| response(&network, hz).magnitude());
    let lag = -response(&network, LAG_HZ).degrees();
    let hold = 360.0 * LAG_HZ * TICK_S / 2.0;
    for line in [
        format!("| gain from PA4 to the amplifier's input | {:.3}, within {gain_spread:.1} % |", gain(&network)),
        format!("| amplifier's input for 0.2 V to 3.1 V at PA4 | {low:.2} V to +{high:.2} V |").replace('-', "−"),
        format!("| amplifier's input while PA4 floats | 0 V, within {reset_spread:.1} mV |"),
        format!("| corner of the reconstruction filter | {filter:.0} Hz |"),
        format!("| lag at 2.5 Hz of the filter | {lag:.2}° |"),
        format!("| lag at 2.5 Hz of an output held for 1 ms | {hold:.2}° |"),
        format!("| lag at 2.5 Hz in all | {:.2}° |", lag + hold),
    ] {
        states("docs/LAB_GUIDE.md", &line);
    }
}

#[test]
fn without_its_followers_the_drive_would_be_wrong() {
    let mut netlist = Netlist::read();
    // The pin drives the difference amplifier, and the filter the amplifier, themselves.
    for (follower, input, output) in [("U1A", "PA4", "BUF"), ("U1D", "FILT", "OUT")] {
        netlist.part.retain(|part| part.reference != follower);
        let nets =
            netlist.part.iter_mut().flat_map(|part| part.nets.iter_mut().flatten().chain(part.pins.values_mut()));
        nets.filter(|net| *net == output).for_each(|net| *net = input.into());
    }
    let network = netlist.drive(SUPPLY_V, Part::ohm);
    // The filter's 10 kΩ and the two 10 kΩ at the amplifier make a third.
    let third = 1.0 / 3.0;
    assert!((gain(&network) - third).abs() < 1e-9, "{}", gain(&network));
    let in_reset = at_amplifier(&network, None, 0.0).re / third;
    assert!((in_reset + 1.18).abs() < 0.005, "{in_reset} V at the difference amplifier: 81 % of its span");
    let filter = corner(|hz| response(&network, hz).magnitude());
    assert!((filter - 477.0).abs() < 1.0, "{filter} Hz");
}

#[test]
fn the_default_scale_of_the_drive_is_that_of_the_guide() {
    let drive = DriveScale::default();
    let counts = |volts: f64| volts / SUPPLY_V * 4_095.0;
    let per_volt_mm = 1e3 * f64::from(drive.metres_per_count) * counts(1.0);
    let netlist = Netlist::read();
    let per_amplifier_volt_mm = per_volt_mm / gain(&netlist.drive(SUPPLY_V, Part::ohm));
    states(
        "docs/LAB_GUIDE.md",
        &format!("| base for 1 V at the amplifier's input, as delivered | {per_amplifier_volt_mm:.2} mm |"),
    );
    let most_mm = 1e3 * f64::from(drive.range().amplitude_m());
    states("docs/LAB_GUIDE.md", &format!("| largest amplitude of the base, as delivered | {most_mm:.2} mm |"));
    // The linear range is cut to whole counts, inside 0.2 V to 3.1 V.
    assert!((0.0..counts(0.2) + 1.0).contains(&(f64::from(drive.linear_low_counts))));
    assert!(f64::from(drive.linear_low_counts) >= counts(0.2));
    assert!(f64::from(drive.linear_high_counts) <= counts(3.1));
}

/// Voltage at the pin for a voltage of the sensor.
fn at_pin(divider: &Divider, source_ohm: f64, volts: f64, hz: f64) -> nodal::Complex {
    let mut network = divider.network(SUPPLY_V, source_ohm);
    network.source(volts, "SOURCE");
    network.solve(hz)["PIN"]
}

/// Current through the clamp, mA, while the sensor's cable has a voltage and the clamp holds the pin at `pin_v`.
fn clamp_ma(divider: &Divider, volts: f64, pin_v: f64) -> f64 {
    let ohm = |value: &Option<String>| value.as_ref().map_or(f64::INFINITY, |value| quantity(value, "Ω"));
    let series = quantity(&divider.series, "Ω");
    let current =
        (volts - pin_v) / series + (SUPPLY_V - pin_v) / ohm(&divider.to_supply) - pin_v / ohm(&divider.to_ground);
    1e3 * current
}

#[test]
fn the_dividers_have_the_stated_spans_corners_and_clamp_currents() {
    let netlist = Netlist::read();
    let guide = "docs/LAB_GUIDE.md";
    for divider in &netlist.divider {
        // A shunt is the source's resistance whatever the sensor; an ideal source shows the scale.
        let source = if divider.shunt.is_some() { divider.source_ohm } else { 0.0 };
        let [low, high] = divider.span().map(|volts| at_pin(divider, source, volts, 0.0).re);
        let response = |source_ohm: f64| {
            move |hz: f64| (at_pin(divider, source_ohm, 1.0, hz) - at_pin(divider, source_ohm, 0.0, hz)).magnitude()
        };
        let [from, to] = divider.span();
        let ratio = (high - low) / (to - from);
        let slow = corner(response(divider.source_ohm));
        // The follower has a supply of ±12 V.
        let reach = |volts: f64| if divider.follower.is_some() { volts.min(11.9) } else { volts };
        let over = clamp_ma(divider, reach(divider.overvoltage_v), SUPPLY_V + CLAMP_V);
        let under = if divider.follower.is_some() { clamp_ma(divider, -11.9, -CLAMP_V).abs() } else { 0.0 };
        let pin = if divider.follower.is_some() { -CLAMP_V } else { 0.0 };
        let open = at_pin(divider, 0.0, divider.open_v, 0.0).re.clamp(pin, SUPPLY_V);
        assert!(open < 0.01 * SUPPLY_V, "divider {}: an open input reads {open} V, which is no rail", divider.name);
        assert!(low > -0.01 && high < SUPPLY_V + 0.02, "divider {}: {low} V to {high} V", divider.name);
        // The corner lies below half of the sampling rate: 10 kHz, walls 50 kHz.
        let nyquist = if divider.name == "W" { 25e3 } else { 5e3 };
        assert!(slow < nyquist, "divider {}: {slow} Hz", divider.name);
        assert!(over.max(under) < 200.0, "a BAT54S carries 200 mA");
        let number = |value: f64| format!("{:.2}", value + 0.0).replace('-', "−");
        states(
            guide,
            &format!(
                "| {} | {} | {ratio:.3} | {} V to {} V | {:.1} kHz | {:.1} mA at {} V |",
                divider.name,
                divider.sensor,
                number(low),
                number(high),
                slow / 1e3,
                over.max(under),
                divider.overvoltage_v
            ),
        );
    }
    for channel in &netlist.channel {
        assert!(channel.allowed.contains(&channel.divider), "{}: divider {}", channel.pin, channel.divider);
        channel.allowed.iter().for_each(|name| {
            netlist.divider(name);
        });
        states(
            guide,
            &format!("| {} | {} | {} | {} |", channel.signal, channel.pin, channel.divider, channel.allowed.join(", ")),
        );
    }
    // The plug replaces the divider of an input without a sensor.
    let plug_v = SUPPLY_V * 1.0 / (9.1 + 1.0);
    states(guide, &format!("9.1 kΩ to 3.3 V and 1 kΩ to GND give {plug_v:.2} V"));
}

#[test]
fn the_switches_have_external_pull_ups_and_open_within_a_tick() {
    let netlist = Netlist::read();
    for (pin, line, pull, series, filter) in [("PA8", "LIMIT", "R18", "R19", "C6"), ("PA9", "STOP", "R20", "R21", "C7")]
    {
        for (part, nets) in [(pull, ["3V3", line]), (series, [line, pin]), (filter, [pin, "GND"])] {
            let connected: Vec<&str> = netlist.part(part).connected().map(String::as_str).collect();
            assert_eq!(connected, nets, "{part}");
        }
        let mut network = Network::default();
        network.source(SUPPLY_V, "3V3");
        network.resistor(netlist.part(pull).ohm(), "3V3", line);
        network.resistor(netlist.part(series).ohm(), line, pin);
        // The controller's own pull-up, at least.
        network.resistor(25e3, "3V3", pin);
        network.short(line, "GND");
        let closed = network.solve(0.0)[pin].re;
        assert!(closed < 0.3 * SUPPLY_V, "{pin}: {closed} V with the switch closed");
        let constant_s =
            (netlist.part(pull).ohm() + netlist.part(series).ohm()) * quantity(&netlist.part(filter).value, "F");
        // From 0 V to the input's high level, 0.7 of the supply.
        let opens_ms = 1e3 * constant_s * (1.0 / 0.3_f64).ln();
        assert!(opens_ms < 1e3 * TICK_S);
        states("docs/LAB_GUIDE.md", &format!("reads as open {opens_ms:.2} ms after it has opened"));
    }
}

#[test]
fn the_relays_driver_holds_the_coil_and_survives_its_release() {
    let netlist = Netlist::read();
    let base_ma = 1e3 * (SUPPLY_V - 0.7) / netlist.part("R12").ohm();
    let coil_ohm = quantity(netlist.part("K1").value.split("≥ ").nth(1).unwrap(), "Ω");
    let coil_ma = 1e3 * 24.0 / coil_ohm;
    assert!(coil_ma / base_ma < 20.0, "{} is not saturated: {coil_ma} mA for {base_ma} mA", netlist.part("Q1").value);
    // The coil's supply, the suppressor and a diode, with a margin for the suppressor's tolerance of 7 %.
    let stated_v = |part: &str| quantity(netlist.part(part).purpose.rsplit(", ").next().unwrap(), "V");
    let seen_v = 24.0 + stated_v("D2") + 0.7;
    assert!(seen_v + 0.07 * stated_v("D2") < stated_v("Q1"));
    states("docs/LAB_GUIDE.md", &format!("sees {seen_v:.0} V"));
}

/// The nets that `from` supplies through switches, fuses, diodes and small resistances while `open` is open.
fn supplied(netlist: &Netlist, from: &str, open: &str) -> BTreeSet<String> {
    let mut reached = BTreeSet::from([from.to_string()]);
    loop {
        let more = netlist.part.iter().filter(|part| part.reference != open).filter_map(|part| {
            let is_supply =
                part.nets.is_some() && !part.reference.starts_with(['C', 'R']) || part.value.starts_with("NTC");
            let (from, to) = match &part.nets {
                Some([from, to]) if is_supply => (from, to),
                None if part.reference.starts_with('D') && part.pins.len() == 2 => {
                    (&part.pins["anode"], &part.pins["cathode"])
                }
                _ => return None,
            };
            // A diode supplies in one direction.
            let back = part.nets.is_some() && reached.contains(to);
            if reached.contains(from) { Some(to.clone()) } else { back.then(|| from.clone()) }
        });
        let more: BTreeSet<String> = more.filter(|net| net != "GND" && !reached.contains(net)).collect();
        if more.is_empty() {
            return reached;
        }
        reached.extend(more);
    }
}

#[test]
fn contact_1_of_the_emergency_stop_cuts_the_relay_and_the_motor() {
    let netlist = Netlist::read();
    let (coil, motor) = (&netlist.part("K1").pins["coil"], &netlist.part("U2").pins["vm"]);
    let released = supplied(&netlist, "24V", "");
    assert!(released.contains(coil) && released.contains(motor), "{released:?}");
    let pressed = supplied(&netlist, "24V", "S1.1");
    assert!(!pressed.contains(coil) && !pressed.contains(motor), "{pressed:?}");
    // The capacitor of the motor's driver does not keep the coil supplied.
    let kept = supplied(&netlist, motor, "S1.1");
    assert!(!kept.contains(coil), "{kept:?}");
}

#[test]
fn guide_drawing_and_pin_table_agree_on_the_motors_enable() {
    let netlist = Netlist::read();
    let driver = netlist.part("U2");
    let pull = netlist.part("R14");
    assert_eq!(pull.nets, Some([driver.pins["vio"].clone(), driver.pins["enable_low"].clone()]));
    let stated = format!("{} to VIO", pull.value);
    for (path, line) in [
        ("docs/LAB_GUIDE.md", format!("/ENABLE (PB10, low switches the motor on) has {stated}")),
        ("docs/wiring.svg", format!("/ENABLE: {stated}, low = on")),
        ("docs/wiring.svg", "PB10 (D6)".into()),
        ("firmware/README.md", format!("| stepper driver /ENABLE, {stated} |")),
        ("firmware/README.md", "| PB10 | D6 | GPIO out | motor off | low: motor on;".into()),
        (
            "firmware/src/boards/nucleo_g474re/mod.rs",
            "//! | PB10 (D6) | GPIO | motor off (low switches the motor on) |".into(),
        ),
    ] {
        states(path, &line);
    }
}

/// The pins in the first column of a table; `//! | PA0 (A0) | …` and `| PA2, PA3 | …`.
fn table_pins(table: &str) -> BTreeSet<String> {
    let rows = table.lines().filter_map(|line| line.trim_start_matches("//!").trim_start().strip_prefix("| P"));
    let cells = rows
        .filter_map(|row| row.split(" |").next())
        .flat_map(|cell| format!("P{cell}").split(", ").map(String::from).collect::<Vec<_>>());
    let pins = cells.filter_map(|cell| cell.split(' ').next().map(String::from));
    pins.filter(|pin| is_mcu_pin(pin)).collect()
}

/// The pins that the board file takes: `p.PA0`.
fn taken_pins(code: &str) -> BTreeSet<String> {
    let names =
        code.split("p.P").skip(1).map(|rest| rest.chars().take_while(char::is_ascii_alphanumeric).collect::<String>());
    names.map(|name| format!("P{name}")).filter(|name| is_mcu_pin(name)).collect()
}

#[test]
fn the_netlist_has_the_pins_of_the_firmware_no_fewer_and_no_more() {
    let pins = Netlist::read().mcu_pins();
    let board = text("firmware/src/boards/nucleo_g474re/mod.rs");
    assert_eq!(taken_pins(&board), pins, "taken by the board file, and in the netlist");
    assert_eq!(table_pins(&board), pins, "described by the board file, and in the netlist");
    assert_eq!(table_pins(&text("firmware/README.md")), pins, "in firmware/README.md, and in the netlist");
}

/// The rows `| R1, R2 | 100 kΩ, 0.1 % | …` of the bill of materials.
fn bill() -> BTreeMap<String, String> {
    let document = text("docs/HARDWARE.md");
    let (_, bill) = document.split_once("## Bill of materials").expect("a bill of materials");
    let rows =
        bill.lines().skip_while(|line| !line.starts_with("|---")).skip(1).take_while(|line| line.starts_with('|'));
    let cells = rows.map(|row| row.trim_matches('|').split(" | ").map(str::trim).collect::<Vec<_>>());
    cells
        .flat_map(|cells| cells[0].split(", ").map(|part| (part.to_string(), cells[1].to_string())).collect::<Vec<_>>())
        .collect()
}

#[test]
fn the_bill_of_materials_is_the_netlist() {
    let netlist = Netlist::read();
    let precise =
        |reference: &str| netlist.part.iter().any(|part| part.reference == reference && part.tolerance == 0.001);
    let wanted: BTreeMap<String, String> = netlist
        .values()
        .into_iter()
        .map(|(reference, value)| {
            let value = if precise(&reference) { format!("{value}, 0.1 %") } else { value };
            (reference, value)
        })
        .collect();
    assert_eq!(bill(), wanted);
    assert!(netlist.part.iter().all(|part| !part.purpose.is_empty()), "each part says what it is for");
    for divider in netlist.divider.iter().filter(|divider| !netlist.channel.iter().any(|it| it.divider == divider.name))
    {
        let n = netlist.channel[0].n;
        let parts =
            divider.values(n).into_iter().map(|(part, value)| format!("{} {value}", part.replace(&n.to_string(), "…")));
        let parts = parts.collect::<Vec<_>>().join(", ");
        states("docs/HARDWARE.md", &format!("| {} | {} | {parts} |", divider.name, divider.sensor));
    }
}

#[test]
fn the_schematic_shows_every_part_with_its_value_and_no_other() {
    let netlist = Netlist::read();
    let drawing = text("docs/schematic.svg");
    let labels: BTreeSet<&str> =
        drawing.split("data-part=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    let mut wanted: BTreeSet<String> =
        netlist.part.iter().map(|part| format!("{} {}", part.reference, part.value)).collect();
    for divider in &netlist.divider {
        // The drawing has each divider once, with … for the number of the channel.
        let n = netlist.channel[0].n;
        let parts = divider.values(n).into_iter();
        wanted.extend(
            parts.map(|(reference, value)| {
                format!("{}: {} {value}", divider.name, reference.replace(&n.to_string(), "…"))
            }),
        );
    }
    assert_eq!(labels.iter().map(|label| label.to_string()).collect::<BTreeSet<_>>(), wanted);
    for pin in netlist.mcu_pins().iter().filter(|pin| !netlist.board.contains_key(*pin)) {
        assert!(drawing.contains(&format!(">{pin}<")), "{pin} is not in the drawing");
    }
}
