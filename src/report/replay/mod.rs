//! The replay of an episode: one HTML page that needs nothing else, neither network nor server.
//!
//! The page's parts are files beside this one. Their data is JSON in the page itself, rounded to a
//! centimetre, a hundredth of a degree and a millimetre per second; `episode.csv` has every digit.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::atomic_file::{self, WriteError};
use crate::encounter::Encounter;
use crate::episode::{Episode, TargetSummary};
use crate::geo::Position;

const PAGE: &str = include_str!("page.html");
const STYLE: &str = include_str!("style.css");
const SCRIPT: [&str; 4] = [
    include_str!("data.js"),
    include_str!("scene.js"),
    include_str!("distances.js"),
    include_str!("player.js"),
];

/// Writes `index.html` into `folder`.
///
/// # Errors
/// Where the file cannot be written.
pub fn write(episode: &Episode, folder: &Path) -> Result<PathBuf, WriteError> {
    let path = folder.join("index.html");
    atomic_file::write(&path, |out| out.write_all(page(episode)?.as_bytes()))?;
    Ok(path)
}

/// The page as text.
fn page(episode: &Episode) -> serde_json::Result<String> {
    let data = serde_json::to_string(&PageEpisode::of(episode))?;
    let title = format!("{}, {} \u{2013} searoom", episode.scenario, episode.policy);
    Ok(fill(
        PAGE,
        &[
            ("title", &text_in_html(&title)),
            ("style", STYLE.trim_end()),
            ("script", SCRIPT.join("\n").trim_end()),
            ("episode", &json_in_html(&data)),
        ],
    ))
}

/// The page without an episode: whoever has one puts its data in the place of `{{episode}}`.
pub(super) fn frame() -> String {
    let script = SCRIPT.join("\n");
    let parts = [
        ("title", "searoom"),
        ("style", STYLE.trim_end()),
        ("script", script.trim_end()),
        ("episode", "{{episode}}"),
    ];
    fill(PAGE, &parts)
}

/// Replaces each `{{name}}` of a template, in one pass: what was filled in is not looked at again.
pub(super) fn fill(template: &str, values: &[(&str, &str)]) -> String {
    let mut text = String::new();
    let mut rest = template;
    while let Some((before, after)) = rest.split_once("{{") {
        let (name, after) = after.split_once("}}").unwrap_or((after, ""));
        text.push_str(before);
        text.extend(values.iter().filter(|(key, _)| *key == name).map(|(_, value)| *value));
        rest = after;
    }
    text + rest
}

pub(super) fn text_in_html(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// JSON that no HTML parser takes for markup: `</script>` and `<!--` cannot occur without `<`, which
/// JSON has only inside strings.
pub(super) fn json_in_html(json: &str) -> String {
    json.replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026")
}

/// The episode as `data.js` reads it: columns rather than rows, which makes the page a third of the
/// size.
#[derive(Debug, Serialize)]
struct PageEpisode<'a> {
    version: &'static str,
    scenario: &'a str,
    description: &'a str,
    /// As text: JavaScript's numbers end at 2^53.
    seed: String,
    policy: &'a str,
    dt_s: f64,
    vessels: Vec<PageVessel<'a>>,
    targets: Vec<PageTarget>,
}

#[derive(Debug, Serialize)]
struct PageVessel<'a> {
    name: &'a str,
    motion: &'a str,
    length_m: f64,
    beam_m: f64,
    collision_radius_m: f64,
    /// Corners: metres ahead, metres to starboard.
    hull: Vec<[f64; 2]>,
    north_m: Vec<f64>,
    east_m: Vec<f64>,
    heading_deg: Vec<f64>,
    course_deg: Vec<f64>,
    speed_mps: Vec<f64>,
    /// North and east in metres, one per step; empty where sensors are free of noise.
    observed: Vec<[f64; 2]>,
    /// Paths ahead, one per step, north and east in metres; empty where nothing is forecast.
    ahead: Vec<Vec<[f64; 2]>>,
}

#[derive(Debug, Serialize)]
struct PageTarget {
    vessel: usize,
    name: String,
    encounter: Option<&'static str>,
    start_dcpa_m: f64,
    start_tcpa_s: f64,
    closest_centre_m: f64,
    closest_centre_time_s: f64,
    closest_hull_m: f64,
    contact_distance_m: f64,
    first_circle_contact_s: Option<f64>,
    first_hull_contact_s: Option<f64>,
    distance_m: Vec<f64>,
}

impl<'a> PageEpisode<'a> {
    fn of(episode: &'a Episode) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION"),
            scenario: &episode.scenario,
            description: &episode.description,
            seed: episode.seed.to_string(),
            policy: &episode.policy,
            dt_s: episode.dt_s,
            vessels: (0..episode.vessels.len()).map(|index| PageVessel::of(episode, index)).collect(),
            targets: episode
                .summaries()
                .into_iter()
                .map(|summary| PageTarget::of(episode, summary))
                .collect(),
        }
    }
}

impl<'a> PageVessel<'a> {
    fn of(episode: &'a Episode, index: usize) -> Self {
        let info = &episode.vessels[index];
        let steps = || episode.steps.iter().map(|step| &step.vessels[index]);
        let observed: Vec<_> = steps().filter_map(|vessel| vessel.observed).map(rounded).collect();
        let ahead: Vec<Vec<_>> =
            steps().map(|vessel| vessel.ahead.iter().copied().map(rounded).collect()).collect();
        Self {
            name: &info.name,
            motion: &info.motion,
            length_m: info.length_m,
            beam_m: info.beam_m,
            collision_radius_m: info.collision_radius_m,
            hull: info.hull.iter().map(|corner| [corner.forward_m, corner.starboard_m]).collect(),
            north_m: steps().map(|vessel| round(vessel.position.north_m, 100.0)).collect(),
            east_m: steps().map(|vessel| round(vessel.position.east_m, 100.0)).collect(),
            heading_deg: steps().map(|vessel| round(vessel.heading.degrees(), 100.0)).collect(),
            course_deg: steps().map(|vessel| round(vessel.velocity.course().degrees(), 100.0)).collect(),
            speed_mps: steps().map(|vessel| round(vessel.velocity.speed_mps(), 1000.0)).collect(),
            // A vessel is observed at every step or at none; the page counts on it.
            observed: if observed.len() == episode.steps.len() { observed } else { Vec::new() },
            ahead: if ahead.iter().any(|path| !path.is_empty()) { ahead } else { Vec::new() },
        }
    }
}

impl PageTarget {
    fn of(episode: &Episode, summary: TargetSummary) -> Self {
        let pairs = episode.steps.iter().map(|step| &step.pairs[summary.vessel - 1]);
        Self {
            vessel: summary.vessel,
            name: summary.name,
            encounter: summary.encounter.map(Encounter::words),
            start_dcpa_m: summary.start_cpa.distance_m,
            start_tcpa_s: summary.start_cpa.time_s,
            closest_centre_m: summary.closest_centre_m,
            closest_centre_time_s: summary.closest_centre_time_s,
            closest_hull_m: summary.closest_hull_m,
            contact_distance_m: summary.contact_distance_m,
            first_circle_contact_s: summary.first_circle_contact_s,
            first_hull_contact_s: summary.first_hull_contact_s,
            distance_m: pairs.map(|pair| round(pair.centre_distance_m, 100.0)).collect(),
        }
    }
}

fn round(value: f64, parts: f64) -> f64 {
    (value * parts).round() / parts
}

fn rounded(position: Position) -> [f64; 2] {
    [round(position.north_m, 100.0), round(position.east_m, 100.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::episode::tests::head_on;

    #[test]
    fn names_cannot_end_the_script_or_the_title() {
        let mut episode = head_on(40.0);
        let nasty = "</script><script>alert(1)</script><!-- {{style}} & \u{2028}";
        episode.vessels[1].name = nasty.to_owned();
        episode.scenario = format!("</title>{nasty}");
        let page = page(&episode).unwrap();
        assert!(!page.contains("alert(1)</script>") && !page.contains("</title><"));
        assert_eq!(page.matches("</script>").count(), PAGE.matches("</script>").count());
        assert_eq!(page.matches(":root {").count(), STYLE.matches(":root {").count());
        let data = page.split_once("id=\"episode\">").unwrap().1.split_once("</script>").unwrap().0;
        let value: serde_json::Value = serde_json::from_str(data).unwrap();
        assert_eq!(value["vessels"][1]["name"], nasty);
    }

    #[test]
    fn the_page_asks_for_nothing_from_elsewhere() {
        let page = page(&head_on(40.0)).unwrap();
        let text = page.replace("http://www.w3.org/2000/svg", "");
        for word in ["http:", "https:", "src=", "href=", "url(", "@import", "fetch(", "{{"] {
            assert!(!text.contains(word), "the page says {word}");
        }
    }

    #[test]
    fn large_seeds_keep_their_digits() {
        let episode = Episode { seed: u64::MAX, ..head_on(40.0) };
        assert!(page(&episode).unwrap().contains("\"seed\":\"18446744073709551615\""));
    }

    #[test]
    fn an_episode_without_steps_still_makes_a_page() {
        let episode = Episode { steps: Vec::new(), ..head_on(40.0) };
        assert!(page(&episode).unwrap().contains("\"north_m\":[]"));
    }
}
