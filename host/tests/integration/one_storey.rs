//! A structure with one place moves as one of one degree of freedom, which another engine moves: closed forms of the base and records, bifurcation
//! diagrams, forces on walls.

use std::f64::consts::TAU;

use crate::common::{damprig, folder, read_parquet, refused, simulated as answer};
use crate::multi_degree::{column, largest, number};

#[test]
fn one_storey_moves_like_a_structure_of_one_degree_of_freedom() {
    let sine = "{ kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }";
    moves_like_one_degree(sine, "steady_from_cycle = 5, ", "clearance_ratio = 5", "friction_ratio = 0.1");
}

/// On an acceleration, a displacement that starts elsewhere with a velocity, and noise.
#[test]
fn one_storey_moves_like_a_structure_of_one_degree_of_freedom_on_a_record() {
    let cases = concat!(env!("CARGO_MANIFEST_DIR"), "/cases");
    let walk: String =
        (0..200).map(|n| format!("{},{}\n", 0.05 * f64::from(n), 4e-3 * (0.75 * f64::from(n) + 1.0).sin())).collect();
    let folder = folder(&[("walk.csv", &format!("time_s,displacement_m\n{walk}"))]);
    let walk =
        format!("{{ kind = \"record\", file = {:?}, quantity = \"displacement\" }}", folder.path().join("walk.csv"));
    for base in [
        format!("{{ kind = \"record\", file = \"{cases}/shake.csv\", quantity = \"acceleration\", unit = \"g\" }}"),
        walk,
        "{ kind = \"record\", noise = { seed = 7, from_hz = 0.5, to_hz = 10, duration_s = 8 }, target_peak_m = 0.004 }"
            .into(),
    ] {
        moves_like_one_degree(&base, "", "clearance_m = 0.002", "force_n = 0.3");
    }
}

/// A case with one degree of freedom, and the same with one storey; `dampers` has them at a place.
fn one_and_storey(rest: &str, dampers: &dyn Fn(&str) -> String) -> [String; 2] {
    let (mass_kg, natural_rad_per_s) = (1.6, TAU * 2.5);
    let (stiffness, damping) =
        (mass_kg * natural_rad_per_s * natural_rad_per_s, 2.0 * 0.0038 * mass_kg * natural_rad_per_s);
    let structure = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }";
    let storey =
        format!("[[storey]]\nmass_kg = 1.6\nstiffness_n_per_m = {stiffness:?}\ndamping_n_s_per_m = {damping:?}\n");
    [format!("{structure}\n{rest}{}", dampers("")), format!("{rest}{}{storey}", dampers("place = \"floor 1\"\n"))]
}

/// A hybrid damper on a storey, and on a mode, compared with the same structure of one degree of freedom.
fn moves_like_one_degree(base: &str, run: &str, clearance: &str, friction: &str) {
    let rest = format!(
        "base = {base}\ninitial = {{ x_m = 0.01, v_m_per_s = 0.05 }}\n\
         run = {{ {run}duration_s = 4, sample_times_s = [0.3, 1, 4] }}\n"
    );
    let dampers = |place: &str| {
        format!(
            "[particle]\n{place}mass_ratio = 0.1\n{clearance}\nfriction_coefficient = 0.02\nstart = \"at_negative_wall\"\n\
             wall = {{ kind = \"restitution\", coefficient = 0.6 }}\n[friction_damper]\n{place}{friction}\n"
        )
    };
    let [one, storey] = one_and_storey(&rest, &dampers);
    let mass_kg = 1.6_f64;
    let mode = format!(
        "places = [\"top\"]\n{rest}{}[[mode]]\nfrequency_hz = 2.5\ndamping_ratio = 0.0038\nshape_per_root_kg = [{:?}]\nparticipation_root_kg = {:?}\n",
        dampers("place = \"top\"\n"),
        1.0 / mass_kg.sqrt(),
        mass_kg.sqrt()
    );
    let expected = answer(&one, &[]);
    for case in [storey, mode] {
        let answer = answer(&case, &[]);
        assert!(number(&expected, "/summary/impact_count") > 10.0);
        // The tails of chatters are summed with one degree of freedom, and counted here.
        let summary = expected["summary"].as_object().expect("a table");
        let is_summed = |name: &str| name.ends_with("_count") && summary.contains_key("accumulation_count");
        for (name, wanted) in summary.iter().filter(|(name, _)| !is_summed(name)) {
            let (found, wanted) = (number(&answer, &format!("/summary/{name}")), wanted.as_f64().expect("a number"));
            assert!((found - wanted).abs() <= 1e-9 * wanted.abs(), "{base}, {name}: {found} {wanted}");
        }
        for name in ["x_m", "y_m", "v_m_per_s", "u_m_per_s"] {
            for n in 0..3 {
                let path = format!("/{name}/{n}");
                let (found, wanted) = (number(&answer, &path), number(&expected, &path));
                assert!((found - wanted).abs() < 1e-9, "{base}, {path}: {found} {wanted}");
            }
        }
        assert_eq!(number(&answer, "/places/0/max_abs_x_m"), number(&answer, "/summary/max_abs_x_m"));
        assert_eq!(answer["impact_dampers"][0]["impact_count"], answer["summary"]["impact_count"]);
    }
}

/// With hard walls, and with soft ones that the particle presses into at the section, so that each value begins within a contact.
#[test]
fn a_bifurcation_diagram_of_one_storey_is_that_of_one_degree_of_freedom() {
    let soft = "kind = \"voigt\", stiffness_n_per_m = 400, damping_n_s_per_m = 6, release = \"zero_force\"";
    let rest = "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }\nrun = { duration_s = 4 }\n";
    for (clearance_m, wall, axis, settle, presses) in [
        (0.03, "kind = \"restitution\", coefficient = 0.5", "particle.clearance_m=0.028:0.034:4", "20", false),
        (0.01, soft, "base.frequency_hz=2.1:2.14:4", "600", true),
    ] {
        let cases = one_and_storey(rest, &|place| {
            format!("[particle]\n{place}mass_kg = 0.16\nclearance_m = {clearance_m}\nwall = {{ {wall} }}\n")
        });
        let folder = folder(&[("one.toml", &cases[0]), ("storey.toml", &cases[1])]);
        let [expected, found] = ["one", "storey"].map(|name| {
            let case = format!("{name}.toml");
            let sweep = ["study", "bifurcation", &case, "--axis", axis, "--settle-cycles", settle, "--cycles", "3"];
            damprig(&folder).args(sweep).args(["--out", name]).assert().success();
            read_parquet(folder.path().join(name).join("bifurcation.parquet"))
        });
        let offset = column(&found, "y_minus_x_m");
        assert!(!presses || offset.iter().all(|offset| offset.abs() > clearance_m), "{offset:?}");
        for name in ["x_m", "v_m_per_s", "cycle_max_m"] {
            let (expected, found) = (column(&expected, name), column(&found, name));
            assert_eq!(expected.len(), 4 * 3 * 2);
            let most = largest(expected.iter().copied());
            for (n, (a, b)) in expected.iter().zip(&found).enumerate() {
                assert!((a - b).abs() < 1e-9 * most, "{wall}, {name}, row {n}: {a} {b}");
            }
        }
        refused(
            &[("storey.toml", &cases[1])],
            &["study", "bifurcation", "storey.toml", "--axis", "storey.1.mass_kg=1:2:3"],
            &["`storey.1.mass_kg` changes the natural modes", "a key of a damper or of the excitation"],
        );
    }
}

/// Forces on the walls of one storey are those of one degree of freedom: of spring and dashpot, of a stated contact by the impulse, and of a Hertz
/// wall, to the errors of both engines (1e-9 of a contact), which eleven impacts have amplified. So are its contacts.
#[test]
fn forces_on_walls_are_those_of_one_degree_of_freedom() {
    let case = |structure: &str, place: &str, wall: &str| {
        format!(
            "{structure}\nparticle = {{ {place} mass_kg = 0.16, clearance_m = 0.006, wall = {{ {wall} }} }}\n\
             base = {{ kind = \"sine\", amplitude_m = 0.001, frequency_hz = 2.4 }}\nrun = {{ duration_s = 2 }}\n"
        )
    };
    let one = "structure = { mass_kg = 1.6, stiffness_n_per_m = 394.8, damping_n_s_per_m = 0.191 }";
    let storey = "storey = [{ mass_kg = 1.6, stiffness_n_per_m = 394.8, damping_n_s_per_m = 0.191 }]";
    for (wall, tolerance) in [
        ("kind = \"voigt\", stiffness_n_per_m = 4000, damping_n_s_per_m = 3, release = \"zero_force\"", 1e-9),
        ("kind = \"restitution\", coefficient = 0.5, contact_time_s = 0.002", 1e-9),
        ("kind = \"hertz\", stiffness_n_per_m15 = 1e9, hunt_crossley_s_per_m = 0.3", 1e-7),
    ] {
        let own = answer(&case(one, "", wall), &[]);
        let several = answer(&case(storey, "place = \"floor 1\",", wall), &[]);
        let expected = own["summary"]["peak_contact_force_n"].as_f64().unwrap();
        let found = several["impact_dampers"][0]["peak_contact_force_n"].as_f64().unwrap();
        assert!(expected > 1.0 && (found / expected - 1.0).abs() < tolerance, "{wall}: {found} {expected}");
        assert_eq!(own["summary"]["impact_count"], several["summary"]["impact_count"], "{wall}");
    }
}
