//! A head-on encounter built in Rust instead of TOML, run under two policies.
//!
//! ```text
//! cargo run --release --example head_on
//! ```

use searoom::angle::Nautical;
use searoom::episode::Episode;
use searoom::geo::MPS_PER_KNOT;
use searoom::scenario::{Fault, OwnShip, Placement, Point, Scenario, TargetMotion};

/// A coaster comes down from the north; own ship is placed to meet it in four minutes.
pub fn encounter(policy: &str) -> Result<Episode, Fault> {
    let coaster = TargetMotion::Linear(Placement::At {
        point: Point::local(4000.0, 0.0),
        course: Nautical::from_degrees(180.0),
        speed_mps: 11.0 * MPS_PER_KNOT,
    });
    let staged =
        Scenario::new("head_on", OwnShip::head_on_to("coaster", 240.0).speed_kn(15.5).size(120.0, 18.0))
            .target("coaster", coaster)
            .duration_s(300.0)
            .policy(policy)
            .set_up()?;
    Ok(staged.run())
}

fn main() -> Result<(), Fault> {
    for policy in ["hold-course", "rule-based"] {
        let episode = encounter(policy)?;
        for target in episode.summaries() {
            println!(
                "{}: {} comes within {:.0} m at {:.0} s, {}",
                episode.policy,
                target.name,
                target.closest_centre_m,
                target.closest_centre_time_s,
                if episode.has_contact() { "contact of the collision circles" } else { "no contact" },
            );
        }
    }
    Ok(())
}
