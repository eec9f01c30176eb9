//! Segments to learn from and to be measured on: drawn fresh from a known process, or cut out of
//! recorded tracks.

use nalgebra::Vector2;
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Segment;
use crate::geo::{Displacement, Position};
use crate::track::Track;
use crate::vessel::{OffsetProcess, PeriodicConfig, StochasticConfig, periodic, stochastic};

/// An endless supply of segments.
pub trait SegmentSource: Send {
    /// The next segment of this stream of random numbers.
    fn draw(&self, rng: &mut ChaCha8Rng) -> Segment;
}

/// A motion whose process is known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Process {
    /// Smoothed autoregressive wander about a straight line.
    Stochastic(StochasticConfig),
    /// Sinusoidal weave with noise about a straight line.
    Periodic(PeriodicConfig),
}

/// How synthetic segments are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SyntheticConfig {
    /// Either component of the velocity is uniform between plus and minus this, in metres per second.
    pub component_mps: f64,
    /// A segment starts at least this many steps into its process, so that it is stationary.
    pub earliest_step: usize,
    /// And at most this many.
    pub latest_step: usize,
    /// Time between two positions, in seconds.
    pub dt_s: f64,
}

impl Default for SyntheticConfig {
    fn default() -> Self {
        Self { component_mps: 5.0, earliest_step: 60, latest_step: 360, dt_s: 5.0 }
    }
}

/// Fresh segments of a known process.
#[derive(Debug, Clone)]
pub struct SyntheticSegments {
    /// The motion.
    pub process: Process,
    /// How segments are drawn.
    pub config: SyntheticConfig,
    /// Positions of history in a segment.
    pub history_len: usize,
    /// Positions to predict in a segment.
    pub horizon: usize,
}

impl SegmentSource for SyntheticSegments {
    fn draw(&self, rng: &mut ChaCha8Rng) -> Segment {
        let limit = self.config.component_mps;
        let velocity = Vector2::from_fn(|_, _| rng.random_range(-limit..=limit));
        match self.process {
            Process::Stochastic(config) => {
                let process = stochastic::Process::new(config, velocity);
                self.follow(velocity, process, rng)
            }
            Process::Periodic(config) => {
                let process = periodic::Process::new(config, velocity, rng);
                self.follow(velocity, process, rng)
            }
        }
    }
}

impl SyntheticSegments {
    /// As many segments of one seed as asked for.
    #[must_use]
    pub fn take(&self, count: usize, rng: &mut ChaCha8Rng) -> Vec<Segment> {
        (0..count).map(|_| self.draw(rng)).collect()
    }

    fn follow(
        &self,
        velocity: Vector2<f64>,
        mut process: impl OffsetProcess,
        rng: &mut ChaCha8Rng,
    ) -> Segment {
        let start = rng.random_range(self.config.earliest_step..=self.config.latest_step);
        for _ in 0..start {
            process.next_offset(rng);
        }
        let mut position = |k: usize| {
            let xy = velocity * (k as f64 * self.config.dt_s) + process.next_offset(rng);
            Position { north_m: xy.y, east_m: xy.x }
        };
        let history: Vec<Position> = (0..self.history_len).map(&mut position).collect();
        let future = (self.history_len..self.history_len + self.horizon).map(&mut position).collect();
        let present = history.last().copied().unwrap_or_default();
        Segment { history, present, future, mmsi: None, start_unix_s: None }
    }
}

/// How recorded segments are drawn for training.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RecordedConfig {
    /// Probability that a segment is drawn among those with a curve.
    pub curve_share: f64,
    /// A segment has a curve if its course changes by more than this over the horizon, in degrees.
    pub curve_deg: f64,
    /// Least standard deviation of the noise added to the positions seen, in metres on each axis.
    pub least_noise_m: f64,
    /// Largest; drawn per segment, uniform in its logarithm.
    pub most_noise_m: f64,
    /// Standard deviation of a shift of the whole segment on each axis, in metres: vessels of one route
    /// do not sail in one another's wake.
    pub shift_m: f64,
}

impl Default for RecordedConfig {
    fn default() -> Self {
        Self { curve_share: 0.2, curve_deg: 15.0, least_noise_m: 0.2, most_noise_m: 20.0, shift_m: 0.0 }
    }
}

/// Segments of recorded tracks: every stretch of `history_len + horizon` positions of every track.
#[derive(Debug, Clone)]
pub struct RecordedSegments {
    tracks: Vec<Track>,
    /// Segments of this and of all earlier tracks.
    cumulative: Vec<usize>,
    /// Track and first position of the segments with a curve.
    curves: Vec<(usize, usize)>,
    history_len: usize,
    horizon: usize,
    config: RecordedConfig,
}

/// Why there is nothing to draw from.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum DatasetError {
    /// Every track is shorter than one segment.
    #[error(
        "none of {tracks} tracks has the {needed} positions that a segment needs; take tracks of a longer \
         duration or a shorter horizon"
    )]
    NoSegments {
        /// Tracks there are.
        tracks: usize,
        /// Positions of history and horizon together.
        needed: usize,
    },
    /// The augmentation's bounds are no bounds.
    #[error(
        "`least_noise_m` is {least} and `most_noise_m` is {most}; they have to be positive, finite and in this order"
    )]
    Noise {
        /// The lower bound given.
        least: f64,
        /// The upper bound given.
        most: f64,
    },
    /// The shift's spread is none.
    #[error("`shift_m` is {0}; it has to be 0 or more, and finite")]
    Shift(f64),
    /// Not a probability.
    #[error("`curve_share` is {0}; it has to lie between 0 and 1")]
    CurveShare(f64),
}

impl RecordedSegments {
    /// All segments of the tracks.
    ///
    /// # Errors
    ///
    /// When no track is long enough for one segment, or `config` is out of range.
    pub fn new(
        tracks: Vec<Track>,
        history_len: usize,
        horizon: usize,
        config: RecordedConfig,
    ) -> Result<Self, DatasetError> {
        let (least, most) = (config.least_noise_m, config.most_noise_m);
        if !(least > 0.0 && least <= most && most.is_finite()) {
            return Err(DatasetError::Noise { least, most });
        }
        if !(0.0..=1.0).contains(&config.curve_share) {
            return Err(DatasetError::CurveShare(config.curve_share));
        }
        if !(config.shift_m >= 0.0 && config.shift_m.is_finite()) {
            return Err(DatasetError::Shift(config.shift_m));
        }
        let needed = history_len + horizon;
        let mut total = 0;
        let cumulative = tracks
            .iter()
            .map(|track| {
                total += (track.positions.len() + 1).saturating_sub(needed);
                total
            })
            .collect();
        if total == 0 {
            return Err(DatasetError::NoSegments { tracks: tracks.len(), needed });
        }
        let mut segments = Self { tracks, cumulative, curves: Vec::new(), history_len, horizon, config };
        let curve_rad = config.curve_deg.to_radians();
        segments.curves = (0..total)
            .map(|index| segments.place(index))
            .filter(|&(track, first)| segments.turn_rad(track, first) > curve_rad)
            .collect();
        Ok(segments)
    }

    /// Number of segments.
    #[must_use]
    pub fn len(&self) -> usize {
        self.cumulative.last().copied().unwrap_or(0)
    }

    /// Never: there is at least one segment.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of segments with a curve.
    #[must_use]
    pub fn curves(&self) -> usize {
        self.curves.len()
    }

    /// At most `count` segments, evenly spread over all of them.
    #[must_use]
    pub fn spread(&self, count: usize) -> Vec<Segment> {
        let count = count.min(self.len());
        (0..count)
            .map(|k| {
                let (track, first) = self.place(k * self.len() / count);
                self.cut(track, first)
            })
            .collect()
    }

    /// Track and first position of segment `index`.
    fn place(&self, index: usize) -> (usize, usize) {
        let track = self.cumulative.partition_point(|&end| end <= index);
        let before = if track == 0 { 0 } else { self.cumulative[track - 1] };
        (track, index - before)
    }

    fn turn_rad(&self, track: usize, first: usize) -> f64 {
        let track = &self.tracks[track];
        let now = first + self.history_len - 1;
        let end = now + self.horizon;
        // The course *over the last step*, as in `Segment::has_curve`.
        track.course(end - 1).turn_from(track.course(now.saturating_sub(1))).abs()
    }

    fn cut(&self, track: usize, first: usize) -> Segment {
        let track = &self.tracks[track];
        let now = first + self.history_len;
        Segment {
            history: track.positions[first..now].to_vec(),
            present: track.positions[now - 1],
            future: track.positions[now..now + self.horizon].to_vec(),
            mmsi: Some(track.mmsi),
            start_unix_s: Some(track.unix_s(first)),
        }
    }
}

impl SegmentSource for RecordedSegments {
    fn draw(&self, rng: &mut ChaCha8Rng) -> Segment {
        let wants_curve = rng.random_bool(self.config.curve_share);
        let (track, first) = if wants_curve && !self.curves.is_empty() {
            self.curves[rng.random_range(0..self.curves.len())]
        } else {
            self.place(rng.random_range(0..self.len()))
        };
        let mut segment = self.cut(track, first);
        let RecordedConfig { least_noise_m, most_noise_m, shift_m, .. } = self.config;
        if shift_m > 0.0 {
            segment.shift(normal_displacement(shift_m, rng));
        }
        let noise_m = least_noise_m * (most_noise_m / least_noise_m).powf(rng.random::<f64>());
        disturb(&mut segment.history, noise_m, rng);
        segment
    }
}

/// Adds independent noise of a standard deviation in metres to either axis of every position.
pub fn disturb(positions: &mut [Position], noise_m: f64, rng: &mut impl Rng) {
    for position in positions {
        *position += normal_displacement(noise_m, rng);
    }
}

fn normal_displacement(sd_m: f64, rng: &mut impl Rng) -> Displacement {
    let north_m = sd_m * rng.sample::<f64, _>(StandardNormal);
    let east_m = sd_m * rng.sample::<f64, _>(StandardNormal);
    Displacement { north_m, east_m }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rand::SeedableRng;

    use super::super::{SplitConfig, split_by_time};
    use super::*;
    use crate::track::VesselParticulars;

    fn track(mmsi: u32, start_unix_s: i64, length: usize) -> Track {
        let positions = (0..length)
            .map(|k| {
                let after = k.saturating_sub(40) as f64;
                Position { north_m: 50.0 * k.min(40) as f64 + start_unix_s as f64, east_m: 50.0 * after }
            })
            .collect();
        Track { mmsi, start_unix_s, dt_s: 5.0, positions, particulars: VesselParticulars::default() }
    }

    fn recorded(tracks: Vec<Track>) -> RecordedSegments {
        RecordedSegments::new(tracks, 10, 20, RecordedConfig::default()).unwrap()
    }

    #[test]
    fn segments_are_counted_and_found() {
        let segments = recorded(vec![track(1, 0, 29), track(2, 0, 32), track(3, 0, 30)]);
        assert_eq!(segments.len(), 4);
        let vessels: Vec<_> = segments.spread(100).iter().map(|s| s.mmsi.unwrap()).collect();
        assert_eq!(vessels, [2, 2, 2, 3]);
        assert_eq!(segments.spread(2).len(), 2);
    }

    #[test]
    fn segments_with_a_curve_are_those_the_evaluation_counts() {
        let segments = recorded(vec![track(1, 0, 100)]);
        let curve_rad = 15_f64.to_radians();
        let counted = segments.spread(usize::MAX).iter().filter(|s| s.has_curve(curve_rad)).count();
        assert_eq!(segments.curves(), counted);
        assert_eq!(counted, 20);
    }

    #[test]
    fn curves_are_oversampled() {
        let segments = recorded(vec![track(1, 0, 1000)]);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let is_curve = |s: &Segment| s.future.first().unwrap().east_m < 1000.0 && s.future[19].east_m > 0.0;
        let drawn = (0..1000).filter(|_| is_curve(&segments.draw(&mut rng))).count();
        assert!((180..300).contains(&drawn), "{drawn}");
    }

    #[test]
    fn noise_is_on_what_is_seen_only_and_spread_over_its_range() {
        let segments = recorded(vec![track(1, 0, 200)]);
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut levels = Vec::new();
        for _ in 0..500 {
            let segment = segments.draw(&mut rng);
            let first = (segment.start_unix_s.unwrap() / 5.0) as usize;
            let truth = &segments.tracks[0].positions[first..];
            assert_eq!(segment.future[0], truth[10]);
            let squares = segment.history.iter().zip(truth).map(|(seen, at)| seen.distance_m(*at).powi(2));
            // Two coordinates of ten positions.
            levels.push((squares.sum::<f64>() / 20.0).sqrt());
        }
        levels.sort_by(f64::total_cmp);
        // Log-uniform in 0.2..20 m, seen through the spread of twenty draws.
        assert!(levels[0] >= 0.2 * 0.4 && levels[499] <= 20.0 * 1.8);
        assert!((levels[250] - 2.0).abs() < 0.6, "{}", levels[250]);
        assert!(levels[50] < 0.6 && levels[450] > 6.0);
    }

    /// History, present and future move by the same, which differs by segment and has the spread asked for.
    #[test]
    fn a_shift_moves_the_whole_segment() {
        let mut segments = recorded(vec![track(1, 0, 200)]);
        segments.config.shift_m = 100.0;
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut squares = 0.0;
        for _ in 0..500 {
            let segment = segments.draw(&mut rng);
            let first = (segment.start_unix_s.unwrap() / 5.0) as usize;
            let truth = &segments.tracks[0].positions[first..];
            let shift = segment.present - truth[9];
            let off = |seen: &[Position], from: usize| {
                let apart = seen.iter().zip(&truth[from..]).map(|(seen, at)| seen.distance_m(*at + shift));
                apart.fold(0.0, f64::max)
            };
            assert!(off(&segment.future, 10) < 1e-9);
            // What is left on the history is the noise.
            assert!(off(&segment.history, 0) < 100.0);
            squares += shift.north_m.powi(2) + shift.east_m.powi(2);
        }
        assert!(((squares / 1000.0).sqrt() - 100.0).abs() < 10.0);
    }

    #[test]
    fn unusable_settings_are_refused() {
        let new = |config| RecordedSegments::new(vec![track(1, 0, 50)], 10, 20, config);
        let shift = RecordedConfig { shift_m: -1.0, ..Default::default() };
        assert_eq!(new(shift).unwrap_err(), DatasetError::Shift(-1.0));
        let noise = RecordedConfig { least_noise_m: 0.0, ..Default::default() };
        assert!(matches!(new(noise), Err(DatasetError::Noise { .. })));
        let share = RecordedConfig { curve_share: 1.5, ..Default::default() };
        assert!(matches!(new(share), Err(DatasetError::CurveShare(_))));
        let short = RecordedSegments::new(vec![track(1, 0, 29)], 10, 20, RecordedConfig::default());
        assert!(matches!(short, Err(DatasetError::NoSegments { tracks: 1, needed: 30 })));
    }

    #[test]
    fn synthetic_segments_are_fresh_and_repeat_with_their_seed() {
        let source = SyntheticSegments {
            process: Process::Periodic(PeriodicConfig::default()),
            config: SyntheticConfig::default(),
            history_len: 10,
            horizon: 100,
        };
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let first = source.take(2, &mut rng);
        assert_ne!(first[0], first[1]);
        assert_eq!(first, source.take(2, &mut ChaCha8Rng::seed_from_u64(3)));
        assert_eq!((first[0].history.len(), first[0].future.len()), (10, 100));
        // Five periods on, the weave is at the same phase: what is left is the mean way made good.
        let way = |a: Position, b: Position| (b - a).length_m() / 500.0;
        let segment = &first[0];
        assert!(
            (way(segment.history[9], segment.future[99]) - way(segment.history[0], segment.future[90])).abs()
                < 0.1
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        /// Whatever training draws lies before the boundary; whatever is measured lies after it.
        #[test]
        fn training_never_draws_a_held_out_position(
            spans in prop::collection::vec((0..9_000_i64, 30..300_usize), 4..20),
            seed in 0..1000_u64,
        ) {
            let tracks: Vec<Track> =
                spans.iter().enumerate().map(|(k, &(start, n))| track(k as u32, start, n)).collect();
            let split = split_by_time(&tracks, &SplitConfig::default()).unwrap();
            let config = RecordedConfig::default();
            if let Ok(train) = RecordedSegments::new(split.train.clone(), 10, 20, config) {
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                for _ in 0..100 {
                    let segment = train.draw(&mut rng);
                    let last_unix_s = segment.start_unix_s.unwrap() + 29.0 * 5.0;
                    prop_assert!(last_unix_s < split.boundary_unix_s);
                }
            }
            if let Ok(test) = RecordedSegments::new(split.test.clone(), 10, 20, config) {
                for segment in test.spread(100) {
                    prop_assert!(segment.start_unix_s.unwrap() >= split.boundary_unix_s);
                    prop_assert!(!split.trained_vessels().contains(&segment.mmsi.unwrap()));
                }
            }
        }
    }
}
