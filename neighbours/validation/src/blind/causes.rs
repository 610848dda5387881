//! What can be wrong in a blind session, each with its own finite parametrisation.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::Outsider;
use super::scene::{Axis, Scene, Touch};

/// A hidden cause: what it is, where it acts and how much.
#[derive(Debug, Clone)]
pub struct Cause {
    kind: Kind,
    axis: String,
    component: usize,
    size: f64,
    angle: f64,
    constant: f64,
    direction: Vector3<f64>,
    /// Displacements that grow along an axis vanish at its zero instead of at the middle of the travel used.
    from_zero: bool,
    /// Number of the tool that errs.
    tool: u32,
    /// Where a patch lies and how wide it is.
    patch: (Point3<f64>, f64),
    /// Touches at which a loose stylus changes its seat; the last one counts for all after it.
    seats: Vec<bool>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    StylusOffset,
    StylusLength,
    BallRadius,
    Lobing,
    Latency,
    Scale,
    Straightness,
    Angular,
    Backlash,
    Cyclic,
    Lag,
    Indexing,
    ErrorMotion,
    Link,
    SpindleGrowth,
    PartExpansion,
    Drift,
    Shift,
    Tilt,
    ToolRadius,
    ToolWear,
    Runout,
    Deflection,
    Slip,
    XBump,
    XVibration,
    XTwist,
    XPatch,
    XFeature,
    XWander,
    XKink,
    XOval,
    XCross,
    XLoose,
    XField,
}

impl Kind {
    /// True for what acts on one axis.
    fn needs_axis(self) -> bool {
        matches!(
            self,
            Self::Scale
                | Self::Straightness
                | Self::Angular
                | Self::Backlash
                | Self::Cyclic
                | Self::Lag
                | Self::Indexing
                | Self::ErrorMotion
                | Self::Link
                | Self::XBump
                | Self::XKink
        )
    }
}

const COMPONENTS: [&str; 6] = ["X", "Y", "Z", "A", "B", "C"];

/// The machine and part seen from a cause at one touch.
pub(super) struct Moment<'a> {
    pub(super) touch: &'a Touch,
    pub(super) index: usize,
    pub(super) count: usize,
    pub(super) span: f64,
    /// Speed of an axis during the approach.
    pub(super) speed: f64,
    pub(super) cutting: bool,
    /// Middle and half of the travel used by the axis at hand.
    pub(super) middle: f64,
    pub(super) half: f64,
}

impl Cause {
    pub(super) fn random(random: &mut Pcg64Mcg, scene: &Scene, outside: bool) -> Self {
        use Kind::{
            Angular, Backlash, BallRadius, Cyclic, Deflection, Drift, ErrorMotion, Indexing, Lag,
            Latency, Link, Lobing, PartExpansion, Runout, Scale, Shift, Slip, SpindleGrowth,
            Straightness, StylusLength, StylusOffset, Tilt, ToolRadius, ToolWear, XBump, XCross,
            XFeature, XKink, XOval, XPatch, XTwist, XVibration, XWander,
        };
        let mut kinds = vec![
            StylusOffset,
            StylusLength,
            BallRadius,
            Lobing,
            Latency,
            Scale,
            Straightness,
            Angular,
            Backlash,
            Cyclic,
            Lag,
            Indexing,
            ErrorMotion,
            Link,
            Link,
            Link,
            SpindleGrowth,
            PartExpansion,
            Drift,
            Slip,
        ];
        if scene.cut_here {
            kinds.extend([ToolRadius, ToolWear, Runout, Deflection]);
        } else {
            kinds.extend([Shift, Tilt]);
        }
        if outside {
            kinds = vec![
                XBump, XVibration, XTwist, XPatch, XFeature, XWander, XKink, XOval, XCross,
            ];
        }
        Self::one_of(random, scene, &kinds)
    }

    /// A cause outside the vocabulary of the kind that is asked for.
    pub(super) fn outsider(random: &mut Pcg64Mcg, scene: &Scene, outsider: Outsider) -> Self {
        let kind = match outsider {
            Outsider::LooseStylus => Kind::XLoose,
            Outsider::QuadraticField => Kind::XField,
            Outsider::Bump if scene.has_linear_axis() => Kind::XBump,
            // An arm has bumps on none of its axes; its part may.
            Outsider::Bump => Kind::XPatch,
        };
        let mut cause = Self::one_of(random, scene, &[kind]);
        if kind == Kind::XLoose {
            cause.seats = seats(random, scene.touches.len());
        }
        cause
    }

    /// A cause of one of some kinds.
    fn one_of(random: &mut Pcg64Mcg, scene: &Scene, kinds: &[Kind]) -> Self {
        use Kind::{ErrorMotion, Indexing, Link, Runout, Straightness, XBump, XKink};
        let axes: Vec<&Axis> = scene.part_axes.iter().chain(&scene.tool_axes).collect();
        let (kind, fits) = loop {
            let kind = kinds[random.random_range(0..kinds.len())];
            let turning = matches!(kind, Indexing | ErrorMotion);
            let any = kind == Link;
            // An arm's bearings run true: its links and joints err by far more, and look the same.
            let runs_true = kind == ErrorMotion && axes.iter().all(|axis| axis.turns);
            let fits: Vec<&&Axis> = axes
                .iter()
                .filter(|axis| any || axis.turns == turning && !runs_true)
                .filter(|axis| axis.name != "S")
                .collect();
            // A machine may have no axis of the kind: then only what needs none can be hidden on it.
            if !fits.is_empty() {
                break (kind, fits);
            }
            if !kind.needs_axis() {
                break (kind, axes.iter().collect());
            }
        };
        let axis = fits[random.random_range(0..fits.len())];
        let mut component = random.random_range(0..6);
        if matches!(kind, Straightness | ErrorMotion | XBump | XKink) {
            component = (0..3)
                .filter(|&k| axis.direction[k].abs() < 0.5)
                .nth(random.random_range(0..2))
                .unwrap_or(0);
        }
        let mut direction = Vector3::from_fn(|_, _| random.random_range(-1.0..1.0));
        if direction.norm() < 0.1 {
            direction = Vector3::x();
        }
        let direction = direction.normalize();
        let angle = random.random_range(0.0..std::f64::consts::TAU);
        let constant: f64 = random.random_range(0.0..1.0);
        let tools = scene.tools();
        let second = kind != Runout && constant > 0.5;
        let tool = tools.get(usize::from(second)).or(tools.first());
        Self {
            kind,
            patch: scene.patch(&direction),
            tool: tool.copied().unwrap_or_default(),
            axis: axis.name.clone(),
            component,
            size: 1e-5,
            angle,
            constant,
            direction,
            from_zero: random.random_bool(0.25),
            seats: Vec::new(),
        }
    }

    /// Identifier of the vocabulary, or one that begins with `x.`.
    pub fn id(&self) -> String {
        let axis = |name: &str| format!("axis.{}.{name}", self.axis);
        match self.kind {
            Kind::StylusOffset => "probe.stylus_offset".into(),
            Kind::StylusLength => "probe.stylus_length".into(),
            Kind::BallRadius => "probe.ball_radius".into(),
            Kind::Lobing => "probe.pretravel_lobing".into(),
            Kind::Latency => "probe.trigger_latency".into(),
            Kind::Scale => axis("scale"),
            Kind::Straightness => axis("straightness"),
            Kind::Angular => axis("angular"),
            Kind::Backlash => axis("backlash"),
            Kind::Cyclic => axis("cyclic"),
            Kind::Lag => axis("lag"),
            Kind::Indexing => axis("indexing"),
            Kind::ErrorMotion => axis("error_motion"),
            Kind::Link => format!("link.E{}0{}", COMPONENTS[self.component], self.axis),
            Kind::SpindleGrowth => "thermal.spindle_growth".into(),
            Kind::PartExpansion => "thermal.part_expansion".into(),
            Kind::Drift => "thermal.drift".into(),
            Kind::Shift => "fixture.shift".into(),
            Kind::Tilt => "fixture.tilt".into(),
            Kind::ToolRadius => "process.tool_radius".into(),
            Kind::ToolWear => "process.tool_wear".into(),
            Kind::Runout => "process.tool_runout".into(),
            Kind::Deflection => "process.deflection".into(),
            Kind::Slip => "process.slip".into(),
            Kind::XBump => "x.bump".into(),
            Kind::XVibration => "x.vibration".into(),
            Kind::XTwist => "x.twist".into(),
            Kind::XPatch => "x.patch".into(),
            Kind::XFeature => "x.feature".into(),
            Kind::XWander => "x.wander".into(),
            Kind::XKink => "x.kink".into(),
            Kind::XOval => "x.oval".into(),
            Kind::XCross => "x.cross".into(),
            Kind::XLoose => "x.loose_stylus".into(),
            Kind::XField => "x.quadratic_field".into(),
        }
    }

    /// True parameters as the effect's report names them, where the two agree on what they mean.
    pub(super) fn parameters(&self, span: f64) -> Vec<(String, f64)> {
        use std::f64::consts::{FRAC_PI_2, TAU};
        let (size, angle) = (self.size, self.angle);
        let of = |pairs: &[(&str, f64)]| -> Vec<(String, f64)> {
            let named = pairs.iter().map(|&(name, value)| (name.to_owned(), value));
            named.collect()
        };
        let vector = |names: [&str; 3], factor: f64| -> Vec<(String, f64)> {
            let parts = self.direction.iter().map(|part| part * size * factor);
            names.map(str::to_owned).into_iter().zip(parts).collect()
        };
        let wave = |phase: f64, turn: f64| {
            let phase = if size < 0.0 {
                phase + 0.5 * turn
            } else {
                phase
            };
            (size.abs(), phase.rem_euclid(turn))
        };
        match self.kind {
            Kind::StylusOffset => of(&[("dx", size * angle.cos()), ("dy", size * angle.sin())]),
            Kind::StylusLength => of(&[("dz", size)]),
            Kind::BallRadius => of(&[("dr", size)]),
            Kind::Lobing => {
                let (a, phase) = wave((FRAC_PI_2 - angle) / 3.0, TAU / 3.0);
                of(&[("a", a), ("phase", phase)])
            }
            Kind::Latency | Kind::Lag => of(&[("tau", size)]),
            Kind::Scale => of(&[("k", size)]),
            Kind::Angular => of(&[("k", size / 0.1)]),
            Kind::Straightness if !self.from_zero => {
                of(&[("a", size), ("a3", -0.4 * (self.constant - 0.5) * size)])
            }
            Kind::Backlash => of(&[("b", size)]),
            Kind::Cyclic => {
                let (a, phase) = wave(angle + FRAC_PI_2, TAU);
                let period = 0.002 * 10.0_f64.powf(self.constant);
                of(&[("a", a), ("phase", phase), ("period", period)])
            }
            Kind::Indexing => {
                let (a, phase) = wave(angle, TAU);
                of(&[("a", a), ("phase", phase)])
            }
            Kind::ErrorMotion => {
                let (a, phase) = wave(angle + FRAC_PI_2, TAU);
                of(&[("a", a), ("phase", phase)])
            }
            Kind::Link | Kind::ToolRadius => of(&[("e", size)]),
            Kind::SpindleGrowth => {
                let slow = 60.0 * 10.0_f64.powf(1.2 * self.constant);
                of(&[("g", size), ("tau", slow)])
            }
            Kind::PartExpansion => of(&[("alpha", size / 0.1)]),
            Kind::Drift => vector(["rate_x", "rate_y", "rate_z"], 1.0 / span),
            Kind::Shift => vector(["x", "y", "z"], 1.0),
            Kind::Tilt => vector(["a", "b", "c"], 1.0),
            Kind::ToolWear => of(&[("rate", size / 10.0)]),
            Kind::Slip => of(&[("step", size)]),
            _ => Vec::new(),
        }
    }

    /// False where it would show as something else: a tool that cuts at one height has no run-out along it.
    pub(super) fn shows_as_itself(&self, scene: &Scene) -> bool {
        let mut heights = (scene.touches.iter())
            .filter(|touch| touch.tool == self.tool)
            .map(|touch| touch.tool_height);
        let first = heights.next();
        self.kind != Kind::Runout || heights.any(|height| Some(height) != first)
    }

    pub(super) fn resize(&mut self, factor: f64) {
        self.size *= factor;
    }

    /// False where only an absurd size would show.
    pub(super) fn sensible(&self) -> bool {
        self.size.abs()
            < match self.kind {
                Kind::Latency | Kind::Lag => 0.05,
                Kind::Scale | Kind::Angular | Kind::Link | Kind::Tilt | Kind::Indexing => 5e-3,
                Kind::XTwist => 1.0,
                // Ten times what screws do, four times what any usual material does.
                Kind::Cyclic => 5e-5,
                Kind::PartExpansion => 1e-5,
                _ => 1e-3,
            }
    }

    /// Displacement of a joint before and after its motion, and what its position is off by.
    pub(super) fn joint(
        &self,
        axis: &Axis,
        position: f64,
        moment: &Moment<'_>,
    ) -> (Isometry3<f64>, f64, Isometry3<f64>) {
        let none = Isometry3::identity();
        if axis.name != self.axis {
            return (none, 0.0, none);
        }
        let along = |component: usize, by: f64| {
            let mut shift = Vector3::zeros();
            shift[component] = by;
            Isometry3::from_parts(Translation3::from(shift), UnitQuaternion::identity())
        };
        let about = |component: usize, by: f64| {
            let mut turn = Vector3::zeros();
            turn[component] = by;
            Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::from_scaled_axis(turn),
            )
        };
        let moving = if moment.cutting { 0.0 } else { moment.speed };
        match self.kind {
            Kind::Scale => (none, self.size * position, none),
            Kind::Backlash => (
                none,
                -0.5 * self.size * if moving == 0.0 { 0.0 } else { moving.signum() },
                none,
            ),
            Kind::Lag => (none, -self.size * moving, none),
            Kind::Cyclic => {
                let pitch = 0.002 * 10.0_f64.powf(self.constant);
                (
                    none,
                    self.size * (std::f64::consts::TAU * position / pitch + self.angle).cos(),
                    none,
                )
            }
            Kind::Indexing => (none, self.size * (position + self.angle).sin(), none),
            Kind::ErrorMotion => (
                along(self.component, self.size * (position + self.angle).cos()),
                0.0,
                none,
            ),
            Kind::Straightness => {
                let cubic = 0.4 * (self.constant - 0.5);
                let shape = if self.from_zero {
                    let u = position / moment.half;
                    u * u - cubic * u.powi(3)
                } else {
                    let u = (position - moment.middle) / moment.half;
                    (u * u - 1.0 / 3.0) - cubic * (u.powi(3) - 0.6 * u)
                };
                (none, 0.0, along(self.component, self.size * shape))
            }
            Kind::Angular => {
                let from = if self.from_zero { 0.0 } else { moment.middle };
                let turn = self.size * (position - from) / 0.1;
                (none, 0.0, about(self.component % 3, turn))
            }
            Kind::Link if self.component < 3 => (along(self.component, self.size), 0.0, none),
            Kind::Link => (about(self.component - 3, self.size), 0.0, none),
            Kind::XBump => {
                let at = moment.middle + 1.2 * moment.half * (self.constant - 0.5);
                let u = (position - at) / (0.006 + 0.008 * self.constant);
                (
                    none,
                    0.0,
                    along(self.component, self.size * (-0.5 * u * u).exp()),
                )
            }
            Kind::XKink => {
                let at = moment.middle + moment.half * (self.constant - 0.5);
                let beyond = (position - at).max(0.0) / moment.half;
                (none, 0.0, along(self.component, self.size * beyond))
            }
            _ => (none, 0.0, none),
        }
    }

    /// Displacement of the part in its frame.
    pub(super) fn part(&self, point: &Point3<f64>, moment: &Moment<'_>) -> Vector3<f64> {
        if moment.cutting {
            return Vector3::zeros();
        }
        let time = moment.touch.time;
        match self.kind {
            Kind::Shift => self.direction * self.size,
            Kind::Tilt => {
                UnitQuaternion::from_scaled_axis(self.direction * self.size) * point.coords
                    - point.coords
            }
            Kind::Drift => self.direction * (self.size * time / moment.span),
            Kind::PartExpansion => point.coords * (self.size * moment.touch.warm / 0.1),
            Kind::XTwist => {
                let turn = self.size * (point.z - 0.03);
                UnitQuaternion::from_scaled_axis(Vector3::z() * turn) * point.coords - point.coords
            }
            Kind::XField => {
                // A saddle or a valley, by its angle: p·Mp with M symmetric, over a part of 50 mm.
                let p = point.coords / 0.05;
                let (sin, cos) = self.angle.sin_cos();
                let form =
                    cos * p.x * p.x + sin * p.y * p.y + (2.0 * self.constant - 1.0) * p.x * p.z;
                self.direction * (self.size * form)
            }
            _ => Vector3::zeros(),
        }
    }

    /// Displacement of the ball in the probe mount.
    pub(super) fn ball(&self, moment: &Moment<'_>) -> Vector3<f64> {
        match self.kind {
            _ if moment.cutting => Vector3::zeros(),
            Kind::StylusOffset => Vector3::new(self.angle.cos(), self.angle.sin(), 0.0) * self.size,
            Kind::StylusLength => Vector3::z() * self.size,
            Kind::SpindleGrowth => {
                let slow = 60.0 * 10.0_f64.powf(1.2 * self.constant);
                Vector3::z() * (self.size * (1.0 - (-moment.touch.time / slow).exp()))
            }
            Kind::XLoose => {
                let seat = self.seats.get(moment.index).or(self.seats.last());
                let other = f64::from(u8::from(seat.is_some_and(|&other| other)));
                // The one or the other seat is where it was calibrated, or it lay between them.
                let calibrated = 0.5 * (3.0 * self.constant).floor();
                self.direction * (self.size * (other - calibrated))
            }
            _ => Vector3::zeros(),
        }
    }

    /// Change of the reading along the normal: `touched` is the normal in the probe mount.
    pub(super) fn reading(&self, touched: &Vector3<f64>, moment: &Moment<'_>) -> f64 {
        let touch = moment.touch;
        match self.kind {
            Kind::BallRadius => self.size,
            Kind::Lobing => {
                let angle = touched.y.atan2(touched.x);
                self.size * touched.x.hypot(touched.y) * (3.0 * angle + self.angle).sin()
            }
            Kind::Latency => -touch.feed * self.size,
            Kind::Slip => {
                let from = (moment.count as f64 * (0.2 + 0.6 * self.constant)) as usize;
                if moment.index >= from { self.size } else { 0.0 }
            }
            Kind::XVibration => {
                self.size
                    * (std::f64::consts::TAU * touch.time / (120.0 + 150.0 * self.constant)
                        + self.angle)
                        .sin()
            }
            Kind::XWander => {
                let u = touch.time / moment.span;
                self.size
                    * ((7.0 * u + self.angle).sin() + 0.7 * (17.0 * u + 2.0 * self.angle).sin())
            }
            _ => 0.0,
        }
    }

    /// Material left on the part at a point.
    pub(super) fn material(&self, moment: &Moment<'_>) -> f64 {
        let touch = moment.touch;
        let own = touch.tool > 0 && touch.tool == self.tool;
        match self.kind {
            Kind::ToolRadius if own => self.size,
            Kind::ToolWear if own => self.size * touch.cut_length / 10.0,
            Kind::Runout if own => {
                let u = touch.tool_height / 0.06;
                self.size * (1.0 - 1.5 * u + self.constant * u * u)
            }
            Kind::Deflection if touch.operation >= 0 => {
                let u = touch.overhang / 0.1;
                self.size * u * u * (3.0 - u)
            }
            Kind::XPatch => {
                let (place, width) = self.patch;
                let far = (touch.point - place).norm() / width;
                self.size * (-0.5 * far * far).exp()
            }
            Kind::XOval if touch.round => {
                let lobes = if self.constant > 0.5 { 2.0 } else { 3.0 };
                let angle = touch.normal.y.atan2(touch.normal.x);
                self.size * (lobes * angle + self.angle).cos()
            }
            Kind::XCross => {
                let (u, v) = (touch.point.x / 0.05, touch.point.y / 0.05);
                self.size * u * v * touch.normal.dot(&self.direction)
            }
            Kind::XFeature => {
                let phase = self.angle + touch.feature as f64 * 2.4;
                self.size * phase.sin()
            }
            _ => 0.0,
        }
    }
}

/// The seat of a loose stylus at each touch: a Markov chain that leaves either seat with a probability of its own.
fn seats(random: &mut Pcg64Mcg, count: usize) -> Vec<bool> {
    let mut own = Pcg64Mcg::seed_from_u64(random.random());
    let leaves = [own.random_range(0.05..0.35), own.random_range(0.05..0.35)];
    let mut other = own.random_bool(0.5);
    (0..count)
        .map(|_| {
            other ^= own.random_bool(leaves[usize::from(other)]);
            other
        })
        .collect()
}
