//! Declares the keys of a structure with several places, at the top of a case and in the plant of a campaign.

use damprig_structures::MAX_MODES;

use crate::input::key::DefaultValue::Number;
use crate::input::key::Need::{Default, Forbidden, If, Optional, Required};
use crate::input::key::Range::{Any, NotNegative, Positive, Whole};
use crate::input::key::{KeyedQuantity, Table, ValueKind, key, number, tables};

/// Its tables in the plant of a campaign.
pub const PLANT: [Table; 5] = [
    Table { path: "plant.storey", ..storey::TABLE },
    Table { path: "plant.beam", ..beam::TABLE },
    Table { path: "plant.beam", ..beam_cantilever::TABLE },
    Table { path: "plant.beam", ..beam_supported::TABLE },
    Table { path: "plant.mode", ..mode::TABLE },
];

tables! {
    "The tables of a structure with several places."

    "What describes it: one of these in place of `structure`."
    description("") {
        STOREYS: Optional, [key("storey", ValueKind::Tables, "a frame in place of `structure`: its storeys from the ground up; the places are its floors")];
        BEAM: Optional, [key("beam", ValueKind::Table, "a beam in place of `structure`; places are positions on it")];
        MODES: Optional, [key("mode", ValueKind::Tables, "natural modes in place of `structure`, at the places of `places`")];
        MATRICES: Optional, [key("matrices", ValueKind::Table, "mass, stiffness and damping matrices in place of `structure`; a row for each of `places`")];
        PLACES: If(&MATRICES, "matrices", &Required, &If(&MODES, "mode", &Required, &Forbidden)), [
            key("places", ValueKind::Texts, "names of the places of modes or matrices, in their order"),
        ];
        MODAL_DAMPING: If(&STOREYS, "storey", &Optional, &Forbidden), [
            number("modal_damping_ratio", NotNegative, "ζ of every mode, in place of the dampings of the storeys").usual(0.0, 0.2),
        ];
        OBSERVED: Optional, [
            key("observed_place", ValueKind::Text, "the place whose displacement is x; default: the top floor, the last of `places`, the free end or the middle of a beam"),
            number("observed_position_m", NotNegative, "the position on a beam whose displacement is x"),
        ];
    }

    "A storey of a frame whose floors move sideways."
    storey("storey") {
        NAME: Optional, [key("name", ValueKind::Text, "the name of its floor as a place; default: floor 1, floor 2 …")];
        MASS: Required, [number("mass_kg", Positive, "mass of its floor, above its columns").usual(0.01, 1e7)];
        STIFFNESS: Required, [number("stiffness_n_per_m", Positive, "stiffness of its columns together").usual(1.0, 1e10)];
        DAMPING: Default(Number(0.0)), [number("damping_n_s_per_m", NotNegative, "damping between its floor and the one below").usual(0.0, 1e9)];
    }

    "Of every beam: slender and uniform, bending in one plane (Euler and Bernoulli)."
    beam("beam") {
        LENGTH: Required, [number("length_m", Positive, "length").usual(0.02, 200.0)];
        STIFFNESS: Required, [
            number("bending_stiffness_n_m2", Positive, "E·I, the bending stiffness"),
            number("youngs_modulus_pa", Positive, "E, with `second_moment_m4`").usual(1e9, 7e11),
        ];
        SECOND_MOMENT: If(&STIFFNESS, "youngs_modulus_pa", &Required, &Forbidden), [
            number("second_moment_m4", Positive, "I, the second moment of area, with `youngs_modulus_pa`"),
        ];
        MASS: Required, [
            number("mass_per_length_kg_per_m", Positive, "ρ·A, the mass per length").usual(1e-3, 1e5),
            number("density_kg_per_m3", Positive, "ρ, with `area_m2`").usual(100.0, 2e4),
        ];
        AREA: If(&MASS, "density_kg_per_m3", &Required, &Forbidden), [
            number("area_m2", Positive, "A, the area of the cross-section, with `density_kg_per_m3`"),
        ];
        MODES: Default(Number(5.0)), [number("modes", Whole(1.0, MAX_MODES as f64), "number of modes, the lowest ones")];
        DAMPING: Required, [number("damping_ratio", NotNegative, "ζ of each mode").usual(0.0, 0.2)];
    }

    "A beam that is clamped at position 0."
    beam_cantilever("beam", "cantilever") {
        TIP_MASS: Default(Number(0.0)), [number("tip_mass_kg", NotNegative, "mass at the free end").usual(0.0, 1e5)];
    }

    "A beam that is simply supported at both ends."
    beam_supported("beam", "simply_supported") {}

    "A natural mode of a structure, from a modal test or a calculation."
    mode("mode") {
        FREQUENCY: Required, [
            number("frequency_hz", Positive, "ω/2π, the undamped natural frequency").usual(0.1, 1e4),
            number("angular_frequency_rad_per_s", Positive, "ω").usual(0.6, 6e4),
        ];
        DAMPING: Required, [number("damping_ratio", NotNegative, "ζ").usual(0.0, 0.2)];
        SHAPE: Required, [
            key("shape_per_root_kg", ValueKind::Numbers(Any), "φ, the displacement of each of `places`, for a modal mass of 1 kg"),
        ];
        PARTICIPATION: Optional, [
            number("participation_root_kg", Any, "Γ = φᵀMι, the participation in a motion of the base; needed where the base moves"),
        ];
    }

    "Matrices of a structure, M x″ + C x′ + K x with x relative to the base, from files of comma-separated numbers, a line for each row."
    matrices("matrices") {
        MASS: Required, [key("mass_file", ValueKind::Text, "file of M, kg, beside this one: symmetric, positive definite")];
        STIFFNESS: Required, [key("stiffness_file", ValueKind::Text, "file of K, N/m: symmetric, positive definite")];
        DAMPING: Required, [
            number("damping_ratio", NotNegative, "ζ of every mode").usual(0.0, 0.2),
            number("mass_damping_per_s", NotNegative, "a of C = aM + bK, with `stiffness_damping_s`"),
            key("damping_file", ValueKind::Text, "file of C, N·s/m: symmetric, no negative eigenvalue"),
        ];
        STIFFNESS_DAMPING: If(&DAMPING, "mass_damping_per_s", &Required, &Forbidden), [
            number("stiffness_damping_s", NotNegative, "b of C = aM + bK"),
        ];
        INFLUENCE: Optional, [
            key("influence", ValueKind::Numbers(Any), "displacement of each place per displacement of the base; default: 1 for each"),
        ];
    }
}
