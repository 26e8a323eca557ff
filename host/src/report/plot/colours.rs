//! Checks the colours of curves in look.css against those of the figures, and the dark ones by numbers.

use super::palette::{COLOURS, colour};

const LOOK: &str = include_str!("../look.css");
const STYLE: &str = include_str!("../page/style.css");

/// Curves whose dark colours must differ for every reader.
const DISTINCT: usize = 8;

/// Least contrast of a graphical object with its background (WCAG 2.2, 1.4.11).
const MIN_CONTRAST: f64 = 3.0;

/// Least distance in OKLab; 0.02 is just noticeable, and lines are thin.
const MIN_DISTANCE: f64 = 0.07;

/// Linear sRGB of a reader with full colour vision and, of severity 1, with protanopia, deuteranopia and tritanopia (Machado,
/// Oliveira & Fernandes 2009, doi:10.1109/TVCG.2009.113).
const READERS: [(&str, Matrix); 4] = [
    ("full", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    ("protanopia", [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]),
    (
        "deuteranopia",
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    ),
    ("tritanopia", [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]),
];

/// From linear sRGB to the cone responses of OKLab, and from their cube roots to OKLab (Ottosson 2020).
const TO_CONES: Matrix = [
    [0.4122214708, 0.5363325363, 0.0514459929],
    [0.2119034982, 0.6806995451, 0.1073969566],
    [0.0883024619, 0.2817188376, 0.6299787005],
];
const TO_OKLAB: Matrix = [
    [0.2104542553, 0.7936177850, -0.0040720468],
    [1.9779984951, -2.4285922050, 0.4505937099],
    [0.0259040371, 0.7827717662, -0.8086757660],
];

type Matrix = [[f64; 3]; 3];

fn times(matrix: &Matrix, vector: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row.iter().zip(vector).map(|(a, b)| a * b).sum())
}

/// A colour of the style sheet, `--name: #rrggbb`, at each of its places, as linear sRGB.
fn variables(name: &str) -> Vec<[f64; 3]> {
    let linear = |byte: u8| {
        let value = f64::from(byte) / 255.0;
        if value <= 0.04045 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) }
    };
    let read = |text: &str| [0, 2, 4].map(|from| linear(u8::from_str_radix(&text[from..from + 2], 16).unwrap()));
    LOOK.split(&format!("--{name}: #")).skip(1).map(read).collect()
}

fn luminance(linear: [f64; 3]) -> f64 {
    times(&[[0.2126, 0.7152, 0.0722]; 3], linear)[0]
}

fn oklab(linear: [f64; 3]) -> [f64; 3] {
    times(&TO_OKLAB, times(&TO_CONES, linear.map(|part| part.clamp(0.0, 1.0))).map(libm::cbrt))
}

#[test]
fn the_page_knows_every_colour_of_the_figures() {
    for index in 0..COLOURS {
        let (light, dark) = (colour(index).to_string(), format!("var(--curve-{index})"));
        assert!(LOOK.contains(&format!("--curve-{index}: {}", light.to_lowercase())), "look.css: curve {index}");
        for part in ["fill", "stroke"] {
            let rule = format!("figure svg [{part}=\"{light}\"] {{ {part}: {dark}; }}");
            assert!(STYLE.contains(&rule), "style.css lacks {rule}");
        }
    }
}

#[test]
fn the_dark_colours_are_the_same_however_dark_was_chosen() {
    for index in 0..COLOURS {
        let [_, by_system, by_reader] = variables(&format!("curve-{index}"))[..] else {
            panic!("curve {index} is not in the three palettes")
        };
        assert_eq!(by_system, by_reader, "curve {index}");
    }
}

#[test]
fn dark_curves_stand_out_and_the_first_eight_differ_for_colour_blind_readers() {
    let dark = |index: usize| variables(&format!("curve-{index}"))[1];
    let sheet = luminance(variables("sheet")[1]);
    for index in 0..COLOURS {
        let contrast = (luminance(dark(index)) + 0.05) / (sheet + 0.05);
        assert!(contrast >= MIN_CONTRAST, "curve {index}: contrast {contrast:.2}");
    }
    for (reader, matrix) in &READERS {
        for a in 0..DISTINCT {
            for b in 0..a {
                let [one, other] = [a, b].map(|index| oklab(times(matrix, dark(index))));
                let distance = one.iter().zip(other).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
                assert!(distance >= MIN_DISTANCE, "{reader}: curves {b} and {a} are {distance:.3} apart");
            }
        }
    }
}
