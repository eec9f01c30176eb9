//! Two vessels on one grid of times.

use anyhow::ensure;
use nalgebra::Vector2;

use super::track_csv::TimedTrack;
use crate::cpa::StraightMotion;

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
}

/// The step nearest to a time after the first of them.
fn step_of(at_s: f64, dt_s: f64, last: usize) -> anyhow::Result<usize> {
    let covered_s = dt_s * last as f64;
    ensure!((0.0..=covered_s).contains(&at_s), "--at {at_s} lies outside: choose 0 to {covered_s} seconds");
    Ok((at_s / dt_s).round() as usize)
}
