//! E-runout: the radius that a tool sweeps varies along its height; a planar test finds it, and it predicts parts.
//!
//! Twelve seeds, each with a planar test (two faces of a rib), an S piece and a cone, 15 points each. Prediction error =
//! measured − predicted, with the path alone ("No. 3" of the source) and with the tool's profile ("No. 2"). µm.

use machining::flank::runout::test_heights;
use machining::flank::simulated::{FlankCase, Place, measured_places};
use machining::flank::{ErringPath, FlankPath, Mirrored, RadiusProfile, Regenerated, RuledPart};
use metrology::statistics::rms;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use report::{Axis, Plot, Series, Table, Unit};

use crate::scenarios::flank::{Parts, Rib, SEEDS, Told, case, map, map_plot, on_one_scale};
use crate::scenarios::{Expected, Figure, Outcome, Recorded, Rule, Run, Scenario, ScenarioError};

pub(crate) const SCENARIO: Scenario = Scenario {
    name: "E-runout",
    effect: "the tool's effective radius varies along its height",
    source: "rms prediction error, mean of 12 seeds: S piece 13.2 with the path alone, 1.9 µm with the tool; cone 14.1, \
             1.6 µm",
    run,
    sessions: Some(sessions),
};

/// E.2, ΔR at Z = 3…45 mm, µm.
const PUBLISHED: [f64; 15] = [
    14.1, 15.5, 15.9, 15.4, 14.0, 11.8, 10.0, 12.3, 13.8, 14.6, 14.5, 13.6, 12.1, 9.9, 10.5,
];

/// Prediction errors of one part over the seeds, m.
#[derive(Default)]
struct Errors {
    path_alone: f64,
    with_tool: f64,
    worst: f64,
}

impl Errors {
    fn add(
        &mut self,
        case: &FlankCase,
        part: &impl RuledPart,
        told: &Told,
        random: &mut Pcg64,
    ) -> Result<(), ScenarioError> {
        let places = measured_places(part);
        let measured = case.measured(part, part, &places, random)?;
        let miss = |profile: Option<&RadiusProfile>| -> Result<f64, ScenarioError> {
            let predicted = case.predicted(part, part, profile, &places)?;
            let errors: Vec<f64> = measured.iter().zip(predicted).map(|(m, p)| m - p).collect();
            Ok(rms(&errors))
        };
        let (alone, with) = (miss(None)?, miss(Some(&told.two_faces))?);
        self.path_alone += alone / SEEDS as f64;
        self.with_tool += with / SEEDS as f64;
        self.worst = self.worst.max(with / alone);
        Ok(())
    }
}

fn run(run: &Run<'_>) -> Result<Outcome, ScenarioError> {
    let case = case()?;
    let parts = Parts::of(&case)?;
    let (mut s, mut cone) = (Errors::default(), Errors::default());
    let mut first = None;
    for place in 0..SEEDS {
        let mut random = Pcg64::seed_from_u64(run.seed.wrapping_add(place));
        let told = Told::by(&case.planar_test(&mut random)?)?;
        s.add(&case, &parts.s, &told, &mut random)?;
        cone.add(&case, &parts.cone, &told, &mut random)?;
        first.get_or_insert(told);
        run.done(place as usize + 1, SEEDS as usize + 2);
    }
    let Some(told) = first else {
        return Err(ScenarioError::Course("no planar test was made".to_owned()));
    };
    let profile = &told.two_faces;
    let off = test_heights()
        .into_iter()
        .zip(PUBLISHED)
        .map(|(height, published)| (case.tool.radius_error(height) * 1e6 - published).abs())
        .fold(0.0, f64::max);
    let (s_left, s_maps) = regenerated(&case, &parts.s, profile, "S piece")?;
    let (cone_left, _) = regenerated(&case, &parts.cone, profile, "cone")?;
    let um = |errors: &Errors| [errors.path_alone * 1e6, errors.with_tool * 1e6];
    let figures = vec![
        Figure::new(
            "s_path_tool_um",
            "S piece: rms prediction error, path alone, with the tool",
            "µm",
            um(&s),
        )
        .source([13.2, 1.9])
        .rule(Rule::Near(1.0)),
        Figure::new(
            "cone_path_tool_um",
            "cone: rms prediction error, path alone, with the tool",
            "µm",
            um(&cone),
        )
        .source([14.1, 1.6])
        .rule(Rule::Near(1.0)),
        Figure::new(
            "worst_ratio",
            "worst of all seeds: with the tool, over path alone (S piece, cone)",
            "",
            [s.worst, cone.worst],
        )
        .source([0.23, 0.23])
        .rule(Rule::AtMost(0.30)),
        Figure::new(
            "run_out_off_published_um",
            "run-out at 15 heights: largest difference from the published values",
            "µm",
            off,
        )
        .rule(Rule::AtMost(0.0501)),
        Figure::new(
            "run_out_period_mm",
            "height after which the flutes repeat",
            "mm",
            case.tool.period() * 1e3,
        )
        .source(20.9)
        .rule(Rule::Near(0.05)),
        Figure::new(
            "s_regenerated_ratio",
            "S piece: deviation left by the regenerated path, over the planned one",
            "",
            s_left[1] / s_left[0],
        )
        .rule(Rule::AtMost(0.4)),
        Figure::new(
            "cone_regenerated_ratio",
            "cone: deviation left by the regenerated path, over the planned one",
            "",
            cone_left[1] / cone_left[0],
        )
        .rule(Rule::AtMost(0.3)),
    ];
    let mut plots = vec![run_out_plot(&case, &told)];
    plots.extend(s_maps);
    Ok(Outcome {
        figures,
        plots,
        tables: vec![profile_table(&case, profile)],
        remarks: vec![
            "Which heights the source measured on the parts is not stated; ours are every 3 mm in turn.".to_owned(),
            "The regenerated path makes up for known link errors and for the line nearest the tool's profile; its \
             departure from that line, and what a cylinder overcuts on a twisted surface, stay."
                .to_owned(),
        ],
    })
}

/// Deviation left (rms over the measured places, m) by the planned and by the regenerated path, and maps of the part.
fn regenerated(
    case: &FlankCase,
    part: &impl RuledPart,
    profile: &RadiusProfile,
    name: &str,
) -> Result<([f64; 2], Vec<Plot>), ScenarioError> {
    let known = ErringPath::new(part, case.head, &case.chain, &case.known)?;
    let mirrored = Mirrored::new(known);
    let better = Regenerated::new(&mirrored, profile, 0.0, part.ruling(0.5));
    let places = measured_places(part);
    let left = |path: &dyn FlankPath| -> Result<f64, ScenarioError> {
        let left = places
            .iter()
            .map(|&place| Ok(case.machined(part, &path, place)?))
            .collect::<Result<Vec<f64>, ScenarioError>>()?;
        Ok(rms(&left))
    };
    let predicted = map(part, "deviation", |u, v| {
        let one = case.predicted(part, part, Some(profile), &[Place { u, v }])?;
        Ok(one[0])
    })?;
    let made = map(part, "deviation", |u, v| {
        Ok(case.machined(part, part, Place { u, v })?)
    })?;
    let after = map(part, "deviation", |u, v| {
        Ok(case.machined(part, &better, Place { u, v })?)
    })?;
    let [predicted, made, after] = on_one_scale([predicted, made, after]);
    let plots = vec![
        map_plot(&format!("{name}: predicted deviation"), predicted),
        map_plot(&format!("{name}: deviation as machined"), made),
        map_plot(
            &format!("{name}: as machined on the regenerated path"),
            after,
        ),
    ];
    Ok(([left(part)?, left(&better)?], plots))
}

fn run_out_plot(case: &FlankCase, told: &Told) -> Plot {
    let truth = (0..=460).map(|step| {
        let height = f64::from(step) * 1e-4;
        (height, case.tool.radius_error(height))
    });
    let points = |profile: &RadiusProfile| {
        let heights = profile.heights().iter().copied();
        heights.zip(profile.errors().iter().copied()).collect()
    };
    Plot::new(
        "Run-out along the tool",
        Axis::new("height over the tip", Unit::MM),
        Axis::new("radius error", Unit::UM),
    )
    .with(Series::line("true", truth.collect()))
    .with(Series::points(
        "from both faces of a rib",
        points(&told.two_faces),
    ))
    .with(Series::points("from one face", points(&told.one_face)))
}

fn profile_table(case: &FlankCase, profile: &RadiusProfile) -> Table {
    let mut table = Table::new(
        "Radius error of the tool, µm",
        &["height, mm", "published", "true", "identified"],
    );
    for ((height, error), published) in profile
        .heights()
        .iter()
        .zip(profile.errors())
        .zip(PUBLISHED)
    {
        table.row(vec![
            format!("{:.0}", height * 1e3),
            format!("{published:.1}"),
            format!("{:.2}", case.tool.radius_error(*height) * 1e6),
            format!("{:.2}", error * 1e6),
        ]);
    }
    table
}

fn sessions(seed: u64) -> Result<Vec<Recorded>, ScenarioError> {
    let case = case()?;
    let rib = Rib {
        faces: &[1.0, -1.0],
        heights: &test_heights(),
        cut_here: true,
        gauge: true,
    };
    let left = |_: f64, height: f64| -case.tool.radius_error(height);
    Ok(vec![Recorded {
        name: "rib",
        session: rib.session("rib", &case, left, seed)?,
        expected: Expected::Effects(&["process.tool_runout"], 0.3),
    }])
}
