//! Many episodes in one self-contained page: a table of who did how well where, the episodes behind each of
//! its cells with the worst first, and the replay of any of them.
//!
//! Several policies sail the same episodes, so that whatever does not depend on own ship is written
//! once per scene: the target ships, the sensor noise, the forecasts. Numbers are rounded (decimetres,
//! tenths of a degree, centimetres per second), written as differences, and the whole is compressed;
//! the page unpacks it and hands single episodes to the page of [`super::replay`].

use std::collections::HashMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use serde::Serialize;

use super::replay;
use crate::atomic_file::{self, WriteError};
use crate::episode::{Episode, VesselStep};
use crate::geo::Position;

const PAGE: &str = include_str!("page.html");
const STYLE: &str = include_str!("style.css");
const SCRIPT: [&str; 2] = [include_str!("unpack.js"), include_str!("browse.js")];

/// Parts of a metre that positions are rounded to.
const PER_METRE: f64 = 10.0;
/// Parts of a degree that headings and courses are rounded to.
const PER_DEGREE: f64 = 10.0;
/// Parts of a metre per second that speeds are rounded to.
const PER_MPS: f64 = 100.0;
/// Parts that draws of a standard normal distribution are rounded to.
const PER_DRAW: f64 = 100.0;

/// A scene of a [`Gallery`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SceneId(usize);

/// What a run came to: how the page sorts and counts it.
#[derive(Debug, Clone, PartialEq)]
pub struct RunFacts {
    /// Who steered.
    pub policy: String,
    /// Standard deviation of the sensor noise, in metres.
    pub sigma_m: f64,
    /// Whether there was contact.
    pub contact: bool,
    /// Whether own ship was on the wrong side.
    pub wrong_side: bool,
    /// Sum of rewards.
    pub total_reward: f64,
}

/// Episodes to be shown together.
#[derive(Debug, Default, Serialize)]
pub struct Gallery {
    version: &'static str,
    title: String,
    caption: String,
    /// Names that scenes and runs refer to by number.
    texts: Vec<String>,
    scenes: Vec<Scene>,
    runs: Vec<Run>,
    #[serde(skip)]
    numbers: HashMap<String, usize>,
}

/// What all runs of an episode have in common.
#[derive(Debug, Serialize)]
struct Scene {
    /// Text: which tracks.
    tracks: usize,
    /// Text: which scenario.
    scenario: usize,
    /// Number of the episode, from 0.
    number: usize,
    seed: String,
    /// Text.
    description: usize,
    dt_s: f64,
    vessels: Vec<SceneVessel>,
    /// One per target ship.
    targets: Vec<SceneTarget>,
    /// Draws of the sensor noise: per vessel north and east.
    draws: Vec<[Vec<i32>; 2]>,
    forecasts: Vec<Forecast>,
}

#[derive(Debug, Serialize)]
struct SceneVessel {
    /// Text.
    name: usize,
    /// Text.
    motion: usize,
    length_m: f64,
    beam_m: f64,
    collision_radius_m: f64,
    /// Corners: metres ahead, metres to starboard.
    hull: Vec<[f64; 2]>,
}

#[derive(Debug, Serialize)]
struct SceneTarget {
    /// Text, or nothing.
    encounter: Option<usize>,
    dcpa_m: f64,
    tcpa_s: f64,
    way: Way,
}

/// Where a vessel went: second differences of positions, first differences of the rest.
#[derive(Debug, Serialize)]
struct Way {
    north: Vec<i32>,
    east: Vec<i32>,
    heading: Vec<i32>,
    course: Vec<i32>,
    speed: Vec<i32>,
}

#[derive(Debug, Serialize)]
struct Forecast {
    sigma_m: f64,
    /// The time step at which it was made.
    step: usize,
    /// North and east in metres, as differences from the last point; the first from the origin.
    points: Vec<[i32; 2]>,
}

#[derive(Debug, Serialize)]
struct Run {
    scene: usize,
    /// Text.
    policy: usize,
    /// Text: what the replay is headed by.
    title: usize,
    sigma_m: f64,
    contact: bool,
    wrong_side: bool,
    total_reward: f64,
    way: Way,
    targets: Vec<RunTarget>,
}

/// Closest distance of centres and its time, closest distance of hulls, first contact of circles and hulls.
type RunTarget = (f64, f64, f64, Option<f64>, Option<f64>);

impl Gallery {
    /// An empty one.
    #[must_use]
    pub fn new(title: impl Into<String>, caption: impl Into<String>) -> Self {
        let version = env!("CARGO_PKG_VERSION");
        Self { version, title: title.into(), caption: caption.into(), ..Self::default() }
    }

    /// Number of runs.
    #[must_use]
    pub fn len(&self) -> usize {
        self.runs.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.runs.is_empty()
    }

    fn text(&mut self, text: &str) -> usize {
        if let Some(&number) = self.numbers.get(text) {
            return number;
        }
        self.texts.push(text.to_owned());
        self.numbers.insert(text.to_owned(), self.texts.len() - 1);
        self.texts.len() - 1
    }

    /// Adds what the runs of an episode have in common, as any of them shows it.
    pub fn add_scene(&mut self, tracks: &str, scenario: &str, number: usize, episode: &Episode) -> SceneId {
        let vessels = episode.vessels.iter().map(|info| SceneVessel {
            name: self.text(&info.name),
            motion: self.text(&info.motion),
            length_m: info.length_m,
            beam_m: info.beam_m,
            collision_radius_m: info.collision_radius_m,
            hull: info.hull.iter().map(|corner| [corner.forward_m, corner.starboard_m]).collect(),
        });
        let vessels = vessels.collect();
        let targets = episode.summaries().into_iter().map(|summary| SceneTarget {
            encounter: summary.encounter.map(|encounter| self.text(encounter.words())),
            dcpa_m: rounded(summary.start_cpa.distance_m, 100.0),
            tcpa_s: rounded(summary.start_cpa.time_s, 100.0),
            way: Way::of(episode, summary.vessel),
        });
        let targets = targets.collect();
        let scene = Scene {
            tracks: self.text(tracks),
            scenario: self.text(scenario),
            number,
            seed: episode.seed.to_string(),
            description: self.text(&episode.description),
            dt_s: episode.dt_s,
            vessels,
            targets,
            draws: Vec::new(),
            forecasts: Vec::new(),
        };
        self.scenes.push(scene);
        SceneId(self.scenes.len() - 1)
    }

    /// Adds a forecast of the first target ship, made at a time step under a noise.
    pub fn add_forecast(&mut self, scene: SceneId, sigma_m: f64, step: usize, points: &[[i32; 2]]) {
        let mut before = [0, 0];
        let differences = points.iter().map(|&point| {
            let difference = [point[0] - before[0], point[1] - before[1]];
            before = point;
            difference
        });
        let points = differences.collect();
        self.scenes[scene.0].forecasts.push(Forecast { sigma_m, step, points });
    }

    /// Adds a run of a scene.
    pub fn add_run(&mut self, scene: SceneId, facts: &RunFacts, episode: &Episode) {
        if facts.sigma_m > 0.0 && self.scenes[scene.0].draws.is_empty() {
            self.scenes[scene.0].draws = draws(episode, facts.sigma_m);
        }
        let (policy, title) = (self.text(&facts.policy), self.text(&episode.scenario));
        let time = |time_s: f64| rounded(time_s, 100.0);
        let targets = episode.summaries().into_iter().map(|summary| {
            (
                rounded(summary.closest_centre_m, 10.0),
                time(summary.closest_centre_time_s),
                rounded(summary.closest_hull_m, 10.0),
                summary.first_circle_contact_s.map(time),
                summary.first_hull_contact_s.map(time),
            )
        });
        self.runs.push(Run {
            scene: scene.0,
            policy,
            title,
            sigma_m: facts.sigma_m,
            contact: facts.contact,
            wrong_side: facts.wrong_side,
            total_reward: facts.total_reward,
            way: Way::of(episode, 0),
            targets: targets.collect(),
        });
    }

    /// Writes the page.
    ///
    /// # Errors
    ///
    /// Where the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<PathBuf, WriteError> {
        atomic_file::write(path, |out| out.write_all(self.page()?.as_bytes()))?;
        Ok(path.to_owned())
    }

    fn page(&self) -> std::io::Result<String> {
        let mut packed = ZlibEncoder::new(Vec::new(), Compression::best());
        serde_json::to_writer(&mut packed, self)?;
        packed.flush()?;
        let frame = serde_json::to_string(&replay::frame())?;
        Ok(replay::fill(
            PAGE,
            &[
                ("title", &replay::text_in_html(&self.title)),
                ("style", STYLE.trim_end()),
                ("script", SCRIPT.join("\n").trim_end()),
                ("frame", &replay::json_in_html(&frame)),
                ("data", &STANDARD.encode(packed.finish()?)),
            ],
        ))
    }
}

impl Way {
    fn of(episode: &Episode, vessel: usize) -> Self {
        let steps = || episode.steps.iter().map(|step| &step.vessels[vessel]);
        let column = |value: fn(&VesselStep) -> f64, parts: f64| {
            differences(steps().map(|step| (value(step) * parts).round() as i32).collect())
        };
        Self {
            north: differences(column(|step| step.position.north_m, PER_METRE)),
            east: differences(column(|step| step.position.east_m, PER_METRE)),
            heading: column(|step| step.heading.degrees(), PER_DEGREE),
            course: column(|step| step.velocity.course().degrees(), PER_DEGREE),
            speed: column(|step| step.velocity.speed_mps(), PER_MPS),
        }
    }
}

/// The first value, then what each is more than the one before.
fn differences(mut values: Vec<i32>) -> Vec<i32> {
    for index in (1..values.len()).rev() {
        values[index] -= values[index - 1];
    }
    values
}

/// The sensor noise of an episode over its standard deviation: per vessel, north and east.
fn draws(episode: &Episode, sigma_m: f64) -> Vec<[Vec<i32>; 2]> {
    let of = |vessel: usize, axis: fn(Position) -> f64| {
        let errors = episode.steps.iter().map(|step| {
            let VesselStep { position, observed, .. } = &step.vessels[vessel];
            axis(observed.unwrap_or(*position)) - axis(*position)
        });
        errors.map(|error_m| (error_m / sigma_m * PER_DRAW).round() as i32).collect()
    };
    (0..episode.vessels.len())
        .map(|vessel| [of(vessel, |position| position.north_m), of(vessel, |position| position.east_m)])
        .collect()
}

fn rounded(value: f64, parts: f64) -> f64 {
    (value * parts).round() / parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::episode::tests::head_on;

    fn gallery() -> Gallery {
        let mut gallery = Gallery::new("Noise </script>", "Two of them.");
        let episode = head_on(40.0);
        let scene = gallery.add_scene("held-out", "straight-on", 3, &episode);
        let facts = RunFacts {
            policy: "hold-course".into(),
            sigma_m: 5.0,
            contact: true,
            wrong_side: false,
            total_reward: -3.0,
        };
        gallery.add_run(scene, &facts, &episode);
        gallery.add_forecast(scene, 5.0, 8, &[[10, 20], [30, 10]]);
        gallery
    }

    #[test]
    fn differences_sum_up_to_the_values() {
        assert_eq!(differences(vec![5, 7, 4, 4]), [5, 2, -3, 0]);
        assert!(differences(Vec::new()).is_empty());
        let way = Way::of(&head_on(40.0), 0);
        // At constant speed only the first two of the second differences are not zero.
        assert_eq!(way.north[..4], [0, 400, 0, 0]);
        assert_eq!(way.speed[..2], [800, 0]);
    }

    #[test]
    fn what_scenes_have_in_common_is_written_once() {
        let gallery = gallery();
        assert_eq!((gallery.len(), gallery.scenes.len()), (1, 1));
        // 3 m and -4 m at 5 m of noise, on the target ship only.
        let [own, target] = &gallery.scenes[0].draws[..] else { panic!("two vessels") };
        assert!(own[0].iter().all(|&draw| draw == 0));
        assert!(target[0].iter().all(|&draw| draw == 60) && target[1].iter().all(|&draw| draw == -80));
        assert_eq!(gallery.scenes[0].forecasts[0].points, [[10, 20], [20, -10]]);
        let [(closest_m, .., contact_s, None)] = gallery.runs[0].targets[..] else { panic!("one target") };
        assert!(closest_m == 40.0 && contact_s.is_some());
    }

    #[test]
    fn the_page_stands_alone() {
        let page = gallery().page().unwrap();
        assert!(page.contains("<title>Noise &lt;/script&gt;</title>"));
        let text = page.replace("http://www.w3.org/2000/svg", "");
        for word in ["http:", "https:", "src=", "href=", "url(", "@import", "fetch("] {
            assert!(!text.contains(word), "the page says {word}");
        }
        assert_eq!(page.matches("</script>").count(), PAGE.matches("</script>").count());
    }
}
