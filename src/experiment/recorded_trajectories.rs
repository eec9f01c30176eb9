//! `Ebeltoft_trajs`: the recorded trajectories on a map of the area (paper, section "Trajectory data").
//! The name is the paper's, whose area is near Ebeltoft; the map is of whichever area is given.

use super::curves::counted;
use super::product::{DataTable, Drawing, Product, data_row};
use crate::ais::Area;
use crate::geo::LocalPlane;
use crate::report::map;
use crate::track::Track;

/// All tracks, coloured by speed.
#[must_use]
pub fn make(tracks: &[Track], plane: &LocalPlane, area: &Area) -> Product {
    let mut data = DataTable::new(&["track", "mmsi", "time_s", "latitude_deg", "longitude_deg", "speed_mps"]);
    let every = usize::max(1, (60.0 / tracks.first().map_or(60.0, |track| track.dt_s)).round() as usize);
    for (index, track) in tracks.iter().enumerate() {
        for k in (0..track.positions.len()).step_by(every) {
            let point = plane.unproject(track.positions[k]);
            data.push(data_row![
                index,
                u64::from(track.mmsi),
                track.unix_s(k),
                point.latitude_deg,
                point.longitude_deg,
                track.velocity(k).speed_mps(),
            ]);
        }
    }
    let hours: f64 = tracks.iter().map(Track::duration_s).sum::<f64>() / 3600.0;
    let caption = format!(
        "Recorded trajectories in {}: {} of {:.0} hours in all, on a uniform grid of {} s. The data hold one position a \
         minute. The paper shows 137 trajectories near Ebeltoft, Denmark, which are not public.",
        area.name,
        counted(tracks.len(), "track"),
        hours,
        tracks.first().map_or(0.0, |track| track.dt_s),
    );
    Product { drawing: Drawing::Svg(map::draw(tracks, plane, area)), data, caption }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ais::GeoBox;
    use crate::experiment::Cell;
    use crate::geo::Position;
    use crate::track::VesselParticulars;

    #[test]
    fn tracks_are_on_the_map_and_in_the_data() {
        let bounds = GeoBox { south_deg: 40.38, north_deg: 40.64, west_deg: -74.08, east_deg: -73.64 };
        let area = Area::of_box("Bay", bounds);
        let track = Track {
            mmsi: 219_000_001,
            start_unix_s: 1_606_780_800,
            dt_s: 5.0,
            positions: (0..601)
                .map(|k| Position { north_m: 0.0, east_m: 20.0 * f64::from(k) - 6000.0 })
                .collect(),
            particulars: VesselParticulars::default(),
        };
        let product = make(&[track], &area.plane(), &area);
        assert_eq!(product.data.rows().len(), 51);
        assert!(matches!(product.data.rows()[3][5], Cell::Number(speed) if (speed - 4.0).abs() < 1e-9));
        assert!(product.caption.contains("1 track of 1 hours"), "{}", product.caption);
        let svg = product.to_svg().unwrap();
        assert!(svg.contains("speed (kn)") && svg.contains("Recorded trajectories in Bay"));
    }
}
