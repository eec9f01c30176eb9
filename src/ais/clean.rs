//! Cleaning: of one vessel's messages, those that can be where it was.

use super::config::ImportConfig;
use super::message::Message;
use super::report::{Counts, MessageDrop};
use crate::angle::Nautical;
use crate::geo::{LocalPlane, Position, Velocity};

/// A message on the local plane of the area.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fix {
    /// Milliseconds since 1970-01-01 00:00:00 UTC.
    pub unix_ms: i64,
    /// Where the vessel was.
    pub position: Position,
    /// Speed over ground it reported, where it did.
    pub sog_mps: Option<f64>,
    /// Course over ground it reported, where it did.
    pub cog: Option<Nautical>,
}

impl Fix {
    /// A message's place on the plane.
    pub fn of(message: &Message, plane: &LocalPlane) -> Self {
        let known = |value: f32| (!value.is_nan()).then_some(f64::from(value));
        Self {
            unix_ms: message.unix_ms,
            position: plane.project(message.position),
            sog_mps: known(message.sog_mps),
            cog: known(message.cog_deg).map(Nautical::from_degrees),
        }
    }

    /// Time since an earlier fix, in seconds.
    pub fn seconds_since(&self, earlier: &Self) -> f64 {
        (self.unix_ms - earlier.unix_ms) as f64 / 1000.0
    }

    /// The speed that a straight way from `earlier` to here implies, in metres per second.
    pub fn speed_from_mps(&self, earlier: &Self) -> f64 {
        self.position.distance_m(earlier.position) / self.seconds_since(earlier)
    }

    /// The velocity reported, where speed and course both are.
    pub fn reported_velocity(&self) -> Option<Velocity> {
        Some(Velocity::from_course(self.cog?, self.sog_mps?))
    }
}

/// Puts one vessel's messages, ordered by time, on the plane; drops exact duplicates and positions
/// that are told again while the vessel moves on.
pub fn without_repetitions(
    messages: &[Message],
    plane: &LocalPlane,
    config: &ImportConfig,
    dropped: &mut Counts<MessageDrop>,
) -> Vec<Fix> {
    let mut kept: Vec<&Message> = Vec::with_capacity(messages.len());
    for message in messages {
        // Where two messages share a time, the one told again may come after the new one.
        let told_before = kept.iter().rev().take(3).find(|earlier| earlier.position == message.position);
        let seconds = told_before.map(|earlier| (message.unix_ms - earlier.unix_ms) as f64 / 1000.0);
        match seconds {
            Some(0.0) => dropped.add(MessageDrop::Duplicate, 1),
            // An unknown speed is not a number, and no comparison holds for it.
            Some(seconds) if f64::from(message.sog_mps) * seconds > config.stale_distance_m => {
                dropped.add(MessageDrop::StalePosition, 1);
            }
            _ => kept.push(message),
        }
    }
    kept.into_iter().map(|message| Fix::of(message, plane)).collect()
}

/// How far a vessel may get from a fix in `seconds`, in metres, that made `speed_mps` there. This
/// bounds neighbours; the speed cap is a matter apart.
pub fn reach_m(speed_mps: f64, seconds: f64, config: &ImportConfig) -> f64 {
    speed_mps * seconds + 0.5 * config.max_acceleration_mps2 * seconds * seconds + config.position_slack_m
}

/// Drops the spikes of a strand: fixes off the line that their neighbours imply, farther than
/// turning could bring the vessel and than the speed around them explains.
///
/// A spike also throws its neighbours' lines off, so only the worst of adjacent suspects goes, and
/// the rest is looked at again: the good fixes around a spike stay.
pub fn without_spikes(fixes: &[Fix], config: &ImportConfig, dropped: &mut Counts<MessageDrop>) -> Vec<Fix> {
    let mut kept = fixes.to_vec();
    loop {
        let misses: Vec<Miss> = (0..kept.len()).map(|index| Miss::of(&kept, index, config)).collect();
        let off_m =
            |index: Option<usize>| index.and_then(|index| misses.get(index)).map_or(0.0, |miss| miss.off_m);
        let is_spike = |index: usize| {
            let Miss { off_m: own_m, excess_m } = misses[index];
            excess_m > 0.0 && own_m > off_m(index.checked_sub(1)) && own_m >= off_m(Some(index + 1))
        };
        let good: Vec<Fix> =
            (0..kept.len()).filter(|&index| !is_spike(index)).map(|index| kept[index]).collect();
        if good.len() == kept.len() {
            return kept;
        }
        dropped.add(MessageDrop::PositionSpike, (kept.len() - good.len()) as u64);
        kept = good;
    }
}

/// How a fix fits its neighbours.
#[derive(Debug, Clone, Copy)]
struct Miss {
    /// How far it lies from where they put it, in metres.
    off_m: f64,
    /// How much farther that is than it may be; zero or less for a good fix.
    excess_m: f64,
}

impl Miss {
    fn of(fixes: &[Fix], index: usize, config: &ImportConfig) -> Self {
        let from = |pair: [usize; 2]| Self::from_pair(fixes, index, pair, config);
        let last = fixes.len().saturating_sub(1);
        if index > 0 && index < last {
            return from([index - 1, index + 1]);
        }
        if fixes.len() < 4 {
            return Self { off_m: 0.0, excess_m: 0.0 };
        }
        // At an end the neighbours are all on one side. One of the three may be a spike itself; two
        // of them then still put a good fix where it is.
        let nth = |n: usize| if index == 0 { n } else { last - n };
        let misses = [[nth(1), nth(2)], [nth(2), nth(3)], [nth(1), nth(3)]].map(from);
        misses.into_iter().fold(misses[0], |least, miss| Self {
            off_m: least.off_m.min(miss.off_m),
            excess_m: least.excess_m.min(miss.excess_m),
        })
    }

    /// Judged by the straight and steady motion through two other fixes.
    fn from_pair(fixes: &[Fix], index: usize, pair: [usize; 2], config: &ImportConfig) -> Self {
        let (suspect, [a, b]) = (&fixes[index], pair.map(|at| &fixes[at]));
        let (from_a_s, from_b_s) = (suspect.seconds_since(a), suspect.seconds_since(b));
        let steady = a.position.lerp(b.position, from_a_s / (from_a_s - from_b_s));
        let off_m = suspect.position.distance_m(steady);
        let beyond_scatter_m = off_m - config.position_slack_m;
        if beyond_scatter_m <= 0.0 {
            return Self { off_m, excess_m: beyond_scatter_m };
        }
        // Constant acceleration bows the way by this much at the suspect.
        let by_turning_m = 0.5 * config.max_acceleration_mps2 * (from_a_s * from_b_s).abs();
        let (first, second) = (pair[0].min(pair[1]), pair[0].max(pair[1]));
        let before =
            first.checked_sub(1).filter(|&at| at != index).map(|at| fixes[first].speed_from_mps(&fixes[at]));
        let after = fixes
            .get(second + 1)
            .filter(|_| second + 1 != index)
            .map(|next| next.speed_from_mps(&fixes[second]));
        let between = fixes[second].speed_from_mps(&fixes[first]);
        let fastest_mps = [before, after, Some(between), a.sog_mps, suspect.sog_mps, b.sog_mps]
            .into_iter()
            .flatten()
            .fold(0.0, f64::max);
        let nearest_s = from_a_s.abs().min(from_b_s.abs());
        let by_speed_m = (config.spike_factor * fastest_mps + config.spike_floor_mps) * nearest_s;
        Self { off_m, excess_m: beyond_scatter_m - by_turning_m.min(by_speed_m) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geo::Geodetic;

    fn fix(seconds: i64, north_m: f64, east_m: f64) -> Fix {
        Fix { unix_ms: seconds * 1000, position: Position { north_m, east_m }, sog_mps: None, cog: None }
    }

    /// North at 8 m/s, a fix every 10 s.
    fn straight() -> Vec<Fix> {
        (0..20).map(|k| fix(10 * k, 80.0 * k as f64, 0.0)).collect()
    }

    fn spikes(fixes: &[Fix]) -> (Vec<Fix>, u64) {
        let mut dropped = Counts::default();
        let kept = without_spikes(fixes, &ImportConfig::default(), &mut dropped);
        (kept, dropped.of(MessageDrop::PositionSpike))
    }

    #[test]
    fn a_spike_goes_and_the_good_fixes_around_it_stay() {
        for at in [0, 1, 2, 7, 17, 18, 19] {
            let mut fixes = straight();
            fixes[at].position.east_m = 250.0;
            let (kept, dropped) = spikes(&fixes);
            assert_eq!(dropped, 1, "at {at}");
            fixes.remove(at);
            assert_eq!(kept, fixes);
        }
    }

    #[test]
    fn scatter_and_sharp_turns_stay() {
        let mut fixes = straight();
        for (index, fix) in fixes.iter_mut().enumerate() {
            fix.position.east_m = if index % 2 == 0 { 10.0 } else { -10.0 };
        }
        assert_eq!(spikes(&fixes).1, 0);
        // About in a minute, at 5 m/s.
        let turn: Vec<Fix> = (0..12)
            .map(|k| {
                let turned_rad = (0.05 * (10.0 * f64::from(k) - 30.0)).clamp(0.0, std::f64::consts::PI);
                let (before_m, after_m) =
                    (5.0 * (10.0 * f64::from(k)).min(30.0), 5.0 * (10.0 * f64::from(k) - 92.8).max(0.0));
                let north_m = before_m + 100.0 * turned_rad.sin() - after_m;
                fix(10 * i64::from(k), north_m, 100.0 - 100.0 * turned_rad.cos())
            })
            .collect();
        assert_eq!(spikes(&turn).1, 0);
    }

    #[test]
    fn exact_duplicates_and_stale_positions_go() {
        let plane = LocalPlane::at(Geodetic { latitude_deg: 40.0, longitude_deg: -74.0 });
        let message = |seconds: i64, latitude_deg: f64, sog_mps: f32| Message {
            mmsi: 219_000_001,
            unix_ms: seconds * 1000,
            position: Geodetic { latitude_deg, ..plane.origin },
            sog_mps,
            cog_deg: f32::NAN,
            heading_deg: f32::NAN,
        };
        let messages = [
            message(0, 40.0, 6.0),
            message(0, 40.0, 6.0),
            // Told again eight seconds later, at six metres per second.
            message(8, 40.0, 6.0),
            message(10, 40.0006, 6.0),
            // At rest, or with no speed known, the same position may be true.
            message(20, 40.0006, 0.0),
            message(30, 40.0006, f32::NAN),
        ];
        let mut dropped = Counts::default();
        let kept = without_repetitions(&messages, &plane, &ImportConfig::default(), &mut dropped);
        assert_eq!(kept.len(), 4);
        assert_eq!((dropped.of(MessageDrop::Duplicate), dropped.of(MessageDrop::StalePosition)), (1, 1));
    }
}
