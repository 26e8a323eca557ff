//! Studies, optimisations and a continuation with the tables and keys that the shipped ones leave out.

pub const MORE_STUDIES: [&str; 6] = [
    r#"
name = "more"
case = "../cases/soft-wall.toml"
metrics = ["peak_contact_force_n", "max_abs_x_m"]
objective = "max_abs_x_m"
goal = "maximum"
points_per_part = 10
sampling = { method = "latin_hypercube", count = 5, seed = 3 }
record = { duration_s = 4, settle_s = 1 }

[[axis]]
key = "particle.clearance_m"
from = 0.01
to = 0.02
scale = "log"

[[axis]]
key = "particle.wall.release"
words = ["zero_force", "zero_penetration"]
reduce = "mean"
"#,
    r#"
case = "../cases/spid.toml"
metrics = ["x_over_z"]
record = { cycles = 10, settle_cycles = 2 }
ensemble = { starts = 3, quantiles = [0.1, 0.9] }

[[axis]]
key = "base.frequency_hz"
values = [2.4, 2.5]
"#,
    r#"
case = "../cases/spid.toml"
metrics = ["rms_x_m"]
sampling = { method = "sobol", count = 5 }

[[axis]]
key = "base.frequency_ratio"
from = 0.9
to = 1.1
"#,
    r#"
case = "../cases/spid.toml"
metrics = ["rms_x_m"]
points = "design.csv"
"#,
    r#"
case = "../cases/spid.toml"
metrics = ["rms_x_m"]
sampling = { method = "sobol_indices", count = 8, seed = 2 }

[[axis]]
key = "particle.clearance_ratio"
distribution = "normal"
mean = 12
standard_deviation = 1
from = 9
to = 15

[[axis]]
key = "particle.wall.coefficient"
distribution = "lognormal"
mean = 0.5
standard_deviation = 0.05
"#,
    r#"
case = "../cases/spid.toml"
metrics = ["rms_x_m"]
sampling = { method = "morris", count = 5, seed = 2 }

[[axis]]
key = "particle.clearance_ratio"
from = 9
to = 15
distribution = "uniform"
"#,
];

pub const MORE_OPTIMISATIONS: [&str; 3] = [
    r#"
name = "more"
case = "../cases/soft-wall.toml"
objective = "max_abs_x_m"
goal = "maximum"
evaluations = 500
seed = 3
record = { duration_s = 4, settle_s = 1 }
ensemble = { starts = 3, over = "median" }
front = { metric = "peak_contact_force_n", goal = "minimum", count = 3 }

[[variable]]
key = "particle.clearance_m"
from = 0.01
to = 0.02
tolerance = 0.0001
scale = "log"

[[axis]]
key = "particle.wall.release"
words = ["zero_force", "zero_penetration"]
reduce = "mean"

[[constraint]]
metric = "peak_contact_force_n"
at_most = 20
"#,
    r#"
case = "../cases/spid.toml"
objective = "x_over_z"
record = { cycles = 10, settle_cycles = 2 }
ensemble = { starts = 3, over = "q95" }

[[variable]]
key = "particle.wall.coefficient"
from = 0.2
to = 0.8

[[axis]]
key = "base.frequency_hz"
values = [2.4, 2.5]
reduce = "minimum"

[[constraint]]
metric = "impacts_per_cycle"
at_least = 1.5

[[constraint]]
metric = "period_cycles"
equals = 1
"#,
    r#"
case = "../cases/spid.toml"
objective = "rms_x_m"

[[variable]]
key = "particle.clearance_ratio"
from = 4
to = 20
step = 0.5
relative_tolerance = 0.02

[[variable]]
key = "particle.mass_ratio"
values = [0.05, 0.1]

[[uncertain]]
key = "particle.wall.coefficient"
from = 0.3
to = 0.7
scale = "log"

[[uncertain]]
key = "structure.damping_ratio"
values = [0.003, 0.004, 0.005]

[[uncertain]]
key = "particle.friction_coefficient"
distribution = "lognormal"
mean = 0.1
standard_deviation = 0.02

[[axis]]
key = "base.frequency_ratio"
from = 0.9
to = 1.1
count = 3
reduce = "maximum"

[[alternative]]
name = "tuned"
case = { tmd = { mass_ratio = 0.1, frequency_ratio = 0.9, damping_ratio = 0.2 } }
variable = [{ key = "tmd.frequency_ratio", from = 0.8, to = 1 }]
uncertain = [{ key = "structure.damping_ratio", values = [0.003, 0.005] }]
"#,
];

pub const MORE_CONTINUATION: &str = r#"
case = "../cases/spid.toml"
parameter = "particle.clearance_ratio"
from = 8
to = 12
start_at = 10
branches = "all"
restarts = 2
longest_step = 0.02
settle_periods = 4000

[second]
parameter = "particle.wall.coefficient"
from = 0.4
to = 0.6
"#;
