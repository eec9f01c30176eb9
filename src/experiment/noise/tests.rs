use super::*;
use crate::angle::Nautical;
use crate::forecast::{Forecaster, LinearForecaster};
use crate::geo::{Displacement, Position};
use crate::policy::{HoldCourse, Policy, RuleBased, RuleBasedConfig, Situation};
use crate::rl::agent::Algorithm;
use crate::track::{Track, VesselParticulars};
use crate::vessel::Command;

/// A vessel at 10 m/s towards north for `straight_s`, then turning to port for a while.
fn track(mmsi: u32, straight_s: f64, total_s: f64) -> Track {
    let mut positions = vec![Position::ORIGIN];
    for step in 0..(total_s / 5.0) as usize {
        let turning_s = (step as f64 * 5.0 - straight_s).clamp(0.0, 120.0);
        let course = Nautical::from_degrees(-turning_s * 0.6);
        positions.push(positions[step] + Displacement::towards(course, 50.0));
    }
    Track { mmsi, start_unix_s: 0, dt_s: 5.0, positions, particulars: VesselParticulars::default() }
}

fn waters(part: TracksPart, seen: &[u32]) -> Waters {
    let tracks = vec![track(1, 9000.0, 3000.0), track(2, 480.0, 1500.0), track(3, 600.0, 1500.0)];
    let traffic = RecordedTraffic::new(tracks, &CoastalConfig::default()).unwrap();
    Waters { part, traffic: Arc::new(traffic), seen: seen.iter().copied().collect() }
}

fn config() -> NoiseConfig {
    NoiseConfig { sigmas_m: vec![0.0, 20.0], episodes: 6, forecast_batch: 5, ..NoiseConfig::default() }
}

/// Turns as far as it may at every decision.
#[derive(Debug)]
struct Starboard;

impl Policy for Starboard {
    fn name(&self) -> &str {
        "starboard"
    }

    fn reset(&mut self, _seed: u64) {}

    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        Command { turn_rad: situation.own.max_turn_rad, speed_mps: None }
    }
}

/// Holds its course where the forecast takes the recorded vessel out of the way, turns to starboard otherwise.
#[derive(Debug)]
struct Foresighted;

impl Policy for Foresighted {
    fn name(&self) -> &str {
        "foresighted"
    }

    fn reset(&mut self, _seed: u64) {}

    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        let own = &situation.own;
        let meets = situation.targets[0].forecast.is_some_and(|path| {
            (1..).zip(path).any(|(step, position)| {
                let there = own.position + own.velocity.for_seconds(5.0 * f64::from(step));
                position.distance_m(there) < 300.0
            })
        });
        Command { turn_rad: if meets { own.max_turn_rad } else { 0.0 }, speed_mps: None }
    }
}

fn classical(name: &str, estimates: Estimates, make: fn() -> Box<dyn Policy>) -> Contestant {
    Contestant::classical(name, estimates, &CoastalConfig::default(), make)
}

fn hold_course() -> Contestant {
    classical("hold-course", Estimates::None, || Box::new(HoldCourse))
}

fn starboard() -> Contestant {
    classical("starboard", Estimates::None, || Box::new(Starboard))
}

fn foresighted() -> Contestant {
    classical("foresighted", Estimates::Forecast(0), || Box::new(Foresighted))
}

fn linear() -> Box<dyn Forecaster> {
    Box::new(LinearForecaster::over(75))
}

/// Everything, on this many threads.
fn sail(threads: usize, config: &NoiseConfig, contestants: &[Contestant], waters: &[Waters]) -> Vec<Cell> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let mut cells = Vec::new();
        for group in waters.iter().flat_map(|waters| config.groups(waters)) {
            let mut foresight = Foresight::default();
            let paths = forecast(&group, config, &linear, &|_| ()).unwrap();
            foresight.add(0, paths.into_iter().collect());
            for contestant in contestants {
                cells.push(group.sail(config, contestant, &foresight, &|| ()).unwrap());
            }
        }
        cells
    })
}

/// Holding course collides always where the vessel goes straight on and never before a curve; full starboard always
/// before a curve and never where it goes straight on. Without disturbances and further traffic nothing else is left.
#[test]
fn each_scenario_punishes_the_right_answer_of_the_other() {
    let coastal = CoastalConfig {
        linear_obstacles: 0,
        start_position_sd_m: 0.0,
        start_heading_port_deg: 0.0,
        ..CoastalConfig::default()
    };
    let config = NoiseConfig { episodes: 30, coastal: coastal.clone(), ..config() };
    let contestants = [hold_course(), starboard()].map(|mut contestant| {
        contestant.coastal = coastal.clone();
        contestant
    });
    let waters = [waters(TracksPart::HeldOut, &[])];
    let cells = sail(2, &config, &contestants, &waters);
    for row in rows(&cells, &contestants, &waters) {
        let collides = (row.policy == "hold-course") == (row.scenario == "straight-on");
        assert_eq!(row.collisions, if collides { 30 } else { 0 }, "{row:?}");
        assert_eq!(row.wrong_side.count, 0);
    }
}

#[test]
fn everyone_meets_the_same_vessels_whatever_the_noise() {
    let contestants = [hold_course(), starboard(), foresighted()];
    let cells = sail(2, &config(), &contestants, &[waters(TracksPart::HeldOut, &[])]);
    let seeds = config().episode_seeds();
    for cell in &cells {
        let same = cells.iter().find(|other| other.scenario == cell.scenario).unwrap();
        let met =
            |cell: &Cell| cell.voyages.iter().map(|voyage| (voyage.seed, voyage.mmsi)).collect::<Vec<_>>();
        assert_eq!(met(cell), met(same));
        assert!(cell.voyages.iter().map(|voyage| voyage.seed).eq(seeds.iter().copied()));
        // Noise is in what is seen, not in what happens: who does not look does the same under any.
        if cell.policy != "foresighted" {
            let calm = cells
                .iter()
                .find(|other| (&other.policy, other.scenario) == (&cell.policy, cell.scenario))
                .unwrap();
            assert_eq!(calm.voyages, cell.voyages);
        }
    }
    let of =
        |sigma_m| cells.iter().find(|cell| cell.policy == "foresighted" && cell.sigma_m == sigma_m).unwrap();
    assert_ne!(of(0.0).voyages, of(20.0).voyages, "who looks is misled");
    let fewer = NoiseConfig { episodes: 2, ..config() };
    assert_eq!(fewer.episode_seeds(), seeds[..2]);
    assert_ne!(NoiseConfig { seed: 2, ..config() }.episode_seeds(), seeds);
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let contestants = [
        foresighted(),
        classical("rule-based", Estimates::None, || Box::new(RuleBased::new(RuleBasedConfig::default()))),
    ];
    let waters = [waters(TracksPart::HeldOut, &[1]), waters(TracksPart::Training, &[1])];
    let [one, two] = [1, 2].map(|threads| sail(threads, &config(), &contestants, &waters));
    assert_eq!(one, two);
    assert_eq!(rows(&one, &contestants, &waters), rows(&two, &contestants, &waters));
}

/// Forecasts that are made beforehand for all steer as those made at the helm.
#[test]
fn shared_forecasts_steer_like_live_ones() {
    let config = config();
    let waters = waters(TracksPart::HeldOut, &[]);
    let group = config.groups(&waters)[1];
    let cell = sail(2, &config, &[foresighted()], std::slice::from_ref(&waters)).remove(1);
    assert_eq!((cell.scenario, cell.sigma_m), (group.kind, group.sigma_m));
    let coastal =
        CoastalConfig { scenario: ScenarioChoice::BeforeCurve, noise_m: 20.0, ..CoastalConfig::default() };
    let mut env = Coastal::new(coastal, Arc::clone(&waters.traffic), Some(linear())).unwrap();
    env.keep_steps();
    let mut helm: Box<dyn Policy> = Box::new(Foresighted);
    for voyage in &cell.voyages {
        assert_eq!(&Voyage::sail(&mut env, &mut helm, voyage.seed, &config.rules).unwrap(), voyage);
    }
}

#[test]
fn who_knows_the_true_future_does_right_in_both_scenarios() {
    let knowing = foresighted().with_true_future().unwrap();
    assert_eq!((knowing.name.as_str(), knowing.estimates), ("foresighted (true future)", Estimates::Truth));
    assert!(hold_course().with_true_future().is_none());
    let contestants = [foresighted(), knowing];
    let waters = [waters(TracksPart::Whole, &[])];
    let cells = sail(2, &NoiseConfig { episodes: 20, ..config() }, &contestants, &waters);
    let rows = rows(&cells, &contestants, &waters);
    let collisions = |policy: &str| -> u64 {
        rows.iter().filter(|row| row.policy == policy && row.sigma_m == 0.0).map(|row| row.collisions).sum()
    };
    // A straight line foresees no curve.
    assert!(collisions("foresighted (true future)") < collisions("foresighted"), "{rows:?}");
    assert!(rows.iter().all(|row| row.fallbacks == 0 && row.unseen_vessels.is_none()));
}

#[test]
fn rows_print_as_promised() {
    let contestants = [hold_course()];
    let mut waters = [waters(TracksPart::HeldOut, &[]), waters(TracksPart::Training, &[])];
    let cells = sail(1, &config(), &contestants, &waters);
    // The vessel met first before a curve has been seen in training, no other.
    let seen = cells[0].voyages[0].mmsi;
    let unseen = |cell: &Cell| cell.voyages.iter().filter(|voyage| voyage.mmsi != seen).count();
    waters[0].seen.insert(seen);
    let rows = rows(&cells, &contestants, &waters);
    assert_eq!(rows.len(), 4, "two scenarios, two noises; training tracks stand beside");
    let json = serde_json::to_value(&rows).unwrap();
    for row in json.as_array().unwrap() {
        assert!(row["policy"].is_string() && row["scenario"].is_string());
        let [episodes, collisions, rate] =
            ["episodes", "collisions", "rate"].map(|key| row[key].as_f64().unwrap());
        assert_eq!((episodes, rate), (6.0, collisions / episodes));
        let ci95 = row["ci95"].as_array().unwrap();
        let [low, high] = [0, 1].map(|end| ci95[end].as_f64().unwrap());
        assert!(ci95.len() == 2 && low <= rate && rate <= high && low < high);
        assert!(row["mean_return"].as_f64().unwrap() <= 0.0 && row["sigma_m"].is_number());
        assert_eq!(row["training_tracks"]["count"].as_f64(), Some(collisions), "the same tracks here");
    }
    for (row, cell) in rows.iter().zip(&cells) {
        let told = row.unseen_vessels.map_or(0, |share| share.episodes);
        assert_eq!(told as usize, unseen(cell), "{row:?}");
        assert!(told < 6 || row.scenario == "straight-on");
    }
}

#[test]
fn voyages_can_be_sailed_again() {
    let config = config();
    let waters = waters(TracksPart::HeldOut, &[]);
    let group = config.groups(&waters)[3];
    let cell = sail(1, &config, &[foresighted()], std::slice::from_ref(&waters)).remove(3);
    let episodes = record(&group, &config, &cell.policy, &cell.voyages).unwrap();
    for (episode, voyage) in episodes.iter().zip(&cell.voyages) {
        assert_eq!((episode.seed, episode.has_contact()), (voyage.seed, voyage.contact));
        let closest_m =
            episode.summaries().iter().map(|target| target.closest_centre_m).fold(f64::INFINITY, f64::min);
        assert_eq!(closest_m, voyage.closest_m);
    }
}

#[test]
fn agents_of_other_encounters_are_refused_and_scales_are_their_own() {
    let agent = |coastal: &CoastalConfig| {
        let benchmark = CoastalConfig::default();
        let make = || -> Box<dyn Helm> { Box::new(Box::new(HoldCourse) as Box<dyn Policy>) };
        Contestant::agent("agent", (Algorithm::LstmTd3, Estimates::None), (coastal, &benchmark), make)
    };
    let other_scale = CoastalConfig { dcpa_scale_m: 50.0, noise_m: 3.0, ..CoastalConfig::default() };
    assert_eq!(agent(&other_scale).unwrap().coastal, other_scale);
    let other_traffic = CoastalConfig { linear_obstacles: 1, ..CoastalConfig::default() };
    let error = agent(&other_traffic).unwrap_err().to_string();
    assert!(
        error.contains("agent was trained in other encounters") && error.contains("`linear_obstacles`"),
        "{error}"
    );
}

#[test]
fn who_steers_into_nowhere_is_named() {
    #[derive(Debug)]
    struct Lost;
    impl Policy for Lost {
        fn name(&self) -> &str {
            "lost"
        }
        fn reset(&mut self, _seed: u64) {}
        fn decide(&mut self, _situation: &Situation<'_>) -> Command {
            Command { turn_rad: f64::NAN, speed_mps: None }
        }
    }
    let waters = waters(TracksPart::Whole, &[]);
    let group = config().groups(&waters)[0];
    let lost = classical("lost", Estimates::None, || Box::new(Lost));
    let error = group.sail(&config(), &lost, &Foresight::default(), &|| ()).unwrap_err().to_string();
    assert!(error.contains("lost, episode") && error.contains("NaN"), "{error}");
}
