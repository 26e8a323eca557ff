//! The keys of a case beside its set-up's: what moves it, from where, and for how long. The one place where they are
//! declared.

use crate::input::key::DefaultValue::Number;
use crate::input::key::Need::{Default, Optional, Required};
use crate::input::key::Range::{Any, NotNegative, Positive, Whole};
use crate::input::key::{Key, Kind, Quantity, Table, key, number, tables};

const ANGULAR: Key = number("angular_frequency_rad_per_s", Positive, "Ω, the angular frequency");
const HERTZ: Key = number("frequency_hz", Positive, "Ω/2π, the frequency");

tables! {
    "The tables of a case beside its set-up's, with all their keys."

    "The top of a case, where its set-up's keys stand too."
    case("") {
        NAME: Optional, [key("name", Kind::Text, "what plots call the case; else the file's name")];
        BASE: Optional, [key("base", Kind::Table, "the motion of the base; fixed when left out")];
        FORCE: Optional, [key("force", Kind::Table, "a force on the structure, over a fixed base")];
        INITIAL: Optional, [key("initial", Kind::Table, "where the masses start, and how fast; at rest when left out")];
        RUN: Required, [key("run", Kind::Table, "the table of the run: duration_s at least")];
    }

    "A base that does not move."
    base_fixed("base", "fixed") {}

    "A sine: z = Z sin(Ωt + φ)."
    base_sine("base", "sine") {
        AMPLITUDE: Required, [number("amplitude_m", NotNegative, "Z; or `base_amplitude_m` at the top of the case")];
        FREQUENCY: Required, [ANGULAR, HERTZ];
        PHASE: Default(Number(0.0)), [number("phase_rad", Any, "φ")];
    }

    "A half sine: z = Z sin(πt/T), then 0."
    base_half_sine("base", "half_sine") {
        AMPLITUDE: Required, [number("amplitude_m", Any, "Z; or `base_amplitude_m` at the top of the case")];
        DURATION: Required, [number("duration_s", Positive, "T, the length of the pulse")];
    }

    "A versine: z = Z/2 (1 − cos 2πt/T), then 0."
    base_versine("base", "versine") {
        AMPLITUDE: Required, [number("amplitude_m", Any, "Z; or `base_amplitude_m` at the top of the case")];
        DURATION: Required, [number("duration_s", Positive, "T, the length of the pulse")];
    }

    "A harmonic force: P sin(Ωt + φ)."
    force_sine("force", "sine") {
        AMPLITUDE: Required, [number("amplitude_n", NotNegative, "P")];
        FREQUENCY: Required, [ANGULAR, HERTZ];
        PHASE: Default(Number(0.0)), [number("phase_rad", Any, "φ")];
    }

    "A pulse of force: P sin(πt/T), then 0."
    force_half_sine("force", "half_sine") {
        AMPLITUDE: Required, [number("amplitude_n", Any, "P")];
        DURATION: Required, [number("duration_s", Positive, "T, the length of the pulse")];
    }

    "Where the masses start, relative to the resting laboratory."
    initial("initial") {
        X: Optional, [number("x_m", Any, "x; else where the base starts")];
        V: Default(Number(0.0)), [number("v_m_per_s", Any, "x′")];
        Y: Optional, [number("y_m", Any, "y of particle or tuned mass; else x, and a particle's `start` from there")];
        U: Optional, [number("u_m_per_s", Any, "y′; else x′")];
    }

    "How long the case runs, and what is wanted of it."
    run("run") {
        DURATION: Required, [number("duration_s", Positive, "length of the run; of a record, its own when left out")];
        SAMPLE_TIMES: Optional, [key("sample_times_s", Kind::Numbers, "instants at which the state is wanted, rising")];
        CYCLE: Optional, [number("cycle_s", Positive, "length of a cycle")];
        STEADY_FROM: Optional, [number("steady_from_cycle", Whole, "the first cycle that counts as steady, from 0")];
    }
}
