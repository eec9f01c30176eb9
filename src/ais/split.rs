//! Splitting: one vessel's fixes into trajectories without gaps, jumps and long stops.
//!
//! Fixes are dealt out to strands. A fix continues the strand from which the vessel can have come;
//! where there is none, it begins a new one. A spike is thereby a strand of a few fixes beside a
//! long one, a jump ends one strand and begins the next, and two vessels under one MMSI are two
//! long strands at the same time.

use super::clean::{Fix, reach_m};
use super::config::ImportConfig;
use super::report::{Counts, MessageDrop, Splits};
use crate::geo::Position;

/// One vessel's fixes, dealt out.
#[derive(Debug, Default)]
pub struct Strands {
    /// Each in order of time, without repeated times, gaps and implausible speeds; in the order of their first fixes.
    pub strands: Vec<Vec<Fix>>,
    /// Cuts between them.
    pub splits: Splits,
    /// Whether two vessels seem to share the MMSI.
    pub shared: bool,
}

/// Deals one vessel's fixes, ordered by time, out to strands.
pub fn into_strands(fixes: &[Fix], config: &ImportConfig, dropped: &mut Counts<MessageDrop>) -> Strands {
    let mut strands: Vec<Vec<Fix>> = Vec::new();
    // Strands that may still be continued.
    let mut open: Vec<usize> = Vec::new();
    for fix in fixes {
        open.retain(|&index| {
            last(&strands[index]).is_some_and(|last| fix.seconds_since(last) <= config.max_gap_s)
        });
        match strand_for(fix, &strands, &open, config) {
            Some(index) => strands[index].push(*fix),
            None => match open.iter().find_map(|&index| crowds(&strands[index], fix, config)) {
                Some(reason) => dropped.add(reason, 1),
                None => {
                    open.push(strands.len());
                    strands.push(vec![*fix]);
                }
            },
        }
    }
    drop_strays(&mut strands, config, dropped);
    let splits = count_splits(&strands, config);
    let shared = overlap(&strands);
    Strands { strands, splits, shared }
}

/// The strand that a fix continues. Where several could be, the oldest one on whose way it lies;
/// failing that, the one it misses least.
fn strand_for(fix: &Fix, strands: &[Vec<Fix>], open: &[usize], config: &ImportConfig) -> Option<usize> {
    let possible: Vec<usize> =
        open.iter().copied().filter(|&index| continues(&strands[index], fix, config)).collect();
    let on_its_way = |index: &usize| {
        let seconds = last(&strands[*index]).map_or(0.0, |last| fix.seconds_since(last));
        miss_m(&strands[*index], fix) <= reach_m(0.0, seconds, config)
    };
    let nearest = |a: &usize, b: &usize| miss_m(&strands[*a], fix).total_cmp(&miss_m(&strands[*b], fix));
    possible.iter().copied().find(on_its_way).or_else(|| possible.into_iter().min_by(nearest))
}

fn last(strand: &[Fix]) -> Option<&Fix> {
    strand.last()
}

/// Whether a vessel on the strand can have reached the fix.
fn continues(strand: &[Fix], fix: &Fix, config: &ImportConfig) -> bool {
    let [.., last] = strand else { return false };
    let seconds = fix.seconds_since(last);
    if seconds <= 0.0 || fix.speed_from_mps(last) > config.max_speed_mps {
        return false;
    }
    let made_good = strand.windows(2).rev().take(2).map(|leg| leg[1].speed_from_mps(&leg[0]));
    let known = made_good.chain(last.sog_mps).chain(fix.sog_mps).reduce(f64::max);
    known.is_none_or(|speed_mps| {
        let reach_m = reach_m(speed_mps, seconds, config);
        fix.position.distance_m(last.position) <= reach_m
    })
}

/// How far a fix lies from where the strand was heading, in metres.
fn miss_m(strand: &[Fix], fix: &Fix) -> f64 {
    fix.position.distance_m(expected(strand, fix))
}

fn expected(strand: &[Fix], fix: &Fix) -> Position {
    let [.., last] = strand else { return fix.position };
    let velocity = match strand {
        [.., earlier, last] => {
            Some((last.position - earlier.position).per_seconds(last.seconds_since(earlier)))
        }
        _ => last.reported_velocity(),
    };
    velocity.map_or(last.position, |velocity| last.position + velocity.for_seconds(fix.seconds_since(last)))
}

/// Why a fix that does not continue a strand is not the beginning of another one either: it lies
/// where the vessel is, but tells the same time again, or a time too close to the last for the way.
/// Receivers' clocks differ by seconds.
fn crowds(strand: &[Fix], fix: &Fix, config: &ImportConfig) -> Option<MessageDrop> {
    let [.., last] = strand else { return None };
    let seconds = fix.seconds_since(last);
    let near_m = config.position_slack_m + config.max_speed_mps * seconds;
    let is_near = fix.position.distance_m(last.position) <= near_m;
    is_near.then_some(if seconds > 0.0 { MessageDrop::PositionSpike } else { MessageDrop::RepeatedTime })
}

/// Drops the strands of a few fixes that lie beside a longer one in time.
fn drop_strays(strands: &mut Vec<Vec<Fix>>, config: &ImportConfig, dropped: &mut Counts<MessageDrop>) {
    let is_long = |strand: &[Fix]| strand.len() > config.max_stray_fixes;
    let long: Vec<Vec<Fix>> = strands.iter().filter(|strand| is_long(strand)).cloned().collect();
    strands.retain(|strand| {
        if is_long(strand) {
            return true;
        }
        let Some(beside) = long.iter().find(|long| within_gap(strand, long, config)) else { return true };
        for fix in strand {
            let told_again = beside.binary_search_by_key(&fix.unix_ms, |fix| fix.unix_ms).is_ok();
            let reason = if told_again { MessageDrop::RepeatedTime } else { MessageDrop::PositionSpike };
            dropped.add(reason, 1);
        }
        false
    });
}

/// Whether two strands overlap in time or have no gap between them.
fn within_gap(a: &[Fix], b: &[Fix], config: &ImportConfig) -> bool {
    let ([a_first, .., _] | [a_first], [b_first, .., _] | [b_first]) = (a, b) else { return false };
    let (Some(a_last), Some(b_last)) = (last(a), last(b)) else { return false };
    a_first.seconds_since(b_last) <= config.max_gap_s && b_first.seconds_since(a_last) <= config.max_gap_s
}

fn count_splits(strands: &[Vec<Fix>], config: &ImportConfig) -> Splits {
    let mut splits = Splits::default();
    for (index, strand) in strands.iter().enumerate().skip(1) {
        let (Some(first), earlier) = (strand.first(), &strands[..index]) else { continue };
        let goes_on =
            |other: &Vec<Fix>| last(other).is_some_and(|last| first.seconds_since(last) <= config.max_gap_s);
        let beside = |other: &Vec<Fix>| last(other).is_some_and(|last| last.unix_ms > first.unix_ms);
        if earlier.iter().any(beside) {
            // A second vessel beside the first: nothing was cut.
        } else if earlier.iter().any(goes_on) {
            splits.jump += 1;
        } else {
            splits.gap += 1;
        }
    }
    splits
}

/// Whether two long strands have fixes during each other.
fn overlap(strands: &[Vec<Fix>]) -> bool {
    let span = |strand: &Vec<Fix>| Some((strand.first()?.unix_ms, strand.last()?.unix_ms));
    let spans: Vec<(i64, i64)> = strands.iter().filter_map(span).collect();
    spans.iter().enumerate().any(|(index, a)| spans[..index].iter().any(|b| a.0 < b.1 && b.0 < a.1))
}

/// Cuts a strand where the vessel stops for long and where it sets off again, so that a stop is a
/// trajectory of its own.
pub fn at_stops(strand: Vec<Fix>, config: &ImportConfig, splits: &mut Splits) -> Vec<Vec<Fix>> {
    let stopped = stopped(&strand, config);
    let trajectories: Vec<Vec<Fix>> = strand
        .iter()
        .zip(&stopped)
        .collect::<Vec<_>>()
        .chunk_by(|a, b| a.1 == b.1)
        .map(|chunk| chunk.iter().map(|(fix, _)| **fix).collect())
        .collect();
    splits.stop += trajectories.len().saturating_sub(1) as u64;
    trajectories
}

/// For each fix, whether it belongs to a stop: a stretch of the configured duration within the
/// configured distance of its first fix.
fn stopped(fixes: &[Fix], config: &ImportConfig) -> Vec<bool> {
    let mut stopped = vec![false; fixes.len()];
    let mut first = 0;
    while first < fixes.len() {
        let stays = |fix: &&Fix| fix.position.distance_m(fixes[first].position) <= config.moored_radius_m;
        let length = fixes[first..].iter().take_while(stays).count();
        let end = first + length;
        if fixes[end - 1].seconds_since(&fixes[first]) >= config.moored_duration_s {
            stopped[first..end].fill(true);
            first = end;
        } else {
            first += 1;
        }
    }
    stopped
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn fix(seconds: f64, north_m: f64, east_m: f64) -> Fix {
        let unix_ms = (seconds * 1000.0) as i64;
        Fix { unix_ms, position: Position { north_m, east_m }, sog_mps: None, cog: None }
    }

    fn course(from_s: f64, count: usize, every_s: f64, east_m: f64) -> Vec<Fix> {
        (0..count).map(|k| from_s + every_s * k as f64).map(|t| fix(t, 6.0 * t, east_m)).collect()
    }

    fn strands(mut fixes: Vec<Fix>) -> (Strands, Counts<MessageDrop>) {
        fixes.sort_by_key(|fix| fix.unix_ms);
        let mut dropped = Counts::default();
        (into_strands(&fixes, &ImportConfig::default(), &mut dropped), dropped)
    }

    #[test]
    fn a_gap_splits_just_above_the_threshold() {
        let with_gap = |gap_s: f64| {
            let first = course(0.0, 10, 60.0, 0.0);
            let second = course(540.0 + gap_s, 10, 60.0, 0.0);
            strands([first, second].concat()).0
        };
        assert_eq!(with_gap(371.0).strands.len(), 1);
        let split = with_gap(372.0);
        assert_eq!((split.strands.len(), split.splits.gap, split.shared), (2, 1, false));
    }

    #[test]
    fn a_jump_splits() {
        let (split, dropped) =
            strands([course(0.0, 10, 60.0, 0.0), course(600.0, 10, 60.0, 20_000.0)].concat());
        assert_eq!((split.strands.len(), split.splits.jump, split.shared), (2, 1, false));
        assert_eq!(dropped.total(), 0);
    }

    #[test]
    fn two_vessels_under_one_mmsi_become_two_strands() {
        let (a, b) = (course(0.0, 20, 60.0, 0.0), course(30.0, 20, 60.0, 5000.0));
        let (split, dropped) = strands([a.clone(), b.clone()].concat());
        assert_eq!(split.strands, [a, b]);
        assert!(split.shared);
        assert_eq!(dropped.total(), 0);
    }

    #[test]
    fn two_vessels_that_report_at_the_same_times_are_told_apart() {
        let (a, b) = (course(0.0, 20, 60.0, 0.0), course(0.0, 20, 60.0, 5000.0));
        let (split, dropped) = strands([a.clone(), b.clone()].concat());
        assert_eq!(split.strands, [a, b]);
        assert_eq!(dropped.total(), 0);
    }

    #[test]
    fn a_stray_beside_a_strand_is_a_spike_and_the_rest_stays() {
        let good = course(0.0, 20, 60.0, 0.0);
        let (split, dropped) = strands([good.clone(), vec![fix(630.0, 0.0, 90_000.0)]].concat());
        assert_eq!(split.strands, [good]);
        assert_eq!(dropped.of(MessageDrop::PositionSpike), 1);
    }

    #[test]
    fn a_repeated_time_keeps_its_first_fix() {
        let good = course(0.0, 20, 60.0, 0.0);
        let mut again = good[7];
        again.position.east_m += 5.0;
        let mut far = good[9];
        far.position.east_m += 9000.0;
        let (split, dropped) = strands([good.clone(), vec![again, far]].concat());
        assert_eq!(split.strands, [good]);
        assert_eq!(dropped.of(MessageDrop::RepeatedTime), 2);
    }

    #[test]
    fn a_long_stop_is_a_trajectory_of_its_own() {
        let out = course(0.0, 10, 60.0, 0.0);
        let berth: Vec<Fix> = (0..30).map(|k| fix(600.0 + 60.0 * f64::from(k), 3600.0, 5.0)).collect();
        let back: Vec<Fix> =
            (0..10).map(|k| fix(2400.0 + 60.0 * f64::from(k), 3000.0 - 300.0 * f64::from(k), 0.0)).collect();
        let mut splits = Splits::default();
        let parts = at_stops([out, berth, back].concat(), &ImportConfig::default(), &mut splits);
        assert_eq!(parts.iter().map(Vec::len).collect::<Vec<_>>(), [10, 30, 10]);
        assert_eq!(splits.stop, 2);
    }

    proptest! {
        /// Whatever comes in: every fix once, no gap, no repeated time, no speed above the cap.
        #[test]
        fn strands_hold_their_promises(
            raw in proptest::collection::vec((0..4000_u16, -3000.0..3000.0_f64, -3000.0..3000.0_f64), 0..80),
        ) {
            let config = ImportConfig::default();
            let fixes: Vec<Fix> = raw.iter().map(|&(t, north, east)| fix(f64::from(t), north, east)).collect();
            let (split, dropped) = strands(fixes.clone());
            let mut splits = Splits::default();
            let trajectories: Vec<Vec<Fix>> =
                split.strands.into_iter().flat_map(|strand| at_stops(strand, &config, &mut splits)).collect();
            let placed: usize = trajectories.iter().map(Vec::len).sum();
            prop_assert_eq!(placed as u64 + dropped.total(), fixes.len() as u64);
            for leg in trajectories.iter().flat_map(|trajectory| trajectory.windows(2)) {
                let seconds = leg[1].seconds_since(&leg[0]);
                prop_assert!(seconds > 0.0 && seconds <= config.max_gap_s);
                prop_assert!(leg[1].speed_from_mps(&leg[0]) <= config.max_speed_mps);
            }
        }
    }
}
