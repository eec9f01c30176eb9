use proptest::prelude::*;

use super::*;
use crate::angle::Nautical;
use crate::geo::{Position, Velocity};

fn vessel(length_m: f64, beam_m: f64, collision_radius_m: f64) -> VesselBody {
    VesselBody { hull: Hull::new(length_m, beam_m, Bow::Normal).expect("a hull"), collision_radius_m }
}

fn state(north_m: f64, east_m: f64, heading_deg: f64) -> VesselState {
    VesselState {
        position: Position { north_m, east_m },
        velocity: Velocity::default(),
        heading: Nautical::from_degrees(heading_deg),
    }
}

fn pair(starts: [VesselState; 2]) -> World {
    let mut world = World::new(WorldConfig::default());
    let a = world.add_vessel(vessel(180.0, 30.0, 150.0), starts[0]);
    let b = world.add_vessel(vessel(90.0, 16.0, 150.0), starts[1]);
    world.watch(a, b);
    world
}

/// State a fraction of the way from one to the other: the world's idea of what happens in a step.
fn between(from: &VesselState, to: &VesselState, fraction: f64) -> VesselState {
    VesselState {
        position: from.position.lerp(to.position, fraction),
        velocity: from.velocity,
        heading: from.heading.turned(to.heading.turn_from(from.heading) * fraction),
    }
}

#[test]
fn a_vessel_that_passes_clean_through_a_circle_is_caught() {
    let mut world = pair([state(0.0, 0.0, 0.0), state(1000.0, 100.0, 180.0)]);
    assert!(!world.reports()[0].circles_touch());
    let report = world.step(&[state(0.0, 0.0, 0.0), state(-1000.0, 100.0, 180.0)])[0];
    assert!(report.centre_distance_m > 1000.0);
    assert!((report.min_centre_distance_m - 100.0).abs() < 1e-9);
    assert!((report.min_centre_time_s - 2.5).abs() < 1e-9);
    let entered_s = report.circle_contact_time_s.expect("contact of the circles");
    assert!((entered_s - 5.0 * (1000.0 - 80_000_f64.sqrt()) / 2000.0).abs() < 1e-9);
    assert!(!report.hulls_touch());
    assert!((report.min_hull_distance_m - (100.0 - 15.0 - 8.0)).abs() < 1e-9);
    let overlap = world.overlap(VesselId(0), VesselId(1));
    assert_eq!(overlap, Overlap { circles: false, hulls: false });
}

#[test]
fn hulls_that_pass_through_each_other_touch_at_the_right_moment() {
    let mut world = pair([state(0.0, 0.0, 0.0), state(1000.0, 0.0, 180.0)]);
    let report = world.step(&[state(0.0, 0.0, 0.0), state(-1000.0, 0.0, 180.0)])[0];
    assert_eq!(report.min_hull_distance_m, 0.0);
    // Bow to bow after 1000 - 90 - 45 metres.
    let contact_s = report.hull_contact_time_s.expect("contact of the hulls");
    assert!((contact_s - 5.0 * 865.0 / 2000.0).abs() < 1e-9);
    assert_eq!(report.min_hull_time_s, contact_s);
}

#[test]
fn a_stern_that_swings_out_touches() {
    // Turning on the spot, the hulls are clear before and after and overlap in between.
    let mut world = pair([state(0.0, 0.0, 30.0), state(0.0, 95.0, 0.0)]);
    assert!(world.reports()[0].hull_distance_m > 5.0);
    let report = world.step(&[state(0.0, 0.0, 150.0), state(0.0, 95.0, 0.0)])[0];
    assert!(report.hull_distance_m > 5.0);
    assert!(report.hulls_touch());
    let contact_s = report.hull_contact_time_s.expect("contact of the hulls");
    assert!(contact_s > 0.5 && contact_s < 2.5, "{contact_s}");
}

/// A vessel that drifts broadside on: its hull lies as it heads, not as it goes.
#[test]
fn the_hull_of_a_drifting_vessel_lies_along_its_heading() {
    let mut world = pair([state(0.0, 0.0, 0.0), state(70.0, 60.0, 0.0)]);
    let drifting = |east_m: f64| {
        let velocity = Velocity { north_mps: 0.0, east_mps: 8.0 };
        VesselState { velocity, ..state(0.0, east_m, 0.0) }
    };
    // Beam to beam the hulls touch after 60 - 15 - 8 metres; end on they would have at once.
    let report = world.step(&[drifting(40.0), state(70.0, 60.0, 0.0)])[0];
    let contact_s = report.hull_contact_time_s.expect("contact of the hulls");
    assert!((contact_s - 5.0 * 37.0 / 40.0).abs() < 1e-3, "{contact_s}");
    // Ahead of its bow the same drift touches nothing.
    let mut world = pair([state(0.0, 0.0, 0.0), state(140.0, 60.0, 0.0)]);
    let report = world.step(&[drifting(120.0), state(140.0, 60.0, 0.0)])[0];
    assert!(!report.hulls_touch() && report.min_hull_distance_m > 4.0, "{report:?}");
}

#[test]
fn times_count_from_the_start_and_reset_sets_them_back() {
    let starts = [state(0.0, 0.0, 0.0), state(1000.0, 0.0, 180.0)];
    let mut world = pair(starts);
    let first = world.reports()[0];
    let gone = [state(100.0, 0.0, 0.0), state(900.0, 0.0, 180.0)];
    world.step(&starts);
    let report = world.step(&gone)[0];
    assert_eq!((report.min_centre_time_s, world.time_s()), (10.0, 10.0));
    assert_eq!(world.reset(&starts)[0], first);
    let again = world.step(&starts)[0];
    assert_eq!(again.min_hull_distance_m, first.hull_distance_m);
}

#[test]
fn all_pairs_are_watched_once() {
    let mut world = pair([state(0.0, 0.0, 0.0), state(1000.0, 0.0, 180.0)]);
    world.add_vessel(vessel(50.0, 10.0, 100.0), state(0.0, 500.0, 0.0));
    world.watch_all();
    let pairs: Vec<_> = world.reports().iter().map(|report| (report.a.0, report.b.0)).collect();
    assert_eq!(pairs, [(0, 1), (0, 2), (1, 2)]);
}

fn any_state(reach_m: f64) -> impl Strategy<Value = VesselState> {
    (-reach_m..reach_m, -reach_m..reach_m, 0.0..360.0_f64).prop_map(|(n, e, h)| state(n, e, h))
}

/// A state and one that a step of moving and turning leads to.
fn any_step() -> impl Strategy<Value = [VesselState; 2]> {
    let turn_deg = prop_oneof![Just(0.0), -3.0..3.0_f64, -170.0..170.0_f64];
    (any_state(250.0), -200.0..200.0_f64, -200.0..200.0_f64, turn_deg).prop_map(
        |(from, north, east, turn)| {
            let to = state(
                from.position.north_m + north,
                from.position.east_m + east,
                from.heading.degrees() + turn,
            );
            [from, to]
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn dense_sampling_finds_nothing_closer_and_nothing_earlier(a in any_step(), b in any_step()) {
        let mut world = pair([a[0], b[0]]);
        let report = world.step(&[a[1], b[1]])[0];
        let tolerance_m = WorldConfig::default().hull_tolerance_m;
        let (hull_a, hull_b) = (world.body(VesselId(0)).hull.clone(), world.body(VesselId(1)).hull.clone());
        let distances = |fraction: f64| {
            let (a, b) = (between(&a[0], &a[1], fraction), between(&b[0], &b[1], fraction));
            (a.position.distance_m(b.position), hull_a.distance_m(&a, &hull_b, &b))
        };
        let (centre, hull) = distances(1.0);
        prop_assert!((report.centre_distance_m - centre).abs() < 1e-9);
        prop_assert!((report.hull_distance_m - hull).abs() < 1e-9);
        prop_assert!((distances(report.min_centre_time_s / 5.0).0 - report.min_centre_distance_m).abs() < 1e-9);
        prop_assert!((distances(report.min_hull_time_s / 5.0).1 - report.min_hull_distance_m).abs() < 1e-6);
        prop_assert_eq!(report.hulls_touch(), report.min_hull_distance_m <= tolerance_m);
        if let Some(contact_s) = report.hull_contact_time_s {
            prop_assert!(distances(contact_s / 5.0).1 <= tolerance_m + 1e-6);
        }
        for k in 0..=400 {
            let fraction = f64::from(k) / 400.0;
            let (centre, hull) = distances(fraction);
            prop_assert!(centre >= report.min_centre_distance_m - 1e-9);
            prop_assert!(hull >= report.min_hull_distance_m - tolerance_m - 1e-9);
            let in_contact = report.hull_contact_time_s.is_some_and(|contact_s| contact_s <= fraction * 5.0 + 1e-3);
            prop_assert!(hull > 0.0 || in_contact, "overlap at {fraction}, contact {:?}", report.hull_contact_time_s);
        }
    }

    #[test]
    fn rapier_sees_the_same_overlaps_at_the_end_of_a_step(a in any_step(), b in any_step()) {
        let mut world = pair([a[0], b[0]]);
        let report = world.step(&[a[1], b[1]])[0];
        let overlap = world.overlap(report.a, report.b);
        prop_assert_eq!(overlap.circles, report.centre_distance_m <= 300.0);
        prop_assert_eq!(overlap.hulls, report.hull_distance_m <= 0.0);
    }

    #[test]
    fn the_order_of_a_pair_does_not_matter(a in any_step(), b in any_step()) {
        let mut world = pair([a[0], b[0]]);
        world.watch(VesselId(1), VesselId(0));
        let reports = world.step(&[a[1], b[1]]);
        let tolerance_m = 2.0 * WorldConfig::default().hull_tolerance_m;
        prop_assert!((reports[0].min_hull_distance_m - reports[1].min_hull_distance_m).abs() <= tolerance_m);
        prop_assert_eq!(reports[0].min_centre_distance_m, reports[1].min_centre_distance_m);
    }
}
