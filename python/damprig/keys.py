"""The keys of input files as types: annotate a dict, and an editor completes its keys and finds wrong ones before it runs.

>>> from damprig.keys import Case
>>> case: Case = {"structure": {"mass_kg": 1.6, "natural_frequency_hz": 2.5, "damping_ratio": 0.0038}}

`damprig keys --python` prints this file from the declarations that the parsers use; docs/KEYS.md has ranges and defaults too. No key is
required here: which of them a table needs depends on the others.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Literal, TypedDict, Union


class BaseFixed(TypedDict, total=False):
    """A fixed base."""

    kind: Literal["fixed"]


class BaseSine(TypedDict, total=False):
    """A sine: z = Z sin(Ωt + φ)."""

    kind: Literal["sine"]
    amplitude_m: float
    """Z; or `base_amplitude_m` at the top of the case (m)"""
    angular_frequency_rad_per_s: float
    """Ω, the angular frequency (rad/s)"""
    frequency_hz: float
    """Ω/2π, the frequency (Hz), in place of angular_frequency_rad_per_s"""
    frequency_ratio: float
    """Ω/ωn, the frequency over the structure's natural one, in place of angular_frequency_rad_per_s"""
    phase_rad: float
    """φ (rad)"""


class BaseHalfSine(TypedDict, total=False):
    """A half sine: z = Z sin(πt/T), then 0."""

    kind: Literal["half_sine"]
    amplitude_m: float
    """Z; or `base_amplitude_m` at the top of the case (m)"""
    duration_s: float
    """T, the length of the pulse (s)"""


class BaseVersine(TypedDict, total=False):
    """A versine: z = Z/2 (1 − cos 2πt/T), then 0."""

    kind: Literal["versine"]
    amplitude_m: float
    """Z; or `base_amplitude_m` at the top of the case (m)"""
    duration_s: float
    """T, the length of the pulse (s)"""


class BaseSamples(TypedDict, total=False):
    """Samples of the base's motion: any sweep, sum of sines or shape, as a program computes it."""

    kind: Literal["samples"]
    displacement_m: Sequence[float]
    """z at each instant, joined by cubics; before the first one the base rests there, after the last one too (m)"""
    acceleration_m_per_s2: Sequence[float]
    """z″ at each instant, joined by lines; z starts from 0 at rest (m/s²), in place of displacement_m"""
    time_step_s: float
    """time between two samples (s)"""


class BaseNoiseEnvelope(TypedDict, total=False):
    """Envelope of the noise."""

    rise_s: float
    """time over which the noise rises from 0 (s)"""
    fall_s: float
    """time over which it falls to 0; with `rise_s` at most `duration_s` (s)"""


class BaseNoise(TypedDict, total=False):
    """Noise: sines of equal amplitudes and random phases within a band, under an envelope. The same seed gives the same motion on every machine."""

    seed: int
    """seed of the phases"""
    from_hz: float
    """lower end of the band (Hz)"""
    to_hz: float
    """upper end of the band (Hz)"""
    duration_s: float
    """length, with its envelope (s)"""
    envelope: BaseNoiseEnvelope
    """rise and fall at the ends; a tenth of the length each when left out"""


class BaseRecord(TypedDict, total=False):
    """A recorded base motion, or noise from a seed."""

    kind: Literal["record"]
    noise: BaseNoise
    """band-limited noise in place of a file"""
    file: str
    """CSV, AT2, V2, UFF, MAT, HDF5 or Parquet file, relative to this file; `FILE#3` or `FILE#name` is one of several signals; or `noise`"""
    quantity: Literal["acceleration", "displacement"]
    """quantity of the values, where the file does not state it"""
    unit: Literal["m/s2", "g", "cm/s2", "mm/s2", "m", "cm", "mm", "V", "mV"]
    """unit of the values, where neither the file nor the end of the column's name states it"""
    sensitivity: str
    """of the sensor, if the values are its voltage: '100 mV/g', '10.2 mV/(m/s2)', '2.5 V/mm'"""
    scale: float
    """factor on every value"""
    time_step_s: float
    """time between samples; otherwise the file has a time column (s)"""
    column: Union[str, int]
    """column of the values; default: the only one beside the time column"""
    time_column: Union[str, int]
    """time column; default: the first"""
    target_peak_m: float
    """largest |z| of the noise (m)"""


Base = Union[BaseFixed, BaseSine, BaseHalfSine, BaseVersine, BaseSamples, BaseRecord]


class ForceSine(TypedDict, total=False):
    """A harmonic force: P sin(Ωt + φ)."""

    kind: Literal["sine"]
    amplitude_n: float
    """P (N)"""
    angular_frequency_rad_per_s: float
    """Ω, the angular frequency (rad/s)"""
    frequency_hz: float
    """Ω/2π, the frequency (Hz), in place of angular_frequency_rad_per_s"""
    frequency_ratio: float
    """Ω/ωn, the frequency over the structure's natural one, in place of angular_frequency_rad_per_s"""
    phase_rad: float
    """φ (rad)"""
    place: str
    """the place of a structure with several where it acts; default: the observed one"""
    position_m: float
    """the place on a beam where it acts (m), in place of place"""


class ForceHalfSine(TypedDict, total=False):
    """A pulse of force: P sin(πt/T), then 0."""

    kind: Literal["half_sine"]
    amplitude_n: float
    """P (N)"""
    duration_s: float
    """T, the length of the pulse (s)"""
    place: str
    """the place of a structure with several where it acts; default: the observed one"""
    position_m: float
    """the place on a beam where it acts (m), in place of place"""


Force = Union[ForceSine, ForceHalfSine]


class ManyParticles(TypedDict, total=False):
    """Spheres of one size in a box on the structure: docs/PARTICLES.md."""

    count: int
    """number of spheres; computing time grows with it"""
    diameter_m: float
    """diameter of the spheres (m)"""
    mass_kg: float
    """m, the mass of all spheres together (kg)"""
    mass_ratio: float
    """β = m/M, that mass over the structure's, in place of mass_kg"""
    restitution: float
    """e of every contact, between spheres and with the box"""
    friction_coefficient: float
    """μ of every contact; with friction the spheres rotate"""
    stiffness_n_per_m: float
    """k, the contacts' stiffness: larger is harder and slower to compute (N/m)"""
    contact_time_s: float
    """duration of an undamped contact of two spheres, which gives the stiffness (s), in place of stiffness_n_per_m"""
    youngs_modulus_pa: float
    """E of spheres and box, with Hertz contacts in place of springs (Pa), in place of stiffness_n_per_m"""
    poisson_ratio: float
    """ν of spheres and box, with `youngs_modulus_pa`"""
    length_m: float
    """inner length of the box, along the motion (m)"""
    clearance_m: float
    """d, half the free travel: the length is 2d plus what the spheres take, packed in layers (m), in place of length_m"""
    width_m: float
    """inner width of the box, across the motion (m)"""
    height_m: float
    """inner height of the box (m)"""
    steps_per_contact: float
    """steps of the shortest contact"""
    seed: int
    """of the spheres' places at the start"""


class Initial(TypedDict, total=False):
    """Initial state, in the fixed frame."""

    x_m: float
    """x; default: the initial z (m)"""
    v_m_per_s: float
    """x′ (m/s)"""
    y_m: float
    """y of particle or tuned mass; default: x, for a particle plus its `start` (m)"""
    u_m_per_s: float
    """y′; default: x′ (m/s)"""
    mode: int
    """on a structure with several modes: the mode in whose shape x and x′ are given; default: the first"""


class Run(TypedDict, total=False):
    """Duration and requested output of the run."""

    duration_s: float
    """duration of the run; default with a record: that of the record (s)"""
    sample_times_s: Sequence[float]
    """times at which the state is output, rising (s)"""
    cycle_s: float
    """length of a cycle; default under a sine: its period (s)"""
    steady_from_cycle: int
    """first cycle that counts as steady, from 0"""


class Storey(TypedDict, total=False):
    """A storey of a frame whose floors move sideways."""

    name: str
    """the name of its floor as a place; default: floor 1, floor 2 …"""
    mass_kg: float
    """mass of its floor, above its columns (kg)"""
    stiffness_n_per_m: float
    """stiffness of its columns together (N/m)"""
    damping_n_s_per_m: float
    """damping between its floor and the one below (N·s/m)"""


class BeamCantilever(TypedDict, total=False):
    """A beam that is clamped at position 0."""

    kind: Literal["cantilever"]
    length_m: float
    """length (m)"""
    bending_stiffness_n_m2: float
    """E·I, the bending stiffness (N·m²)"""
    youngs_modulus_pa: float
    """E, with `second_moment_m4` (Pa), in place of bending_stiffness_n_m2"""
    second_moment_m4: float
    """I, the second moment of area, with `youngs_modulus_pa` (m⁴)"""
    mass_per_length_kg_per_m: float
    """ρ·A, the mass per length (kg/m)"""
    density_kg_per_m3: float
    """ρ, with `area_m2` (kg/m³), in place of mass_per_length_kg_per_m"""
    area_m2: float
    """A, the area of the cross-section, with `density_kg_per_m3` (m²)"""
    modes: int
    """number of modes, the lowest ones"""
    damping_ratio: float
    """ζ of each mode"""
    tip_mass_kg: float
    """mass at the free end (kg)"""


class BeamSimplySupported(TypedDict, total=False):
    """A beam that is simply supported at both ends."""

    kind: Literal["simply_supported"]
    length_m: float
    """length (m)"""
    bending_stiffness_n_m2: float
    """E·I, the bending stiffness (N·m²)"""
    youngs_modulus_pa: float
    """E, with `second_moment_m4` (Pa), in place of bending_stiffness_n_m2"""
    second_moment_m4: float
    """I, the second moment of area, with `youngs_modulus_pa` (m⁴)"""
    mass_per_length_kg_per_m: float
    """ρ·A, the mass per length (kg/m)"""
    density_kg_per_m3: float
    """ρ, with `area_m2` (kg/m³), in place of mass_per_length_kg_per_m"""
    area_m2: float
    """A, the area of the cross-section, with `density_kg_per_m3` (m²)"""
    modes: int
    """number of modes, the lowest ones"""
    damping_ratio: float
    """ζ of each mode"""


Beam = Union[BeamCantilever, BeamSimplySupported]


class Mode(TypedDict, total=False):
    """A natural mode of a structure, from a modal test or a calculation."""

    frequency_hz: float
    """ω/2π, the undamped natural frequency (Hz)"""
    angular_frequency_rad_per_s: float
    """ω (rad/s), in place of frequency_hz"""
    damping_ratio: float
    """ζ"""
    shape_per_root_kg: Sequence[float]
    """φ, the displacement of each of `places`, for a modal mass of 1 kg (1/√kg)"""
    participation_root_kg: float
    """Γ = φᵀMι, the participation in a motion of the base; needed where the base moves (√kg)"""


class Matrices(TypedDict, total=False):
    """Matrices of a structure, M x″ + C x′ + K x with x relative to the base, from files of comma-separated numbers, a line for each row."""

    mass_file: str
    """file of M, kg, beside this one: symmetric, positive definite"""
    stiffness_file: str
    """file of K, N/m: symmetric, positive definite"""
    damping_ratio: float
    """ζ of every mode"""
    mass_damping_per_s: float
    """a of C = aM + bK, with `stiffness_damping_s` (1/s), in place of damping_ratio"""
    damping_file: str
    """file of C, N·s/m: symmetric, no negative eigenvalue, in place of damping_ratio"""
    stiffness_damping_s: float
    """b of C = aM + bK (s)"""
    influence: Sequence[float]
    """displacement of each place per displacement of the base; default: 1 for each"""


class Structure(TypedDict, total=False):
    """The structure: a mass on a spring and a viscous damper."""

    mass_kg: float
    """M, the structure's mass (kg)"""
    natural_frequency_hz: float
    """f_n = √(k/M)/2π, the undamped natural frequency (Hz)"""
    stiffness_n_per_m: float
    """k, the spring's stiffness (N/m), in place of natural_frequency_hz"""
    damping_ratio: float
    """ζ = c/(2√(kM))"""
    damping_n_s_per_m: float
    """c, the viscous damping (N·s/m), in place of damping_ratio"""


class ParticleWallRestitution(TypedDict, total=False):
    """A hard wall: an impact takes no time."""

    kind: Literal["restitution"]
    coefficient: float
    """e, the coefficient of restitution; with an exponent, that at the reference speed"""
    coefficients: Sequence[float]
    """e at each of `speeds_m_per_s`, 2 to 6 numbers less than 1: linear in the approach speed between them, constant beyond, in place of coefficient"""
    speeds_m_per_s: Sequence[float]
    """approach speeds of `coefficients`, rising (m/s)"""
    exponent: float
    """p of e(v) = min(coefficient·(v/reference speed)^(−p), maximum), with the approach speed v; without it e is the same at every speed"""
    reference_speed_m_per_s: float
    """approach speed at which e is the coefficient (m/s)"""
    maximum: float
    """largest e, that of slow impacts"""
    contact_time_s: float
    """τ, the duration of a contact, from which the wall's force in a case follows; the motion does not depend on it (s)"""
    hertz_stiffness_n_per_m15: float
    """k of an elastic contact of spheres, F = k·δ^(3/2), from which the wall's force in a case follows (N/m^1.5), in place of contact_time_s"""
    pulse_factor: float
    """peak of the contact's force times its duration over its impulse; π/2 of a half-sine"""


class ParticleWallVoigt(TypedDict, total=False):
    """A soft wall: a spring k1 and a dashpot c1 in parallel (Voigt)."""

    kind: Literal["voigt"]
    material: Literal["rubber", "anti_vibration_pad", "acrylic_foam", "pu_foam"]
    """a measured pad: gives k1 and the loss factor"""
    stiffness_n_per_m: float
    """k1, the wall's stiffness (N/m), in place of material"""
    storage_modulus_pa: float
    """E_s of the pad: k1 = ν·E_s with the shape factor (Pa), in place of material"""
    shape_factor_m: float
    """ν of the pad: k1 = ν·E_s needs both (m)"""
    damping_n_s_per_m: float
    """c1, the wall's viscous damping (N·s/m)"""
    loss_factor: float
    """η of the pad: c1 follows by `law`, in place of damping_n_s_per_m"""
    law: Literal["natural", "contact", "natural_hz"]
    """the frequency at which c1 loses what η says: of the structure, or of the contact"""
    release: Literal["zero_penetration", "zero_force"]
    """when the contact ends"""


class ParticleWallHertz(TypedDict, total=False):
    """A wall with Hertz contact and dissipation: F = k·δ^1.5·(1 + β·δ′), δ the penetration. Cases follow it, but those with one degree of freedom on a recorded motion; there, and in campaigns, a hard wall with the restitution of its free impacts acts in its place."""

    kind: Literal["hertz"]
    stiffness_n_per_m15: float
    """k, the stiffness of the contact (N/m^1.5)"""
    youngs_modulus_pa: float
    """E of the wall: k = 4/3·E*·√R with 1/E* = Σ(1 − ν²)/E of wall and particle (Pa), in place of stiffness_n_per_m15"""
    poisson_ratio: float
    """ν of the wall"""
    radius_m: float
    """R of the particle where it touches the wall (m)"""
    particle_youngs_modulus_pa: float
    """E of the particle; that of the wall unless given (Pa)"""
    particle_poisson_ratio: float
    """ν of the particle; that of the wall unless given"""
    hunt_crossley_s_per_m: float
    """α of Hunt and Crossley: β = 1.5·α; e is about 1 − α·v at slow impacts; 0: no loss (s/m)"""
    lankarani_nikravesh_coefficient: float
    """e of Lankarani and Nikravesh: β = 0.75·(1 − e²)/v with the approach speed v of the contact, in place of hunt_crossley_s_per_m"""


class ParticleWallPiezoelectric(TypedDict, total=False):
    """A wall that harvests, in a case: F = k·δ + θ·V with V = (θ·δ − Q)/C and R·Q′ = V, δ the penetration and Q the charge through its load. It has no mass."""

    kind: Literal["piezoelectric"]
    stiffness_n_per_m: float
    """k at short circuit (N/m)"""
    coupling_n_per_v: float
    """θ, the force per voltage at rest (N/V)"""
    capacitance_f: float
    """C of the wall that cannot move (F)"""
    load_ohm: float
    """R across its electrodes (Ω)"""


ParticleWall = Union[ParticleWallRestitution, ParticleWallVoigt, ParticleWallHertz, ParticleWallPiezoelectric]


class Particle(TypedDict, total=False):
    """A single particle that slides between two walls on the structure."""

    mass_kg: float
    """m, the particle's mass (kg)"""
    mass_ratio: float
    """m/M, the particle's mass over the structure's, in place of mass_kg"""
    clearance_m: float
    """d, half the free travel (m)"""
    clearance_ratio: float
    """d/Z, half the free travel over the base amplitude; over P/k of a force, over x0 of a free vibration, in place of clearance_m"""
    friction_coefficient: float
    """μi of the dry friction between particle and structure"""
    wall: ParticleWall
    """both walls, e.g. wall = { kind = 'restitution', coefficient = 0.5 }"""
    positive_wall: ParticleWall
    """the wall at the positive side, where it differs from `wall`: all its keys"""
    offset_m: float
    """y − x in the middle between the walls: they are at y − x = offset ± d (m)"""
    inclination_deg: float
    """angle of the motion to the horizontal; above 0, +x and +y point upwards"""
    start: Literal["centre", "at_negative_wall", "at_positive_wall", "unknown"]
    """where the particle starts in its cavity"""
    start_m: float
    """y − x at the start, within the clearance (m), in place of start"""
    place: str
    """the place of a structure with several, by its name"""
    position_m: float
    """the place on a beam, from its first support (m), in place of place"""


class FrictionDamperSpring(TypedDict, total=False):
    """The friction damper's spring: what it is tuned to, and what is known of it."""

    friction_ratio: float
    """γF = μe·F_N/(kZ), kept while Z changes"""
    normal_force_n: float
    """F_N, the normal force (N), in place of friction_ratio"""
    deflection_m: float
    """Δs from the zero reading (m), in place of friction_ratio"""
    friction_coefficient: float
    """μe between block and base"""
    stiffness_n_per_m: float
    """k_s as far as known: the rig measures it (N/m)"""


class FrictionDamper(TypedDict, total=False):
    """A dry friction damper between structure and base."""

    spring: FrictionDamperSpring
    """a spring that the rig tunes presses the block"""
    force_n: float
    """F, the friction force while slipping (N), in place of spring"""
    friction_ratio: float
    """γF = F/(kZ), the friction force over stiffness times base amplitude, in place of spring"""
    place: str
    """the place of a structure with several, by its name"""
    position_m: float
    """the place on a beam, from its first support (m), in place of place"""
    other_place: str
    """the place of its other end, by its name; the base when left out"""
    other_position_m: float
    """the place of its other end on a beam; the base when left out (m), in place of other_place"""


class Tmd(TypedDict, total=False):
    """A tuned mass damper: a mass on a spring and a dashpot from the structure."""

    mass_kg: float
    """m, the damper's mass (kg)"""
    mass_ratio: float
    """m/M, the damper's mass over the structure's, in place of mass_kg"""
    tuning: Literal["den_hartog", "warburton"]
    """the rule that gives spring and dashpot"""
    stiffness_n_per_m: float
    """k1, the damper's stiffness (N/m), in place of tuning"""
    frequency_ratio: float
    """γ, the damper's own frequency over the structure's, in place of tuning"""
    damping_ratio: float
    """ζ = c1/(2√(k1·m))"""
    damping_n_s_per_m: float
    """c1, the damper's viscous damping (N·s/m), in place of damping_ratio"""
    place: str
    """the place of a structure with several, by its name"""
    position_m: float
    """the place on a beam, from its first support (m), in place of place"""


class Case(TypedDict, total=False):
    """The top level of a case, which also has the keys of its set-up."""

    name: str
    """name of the case in figures; the file name when left out"""
    set_up_file: str
    """a file with tables of a set-up, for the keys that this file leaves out; relative to this file"""
    base: Base
    """motion of the base; fixed when left out"""
    force: Force
    """force on the structure; a sine also beside a sine of the base, whose frequency it has"""
    many_particles: ManyParticles
    """spheres in a box on the structure, in place of the other dampers"""
    initial: Initial
    """initial displacements and velocities; at rest when left out"""
    run: Run
    """duration and requested output, e.g. run = { duration_s = 10 }"""
    storey: Sequence[Storey]
    """a frame in place of `structure`: its storeys from the ground up; the places are its floors"""
    beam: Beam
    """a beam in place of `structure`; places are positions on it"""
    mode: Sequence[Mode]
    """natural modes in place of `structure`, at the places of `places`"""
    matrices: Matrices
    """mass, stiffness and damping matrices in place of `structure`; a row for each of `places`"""
    places: Sequence[str]
    """names of the places of modes or matrices, in their order"""
    modal_damping_ratio: float
    """ζ of every mode, in place of the dampings of the storeys"""
    observed_place: str
    """the place whose displacement is x; default: the top floor, the last of `places`, the free end or the middle of a beam"""
    observed_position_m: float
    """the position on a beam whose displacement is x (m), in place of observed_place"""
    base_amplitude_m: float
    """Z: what a campaign's sine and a case's base move by, and ratios refer to (m)"""
    gravity_m_per_s2: float
    """g in the weight of the particle, and so in the friction between particle and structure (m/s²)"""
    structure: Structure
    """the structure: mass, stiffness, damping"""
    particle: Union[Particle, Sequence[Particle]]
    """the impact damper"""
    friction_damper: Union[FrictionDamper, Sequence[FrictionDamper]]
    """the friction damper, between structure and base"""
    tmd: Union[Tmd, Sequence[Tmd]]
    """the tuned mass damper"""


class CampaignRigSensorsIdeal(TypedDict, total=False):
    """Ideal sensors."""

    kind: Literal["ideal"]


class CampaignRigSensorsDataSheet(TypedDict, total=False):
    """Sensors with the errors of a data sheet."""

    kind: Literal["data_sheet"]
    linearity: float
    """largest deviation from a straight line, as a share of the range"""
    response_s: float
    """time constant of the sensor (s)"""
    skew_s: float
    """delay of the conversion of z after that of x (s)"""
    anti_alias_hz: float
    """corner frequency of the anti-alias filter (Hz)"""
    bits: int
    """resolution of the converter over the whole range"""
    oversampling: int
    """conversions that are averaged into a sample"""


CampaignRigSensors = Union[CampaignRigSensorsIdeal, CampaignRigSensorsDataSheet]


class CampaignRigShaker(TypedDict, total=False):
    """A simulated electrodynamic shaker that feels its load. Of a real rig only `calibrated_at_hz` is used."""

    moving_mass_kg: float
    """mass of table and armature (kg)"""
    suspension_stiffness_n_per_m: float
    """stiffness of the suspension (N/m)"""
    suspension_damping_n_s_per_m: float
    """damping of the suspension (N·s/m)"""
    force_factor_n_per_a: float
    """force per current (N/A)"""
    amplifier: Literal["voltage", "current"]
    """the quantity that the amplifier controls"""
    coil_resistance_ohm: float
    """resistance of the coil (Ω)"""
    limit_v: float
    """limit of the voltage (V)"""
    current_limit_a: float
    """limit of the current (A)"""
    half_stroke_m: float
    """stroke to either side (m)"""
    calibrated_at_hz: float
    """frequency at which the unloaded table moves by the base amplitude (Hz)"""


class CampaignRig(TypedDict, total=False):
    """Simulated sensors and shaker, and the campaign's limits: each tightens a limit of the board while the campaign runs."""

    sensor_resolution_m: float
    """smallest displacement step of the sensors; 0 for none, simulated rigs only (m)"""
    sensor_noise_rms_m: float
    """RMS noise of a displacement sample; 0 for none, simulated rigs only (m)"""
    noise_seed: int
    """seed of the simulated noise"""
    displacement_limit_m: float
    """limit of both |x| and |z| (m)"""
    structure_limit_m: float
    """limit of |x|: above it the controller fades out the drive (m)"""
    base_limit_m: float
    """limit of |z| (m)"""
    half_cycles_ahead: float
    """half-cycles for which a growing motion is predicted, to stop before a limit"""
    wall_force_limit_n: float
    """limit of the force on a wall (N)"""
    saturated_s: float
    """time after which a saturated drive is a fault (s)"""
    host_silent_s: float
    """time without a message after which the board stops the drive (s)"""
    brake_n: float
    """force with which the friction damper brakes after a fault (N)"""
    sensors: CampaignRigSensors
    """errors of the simulated sensors; none when left out"""
    shaker: CampaignRigShaker
    """a simulated shaker that feels its load; when left out the base follows the drive exactly"""


class CampaignTelemetry(TypedDict, total=False):
    """Recorded signals and their rate."""

    rate_hz: float
    """samples of each signal in a second: 0 for none, or 1000 divided by a whole number (Hz)"""
    signals: Sequence[str]
    """names of the signals; x, z, drive and frequency when left out"""


class CampaignPlan(TypedDict, total=False):
    """Who measures what, and in which order. Texts go into manifest and report."""

    operator: str
    """who runs the campaign"""
    specimen: str
    """what is measured: serial number, material, state"""
    notes: str
    """anything else that a reader of the results must know"""
    order: Literal["as_written", "random"]
    """order of the set-ups, of the experiments on each, and of the frequencies that start from rest"""
    order_seed: int
    """seed of a random order"""


class CampaignPlant(TypedDict, total=False):
    """A structure with several places on the rig. A damper's `place` or `position_m` says where it is mounted; when left out, where x is measured."""

    storey: Sequence[Storey]
    """a frame in place of `structure`: its storeys from the ground up; the places are its floors"""
    beam: Beam
    """a beam in place of `structure`; places are positions on it"""
    mode: Sequence[Mode]
    """natural modes in place of `structure`, at the places of `places`"""
    places: Sequence[str]
    """names of the places of modes or matrices, in their order"""
    modal_damping_ratio: float
    """ζ of every mode, in place of the dampings of the storeys"""
    observed_place: str
    """the place whose displacement is x; default: the top floor, the last of `places`, the free end or the middle of a beam"""
    observed_position_m: float
    """the position on a beam whose displacement is x (m), in place of observed_place"""


class CampaignSetUp(TypedDict, total=False):
    """A set-up: what is mounted on the rig, with its base amplitude."""

    name: str
    """a name for experiments to call it by"""
    label: str
    """its name in figures and tables; `name` when left out"""
    instruction: str
    """what a person does before it; asked on a real rig, and noted in the journal"""
    base_amplitude_m: float
    """Z: what a campaign's sine and a case's base move by, and ratios refer to (m)"""
    force_amplitude_n: float
    """P: a force on the structure over a fixed base, instead of a base that moves; P/k takes the place of Z (N), in place of base_amplitude_m"""
    gravity_m_per_s2: float
    """g in the weight of the particle, and so in the friction between particle and structure (m/s²)"""
    structure: Structure
    """the structure: mass, stiffness, damping"""
    particle: Particle
    """the impact damper"""
    friction_damper: FrictionDamper
    """the friction damper, between structure and base"""
    tmd: Tmd
    """the tuned mass damper"""
    damper: Literal["unmodelled"]
    """a damper without a model: it is measured, not predicted"""


class CampaignExperimentFrequenciesHz(TypedDict, total=False):
    """Evenly spaced frequencies."""

    from_hz: float
    """the first frequency (Hz)"""
    to_hz: float
    """the last frequency (Hz)"""
    resonance_points: int
    """further frequencies over the half-power bandwidth of each bare structure, fn(1 − ζ) to fn(1 + ζ)"""
    peak_points: int
    """further frequencies between the neighbours of the point with the highest measured X/Z (cycle maxima) and of a second maximum that may be higher, measured after the grid on each set-up; a sweep (`carry_over`) begins at the first of them from rest"""
    step_hz: float
    """the step; negative for falling frequencies (Hz)"""


class CampaignExperimentSteady(TypedDict, total=False):
    """When a point counts as steady."""

    tolerance: float
    """largest deviation of X/Z from its limit, uncertainty included"""
    scatter: float
    """largest relative scatter of the cycle maxima of a motion that repeats"""
    longest_dwell_s: float
    """time of all dwells of a point that is measured again until it is steady; one dwell when left out (s)"""


class CampaignExperimentClosedLoop(TypedDict, total=False):
    """Parameters of the closed loop of the base amplitude."""

    gain_per_s: float
    """rate at which an amplitude error decays without load (1/s)"""
    tolerance: float
    """relative error of the amplitude within which the base counts as held"""
    wait_s: float
    """longest time after settling until the base is held (s)"""
    drive_limit_m: float
    """limit of the drive; the range of the rig's output when left out (m)"""


class CampaignExperimentSteppedSine(TypedDict, total=False):
    """One frequency of the base after another."""

    kind: Literal["stepped_sine"]
    name: str
    """its name in tables; `experiment 1` for the first when left out"""
    set_ups: Sequence[str]
    """names of the set-ups that it is run on; all when left out"""
    repeats: int
    """times that it is run on each set-up; each is an experiment with a number after its name"""
    instruction: str
    """what a person does before it; asked on a real rig, and noted in the journal"""
    frequencies_hz: Union[Sequence[float], CampaignExperimentFrequenciesHz]
    """a list, or { from_hz, to_hz, step_hz, resonance_points, peak_points } (Hz)"""
    start: Literal["from_rest", "carry_over"]
    """whether a point starts from rest or carries over the motion of the one before"""
    settle_s: float
    """time from the start of a point to its dwell (s)"""
    dwell_s: float
    """the time that is measured at each frequency (s)"""
    ramp_s: float
    """rise and fall of the drive, at most `settle_s` (s)"""
    rest_level_m: float
    """|x| below which the structure counts as at rest before the start (m)"""
    steady: CampaignExperimentSteady
    """when a point counts as steady, and how long it is measured again"""
    drive: Literal["constant", "closed_loop"]
    """constant drive, or the base amplitude in closed loop, which needs `[rig.shaker]`"""
    closed_loop: CampaignExperimentClosedLoop
    """parameters of the closed loop"""


class CampaignExperimentResponseLoop(TypedDict, total=False):
    """Parameters of the loop that keeps the structure's amplitude."""

    gain_per_cycle: float
    """rate at which a deviation is damped, for each cycle of the drive"""
    tolerance: float
    """relative error of the amplitude within which the response counts as held"""
    wait_s: float
    """longest time after settling until the response is held (s)"""
    drive_limit_m: float
    """limit of the drive; the range of the rig's output when left out (m)"""


class CampaignExperimentResponseControlled(TypedDict, total=False):
    """One frequency after another at a constant amplitude of the structure: the drive is whatever keeps it, and Z is the result."""

    kind: Literal["response_controlled"]
    name: str
    """its name in tables; `experiment 1` for the first when left out"""
    set_ups: Sequence[str]
    """names of the set-ups that it is run on; all when left out"""
    repeats: int
    """times that it is run on each set-up; each is an experiment with a number after its name"""
    instruction: str
    """what a person does before it; asked on a real rig, and noted in the journal"""
    x_amplitudes_m: Sequence[float]
    """amplitudes of x at the drive frequency, each an experiment of its own (m)"""
    velocity_amplitudes_m_per_s: Sequence[float]
    """amplitudes of the velocity of x, each an experiment of its own (m/s), in place of x_amplitudes_m"""
    relative_amplitudes_m: Sequence[float]
    """amplitudes of x − z, each an experiment of its own (m), in place of x_amplitudes_m"""
    frequencies_hz: Union[Sequence[float], CampaignExperimentFrequenciesHz]
    """a list, or { from_hz, to_hz, step_hz, resonance_points, peak_points } (Hz)"""
    start: Literal["from_rest", "carry_over"]
    """whether a point starts from rest or carries over the motion of the one before"""
    settle_s: float
    """time from the start of a point to its dwell (s)"""
    dwell_s: float
    """the time that is measured at each frequency (s)"""
    ramp_s: float
    """rise and fall of the drive, at most `settle_s` (s)"""
    rest_level_m: float
    """|x| below which the structure counts as at rest before the start (m)"""
    steady: CampaignExperimentSteady
    """when a point counts as steady, and how long it is measured again"""
    response_loop: CampaignExperimentResponseLoop
    """parameters of the loop that keeps the amplitude"""


class CampaignExperimentPhaseLock(TypedDict, total=False):
    """The loop that follows a resonance by the phase of x."""

    phase_deg: float
    """kept phase of x relative to z; at −90° the structure is at resonance, fn·√(1 + (Z/X)²) of a linear one"""
    gain_per_cycle: float
    """rate of the loop, for each cycle of the drive"""
    tolerance_deg: float
    """deviation of the phase within which it counts as kept; the lock is lost beyond three times it"""
    wait_s: float
    """longest time after settling until the phase is kept; the longest wait of the loops in use counts (s)"""


class CampaignExperimentResonanceTracking(TypedDict, total=False):
    """The resonance at one amplitude after another: the drive's frequency follows the phase of x, and frequency and damping over the amplitude are the result."""

    kind: Literal["resonance_tracking"]
    name: str
    """its name in tables; `experiment 1` for the first when left out"""
    set_ups: Sequence[str]
    """names of the set-ups that it is run on; all when left out"""
    repeats: int
    """times that it is run on each set-up; each is an experiment with a number after its name"""
    instruction: str
    """what a person does before it; asked on a real rig, and noted in the journal"""
    base_amplitudes_m: Sequence[float]
    """amplitudes of the base, in the order in which they are measured; a shaker keeps them with drive = 'closed_loop' (m)"""
    x_amplitudes_m: Sequence[float]
    """amplitudes of x at the drive frequency, in the order in which they are measured; a loop keeps them (m), in place of base_amplitudes_m"""
    velocity_amplitudes_m_per_s: Sequence[float]
    """amplitudes of the velocity of x, likewise (m/s), in place of base_amplitudes_m"""
    relative_amplitudes_m: Sequence[float]
    """amplitudes of x − z, likewise (m), in place of base_amplitudes_m"""
    from_hz: float
    """lowest frequency of the drive (Hz)"""
    to_hz: float
    """highest frequency of the drive (Hz)"""
    start_hz: float
    """frequency at which the first point starts, and each from rest; the middle of the range when left out (Hz)"""
    start: Literal["from_rest", "carry_over"]
    """whether a point starts from rest or carries over the motion of the one before"""
    settle_s: float
    """time from the start of a point to its dwell (s)"""
    dwell_s: float
    """the time that is measured at each frequency (s)"""
    ramp_s: float
    """rise and fall of the drive, at most `settle_s` (s)"""
    rest_level_m: float
    """|x| below which the structure counts as at rest before the start (m)"""
    steady: CampaignExperimentSteady
    """when a point counts as steady, and how long it is measured again"""
    drive: Literal["constant", "closed_loop"]
    """constant drive, or the base amplitude in closed loop, which needs `[rig.shaker]`"""
    closed_loop: CampaignExperimentClosedLoop
    """parameters of the closed loop"""
    response_loop: CampaignExperimentResponseLoop
    """parameters of the loop that keeps the amplitude"""
    phase_lock: CampaignExperimentPhaseLock
    """the phase that is kept, and the loop that keeps it"""


class CampaignExperimentPlayback(TypedDict, total=False):
    """The base follows a recorded motion, or noise from a seed."""

    kind: Literal["playback"]
    name: str
    """its name in tables; `experiment 1` for the first when left out"""
    set_ups: Sequence[str]
    """names of the set-ups that it is run on; all when left out"""
    repeats: int
    """times that it is run on each set-up; each is an experiment with a number after its name"""
    instruction: str
    """what a person does before it; asked on a real rig, and noted in the journal"""
    target_peak_m: float
    """peak to which the record or the noise is scaled (m)"""
    baseline: Literal["none", "linear"]
    """the line that is removed; linear for an acceleration, none for a displacement when left out"""
    sample_rate_hz: float
    """samples per second of the played motion; as fast as the record and the controller allow when left out (Hz)"""
    ramp_s: float
    """rise and fall of the drive at both ends (s)"""
    tail_s: float
    """time measured after the end (s)"""
    rest_level_m: float
    """|x| below which the structure counts as at rest before the start (m)"""
    noise: BaseNoise
    """band-limited noise in place of a file"""
    file: str
    """CSV, AT2, V2, UFF, MAT, HDF5 or Parquet file, relative to this file; `FILE#3` or `FILE#name` is one of several signals; or `noise`"""
    quantity: Literal["acceleration", "displacement"]
    """quantity of the values, where the file does not state it"""
    unit: Literal["m/s2", "g", "cm/s2", "mm/s2", "m", "cm", "mm", "V", "mV"]
    """unit of the values, where neither the file nor the end of the column's name states it"""
    sensitivity: str
    """of the sensor, if the values are its voltage: '100 mV/g', '10.2 mV/(m/s2)', '2.5 V/mm'"""
    scale: float
    """factor on every value"""
    time_step_s: float
    """time between samples; otherwise the file has a time column (s)"""
    column: Union[str, int]
    """column of the values; default: the only one beside the time column"""
    time_column: Union[str, int]
    """time column; default: the first"""


class CampaignExperimentImpulse(TypedDict, total=False):
    """A pulse of the base."""

    kind: Literal["impulse"]
    name: str
    """its name in tables; `experiment 1` for the first when left out"""
    set_ups: Sequence[str]
    """names of the set-ups that it is run on; all when left out"""
    repeats: int
    """times that it is run on each set-up; each is an experiment with a number after its name"""
    instruction: str
    """what a person does before it; asked on a real rig, and noted in the journal"""
    shape: Literal["half_sine", "versine", "haversine", "rectangle"]
    """shape of the pulse; versine and haversine are the same"""
    amplitude_m: float
    """height of the pulse (m)"""
    duration_s: float
    """length of the pulse (s)"""
    rise_s: float
    """rise and fall of a rectangle, at most half its length; a tenth when left out (s)"""
    sample_rate_hz: float
    """samples per second of the played motion; as fast as the record and the controller allow when left out (Hz)"""
    ramp_s: float
    """rise and fall of the drive at both ends (s)"""
    tail_s: float
    """time measured after the end (s)"""
    rest_level_m: float
    """|x| below which the structure counts as at rest before the start (m)"""


class CampaignExperimentFreeVibration(TypedDict, total=False):
    """The structure is held at a displacement and released; a simulated one starts there."""

    kind: Literal["free_vibration"]
    name: str
    """its name in tables; `experiment 1` for the first when left out"""
    set_ups: Sequence[str]
    """names of the set-ups that it is run on; all when left out"""
    repeats: int
    """times that it is run on each set-up; each is an experiment with a number after its name"""
    instruction: str
    """what a person does before it; asked on a real rig, and noted in the journal"""
    start_m: float
    """x0, where the structure is released (m)"""
    measure_s: float
    """time measured after the release (s)"""
    level_m: float
    """|x| beyond which it counts as held, below |x0|; 0.8 |x0| when left out (m)"""
    hold_s: float
    """how long it must be held (s)"""
    timeout_s: float
    """how long the release may take (s)"""
    cycles: int
    """cycles over which the decay is measured"""


CampaignExperiment = Union[CampaignExperimentSteppedSine, CampaignExperimentResponseControlled, CampaignExperimentResonanceTracking, CampaignExperimentPlayback, CampaignExperimentImpulse, CampaignExperimentFreeVibration]


class Campaign(TypedDict, total=False):
    """The top of a campaign. Structure and dampers at the top are for all set-ups: a set-up has the keys that it leaves out from here."""

    name: str
    """a short name, part of the run folder's name: letters, digits, '-' and '_'"""
    set_up_file: str
    """a file with tables of a set-up, for the keys that this file leaves out; relative to this file"""
    rig: CampaignRig
    """simulated sensors and shaker, and the campaign's limits"""
    telemetry: CampaignTelemetry
    """recorded signals; x, z, drive and frequency at 100 Hz when left out"""
    plan: CampaignPlan
    """who measures what, and in which order"""
    gravity_m_per_s2: float
    """g in the weight of the particle, and so in the friction between particle and structure (m/s²)"""
    structure: Structure
    """the structure: mass, stiffness, damping"""
    particle: Particle
    """the impact damper"""
    friction_damper: FrictionDamper
    """the friction damper, between structure and base"""
    tmd: Tmd
    """the tuned mass damper"""
    plant: CampaignPlant
    """a structure with several places that carries the dampers, for the virtual rig, predictions and `damprig compare`; `structure` is then what the board knows of it, its lowest mode at x when left out"""
    set_up: Sequence[CampaignSetUp]
    """the set-ups, in the order in which they are mounted"""
    experiment: Sequence[CampaignExperiment]
    """the experiments"""


# An axis: one key of the case and its values.
StudyAxis = TypedDict(
    "StudyAxis",
    {
        "key": "str",  # the key with its tables, as in the case: particle.clearance_ratio
        "from": "float",  # first value of a range
        "to": "float",  # last value of the range; greater than `from`
        "count": "int",  # number of values of the range; left out with [sampling]: drawn from the range
        "scale": "Literal['linear', 'log']",  # spacing of the values in the range
        "distribution": "Literal['uniform', 'normal', 'lognormal']",  # what a value is drawn from with [sampling]: a range, or a distribution that is cut off at `from` and `to`, by default 4 standard deviations (of the logarithm of a lognormal value) from its middle
        "mean": "float",  # mean of the value before its distribution is cut off, in the key's unit
        "standard_deviation": "float",  # standard deviation of the value (not of its logarithm) before its distribution is cut off, in the key's unit
        "values": "Sequence[float]",  # the values, in place of a range
        "words": "Sequence[str]",  # the values of a key that takes words, in place of a range, in place of values
        "reduce": "Literal['maximum', 'minimum', 'mean', 'grid_maximum', 'scan_maximum']",  # the points of this axis become one: the largest (smallest, mean) value over it; over drive frequencies the largest and smallest are looked for between the values too, on 1600 intervals with scan_maximum; grid_maximum is that of the values alone
    },
    total=False,
)


class StudySampling(TypedDict, total=False):
    """Points drawn from the ranges of the axes without a `count`."""

    method: Literal["latin_hypercube", "sobol", "sobol_indices", "morris"]
    """how points are drawn: a Latin hypercube, Sobol's sequence, or those that sensitivity indices need: Sobol' indices (variance shares) or Morris's elementary effects"""
    count: int
    """number of points; of base points with sobol_indices (count × (ranges + 2) points in all), of trajectories with morris (count × (ranges + 1) points)"""
    seed: int
    """of the random numbers"""


class StudyRecord(TypedDict, total=False):
    """What is counted of each simulation."""

    cycles: int
    """counted cycles of the drive, or of the structure without one"""
    duration_s: float
    """counted time; the cycle maxima are those of its whole cycles (s), in place of cycles"""
    settle_cycles: int
    """cycles simulated before, from rest, not counted"""
    settle_s: float
    """time simulated before, from rest, not counted; rounded up to whole cycles (s), in place of settle_cycles"""


class StudyEnsemble(TypedDict, total=False):
    """Several starts of the particle at each point."""

    starts: int
    """number of starts, evenly spread from one wall to the other"""
    over: Literal["worst", "q95", "median", "mean"]
    """the value over the starts that maps, curves and the best point have: the worst, that which 95 % are as good as, the median or the mean"""
    quantiles: Sequence[float]
    """quantiles over the starts that the table has; default: 0.05, 0.5 and 0.95"""


class StudyOverlay(TypedDict, total=False):
    """Curves over the map of a study: where a periodic motion of the case changes, in the two keys that the study varies."""

    continuation: str
    """a continuation file with a table [second], relative to this file; its case and its two parameters are those of the study"""


class Study(TypedDict, total=False):
    """The top level of a study."""

    name: str
    """name of the study in figures; the file name when left out"""
    case: Union[str, os.PathLike[str], Case]
    """the case that the study varies; relative to this file"""
    metrics: Sequence[str]
    """what is computed at each point, e.g. metrics = ['x_over_z']; docs/STUDIES.md lists them"""
    objective: Literal["x_over_z", "max_x_over_z", "rms_over_z", "mean_cycle_max_m", "max_abs_x_m", "max_abs_x_minus_z_m", "rms_x_m", "cycle_spread", "impacts_per_cycle", "peak_contact_force_n", "harvested_power_w", "period_cycles", "largest_multiplier", "loss_factor", "collective_motion"]
    """the metric whose best value is shown and marked; the first metric when left out"""
    goal: Literal["minimum", "maximum"]
    """whether the smallest or the largest value of the objective is the best"""
    points: str
    """a CSV file of points from outside, relative to this file: a line with keys of the case, then a line of numbers for each point; other axes are combined with them"""
    axis: Sequence[StudyAxis]
    """what is varied, a table for each key of the case"""
    sampling: StudySampling
    """points drawn from the ranges of the axes without a `count`, in place of a grid"""
    record: StudyRecord
    """what is counted of each simulation; default: as the case's `run` says"""
    points_per_part: int
    """points of a part of the results: a kill costs those being computed; default: about two million cycles"""
    ensemble: StudyEnsemble
    """several starts of the particle at each point"""
    overlay: Sequence[StudyOverlay]
    """curves over the map: where periodic motions of the case change"""


# A variable: one key of the case and its range, or the values that there are.
OptimisationVariable = TypedDict(
    "OptimisationVariable",
    {
        "key": "str",  # the key with its tables, as in the case: particle.clearance_ratio
        "from": "float",  # least value
        "to": "float",  # largest value; greater than `from`
        "values": "Sequence[float]",  # the values that there are (a catalogue), in place of a range
        "step": "float",  # the values that can be made are `from` and whole steps from it, in the key's unit
        "tolerance": "float",  # how far from the nominal value the made one may be, to either side, in the key's unit; the objective counts within it. Left out: the nominal value counts, and the answer says what 0.1 % of it (of the range where it is 0) does
        "relative_tolerance": "float",  # the same as a share of the nominal value, in place of tolerance
        "scale": "Literal['linear', 'log']",  # whether the search is even in the value or in its logarithm
    },
    total=False,
)


# A key of the case that nobody knows exactly or that changes in use: the objective counts over its values.
OptimisationUncertain = TypedDict(
    "OptimisationUncertain",
    {
        "key": "str",  # the key with its tables, as in the case: particle.wall.coefficient
        "from": "float",  # least value; without a distribution all between it and `to` are as likely
        "to": "float",  # largest value; greater than `from`
        "scale": "Literal['linear', 'log']",  # whether the value or its logarithm is as likely everywhere
        "distribution": "Literal['uniform', 'normal', 'lognormal']",  # how likely a value is: as likely everywhere in the range, or as a distribution that is cut off at `from` and `to`, by default 4 standard deviations (of the logarithm of a lognormal value) from its middle. The worst counts all values between the ends alike
        "mean": "float",  # mean of the value before its distribution is cut off, in the key's unit
        "standard_deviation": "float",  # standard deviation of the value (not of its logarithm) before its distribution is cut off, in the key's unit
        "values": "Sequence[float]",  # values that are as likely as each other, in place of a range; the middle one is that of the answer's small changes
    },
    total=False,
)


class OptimisationAlternative(TypedDict, total=False):
    """Another damper that is optimised over the same band, with the same objective and record; a constraint on impacts or contact forces is kept where nothing strikes."""

    name: str
    """name of the alternative"""
    case: Union[str, os.PathLike[str], Case]
    """its case: a file, or tables that take the place of the case's own and of all its dampers: case = { friction_damper = { force_n = 5 } }"""
    variable: Sequence[OptimisationVariable]
    """as [[variable]]; none: the case as it is"""
    uncertain: Sequence[OptimisationUncertain]
    """as [[uncertain]]"""


class OptimisationConstraint(TypedDict, total=False):
    """A constraint on a metric, at every point of the band, from every start, within all tolerances and for all uncertain values."""

    metric: Literal["x_over_z", "max_x_over_z", "rms_over_z", "mean_cycle_max_m", "max_abs_x_m", "max_abs_x_minus_z_m", "rms_x_m", "cycle_spread", "impacts_per_cycle", "peak_contact_force_n", "harvested_power_w", "period_cycles", "largest_multiplier", "loss_factor", "collective_motion"]
    """the metric; docs/STUDIES.md has their meanings"""
    at_most: float
    """largest allowed value, in the metric's unit"""
    at_least: float
    """least allowed value, in the metric's unit, in place of at_most"""
    equals: float
    """the only allowed value: period_cycles = 1, in place of at_most"""


class OptimisationFront(TypedDict, total=False):
    """A second objective: the front has the best value of the objective for each of some limits of this metric, which counts as in a constraint."""

    metric: Literal["x_over_z", "max_x_over_z", "rms_over_z", "mean_cycle_max_m", "max_abs_x_m", "max_abs_x_minus_z_m", "rms_x_m", "cycle_spread", "impacts_per_cycle", "peak_contact_force_n", "harvested_power_w", "period_cycles", "largest_multiplier", "loss_factor", "collective_motion"]
    """the second objective's metric; docs/STUDIES.md has their meanings"""
    goal: Literal["minimum", "maximum"]
    """whether its smallest or its largest value is the best"""
    count: int
    """most points of the front; each is an optimisation"""


class OptimisationEnsemble(TypedDict, total=False):
    """What counts of everything that is not certain: starts, tolerances and uncertain values."""

    starts: int
    """number of starts of the particle at each point, evenly spread from one wall to the other; left out: the case's own"""
    over: Literal["worst", "q95", "median", "mean"]
    """the value over all of them that is optimised: the worst, that which 95 % are as good as, the median or the mean"""


class Optimisation(TypedDict, total=False):
    """The top level of an optimisation."""

    name: str
    """name of the optimisation; the file name when left out"""
    case: Union[str, os.PathLike[str], Case]
    """the case that the optimisation varies: its file, relative to this one, or its tables here ([case.structure] and so on)"""
    objective: Literal["x_over_z", "max_x_over_z", "rms_over_z", "mean_cycle_max_m", "max_abs_x_m", "max_abs_x_minus_z_m", "rms_x_m", "cycle_spread", "impacts_per_cycle", "peak_contact_force_n", "harvested_power_w", "period_cycles", "largest_multiplier", "loss_factor", "collective_motion"]
    """the metric that is to be best; docs/STUDIES.md has their meanings"""
    goal: Literal["minimum", "maximum"]
    """whether the smallest or the largest value of the objective is the best"""
    evaluations: int
    """most points that are evaluated; default: 2000 for each variable, 500 with tolerances or uncertain keys"""
    seed: int
    """of the search's random numbers"""
    variable: Sequence[OptimisationVariable]
    """what is looked for, a table for each key of the case"""
    uncertain: Sequence[OptimisationUncertain]
    """what is not known, a table for each key of the case"""
    alternative: Sequence[OptimisationAlternative]
    """other dampers, each optimised under the same rules"""
    axis: Sequence[StudyAxis]
    """the band that each point is judged over: an axis of a study with `reduce`"""
    constraint: Sequence[OptimisationConstraint]
    """what must hold at every point of the band, from every start, within all tolerances and for all uncertain values"""
    front: OptimisationFront
    """a second objective, and the front of both"""
    record: StudyRecord
    """what is counted of each simulation, as in a study; default: as the case's `run` says"""
    ensemble: OptimisationEnsemble
    """what counts of starts, tolerances and uncertain values"""


# The second parameter.
ContinuationSecond = TypedDict(
    "ContinuationSecond",
    {
        "parameter": "str",  # the parameter by its key in a case
        "from": "float",  # lower end of the range
        "to": "float",  # upper end of the range
    },
    total=False,
)


# What is followed: the case, its parameter and the range.
Continuation = TypedDict(
    "Continuation",
    {
        "case": "Union[str, os.PathLike[str], Case]",  # the case file, relative to this file
        "parameter": "str",  # the parameter by its key in a case, e.g. 'particle.clearance_m'
        "from": "float",  # lower end of the range, in the unit of the parameter
        "to": "float",  # upper end of the range
        "start_at": "float",  # value at which the first orbit is simulated; default: that of the case
        "branches": "Literal['main', 'all']",  # whether branches are followed that branch off at a period doubling or where the symmetry breaks
        "restarts": "int",  # most new starts by simulation beyond grazings
        "longest_step": "float",  # longest step, as a share of the range
        "settle_periods": "int",  # most drive periods that a simulation may take to repeat
        "second": "ContinuationSecond",  # a second parameter: curves of the special points in both
    },
    total=False,
)
