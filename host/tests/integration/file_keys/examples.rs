//! Files with the tables and keys that the shipped ones leave out.

pub const MORE_CAMPAIGN: &str = r#"
name = "more"
gravity_m_per_s2 = 9.81
set_up_file = "identified.toml"
friction_damper = { spring = { friction_ratio = 0.6, friction_coefficient = 0.3, stiffness_n_per_m = 500 } }
tmd = { mass_kg = 0.1, frequency_ratio = 0.9, damping_n_s_per_m = 0.1 }

[rig]
structure_limit_m = 0.07
base_limit_m = 0.07
half_cycles_ahead = 6
wall_force_limit_n = 400
saturated_s = 1.0
host_silent_s = 10
brake_n = 0.5
noise_seed = 3
shaker = { amplifier = "current", current_limit_a = 4 }
sensors = { kind = "ideal" }

[plan]
order = "random"
order_seed = 3

[[set_up]]
name = "voigt"
base_amplitude_m = 0.001
structure = { mass_kg = 1.6, stiffness_n_per_m = 400, damping_n_s_per_m = 0.2 }
particle = { mass_kg = 0.16, clearance_m = 0.01, start_m = 0.001, wall = { kind = "voigt", storage_modulus_pa = 1e6, shape_factor_m = 0.05, loss_factor = 0.2, law = "contact", release = "zero_force" } }

[[set_up]]
name = "falling"
base_amplitude_m = 0.001
structure = { mass_kg = 1.6, stiffness_n_per_m = 400, damping_n_s_per_m = 0.2 }
particle = { mass_kg = 0.16, clearance_m = 0.01, offset_m = 0.001, inclination_deg = 30, wall = { kind = "restitution", coefficient = 0.6, exponent = 0.25, reference_speed_m_per_s = 0.5, maximum = 0.9 }, positive_wall = { kind = "restitution", coefficient = 0.6, exponent = 0.25, reference_speed_m_per_s = 0.5, maximum = 0.9 } }

[[set_up]]
name = "modulus"
base_amplitude_m = 0.001
structure = { mass_kg = 1.6, stiffness_n_per_m = 400, damping_n_s_per_m = 0.2 }
particle = { mass_kg = 0.16, clearance_m = 0.01, wall = { kind = "restitution", coefficient = 0.6 }, positive_wall = { kind = "voigt", storage_modulus_pa = 1e6, shape_factor_m = 0.05, loss_factor = 0.2, law = "contact", release = "zero_force" } }

[[set_up]]
name = "material"
base_amplitude_m = 0.001
structure = { mass_kg = 1.6, stiffness_n_per_m = 400, damping_n_s_per_m = 0.2 }
particle = { mass_kg = 0.16, clearance_m = 0.01, wall = { kind = "restitution", coefficients = [0.9, 0.6], speeds_m_per_s = [0.1, 2], contact_time_s = 0.002, pulse_factor = 1.6 }, positive_wall = { kind = "voigt", material = "rubber", release = "zero_force" } }

[[set_up]]
name = "table"
base_amplitude_m = 0.001
structure = { mass_kg = 1.6, stiffness_n_per_m = 400, damping_n_s_per_m = 0.2 }
particle = { mass_kg = 0.16, clearance_m = 0.01, wall = { kind = "restitution", coefficient = 0.6 }, positive_wall = { kind = "restitution", coefficients = [0.9, 0.6], speeds_m_per_s = [0.1, 2], contact_time_s = 0.002, pulse_factor = 1.6 } }

[[set_up]]
name = "hertz"
base_amplitude_m = 0.001
structure = { mass_kg = 1.6, stiffness_n_per_m = 400, damping_n_s_per_m = 0.2 }
particle = { mass_kg = 0.16, clearance_m = 0.01, wall = { kind = "restitution", coefficient = 0.6, hertz_stiffness_n_per_m15 = 1e9 }, positive_wall = { kind = "restitution", coefficient = 0.6, hertz_stiffness_n_per_m15 = 1e9 } }

[[set_up]]
name = "dashpot"
base_amplitude_m = 0.001
structure = { mass_kg = 1.6, stiffness_n_per_m = 400, damping_n_s_per_m = 0.2 }
particle = { mass_kg = 0.16, clearance_m = 0.01, wall = { kind = "restitution", coefficient = 0.6 }, positive_wall = { kind = "voigt", stiffness_n_per_m = 1000, damping_n_s_per_m = 1, release = "zero_force" } }

[[set_up]]
name = "friction"
label = "FD"
base_amplitude_m = 0.001
gravity_m_per_s2 = 9.8
friction_damper = {}

[[set_up]]
name = "tuned"
base_amplitude_m = 0.001
tmd = {}

[[set_up]]
name = "tank"
base_amplitude_m = 0.001
damper = "unmodelled"

[[experiment]]
kind = "stepped_sine"
frequencies_hz = { from_hz = 2.4, to_hz = 2.5, step_hz = 0.1, peak_points = 2 }
start = "from_rest"
ramp_s = 0.1
settle_s = 0.2
dwell_s = 3
rest_level_m = 1e-4
steady = { tolerance = 0.02, scatter = 0.01, longest_dwell_s = 6 }
drive = "closed_loop"
closed_loop = { gain_per_s = 20, tolerance = 0.01, wait_s = 10, drive_limit_m = 0.004 }
set_ups = ["voigt"]

[[experiment]]
kind = "playback"
file = "record.csv"
quantity = "displacement"
unit = "mm"
column = 2
time_column = "t"
scale = 0.5
baseline = "linear"
sample_rate_hz = 100
ramp_s = 0.01
tail_s = 1
rest_level_m = 1e-4

[[experiment]]
kind = "playback"
file = "record.csv"
quantity = "displacement"
unit = "mm"
column = "z_mm"
time_step_s = 0.01

[[experiment]]
name = "voltage"
kind = "playback"
file = "voltage.csv"
unit = "V"
sensitivity = "1 V/mm"

[[experiment]]
kind = "impulse"
shape = "rectangle"
amplitude_m = 0.002
duration_s = 0.2
rise_s = 0.02
sample_rate_hz = 1000
ramp_s = 0
tail_s = 0.5
rest_level_m = 1e-4

[[experiment]]
kind = "free_vibration"
start_m = 0.02
level_m = 0.016
hold_s = 0.5
timeout_s = 60
measure_s = 2
cycles = 4
"#;

/// Experiments that keep the response: not on a shaker in current mode.
pub const MORE_SHEETS: &str = r#"
name = "sheets"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }

[[set_up]]
name = "bare"
base_amplitude_m = 0.001

[[experiment]]
name = "sheets"
kind = "response_controlled"
x_amplitudes_m = [0.002, 0.004]
frequencies_hz = [2.4, 2.5]
start = "from_rest"
ramp_s = 0.1
settle_s = 0.2
dwell_s = 3
rest_level_m = 1e-4
steady = { tolerance = 0.02 }
response_loop = { gain_per_cycle = 1, tolerance = 0.02, wait_s = 10, drive_limit_m = 0.004 }

[[experiment]]
name = "resonance"
kind = "resonance_tracking"
x_amplitudes_m = [0.002, 0.004]
from_hz = 2
to_hz = 3
start_hz = 2.4
start = "from_rest"
ramp_s = 0.1
settle_s = 0.2
dwell_s = 3
rest_level_m = 1e-4
steady = { tolerance = 0.02 }
response_loop = { gain_per_cycle = 1, tolerance = 0.02, wait_s = 10, drive_limit_m = 0.004 }
phase_lock = { phase_deg = -60, gain_per_cycle = 0.8, tolerance_deg = 3, wait_s = 60 }

[[experiment]]
kind = "resonance_tracking"
base_amplitudes_m = [0.001]
from_hz = 2
to_hz = 3
start = "carry_over"
dwell_s = 3
drive = "constant"

[[experiment]]
kind = "resonance_tracking"
velocity_amplitudes_m_per_s = [0.05]
from_hz = 2
to_hz = 3
start = "carry_over"
dwell_s = 3

[[experiment]]
kind = "resonance_tracking"
relative_amplitudes_m = [0.004]
from_hz = 2
to_hz = 3
start = "carry_over"
dwell_s = 3

[[experiment]]
kind = "response_controlled"
velocity_amplitudes_m_per_s = [0.05]
frequencies_hz = [2.5]
start = "carry_over"
dwell_s = 3

[[experiment]]
kind = "response_controlled"
relative_amplitudes_m = [0.004]
frequencies_hz = [2.5]
start = "carry_over"
dwell_s = 3
"#;

pub const SET_UP_FILE: &str = r#"
[structure]
natural_frequency_hz = 2.50012
damping_ratio = 0.003801
[particle]
friction_coefficient = 0.05
wall = { kind = "restitution", coefficient = 0.47 }
[[identified]]
key = "structure.damping_ratio"
value = 0.003801
standard_uncertainty = 3e-6
interval_95 = [0.003795, 0.003807]
unit = ""
method = "decay"
taken_from = "a run"
date = "2026-06-01"
damprig = "damprig 0.1.0"
"#;

/// Plants of every kind.
pub const PLANTS: [&str; 4] = [
    r#"
name = "frame"
[plant]
modal_damping_ratio = 0.01
storey = [{ mass_kg = 1, stiffness_n_per_m = 400 }, { mass_kg = 1, stiffness_n_per_m = 400 }]
[[set_up]]
name = "bare"
base_amplitude_m = 0.001
[[experiment]]
kind = "free_vibration"
start_m = 0.01
measure_s = 2
"#,
    r#"
name = "bar"
[plant]
observed_position_m = 0.5
[plant.beam]
kind = "cantilever"
length_m = 0.5
youngs_modulus_pa = 2.1e11
second_moment_m4 = 1e-11
density_kg_per_m3 = 7850
area_m2 = 6e-5
tip_mass_kg = 0.4
modes = 3
damping_ratio = 0.01
[[set_up]]
name = "spid"
base_amplitude_m = 0.001
particle = { position_m = 0.4, mass_kg = 0.02, clearance_m = 0.004, wall = { kind = "restitution", coefficient = 0.5 } }
[[experiment]]
kind = "free_vibration"
start_m = 0.01
measure_s = 2
"#,
    r#"
name = "bridge"
[plant]
observed_position_m = 1
beam = { kind = "simply_supported", length_m = 2, bending_stiffness_n_m2 = 400, mass_per_length_kg_per_m = 4, modes = 2, damping_ratio = 0.01 }
[[set_up]]
name = "joint"
base_amplitude_m = 0.001
friction_damper = { position_m = 1, other_position_m = 0.5, force_n = 1 }
[[experiment]]
kind = "free_vibration"
start_m = 0.01
measure_s = 2
"#,
    r#"
name = "modes"
[plant]
places = ["tip", "middle"]
observed_place = "tip"
[[plant.mode]]
frequency_hz = 3
damping_ratio = 0.01
shape_per_root_kg = [1.1, 0.4]
participation_root_kg = 0.8
[[plant.mode]]
angular_frequency_rad_per_s = 120
damping_ratio = 0.01
shape_per_root_kg = [1, -0.7]
participation_root_kg = 0.4
[[set_up]]
name = "tmd"
base_amplitude_m = 0.001
tmd = { place = "middle", mass_kg = 0.05, tuning = "den_hartog" }
[[experiment]]
kind = "free_vibration"
start_m = 0.01
measure_s = 2
"#,
];
