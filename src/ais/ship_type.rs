//! Ship types, which some sources write as words and some as AIS codes (ITU-R M.1371-5, table 53).

/// The words of the Danish Maritime Authority beside the codes they stand for.
const WORDS: &[(&str, u8, u8)] = &[
    ("wig", 20, 29),
    ("fishing", 30, 30),
    ("towing", 31, 31),
    ("towing long/wide", 32, 32),
    ("dredging", 33, 33),
    ("diving", 34, 34),
    ("military", 35, 35),
    ("sailing", 36, 36),
    ("pleasure", 37, 37),
    ("hsc", 40, 49),
    ("pilot", 50, 50),
    ("sar", 51, 51),
    ("tug", 52, 52),
    ("port tender", 53, 53),
    ("anti-pollution", 54, 54),
    ("law enforcement", 55, 55),
    ("medical", 58, 58),
    ("passenger", 60, 69),
    ("cargo", 70, 79),
    ("tanker", 80, 89),
    ("other", 90, 99),
];

/// The codes a filter asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wanted {
    first: u8,
    last: u8,
}

impl Wanted {
    /// Reads `cargo`, `70` or `70-79`.
    pub fn parse(text: &str) -> Option<Self> {
        let text = text.trim().to_ascii_lowercase();
        if let Some((_, first, last)) = WORDS.iter().find(|(word, ..)| *word == text) {
            return Some(Self { first: *first, last: *last });
        }
        let (first, last) = text.split_once('-').unwrap_or((&text, &text));
        let (first, last) = (first.trim().parse().ok()?, last.trim().parse().ok()?);
        (first <= last && last <= 99).then_some(Self { first, last })
    }

    /// Whether a vessel's type, as its source writes it, is asked for.
    pub fn holds(self, ship_type: &str) -> bool {
        Self::parse(ship_type).is_some_and(|has| self.first <= has.first && has.last <= self.last)
    }
}

/// A vessel's type as it is kept: trimmed, a code without the fraction some sources give it;
/// nothing where the source knows none.
pub fn normalised(text: &str) -> Option<String> {
    let text = text.trim();
    let text = text.strip_suffix(".0").unwrap_or(text);
    let unknown = matches!(text, "" | "0" | "Undefined" | "Unknown");
    (!unknown).then(|| text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_codes_and_ranges_meet() {
        let cargo = Wanted::parse("cargo").unwrap();
        assert!(cargo.holds("Cargo") && cargo.holds("70") && cargo.holds("79"));
        assert!(!cargo.holds("80") && !cargo.holds("Tanker") && !cargo.holds("?"));
        assert!(Wanted::parse("30-37").unwrap().holds("Sailing"));
        assert!(!Wanted::parse("71").unwrap().holds("Cargo"));
        assert_eq!(Wanted::parse("79-70"), None);
        assert_eq!(Wanted::parse("170"), None);
    }

    #[test]
    fn codes_lose_their_fraction_and_unknown_types_vanish() {
        assert_eq!(normalised(" 60.0 "), Some("60".into()));
        assert_eq!(normalised("Undefined"), None);
        assert_eq!(normalised(""), None);
    }
}
