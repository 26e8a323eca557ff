//! The explicit Runge–Kutta method of order 8 of Dormand and Prince (Hairer, Nørsett, Wanner, *Solving Ordinary Differential
//! Equations I*, 1993, section II.10).

/// Most degrees of freedom.
pub const DOF: usize = 12;

/// Displacements or velocities.
pub type Vector = [f64; DOF];

/// Displacements and velocities.
#[derive(Clone, Copy, Debug, Default)]
pub struct Phase {
    pub displacement: Vector,
    pub velocity: Vector,
}

impl Phase {
    /// Adds `times` another one.
    fn add(&mut self, times: f64, other: &Self) {
        for i in 0..DOF {
            self.displacement[i] += times * other.displacement[i];
            self.velocity[i] += times * other.velocity[i];
        }
    }
}

const NODES: [f64; 12] = [
    0.0,
    0.526_001_519_587_677_3e-1,
    0.789_002_279_381_516e-1,
    0.118_350_341_907_227_4,
    0.281_649_658_092_772_6,
    0.333_333_333_333_333_3,
    0.25,
    0.307_692_307_692_307_7,
    0.651_282_051_282_051_3,
    0.6,
    0.857_142_857_142_857_1,
    1.0,
];

/// Of each stage after the first: number of an earlier one, and its coefficient.
const STAGES: [&[(usize, f64)]; 11] = [
    &[(0, 5.260_015_195_876_773e-2)],
    &[(0, 1.972_505_698_453_79e-2), (1, 5.917_517_095_361_37e-2)],
    &[(0, 2.958_758_547_680_685e-2), (2, 8.876_275_643_042_054e-2)],
    &[(0, 2.413_651_341_592_667e-1), (2, -8.845_494_793_282_861e-1), (3, 9.248_340_032_617_92e-1)],
    &[(0, 3.703_703_703_703_703_5e-2), (3, 1.708_286_087_294_738_6e-1), (4, 1.254_676_875_668_224_2e-1)],
    &[(0, 3.710_937_5e-2), (3, 1.702_522_110_195_440_5e-1), (4, 6.021_653_898_045_596e-2), (5, -1.757_812_5e-2)],
    &[
        (0, 3.709_200_011_850_479e-2),
        (3, 1.703_839_257_122_399_8e-1),
        (4, 1.072_620_304_463_732_8e-1),
        (5, -1.531_943_774_862_440_2e-2),
        (6, 8.273_789_163_814_023e-3),
    ],
    &[
        (0, 6.241_109_587_160_757e-1),
        (3, -3.360_892_629_446_941_4),
        (4, -8.682_193_468_417_26e-1),
        (5, 2.759_209_969_944_671e1),
        (6, 2.015_406_755_047_789_4e1),
        (7, -4.348_988_418_106_996e1),
    ],
    &[
        (0, 4.776_625_364_382_643_4e-1),
        (3, -2.488_114_619_971_667_7),
        (4, -5.902_908_268_368_43e-1),
        (5, 2.123_005_144_818_119_3e1),
        (6, 1.527_923_363_288_242_3e1),
        (7, -3.328_821_096_898_486e1),
        (8, -2.033_120_170_850_862_7e-2),
    ],
    &[
        (0, -9.371_424_300_859_873e-1),
        (3, 5.186_372_428_844_064),
        (4, 1.091_437_348_996_729_5),
        (5, -8.149_787_010_746_927),
        (6, -1.852_006_565_999_696e1),
        (7, 2.273_948_709_935_050_5e1),
        (8, 2.493_605_552_679_652_3),
        (9, -3.046_764_471_898_219_6),
    ],
    &[
        (0, 2.273_310_147_516_538),
        (3, -1.053_449_546_673_725e1),
        (4, -2.000_872_058_224_862_5),
        (5, -1.795_893_186_311_88e1),
        (6, 2.794_888_452_941_996e1),
        (7, -2.858_998_277_135_023_5),
        (8, -8.872_856_933_530_63),
        (9, 1.236_056_717_579_430_3e1),
        (10, 6.433_927_460_157_636e-1),
    ],
];

const WEIGHTS: [(usize, f64); 8] = [
    (0, 5.429_373_411_656_876_5e-2),
    (5, 4.450_312_892_752_409),
    (6, 1.891_517_899_314_500_3),
    (7, -5.801_203_960_010_585),
    (8, 3.111_643_669_578_199e-1),
    (9, -1.521_609_496_625_161e-1),
    (10, 2.013_654_008_040_303_4e-1),
    (11, 4.471_061_572_777_259e-2),
];

/// One step of length `h` from `start` at time `t`; `rate` gives velocities and accelerations.
pub fn step(rate: impl Fn(f64, &Phase) -> Phase, t: f64, start: &Phase, h: f64) -> Phase {
    let mut rates = [Phase::default(); 12];
    rates[0] = rate(t, start);
    for (number, stage) in STAGES.iter().enumerate() {
        let at = combined(start, h, stage, &rates);
        rates[number + 1] = rate(t + NODES[number + 1] * h, &at);
    }
    combined(start, h, &WEIGHTS, &rates)
}

fn combined(start: &Phase, h: f64, coefficients: &[(usize, f64)], rates: &[Phase; 12]) -> Phase {
    let mut sum = Phase::default();
    for (number, coefficient) in coefficients {
        sum.add(*coefficient, &rates[*number]);
    }
    let mut end = *start;
    end.add(h, &sum);
    end
}
