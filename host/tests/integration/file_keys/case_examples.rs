//! Cases that have every key which no shipped one has.

pub const MORE_CASES: [&str; 27] = [
    r#"
places = ["a"]
run = { duration_s = 1 }
matrices = { mass_file = "one.csv", stiffness_file = "one.csv", damping_file = "one.csv", influence = [1] }
"#,
    r#"
places = ["a"]
run = { duration_s = 1 }
matrices = { mass_file = "one.csv", stiffness_file = "one.csv", mass_damping_per_s = 0.1, stiffness_damping_s = 0.1 }
"#,
    r#"
places = ["a"]
run = { duration_s = 1 }
matrices = { mass_file = "one.csv", stiffness_file = "one.csv", damping_ratio = 0.1 }
"#,
    r#"
modal_damping_ratio = 0.02
observed_place = "floor 1"
base = { kind = "sine", amplitude_m = 0.001, frequency_ratio = 0.9 }
run = { duration_s = 1 }
[[storey]]
mass_kg = 100
stiffness_n_per_m = 5e4
[[storey]]
name = "roof"
mass_kg = 80
stiffness_n_per_m = 4e4
[[friction_damper]]
place = "roof"
other_place = "floor 1"
force_n = 2
[[tmd]]
place = "roof"
mass_ratio = 0.05
tuning = "den_hartog"
"#,
    r#"
run = { duration_s = 1 }
[[storey]]
mass_kg = 100
stiffness_n_per_m = 5e4
damping_n_s_per_m = 20
[particle]
place = "floor 1"
mass_kg = 5
clearance_m = 0.01
wall = { kind = "restitution", coefficient = 0.5 }
[friction_damper]
place = "floor 1"
friction_ratio = 0.1
[base]
kind = "sine"
amplitude_m = 0.001
frequency_hz = 3
"#,
    r#"
observed_position_m = 0.3
beam = { kind = "cantilever", length_m = 0.3, youngs_modulus_pa = 2.1e11, second_moment_m4 = 2e-8, density_kg_per_m3 = 7850, area_m2 = 5e-4, tip_mass_kg = 0.4, modes = 3, damping_ratio = 0.01 }
force = { kind = "sine", amplitude_n = 12, frequency_hz = 120, position_m = 0.3 }
initial = { x_m = 1e-4, v_m_per_s = 0.01, mode = 2 }
run = { duration_s = 0.1 }
[[friction_damper]]
position_m = 0.2
other_position_m = 0.3
force_n = 2
[[particle]]
position_m = 0.28
mass_ratio = 0.05
clearance_m = 2e-4
wall = { kind = "restitution", coefficient = 0.5 }
"#,
    r#"
beam = { kind = "simply_supported", length_m = 2, bending_stiffness_n_m2 = 4000, mass_per_length_kg_per_m = 4, damping_ratio = 0.01 }
force = { kind = "half_sine", amplitude_n = 12, duration_s = 0.01, position_m = 1.5 }
run = { duration_s = 0.1 }
[tmd]
position_m = 1
mass_kg = 0.1
stiffness_n_per_m = 1000
damping_n_s_per_m = 1
"#,
    r#"
places = ["tip", "middle"]
force = { kind = "half_sine", amplitude_n = 12, duration_s = 0.01, place = "middle" }
run = { duration_s = 0.1 }
[[mode]]
frequency_hz = 118
damping_ratio = 0.011
shape_per_root_kg = [1.1, 0.4]
[[mode]]
angular_frequency_rad_per_s = 4700
damping_ratio = 0.008
shape_per_root_kg = [1, -0.7]
participation_root_kg = 0.4
"#,
    r#"
places = ["tip"]
force = { kind = "sine", amplitude_n = 1, frequency_hz = 100, place = "tip" }
run = { duration_s = 0.1 }
[[mode]]
frequency_hz = 118
damping_ratio = 0.011
shape_per_root_kg = [1.1]
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
run = { duration_s = 0.01 }
[many_particles]
count = 3
diameter_m = 0.01
mass_kg = 0.16
restitution = 0.5
youngs_modulus_pa = 2.1e11
poisson_ratio = 0.3
length_m = 0.1
width_m = 0.02
height_m = 0.02
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
run = { duration_s = 1 }
[many_particles]
count = 3
diameter_m = 0.01
mass_kg = 0.16
restitution = 0.5
stiffness_n_per_m = 1e4
length_m = 0.1
width_m = 0.02
height_m = 0.02
steps_per_contact = 50
seed = 7
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
force = { kind = "sine", amplitude_n = 1, frequency_ratio = 0.9 }
run = { duration_s = 1 }
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
base = { kind = "sine", amplitude_m = 0.001, frequency_ratio = 0.9 }
run = { duration_s = 1 }
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
friction_damper = { spring = { normal_force_n = 1 } }
base = { kind = "record", file = "record.csv", quantity = "displacement", unit = "mm", scale = 0.5, column = 2, time_column = "t" }
run = {}
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
base = { kind = "record", file = "record.csv", quantity = "displacement", unit = "mm", column = "z_mm", time_step_s = 0.01 }
run = { duration_s = 1 }
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
base = { kind = "record", file = "voltage.csv", unit = "V", sensitivity = "1 V/mm" }
run = { duration_s = 1 }
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
force = { kind = "sine", amplitude_n = 1, angular_frequency_rad_per_s = 15, phase_rad = 0.1 }
run = { duration_s = 1 }
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
base = { kind = "fixed" }
force = { kind = "half_sine", amplitude_n = -2, duration_s = 0.2 }
run = { duration_s = 1 }
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
particle = { mass_kg = 0.1, clearance_m = 0.01, wall = { kind = "piezoelectric", stiffness_n_per_m = 2e4, coupling_n_per_v = 0.02, capacitance_f = 5e-8, load_ohm = 1e5 }, positive_wall = { kind = "restitution", coefficient = 0.5 } }
initial = { x_m = 0.01 }
run = { duration_s = 1 }
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
particle = { mass_kg = 0.1, clearance_m = 0.01, wall = { kind = "restitution", coefficient = 0.5 }, positive_wall = { kind = "piezoelectric", stiffness_n_per_m = 2e4, coupling_n_per_v = 0.02, capacitance_f = 5e-8, load_ohm = 1e5 } }
initial = { x_m = 0.01 }
run = { duration_s = 1 }
"#,
    r#"
name = "more"
set_up_file = "identified.toml"
gravity_m_per_s2 = 9.81
base_amplitude_m = 0.002
base = { kind = "sine", angular_frequency_rad_per_s = 15, phase_rad = 0.1 }
particle = { mass_kg = 0.1, clearance_ratio = 3, start = "centre", friction_coefficient = 0.1, wall = { kind = "voigt", stiffness_n_per_m = 1000, damping_n_s_per_m = 1, release = "zero_penetration" } }
friction_damper = { spring = { deflection_m = 0.001 } }
run = { duration_s = 4, sample_times_s = [0.1, 0.2], cycle_s = 0.4, steady_from_cycle = 2 }
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
particle = { mass_kg = 0.1, clearance_m = 0.01, wall = { kind = "hertz", youngs_modulus_pa = 210e9, poisson_ratio = 0.3, radius_m = 0.01, particle_youngs_modulus_pa = 70e9, particle_poisson_ratio = 0.33, lankarani_nikravesh_coefficient = 0.6 }, positive_wall = { kind = "hertz", stiffness_n_per_m15 = 1e9, hunt_crossley_s_per_m = 0.3 } }
run = { duration_s = 1 }
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
particle = { mass_kg = 0.1, clearance_m = 0.01, wall = { kind = "hertz", stiffness_n_per_m15 = 1e9, hunt_crossley_s_per_m = 0.3 }, positive_wall = { kind = "hertz", youngs_modulus_pa = 210e9, poisson_ratio = 0.3, radius_m = 0.01, particle_youngs_modulus_pa = 70e9, particle_poisson_ratio = 0.33, lankarani_nikravesh_coefficient = 0.6 } }
run = { duration_s = 1 }
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
base = { kind = "half_sine", amplitude_m = -0.003, duration_s = 0.2 }
initial = { x_m = 0.01, v_m_per_s = 0.1, y_m = 0.01, u_m_per_s = 0 }
tmd = { mass_ratio = 0.1, stiffness_n_per_m = 30, damping_ratio = 0.1 }
run = { duration_s = 4 }
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
base = { kind = "record", target_peak_m = 0.002, noise = { seed = 3, from_hz = 0.5, to_hz = 8, duration_s = 5, envelope = { rise_s = 0.5, fall_s = 0.5 } } }
run = { duration_s = 4 }
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
base = { kind = "samples", displacement_m = [0, 0.001, 0.003, 0.002], time_step_s = 0.1 }
run = { duration_s = 0.3 }
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
base = { kind = "samples", acceleration_m_per_s2 = [0, 1, -1, 0.5], time_step_s = 0.1 }
run = { duration_s = 0.3 }
"#,
];
