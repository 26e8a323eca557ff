"""A small rig for the stand-in server: a structure with a particle on a base that walks through a stepped sine.

Plain numbers of the size that a lab sees; not the project's simulation, which the page does not depend on.
"""

import math

STEP_S = 1e-3
MASS_KG, NATURAL_HZ, DAMPING, MASS_RATIO, RESTITUTION = 1.6, 2.5, 0.02, 0.1, 0.6
SIGNALS = [
    ("x", "m"), ("z", "m"), ("drive", "m"), ("frequency", "Hz"), ("x_velocity", "m/s"), ("spring_force", "N"),
    ("wall_low", "N"), ("wall_high", "N"),
]


def transmissibility(frequency_hz, damping=DAMPING):
    """X/Z of the structure alone."""
    ratio = frequency_hz / NATURAL_HZ
    over = 1 + (2 * damping * ratio) ** 2
    under = (1 - ratio**2) ** 2 + (2 * damping * ratio) ** 2
    return math.sqrt(over / under)


class Rig:
    """Advances tick by tick; collects rows, impacts, Poincaré points and measured points."""

    def __init__(self, dwell_s=4.0, clearance_m=0.006, z_m=1.2e-3, set_ups=("bare", "spid", "hybrid")):
        self.dwell_s, self.clearance_m, self.z_m, self.set_ups = dwell_s, clearance_m, z_m, list(set_ups)
        self.frequencies = [round(2.0 + 0.05 * i, 2) for i in range(21)]
        self.tick, self.phase, self.place = 0, 0.0, 0
        self.x = self.v = self.y = self.w = 0.0
        self.force, self.target = 0.0, 12.5
        self.pulse = [0.0, 0.0]
        self.impacts_seen, self.in_cycle, self.last_cycle = 0, 0, 0
        self.highest = self.cycle_high = 0.0
        self.since_point = 0

    @property
    def t_s(self):
        return self.tick * STEP_S

    @property
    def set_up(self):
        return self.set_ups[min(self.place // len(self.frequencies), len(self.set_ups) - 1)]

    @property
    def frequency_hz(self):
        return self.frequencies[self.place % len(self.frequencies)]

    @property
    def planned(self):
        return len(self.frequencies) * len(self.set_ups)

    def advance(self, ticks):
        """Runs for some ticks and returns the parts of a message."""
        t, values = [], {name: [] for name, _ in SIGNALS}
        impacts, section, points = [], [], []
        omega_n = 2 * math.pi * NATURAL_HZ
        for _ in range(ticks):
            omega = 2 * math.pi * self.frequency_hz
            before = self.phase
            self.phase = (self.phase + omega * STEP_S) % (2 * math.pi)
            z, zv = self.z_m * math.sin(self.phase), self.z_m * omega * math.cos(self.phase)
            damping = DAMPING * (2.2 if self.set_up == "hybrid" else 1)
            self.v += STEP_S * (-(omega_n**2) * (self.x - z) - 2 * damping * omega_n * (self.v - zv))
            self.x += STEP_S * self.v
            self.y += STEP_S * self.w
            self.pulse = [0.55 * p if p > 0.5 else 0.0 for p in self.pulse]
            if self.set_up != "bare":
                impacts += self._impacts()
            self.highest = max(self.highest, abs(self.x))
            if self.phase < before:
                section.append([self.x, self.v])
                self.last_cycle, self.in_cycle = self.in_cycle, 0
                self.cycle_high, self.highest = self.highest, 0.0
            self.tick += 1
            self.since_point += 1
            if self.set_up == "hybrid":
                self.force += STEP_S * 0.35 * (self.target - self.force)
            t.append(round(self.t_s, 6))
            row = (self.x, z, z, self.frequency_hz, self.v, self.force, self.pulse[0], self.pulse[1])
            for (name, _), value in zip(SIGNALS, row):
                values[name].append(float(f"{value:.6g}"))
            if self.since_point * STEP_S >= self.dwell_s and self.place < self.planned:
                points.append(self._point())
                self.place += 1
                self.since_point = 0
        return {"rows": {"t_s": t, "values": values}, "impacts": impacts, "section": section, "points": points}

    def _impacts(self):
        found = []
        gap = self.y - self.x
        for side in (1, -1):
            approach = side * (self.w - self.v)
            if side * gap >= self.clearance_m and approach > 0:
                impulse = MASS_KG * MASS_RATIO / (1 + MASS_RATIO) * (1 + RESTITUTION) * approach
                self.w -= side * impulse / (MASS_KG * MASS_RATIO)
                self.v += side * impulse / MASS_KG
                peak = impulse / 0.0012
                self.pulse[0 if side < 0 else 1] = peak
                self.impacts_seen += 1
                self.in_cycle += 1
                found.append({"t_s": round(self.t_s, 4), "side": side, "peak_n": round(peak, 2)})
        return found

    def _point(self):
        ratio = self.cycle_high / self.z_m
        return {"set_up": self.set_up, "experiment": "sweep", "index": self.place % len(self.frequencies),
                "frequency_hz": self.frequency_hz, "x_over_z": ratio, "x_over_z_lock_in": ratio * 0.99,
                "x_amplitude_m": self.cycle_high, "z_amplitude_m": self.z_m, "phase_rad": self._phase(),
                "steadiness": "steady" if abs(self.frequency_hz - 2.5) > 0.08 else "not steady"}

    def _phase(self):
        ratio = self.frequency_hz / NATURAL_HZ
        return -math.atan2(2 * DAMPING * ratio, 1 - ratio**2)

    def spectrum(self):
        """Lines at the drive frequency and its third harmonic over a floor."""
        step, lines = 1 / 8.192, 256
        drive = self.frequency_hz / step
        amplitudes = [max(2e-6, self.cycle_high * (math.exp(-((i - drive) ** 2)) + 0.02 * math.exp(-((i - 3 * drive) ** 2)))) for i in range(lines)]
        return {"t_s": self.t_s, "step_hz": step, "amplitude_m": [float(f"{a:.3g}") for a in amplitudes]}

    def slow(self):
        """The controller's numbers now, as one row."""
        return {"x_over_z_lock_in": self.cycle_high / self.z_m, "x_amplitude_m": self.cycle_high, "z_amplitude_m": self.z_m,
                "impacts_in_cycle": self.last_cycle, "twin_residual_m": 1.1e-4 * (1 + 0.4 * math.sin(self.t_s / 3)),
                "spring_force_n": self.force, "spring_target_n": self.target if self.set_up == "hybrid" else 0.0,
                "wall_low_n": self.pulse[0], "wall_high_n": self.pulse[1]}

    def left(self):
        seconds = (self.planned - self.place) * self.dwell_s
        return {"low_s": seconds, "high_s": 2 * seconds, "text": f"{seconds:.0f} s to {2 * seconds:.0f} s left"}

    def state(self):
        return {
            "activity": "running", "headline": f"Running: set-up {self.set_up}, {self.frequency_hz:.2f} Hz",
            "set_up": self.set_up, "experiment": "sweep", "points_taken": self.place, "points_planned": self.planned,
            "rig_s": self.t_s, "age_s": 0.0, "left": self.left(), "speed": None, "replay": None,
            "numbers": {
                "tick": self.tick, "frequency_hz": self.frequency_hz, "x_over_z_lock_in": self.cycle_high / self.z_m,
                "x_amplitude_m": self.cycle_high, "x_phase_rad": self._phase(), "z_amplitude_m": self.z_m, "z_phase_rad": 0.02,
                "impacts_in_cycle": self.last_cycle, "impacts": self.impacts_seen, "twin_residual_m": self.slow()["twin_residual_m"],
                "twin_predicted": self.impacts_seen, "twin_detected": self.impacts_seen, "twin_missing": 0, "twin_alarm": False,
                "spring_force_n": self.force, "spring_target_n": self.slow()["spring_target_n"], "spring_position_m": 0.0042,
                "spring_stage": "moving to the target" if self.force < 0.95 * self.target else "at target",
                "wall_low_n": self.pulse[0], "wall_high_n": self.pulse[1], "x_mean_m": None, "z_mean_m": None, "safety": "clear",
                "max_abs_x_m": self.cycle_high, "x_over_z_spread": 0.004, "stage": "measuring", "dwells": 1,
                "stage_left_s": round(self.dwell_s - self.since_point * STEP_S, 3)},
            "limits": {"x_m": 0.08, "z_m": 0.01, "wall_force_n": 450.0, "clearance_m": self.clearance_m},
            "link": {"name": "virtual:realtime", "state": "connected", "rows": self.tick, "lost_rows": 0, "dropped_rows": 0,
                     "bad_frames": 0, "interruptions": 0, "viewers": 1, "skipped_frames": 0},
            "fault": None, "alarms": [], "injected": []}
