//! The environments of a run, with the forecaster and the tracks that they share.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, bail};
use serde::Serialize;

use super::{cache, progress, recorded};
use crate::agent::{RunConfig, TracksConfig};
use crate::env::coastal::{Coastal, CoastalConfig, LivePaths, PathSource, RecordedTraffic, TablePaths};
use crate::env::open_water::OpenWater;
use crate::env::{Env, EnvName};
use crate::forecast::sample_table::{Sample, SampleTable, TableFile};
use crate::forecast::{Forecaster, LstmForecaster, Model, split_by_time};
use crate::geo::Geodetic;
use crate::scenario::encounter_starts::HeadOnStarts;
use crate::scenario::starts_cache::CachedStarts;
use crate::track::Track;

/// Which part of the recorded time encounters are drawn from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum TracksPart {
    /// The part that agents learn from.
    Training,
    /// The part that they never see.
    HeldOut,
}

/// Makes environments of a run; what they can share is loaded once.
pub struct EnvMaker {
    config: RunConfig,
    model: Option<Model>,
    traffic: Option<Arc<RecordedTraffic>>,
    /// Forecasts of recorded vessels that episodes share.
    table: Option<Arc<SampleTable>>,
}

impl EnvMaker {
    /// Loads forecaster and tracks.
    pub fn new(config: &RunConfig, part: TracksPart) -> anyhow::Result<Self> {
        let model = config.estimates.then(|| load_forecaster(config)).transpose()?;
        let traffic = match config.env {
            EnvName::OpenWater => None,
            EnvName::Coastal => Some(load_traffic(config, part, model.as_ref())?),
        };
        Ok(Self { config: config.clone(), model, traffic, table: None })
    }

    /// Makes all forecasts that episodes can ask for beforehand, where they do not depend on the episode and so many
    /// `decisions` would ask for more of them than there are. The bits of an episode are the same either way.
    pub fn share_forecasts(&mut self, decisions: u64) -> anyhow::Result<()> {
        let config = &self.config.coastal;
        if let (Some(model), Some(traffic)) = (&self.model, &self.traffic)
            && config.forecasts_depend_on_tracks_alone()
        {
            let asked = decisions / config.forecast_every_decisions.max(1) as u64;
            let samples = traffic.forecast_samples(config);
            if asked >= samples.len() as u64 {
                self.table = Some(Arc::new(forecast_table(model, traffic, &samples, config.forecast_steps)?));
            }
        }
        Ok(())
    }

    /// The same environments without estimates: the same episodes at less cost.
    #[must_use]
    pub fn without_estimates(&self) -> Self {
        let config = RunConfig { estimates: false, ..self.config.clone() };
        Self { config, model: None, traffic: self.traffic.clone(), table: None }
    }

    /// An environment, with its forecaster on one thread.
    pub fn make(&self) -> anyhow::Result<Box<dyn Env>> {
        Ok(match self.config.env {
            EnvName::OpenWater => Box::new(self.open_water()?),
            EnvName::Coastal => Box::new(self.coastal()?),
        })
    }

    /// The open-water environment of this configuration.
    pub fn open_water(&self) -> anyhow::Result<OpenWater> {
        OpenWater::new(self.config.open_water.clone(), self.forecaster()).context("key \"open_water\"")
    }

    /// The coastal environment of this configuration.
    pub fn coastal(&self) -> anyhow::Result<Coastal> {
        let traffic = self.traffic.as_ref().context("the configuration is of another environment")?;
        let config = self.config.coastal.clone();
        let paths: Option<Box<dyn PathSource>> = match &self.table {
            Some(table) => Some(Box::new(TablePaths::new(Arc::clone(table)))),
            None => self.forecaster().map(|forecaster| -> Box<dyn PathSource> {
                Box::new(LivePaths::new(forecaster, config.noise_m == 0.0))
            }),
        };
        Coastal::with_paths(config, Arc::clone(traffic), paths).context("key \"coastal\"")
    }

    fn forecaster(&self) -> Option<Box<dyn Forecaster>> {
        let model = self.model.clone()?;
        Some(Box::new(LstmForecaster::new(model, 1)))
    }
}

/// The forecaster behind the estimates of a run.
pub fn load_forecaster(config: &RunConfig) -> anyhow::Result<Model> {
    let file = config.forecaster_file();
    Model::open(&file).with_context(|| {
        format!(
            "{}: no forecaster for the estimates; name one with `forecaster`, or train without estimates \
             (--no-estimates)",
            file.display()
        )
    })
}

/// The forecasts at these samples: those of an earlier command, or new ones on all cores.
fn forecast_table(
    model: &Model,
    traffic: &RecordedTraffic,
    samples: &BTreeSet<Sample>,
    steps: usize,
) -> anyhow::Result<SampleTable> {
    let tracks: Vec<&Track> = traffic.tracks().collect();
    let bytes = model.to_file().to_bytes();
    let file = cache::folder()?.map(|folder| TableFile::of(&folder, &bytes, &tracks, samples, steps));
    if let Some(table) = file.as_ref().and_then(|file| file.read(samples, steps)) {
        return Ok(table);
    }
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let forecaster = &mut LstmForecaster::new(model.clone(), threads);
    let bar = progress::steps(samples.len() as u64, "forecasts");
    let table = SampleTable::forecast(forecaster, &tracks, samples, steps, &mut |done| bar.inc(done as u64))
        .context("key \"tracks\"")?;
    bar.finish_and_clear();
    if let Some(Err(error)) = file.map(|file| file.write(&table)) {
        eprintln!("note: the forecasts were not kept for the next time: {error}");
    }
    Ok(table)
}

fn load_traffic(
    config: &RunConfig,
    part: TracksPart,
    model: Option<&Model>,
) -> anyhow::Result<Arc<RecordedTraffic>> {
    let TracksConfig { area, files, split } = &config.tracks;
    let recorded = recorded::import(area, files.iter().map(PathBuf::as_path)).context("key \"tracks\"")?;
    if let Some(model) = model {
        check_origin(model, recorded.origin, area)?;
    }
    let split = split_by_time(&recorded.tracks, split).context("key \"tracks.split\"")?;
    let tracks = match part {
        TracksPart::Training => split.train,
        TracksPart::HeldOut => split.test,
    };
    Ok(Arc::new(traffic_on(tracks, &config.coastal).context("key \"tracks\"")?))
}

/// The traffic on these tracks; says how many encounters they offer.
pub fn traffic_on(tracks: Vec<Track>, config: &CoastalConfig) -> anyhow::Result<RecordedTraffic> {
    let CachedStarts { starts, remark, .. } = cache::encounter_starts()?.find(&tracks, &config.head_on);
    if let Some(remark) = remark {
        eprintln!("note: {remark}");
    }
    eprintln!("{}", account(&starts, &tracks));
    Ok(RecordedTraffic::with_starts(tracks, starts, config)?)
}

/// How many starts the tracks offer, and which tracks offer none.
fn account(starts: &HeadOnStarts, tracks: &[Track]) -> String {
    /// Vessels that are named; the others are counted.
    const NAMED: usize = 5;
    let mut text = format!(
        "encounters: {} starts before a curve and {} straight on, on {} of {} tracks",
        starts.before_curve.len(),
        starts.straight_on.len(),
        tracks.len() - starts.tracks_without.len(),
        tracks.len()
    );
    let without: BTreeSet<u32> = starts.tracks_without.iter().map(|&track| tracks[track].mmsi).collect();
    if !without.is_empty() {
        let named: Vec<String> = without.iter().take(NAMED).map(u32::to_string).collect();
        let more = without.len().saturating_sub(NAMED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        text += &format!("; the others, of MMSI {}{more}, offer none", named.join(", "));
    }
    text
}

/// A forecaster knows where it is: in another plane its anchors mean other places.
fn check_origin(model: &Model, origin: Geodetic, area: &Path) -> anyhow::Result<()> {
    match model.origin {
        Some(trained) if trained != origin => bail!(
            "the forecaster \"{}\" was trained in a plane about {:.4}, {:.4}, but {} has its own about {:.4}, {:.4}; \
             name a forecaster of this area with `forecaster`, or train without estimates (--no-estimates)",
            model.config.name,
            trained.latitude_deg,
            trained.longitude_deg,
            area.display(),
            origin.latitude_deg,
            origin.longitude_deg,
        ),
        _ => Ok(()),
    }
}
