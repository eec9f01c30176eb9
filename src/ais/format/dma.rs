//! Daily files of the Danish Maritime Authority (<https://web.ais.dk/aisdata/>).

use super::Format;
use crate::ais::read::time::TimeForm;

pub(super) const FORMAT: Format = Format {
    name: "Danish Maritime Authority",
    mark: &["Type of mobile"],
    time: &["# Timestamp"],
    time_form: TimeForm::DayFirst,
    mmsi: &["MMSI"],
    latitude_deg: &["Latitude"],
    longitude_deg: &["Longitude"],
    sog_kn: &["SOG"],
    cog_deg: &["COG"],
    heading_deg: &["Heading"],
    station: &["Type of mobile"],
    ship_type: &["Ship type"],
    length_m: &["Length"],
    beam_m: &["Width"],
};
