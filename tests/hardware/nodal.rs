//! Solves linear networks of resistors, capacitors, ideal operational amplifiers and voltage sources at one frequency.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A complex number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Complex {
    pub re: f64,
    pub im: f64,
}

impl Complex {
    pub fn real(re: f64) -> Self {
        Self { re, im: 0.0 }
    }

    pub fn magnitude(self) -> f64 {
        self.re.hypot(self.im)
    }

    /// Angle, degrees.
    pub fn degrees(self) -> f64 {
        self.im.atan2(self.re).to_degrees()
    }
}

impl Add for Complex {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }
}

impl Neg for Complex {
    type Output = Self;
    fn neg(self) -> Self {
        Self { re: -self.re, im: -self.im }
    }
}

impl Sub for Complex {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Complex {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }
}

impl Div for Complex {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let square = other.re * other.re + other.im * other.im;
        self * Self { re: other.re / square, im: -other.im / square }
    }
}

#[derive(Clone, Debug)]
enum Element {
    Resistor(f64),
    Capacitor(f64),
    /// The voltage of the first net over the second.
    Source(f64),
}

/// A network. `GND` is its reference.
#[derive(Clone, Debug, Default)]
pub struct Network {
    elements: Vec<(Element, String, String)>,
    /// Nets of the inputs and of the output.
    amplifiers: Vec<[String; 3]>,
}

impl Network {
    pub fn resistor(&mut self, ohm: f64, from: &str, to: &str) {
        self.elements.push((Element::Resistor(ohm), from.into(), to.into()));
    }

    pub fn capacitor(&mut self, farad: f64, from: &str, to: &str) {
        self.elements.push((Element::Capacitor(farad), from.into(), to.into()));
    }

    /// A source between a net and GND.
    pub fn source(&mut self, volts: f64, net: &str) {
        self.elements.push((Element::Source(volts), net.into(), "GND".into()));
    }

    /// A closed contact.
    pub fn short(&mut self, from: &str, to: &str) {
        self.elements.push((Element::Source(0.0), from.into(), to.into()));
    }

    pub fn amplifier(&mut self, plus: &str, minus: &str, out: &str) {
        self.amplifiers.push([plus, minus, out].map(String::from));
    }

    /// The voltage of each net at `hz`; 0 Hz for constant sources.
    ///
    /// # Panics
    /// A net is not connected.
    pub fn solve(&self, hz: f64) -> BTreeMap<String, Complex> {
        let mut place = BTreeMap::new();
        let ends = self.elements.iter().flat_map(|(_, from, to)| [from, to]);
        for net in ends.chain(self.amplifiers.iter().flatten()).filter(|net| *net != "GND") {
            let next = place.len();
            place.entry(net.clone()).or_insert(next);
        }
        let at = |net: &String| place.get(net).copied();
        let sources = self.elements.iter().filter(|(element, ..)| matches!(element, Element::Source(_))).count();
        let unknowns = place.len() + sources + self.amplifiers.len();
        let mut rows = vec![vec![Complex::default(); unknowns + 1]; unknowns];
        let add = |rows: &mut Vec<Vec<Complex>>, row: Option<usize>, column: Option<usize>, value: Complex| {
            if let (Some(row), Some(column)) = (row, column) {
                rows[row][column] = rows[row][column] + value;
            }
        };
        let one = Complex::real(1.0);
        let mut current = place.len();
        for (element, from, to) in &self.elements {
            let (from, to) = (at(from), at(to));
            let admittance = match element {
                Element::Resistor(ohm) => Complex::real(1.0 / ohm),
                Element::Capacitor(farad) => Complex { re: 0.0, im: TAU * hz * farad },
                Element::Source(volts) => {
                    for (end, sign) in [(from, one), (to, -one)] {
                        add(&mut rows, end, Some(current), sign);
                        add(&mut rows, Some(current), end, sign);
                    }
                    rows[current][unknowns] = Complex::real(*volts);
                    current += 1;
                    continue;
                }
            };
            for (end, other) in [(from, to), (to, from)] {
                add(&mut rows, end, end, admittance);
                add(&mut rows, end, other, -admittance);
            }
        }
        // An ideal amplifier: no current into its inputs, both at one voltage, any current from its output.
        for [plus, minus, out] in &self.amplifiers {
            add(&mut rows, at(out), Some(current), one);
            add(&mut rows, Some(current), at(plus), one);
            add(&mut rows, Some(current), at(minus), -one);
            current += 1;
        }
        let solution = eliminate(rows);
        place.into_iter().map(|(net, place)| (net, solution[place])).collect()
    }
}

/// Gaussian elimination with pivots by columns; each row ends with its right-hand side.
fn eliminate(mut rows: Vec<Vec<Complex>>) -> Vec<Complex> {
    let n = rows.len();
    for column in 0..n {
        let pivot = (column..n).max_by(|&a, &b| rows[a][column].magnitude().total_cmp(&rows[b][column].magnitude()));
        let pivot = pivot.expect("a row is left");
        assert!(rows[pivot][column].magnitude() > 1e-15, "a net of the network is not connected");
        rows.swap(column, pivot);
        let head = rows[column].clone();
        for row in rows.iter_mut().skip(column + 1) {
            let factor = row[column] / head[column];
            for (value, above) in row.iter_mut().zip(&head).skip(column) {
                *value = *value - factor * *above;
            }
        }
    }
    let mut solution = vec![Complex::default(); n];
    for row in (0..n).rev() {
        let known = (row + 1..n).fold(rows[row][n], |rest, k| rest - rows[row][k] * solution[k]);
        solution[row] = known / rows[row][row];
    }
    solution
}
