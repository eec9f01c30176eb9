//! Decimal numbers as files write them, fast where they are short.

/// Powers of ten that are exact in an `f64`.
const EXACT_POWERS: [f64; 16] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// Reads a finite decimal number, blanks around it allowed; nothing where it is none.
///
/// Up to 15 digits the quotient of two exact numbers is the correctly rounded value, so the
/// result is the one the standard library gives.
#[inline]
pub fn parse_decimal(text: &[u8]) -> Option<f64> {
    let (negative, unsigned) = match text {
        [b'-', rest @ ..] => (true, rest),
        _ => (false, text),
    };
    let (mut digits, mut count, mut after_point) = (0_u64, 0, None);
    for &byte in unsigned {
        match byte {
            b'0'..=b'9' if count < 15 => {
                digits = digits * 10 + u64::from(byte - b'0');
                count += 1;
            }
            b'.' if after_point.is_none() => after_point = Some(count),
            _ => return parse_any(text),
        }
    }
    if count == 0 {
        return None;
    }
    let value = digits as f64 / EXACT_POWERS[after_point.map_or(0, |at| count - at)];
    Some(if negative { -value } else { value })
}

#[cold]
fn parse_any(text: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(text).ok()?.trim();
    text.parse().ok().filter(|value: &f64| value.is_finite())
}

/// Reads a whole number such as an MMSI; `367466930.0` counts as one.
#[inline]
pub fn parse_whole(text: &[u8]) -> Option<u32> {
    let value = parse_decimal(text)?;
    (value.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&value)).then_some(value as u32)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn what_is_no_finite_number_is_refused() {
        for text in ["", "-", ".", "nan", "inf", "-inf", "1e999", "1.2.3", "12,5", "abc", "\u{661}", "--1"] {
            assert_eq!(parse_decimal(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn whole_numbers_may_carry_a_zero_fraction() {
        assert_eq!(parse_whole(b"367466930.0"), Some(367_466_930));
        assert_eq!(parse_whole(b" 367466930 "), Some(367_466_930));
        for text in [&b"367466930.5"[..], b"-1", b"4294967296", b""] {
            assert_eq!(parse_whole(text), None);
        }
    }

    proptest! {
        #[test]
        fn numbers_are_read_as_the_standard_library_reads_them(text in "-?[0-9]{0,17}(\\.[0-9]{0,12})?(e-?[0-9]{1,2})?") {
            let expected = text.parse().ok().filter(|value: &f64| value.is_finite());
            prop_assert_eq!(parse_decimal(text.as_bytes()), expected);
        }

        #[test]
        fn any_bytes_are_a_number_or_not_but_never_a_panic(text in proptest::collection::vec(any::<u8>(), 0..40)) {
            if let Some(value) = parse_decimal(&text) {
                prop_assert!(value.is_finite());
            }
        }
    }
}
