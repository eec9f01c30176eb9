//! Tables in the terminal: one look for all commands.

use comfy_table::{CellAlignment, ContentArrangement, LineStyle, Table, TableStyle};

/// An empty table under these headings; the columns after the first `text_columns` hold numbers
/// and are aligned to the right.
pub fn table(text_columns: usize, headings: &[&str]) -> Table {
    let rule = LineStyle::none().fill('─').junction('─');
    let style = TableStyle::new().header_separator(rule).bottom_border(rule);
    let mut table = Table::new();
    table.load_style(style).set_content_arrangement(ContentArrangement::Dynamic);
    table.set_header(headings.to_vec());
    for column in table.column_iter_mut().skip(text_columns) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// A whole number with a thin gap between thousands: `172 679`.
pub fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push('\u{2009}');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_are_set_apart() {
        assert_eq!(grouped(0), "0");
        assert_eq!(grouped(999), "999");
        assert_eq!(grouped(1_234_567), "1\u{2009}234\u{2009}567");
    }

    #[test]
    fn numbers_are_aligned_to_the_right() {
        let mut table = table(1, &["reason", "messages"]);
        table.add_row(["gap", "7"]);
        let text = table.to_string();
        assert!(text.lines().any(|line| line.ends_with("       7 ")), "{text}");
    }
}
