//! Times as AIS files write them, to milliseconds since 1970-01-01 00:00:00 UTC.

use serde::{Deserialize, Serialize};

use super::number::parse_decimal;

/// How a file writes times. All are UTC.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum TimeForm {
    /// `2020-12-01T04:49:45`, with `T` or a blank, perhaps a fraction and `Z`.
    #[default]
    #[serde(rename = "iso")]
    Iso,
    /// `31/12/2022 23:59:59`
    #[serde(rename = "day_first")]
    DayFirst,
    /// `12/31/2022 23:59:59`
    #[serde(rename = "month_first")]
    MonthFirst,
    /// Seconds since 1970, perhaps with a fraction.
    #[serde(rename = "unix_s")]
    UnixSeconds,
    /// Milliseconds since 1970.
    #[serde(rename = "unix_ms")]
    UnixMilliseconds,
}

/// The years in which an AIS message can have been sent.
const YEARS: std::ops::RangeInclusive<i64> = 1990..=2199;

impl TimeForm {
    /// Reads a time; nothing where it is not of this form or no date of the calendar.
    pub fn parse(self, text: &[u8]) -> Option<i64> {
        let text = text.trim_ascii();
        let unix_ms = match self {
            Self::Iso => civil(text, 0, 5, 8)?,
            Self::DayFirst => civil(text, 6, 3, 0)?,
            Self::MonthFirst => civil(text, 6, 0, 3)?,
            Self::UnixSeconds => (parse_decimal(text)? * 1000.0).round() as i64,
            Self::UnixMilliseconds => parse_decimal(text)?.round() as i64,
        };
        let earliest = days_from_civil(*YEARS.start(), 1, 1) * 86_400_000;
        let latest = days_from_civil(*YEARS.end() + 1, 1, 1) * 86_400_000;
        (earliest..latest).contains(&unix_ms).then_some(unix_ms)
    }
}

/// A calendar date and time of day whose year, month and day stand at the given places.
fn civil(text: &[u8], year_at: usize, month_at: usize, day_at: usize) -> Option<i64> {
    let (date, clock) = (text.get(..10)?, text.get(11..19)?);
    let separator = if year_at == 0 { b'-' } else { b'/' };
    let separators_at = if year_at == 0 { [4, 7] } else { [2, 5] };
    let well_formed = separators_at.iter().all(|&at| date[at] == separator)
        && matches!(text[10], b' ' | b'T')
        && clock[2] == b':'
        && clock[5] == b':';
    if !well_formed {
        return None;
    }
    let year = digits(&date[year_at..year_at + 4])?;
    let month = digits(&date[month_at..month_at + 2])?;
    let day = digits(&date[day_at..day_at + 2])?;
    let (hour, minute, second) = (digits(&clock[..2])?, digits(&clock[3..5])?, digits(&clock[6..])?);
    let on_calendar = (1..=12).contains(&month) && (1..=days_in(year, month)).contains(&day);
    if !on_calendar || hour > 23 || minute > 59 || second > 59 {
        return None;
    }
    let seconds = days_from_civil(year, month, day) * 86_400 + hour * 3600 + minute * 60 + second;
    Some(seconds * 1000 + fraction_ms(&text[19..])?)
}

/// `.25Z` as 250; an empty rest as 0.
fn fraction_ms(rest: &[u8]) -> Option<i64> {
    let rest = rest.strip_suffix(b"Z").unwrap_or(rest);
    let rest = rest.strip_suffix(b"+00:00").unwrap_or(rest);
    if rest.is_empty() {
        return Some(0);
    }
    let fraction = rest.strip_prefix(b".")?;
    digits(fraction)?;
    let thousandth = |at: usize| i64::from(fraction.get(at).map_or(0, |digit| digit - b'0'));
    Some(thousandth(0) * 100 + thousandth(1) * 10 + thousandth(2))
}

fn digits(text: &[u8]) -> Option<i64> {
    let value = text.iter().try_fold(0_i64, |value, byte| {
        byte.is_ascii_digit().then(|| value.wrapping_mul(10).wrapping_add(i64::from(byte - b'0')))
    })?;
    (!text.is_empty()).then_some(value)
}

fn days_in(year: i64, month: i64) -> i64 {
    match month {
        2 if year % 4 == 0 && (year % 100 != 0 || year % 400 == 0) => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

/// Days from 1970-01-01 to a date of the Gregorian calendar. Years are counted from March, so
/// that the leap day comes last.
fn days_from_civil(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let era = year.div_euclid(400);
    let year_of_era = year.rem_euclid(400);
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
    era * 146_097 + day_of_era - 719_468
}

/// Writes a time as `2020-12-01T04:49:45Z`.
pub fn iso_utc(unix_s: i64) -> String {
    let days = unix_s.div_euclid(86_400) + 719_468;
    let clock = unix_s.rem_euclid(86_400);
    let era = days.div_euclid(146_097);
    let day_of_era = days.rem_euclid(146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let march_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * march_month + 2) / 5 + 1;
    let month = if march_month < 10 { march_month + 3 } else { march_month - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02}T{:02}:{:02}:{:02}Z", clock / 3600, clock / 60 % 60, clock % 60)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn all_forms_of_one_moment_agree() {
        let moment = Some(1_606_798_185_000);
        assert_eq!(TimeForm::Iso.parse(b"2020-12-01T04:49:45"), moment);
        assert_eq!(TimeForm::Iso.parse(b"2020-12-01 04:49:45Z"), moment);
        assert_eq!(TimeForm::DayFirst.parse(b"01/12/2020 04:49:45"), moment);
        assert_eq!(TimeForm::MonthFirst.parse(b"12/01/2020 04:49:45"), moment);
        assert_eq!(TimeForm::UnixSeconds.parse(b"1606798185"), moment);
        assert_eq!(TimeForm::UnixMilliseconds.parse(b"1606798185000"), moment);
        assert_eq!(TimeForm::Iso.parse(b"2020-12-01T04:49:45.25Z"), moment.map(|ms| ms + 250));
        assert_eq!(iso_utc(1_606_798_185), "2020-12-01T04:49:45Z");
    }

    #[test]
    fn what_is_no_time_is_refused() {
        for text in [
            "",
            "2020-12-01",
            "2020-02-30T00:00:00",
            "2021-02-29T00:00:00",
            "2020-13-01T00:00:00",
            "2020-12-01T24:00:00",
            "2020-12-01T00:60:00",
            "2020-12-01T00:00:6x",
            "01/12/2020 04:49:45",
            "0020-12-01T00:00:00",
            "2020-12-01T00:00:00.",
            "2020-12-01T00:00:00+02:00",
        ] {
            assert_eq!(TimeForm::Iso.parse(text.as_bytes()), None, "{text}");
        }
        for text in ["nan", "inf", "1e30", "-5", ""] {
            assert_eq!(TimeForm::UnixSeconds.parse(text.as_bytes()), None, "{text}");
        }
    }

    proptest! {
        #[test]
        fn writing_and_reading_a_time_is_lossless(unix_s in 631_152_000..7_258_118_400_i64) {
            prop_assert_eq!(TimeForm::Iso.parse(iso_utc(unix_s).as_bytes()), Some(unix_s * 1000));
        }

        #[test]
        fn any_bytes_are_a_time_or_not_but_never_a_panic(text in proptest::collection::vec(any::<u8>(), 0..40)) {
            for form in [TimeForm::Iso, TimeForm::DayFirst, TimeForm::MonthFirst, TimeForm::UnixSeconds] {
                let _ = form.parse(&text);
            }
        }
    }
}
