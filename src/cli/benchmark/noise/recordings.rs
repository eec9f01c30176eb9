//! The recorded vessels that a benchmark meets: held-out and training tracks of the area that agents were trained
//! in, or all tracks of another.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context, bail};

use super::Args;
use crate::agent::TracksConfig;
use crate::ais;
use crate::cli::agent_run::traffic_on;
use crate::cli::recorded;
use crate::env::coastal::CoastalConfig;
use crate::experiment::noise::{NoiseConfig, TracksPart, Waters};
use crate::forecast::{Split, SplitConfig, split_by_time};
use crate::geo::Geodetic;
use crate::track::Track;

/// Where tracks come from, and what is sailed on them.
pub(super) struct Recordings {
    /// What results are about, then what stands beside it.
    pub waters: Vec<Waters>,
    /// Origin of the plane that the tracks lie in.
    pub origin: Geodetic,
    /// What tables call the area.
    pub area: String,
    /// What agents were trained on to which these tracks are held out, where it is known.
    pub trained_on: Option<TracksConfig>,
}

impl Recordings {
    pub(super) fn load(args: &Args, config: &NoiseConfig) -> anyhow::Result<Self> {
        let (tracks, origin, area, trained_on) = imported(args)?;
        let split = match (&trained_on, args.train_fraction) {
            (None, None) => None,
            (Some(tracks), None) => Some(tracks.split),
            (_, Some(train_fraction)) => Some(SplitConfig { train_fraction }),
        };
        let Some(split) = split else {
            let waters =
                waters(TracksPart::Whole, tracks, BTreeSet::new(), config).with_context(|| area.clone())?;
            return Ok(Self { waters: vec![waters], origin, area, trained_on });
        };
        let Split { train, test, .. } = split_by_time(&tracks, &split).context("--train-fraction")?;
        let seen: BTreeSet<u32> = train.iter().map(|track| track.mmsi).collect();
        let mut all =
            vec![waters(TracksPart::HeldOut, test, seen.clone(), config).with_context(|| area.clone())?];
        if !args.no_training_tracks {
            all.push(waters(TracksPart::Training, train, seen, config).with_context(|| area.clone())?);
        }
        Ok(Self { waters: all, origin, area, trained_on })
    }
}

type Imported = (Vec<Track>, Geodetic, String, Option<TracksConfig>);

fn imported(args: &Args) -> anyhow::Result<Imported> {
    if let Some(folder) = &args.tracks {
        let set = ais::load_tracks(folder)?;
        return Ok((set.tracks, set.plane.origin, folder.display().to_string(), None));
    }
    let (area, files, default) = match &args.area {
        Some(area) => (area.clone(), args.ais.clone(), None),
        None => {
            let tracks = TracksConfig::default();
            (tracks.area.clone(), tracks.files.clone(), Some(tracks))
        }
    };
    let recorded = recorded::import(&area, files.iter().map(PathBuf::as_path))?;
    if recorded.tracks.is_empty() {
        bail!("{}: no tracks there; look at the report of `searoom ais import`", area.display());
    }
    Ok((recorded.tracks, recorded.origin, area.display().to_string(), default))
}

fn waters(
    part: TracksPart,
    tracks: Vec<Track>,
    seen: BTreeSet<u32>,
    config: &NoiseConfig,
) -> anyhow::Result<Waters> {
    let coastal = CoastalConfig { scenario: config.scenario, ..config.coastal.clone() };
    let traffic = traffic_on(tracks, &coastal).with_context(|| format!("{} tracks", part.as_str()))?;
    Ok(Waters { part, traffic: Arc::new(traffic), seen })
}
