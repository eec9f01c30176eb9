//! Progress bars on standard error, with rate and time left; silent where that is not a terminal.

use indicatif::{ProgressBar, ProgressStyle};

/// A bar over `total` bytes.
pub fn bytes(total: u64, what: &str) -> ProgressBar {
    bar(total, what, "{bytes}/{total_bytes} {bytes_per_sec}")
}

/// A bar over `total` steps, such as episodes or iterations.
pub fn steps(total: u64, what: &str) -> ProgressBar {
    bar(total, what, "{human_pos}/{human_len} {per_sec}")
}

fn bar(total: u64, what: &str, counts: &str) -> ProgressBar {
    let template = format!("{{msg:16}} {{bar:32}} {counts}, {{eta}} left");
    let style = ProgressStyle::with_template(&template)
        .unwrap_or_else(|_| ProgressStyle::default_bar())
        .progress_chars("=> ");
    ProgressBar::new(total).with_style(style).with_message(what.to_owned())
}
