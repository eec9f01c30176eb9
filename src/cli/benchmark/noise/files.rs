//! What a benchmark leaves behind: tables as JSON and CSV, the figure, the page of replays.

use std::collections::HashMap;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow};
use rayon::prelude::*;
use serde::Serialize;

use super::{Benchmark, Results};
use crate::atomic_file;
use crate::episode::Episode;
use crate::experiment::noise::{Cell, Group, Row, ThinnedPath, record, scenario_name};
use crate::experiment::noise_analysis::{self, NoiseRow};
use crate::report::gallery::{Gallery, RunFacts};

/// The files.
pub(super) struct Files {
    folder: PathBuf,
    page: PathBuf,
}

impl Files {
    pub(super) fn tell(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "Wrote results.csv, results.json, episodes.csv and noise_analysis.svg to {}",
            self.folder.display()
        )?;
        writeln!(
            out,
            "Open {} in a browser to replay any of the episodes, the worst first",
            self.page.display()
        )
    }
}

pub(super) fn write(
    benchmark: &Benchmark,
    results: &Results,
    rows: &[Row],
    folder: &Path,
) -> anyhow::Result<Files> {
    atomic_file::write(&folder.join("results.json"), |out| Ok(serde_json::to_writer_pretty(out, rows)?))?;
    atomic_file::write(&folder.join("results.csv"), |out| csv(out, rows.iter().map(FlatRow::of)))?;
    let voyages = results.cells.iter().flat_map(voyage_rows);
    atomic_file::write(&folder.join("episodes.csv"), |out| csv(out, voyages))?;
    let drawn: Vec<NoiseRow> = serde_json::from_value(serde_json::to_value(rows)?)?;
    if let Some(figure) = noise_analysis::make(&drawn) {
        let svg = figure.to_svg().map_err(|error| anyhow!(error)).context("noise_analysis.svg")?;
        atomic_file::write(&folder.join("noise_analysis.svg"), |out| out.write_all(svg.as_bytes()))?;
    }
    let page = gallery(benchmark, results)?.write(&folder.join("index.html"))?;
    Ok(Files { folder: folder.to_owned(), page })
}

fn csv(out: &mut dyn Write, rows: impl Iterator<Item = impl Serialize>) -> io::Result<()> {
    let mut writer = csv::Writer::from_writer(out);
    for row in rows {
        writer.serialize(row).map_err(io::Error::other)?;
    }
    writer.flush()
}

/// A line of `results.csv`.
#[derive(Debug, Serialize)]
struct FlatRow<'a> {
    policy: &'a str,
    estimates: &'a str,
    scenario: &'a str,
    tracks: &'a str,
    sigma_m: f64,
    episodes: u64,
    collisions: u64,
    rate: f64,
    rate_low95: f64,
    rate_high95: f64,
    wrong_side_rate: f64,
    contact_at_decision_rate: f64,
    mean_return: f64,
    mean_return_low95: Option<f64>,
    mean_return_high95: Option<f64>,
    compliance: Option<f64>,
    closest_q01_m: f64,
    closest_q05_m: f64,
    closest_q25_m: f64,
    closest_q50_m: f64,
    closest_q75_m: f64,
    unseen_vessels_episodes: Option<u64>,
    unseen_vessels_rate: Option<f64>,
    training_tracks_episodes: Option<u64>,
    training_tracks_rate: Option<f64>,
    fallbacks: u64,
}

impl<'a> FlatRow<'a> {
    fn of(row: &'a Row) -> Self {
        Self {
            policy: &row.policy,
            estimates: row.estimates,
            scenario: row.scenario,
            tracks: row.tracks.as_str(),
            sigma_m: row.sigma_m,
            episodes: row.episodes,
            collisions: row.collisions,
            rate: row.rate,
            rate_low95: row.ci95[0],
            rate_high95: row.ci95[1],
            wrong_side_rate: row.wrong_side.rate,
            contact_at_decision_rate: row.contact_at_decision.rate,
            mean_return: row.mean_return,
            mean_return_low95: row.mean_return_ci95.map(|ends| ends[0]),
            mean_return_high95: row.mean_return_ci95.map(|ends| ends[1]),
            compliance: row.compliance,
            closest_q01_m: row.closest_m.q01,
            closest_q05_m: row.closest_m.q05,
            closest_q25_m: row.closest_m.q25,
            closest_q50_m: row.closest_m.q50,
            closest_q75_m: row.closest_m.q75,
            unseen_vessels_episodes: row.unseen_vessels.map(|share| share.episodes),
            unseen_vessels_rate: row.unseen_vessels.map(|share| share.rate),
            training_tracks_episodes: row.training_tracks.map(|share| share.episodes),
            training_tracks_rate: row.training_tracks.map(|share| share.rate),
            fallbacks: row.fallbacks,
        }
    }
}

/// A line of `episodes.csv`.
#[derive(Debug, Serialize)]
struct VoyageRow<'a> {
    policy: &'a str,
    scenario: &'a str,
    tracks: &'a str,
    sigma_m: f64,
    episode: usize,
    seed: u64,
    mmsi: u32,
    contact: bool,
    contact_at_decision: bool,
    wrong_side: bool,
    closest_m: f64,
    total_reward: f64,
    compliance: Option<f64>,
}

fn voyage_rows(cell: &Cell) -> impl Iterator<Item = VoyageRow<'_>> {
    cell.voyages.iter().enumerate().map(|(episode, voyage)| VoyageRow {
        policy: &cell.policy,
        scenario: scenario_name(cell.scenario),
        tracks: cell.tracks.as_str(),
        sigma_m: cell.sigma_m,
        episode,
        seed: voyage.seed,
        mmsi: voyage.mmsi,
        contact: voyage.contact,
        contact_at_decision: voyage.contact_at_decision,
        wrong_side: voyage.wrong_side,
        closest_m: voyage.closest_m,
        total_reward: voyage.total_reward,
        compliance: voyage.compliance,
    })
}

/// Every voyage, sailed again for its steps.
fn gallery(benchmark: &Benchmark, results: &Results) -> anyhow::Result<Gallery> {
    let config = &benchmark.config;
    let caption = format!(
        "{} episodes of each scenario and noise, seed {}, on the tracks of {}. Everyone meets the same vessels under the \
         same sensor noise.",
        config.episodes, config.seed, benchmark.recordings.area
    );
    let mut gallery = Gallery::new("Noise benchmark", caption);
    let mut scenes = HashMap::new();
    for (group, paths) in benchmark.groups().iter().zip(&results.paths) {
        let scenario = scenario_name(group.kind);
        for cell in results.cells.iter().filter(|cell| is_of(cell, group)) {
            let tasks: Vec<_> = cell.voyages.chunks(VOYAGES_PER_TASK).collect();
            let episodes = tasks.par_iter().map(|voyages| record(group, config, &cell.policy, voyages));
            let episodes: Vec<Episode> = episodes.collect::<Result<Vec<_>, _>>()?.concat();
            for (number, (voyage, episode)) in cell.voyages.iter().zip(&episodes).enumerate() {
                let scene = *scenes.entry((group.waters.part, group.kind, number)).or_insert_with(|| {
                    gallery.add_scene(group.waters.part.as_str(), scenario, number, episode)
                });
                let facts = RunFacts {
                    policy: cell.policy.clone(),
                    sigma_m: cell.sigma_m,
                    contact: voyage.contact,
                    wrong_side: voyage.wrong_side,
                    total_reward: voyage.total_reward,
                };
                gallery.add_run(scene, &facts, episode);
            }
        }
        add_forecasts(&mut gallery, benchmark, group, paths, &scenes);
    }
    Ok(gallery)
}

/// Episodes that a thread sails again with one environment.
const VOYAGES_PER_TASK: usize = 10;

type Scenes = HashMap<
    (crate::experiment::noise::TracksPart, crate::scenario::encounter_starts::HeadOnKind, usize),
    crate::report::gallery::SceneId,
>;

fn add_forecasts(
    gallery: &mut Gallery,
    benchmark: &Benchmark,
    group: &Group<'_>,
    paths: &[ThinnedPath],
    scenes: &Scenes,
) {
    let seeds = benchmark.config.episode_seeds();
    let numbers: HashMap<u64, usize> =
        seeds.into_iter().enumerate().map(|(number, seed)| (seed, number)).collect();
    let steps_per_decision = group.waters.traffic.steps_per_decision(&benchmark.config.coastal);
    for path in paths {
        let scene =
            numbers.get(&path.seed).and_then(|&number| scenes.get(&(group.waters.part, group.kind, number)));
        if let Some(&scene) = scene {
            gallery.add_forecast(scene, group.sigma_m, path.decision * steps_per_decision, &path.points);
        }
    }
}

fn is_of(cell: &Cell, group: &Group<'_>) -> bool {
    (cell.tracks, cell.scenario, cell.sigma_m) == (group.waters.part, group.kind, group.sigma_m)
}
