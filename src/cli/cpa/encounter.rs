//! Two vessels on one grid of times, from two tracks or from a scenario.

use std::path::Path;

use anyhow::{anyhow, ensure};
use nalgebra::Vector2;

use super::track_csv::TimedTrack;
use crate::cpa::StraightMotion;
use crate::scenario::ScenarioFile;

/// Own ship now, and where the target ship is over time.
pub(super) struct Encounter {
    pub own: StraightMotion,
    pub target_velocity: Vector2<f64>,
    /// The target ship's positions.
    pub target: Vec<Vector2<f64>>,
    /// The position that is the present one.
    pub now: usize,
    pub dt_s: f64,
}

impl Encounter {
    /// On own ship's grid, from the first to the last time that both tracks cover.
    pub fn of_tracks(own: &TimedTrack, target: &TimedTrack, at_s: f64) -> anyhow::Result<Self> {
        let start_s = own.start_s().max(target.start_s());
        let end_s = own.end_s().min(target.end_s());
        let times: Vec<f64> = own.times_s().filter(|time| (start_s..=end_s).contains(time)).collect();
        ensure!(
            times.len() >= 2,
            "{} covers {} and {} covers {}, less than one step of {} s in common: choose tracks that overlap",
            own.name,
            own.span(),
            target.name,
            target.span(),
            own.dt_s
        );
        let now = step_of(at_s, own.dt_s, times.len() - 1)?;
        let now_s = times[now];
        Ok(Self {
            own: StraightMotion { position: own.position_at(now_s), velocity: own.velocity_at(now_s) },
            target_velocity: target.velocity_at(now_s),
            target: times.iter().map(|&time| target.position_at(time)).collect(),
            now,
            dt_s: own.dt_s,
        })
    }

    /// Own ship and a target ship of a scenario, the first where none is named.
    pub fn of_scenario(file: &Path, name: Option<&str>, at_s: f64) -> anyhow::Result<Self> {
        let episode = ScenarioFile::load(file)?.set_up()?.run();
        let targets: Vec<&str> = episode.vessels.iter().skip(1).map(|vessel| vessel.name.as_str()).collect();
        let index =
            targets.iter().position(|target| name.is_none_or(|name| name == *target)).ok_or_else(|| {
                let there = if targets.is_empty() { "none".to_owned() } else { targets.join(", ") };
                let wanted =
                    name.map_or_else(|| "target ship".to_owned(), |name| format!("target ship \"{name}\""));
                anyhow!("{}: there is no {wanted}; its target ships: {there}", file.display())
            })?;
        let vessel = index + 1;
        let now = step_of(at_s, episode.dt_s, episode.steps.len() - 1)?;
        let present = &episode.steps[now].vessels;
        Ok(Self {
            own: StraightMotion { position: present[0].position.xy(), velocity: present[0].velocity.xy() },
            target_velocity: present[vessel].velocity.xy(),
            target: episode.steps.iter().map(|step| step.vessels[vessel].position.xy()).collect(),
            now,
            dt_s: episode.dt_s,
        })
    }
}

/// The step nearest to a time after the first of them.
fn step_of(at_s: f64, dt_s: f64, last: usize) -> anyhow::Result<usize> {
    let covered_s = dt_s * last as f64;
    ensure!((0.0..=covered_s).contains(&at_s), "--at {at_s} lies outside: choose 0 to {covered_s} seconds");
    Ok((at_s / dt_s).round() as usize)
}
