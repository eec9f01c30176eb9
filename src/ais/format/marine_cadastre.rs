//! NOAA MarineCadastre vessel traffic data (<https://hub.marinecadastre.gov/pages/vesseltraffic>),
//! with the header used up to 2024 and the lower-case one since.

use super::Format;
use crate::ais::read::time::TimeForm;

pub(super) const FORMAT: Format = Format {
    name: "MarineCadastre",
    mark: &["BaseDateTime", "base_date_time"],
    time: &["BaseDateTime", "base_date_time"],
    time_form: TimeForm::Iso,
    mmsi: &["MMSI"],
    latitude_deg: &["LAT", "latitude"],
    longitude_deg: &["LON", "longitude"],
    sog_kn: &["SOG"],
    cog_deg: &["COG"],
    heading_deg: &["Heading"],
    // The transceiver class is A or B for all that is published there.
    station: &[],
    ship_type: &["VesselType", "vessel_type"],
    length_m: &["Length"],
    beam_m: &["Width"],
};
