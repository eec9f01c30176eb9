//! Dates and times of scenario files.

use toml::value::{Datetime, Offset};

const S_PER_DAY: i64 = 86_400;
/// Days from 0000-03-01 to 1970-01-01.
const DAYS_TO_1970: i64 = 719_468;

/// Seconds since 1970-01-01 00:00:00 UTC of a date and time; UTC where no offset is written, as in
/// AIS files.
pub(super) fn unix_seconds(text: &str) -> Option<f64> {
    let moment: Datetime = text.parse().ok()?;
    let (date, time) = (moment.date?, moment.time?);
    let offset_min = match moment.offset {
        Some(Offset::Custom { minutes }) => f64::from(minutes),
        _ => 0.0,
    };
    // Months are counted from March, so that the leap day comes last in its year.
    let (year, month) = (i64::from(date.year), i64::from(date.month));
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let leap_days = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    let day_of_year = (153 * month + 2) / 5 + i64::from(date.day) - 1;
    let days = 365 * year + leap_days + day_of_year - DAYS_TO_1970;
    let seconds = f64::from(time.hour) * 3600.0
        + f64::from(time.minute) * 60.0
        + f64::from(time.second.unwrap_or(0))
        + f64::from(time.nanosecond.unwrap_or(0)) * 1e-9;
    Some((days * S_PER_DAY) as f64 + seconds - offset_min * 60.0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn moments_are_seconds_since_1970() {
        for (text, unix_s) in [
            ("1970-01-01T00:00:00Z", 0.0),
            ("2020-12-03T04:05:06Z", 1_606_968_306.0),
            ("2020-12-03 04:05:06", 1_606_968_306.0),
            ("2020-12-03T06:05:06+02:00", 1_606_968_306.0),
            ("2000-02-29T12:00:00.5Z", 951_825_600.5),
            ("1969-12-31T23:59:59Z", -1.0),
        ] {
            assert_eq!(unix_seconds(text), Some(unix_s), "{text}");
        }
        for text in ["2020-12-03", "04:05:06", "2020-13-03T04:05:06Z", "yesterday", ""] {
            assert_eq!(unix_seconds(text), None, "{text}");
        }
    }

    proptest! {
        #[test]
        fn a_moment_that_the_import_writes_is_read_back(unix_s in 0..4_000_000_000_i64) {
            prop_assert_eq!(unix_seconds(&crate::ais::iso_utc(unix_s)), Some(unix_s as f64));
        }
    }
}
