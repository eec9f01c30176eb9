//! The results in the terminal.

use std::io::Write;

use super::{Benchmark, main_waters};
use crate::cli::table::table;
use crate::experiment::noise::{Row, Share, TracksPart};

pub(super) fn write(benchmark: &Benchmark, rows: &[Row], out: &mut dyn Write) -> anyhow::Result<()> {
    let mut scenarios: Vec<&str> = Vec::new();
    for row in rows {
        if !scenarios.contains(&row.scenario) {
            scenarios.push(row.scenario);
        }
    }
    let config = &benchmark.config;
    let which = match main_waters(&benchmark.recordings.waters).map(|waters| waters.part) {
        Some(TracksPart::HeldOut) => "held-out tracks",
        _ => "all tracks",
    };
    writeln!(
        out,
        "Episodes with contact, % (95 % interval), {} episodes each, {which} of {}, seed {}",
        config.episodes, benchmark.recordings.area, config.seed
    )?;
    for scenario in &scenarios {
        let of_scenario: Vec<&Row> = rows.iter().filter(|row| row.scenario == *scenario).collect();
        writeln!(out, "\n{}", title(scenario))?;
        contacts(benchmark, &of_scenario, out)?;
    }
    writeln!(out, "\nWithout noise, or under the least")?;
    details(benchmark, rows, &scenarios, out)
}

fn title(scenario: &str) -> &'static str {
    match scenario {
        "before-curve" => "Before a curve: the vessel turns away, holding course is right",
        _ => "Straight on: holding course collides",
    }
}

/// A line per policy, a column per noise.
fn contacts(benchmark: &Benchmark, rows: &[&Row], out: &mut dyn Write) -> anyhow::Result<()> {
    let sigmas_m = &benchmark.config.sigmas_m;
    let headings: Vec<String> = ["policy".to_owned()]
        .into_iter()
        .chain(sigmas_m.iter().map(|sigma_m| format!("{sigma_m} m")))
        .collect();
    let mut lines = table(1, &headings.iter().map(String::as_str).collect::<Vec<_>>());
    for contestant in &benchmark.field.contestants {
        let cells = sigmas_m.iter().map(|sigma_m| {
            let row = rows.iter().find(|row| row.policy == contestant.name && row.sigma_m == *sigma_m);
            row.map_or_else(String::new, |row| interval(row.rate, row.ci95))
        });
        lines.add_row([contestant.name.clone()].into_iter().chain(cells));
    }
    Ok(writeln!(out, "{lines}")?)
}

/// What there is beside contacts, under the least noise.
fn details(
    benchmark: &Benchmark,
    rows: &[Row],
    scenarios: &[&str],
    out: &mut dyn Write,
) -> anyhow::Result<()> {
    let headings = [
        "policy",
        "scenario",
        "wrong side",
        "mean return",
        "compliance",
        "closest: 5 %",
        "50 %",
        "contact, unseen vessels",
        "contact, training tracks",
    ];
    let mut lines = table(2, &headings);
    let least_m = benchmark.config.sigmas_m.first().copied();
    for contestant in &benchmark.field.contestants {
        for scenario in scenarios {
            let is_it = |row: &&Row| {
                row.policy == contestant.name && row.scenario == *scenario && Some(row.sigma_m) == least_m
            };
            let Some(row) = rows.iter().find(is_it) else { continue };
            lines.add_row([
                row.policy.clone(),
                row.scenario.to_owned(),
                format!("{:.0} %", 100.0 * row.wrong_side.rate),
                format!("{:.2}", row.mean_return),
                row.compliance.map_or_else(|| "\u{2013}".to_owned(), |score| format!("{score:.2}")),
                format!("{:.0} m", row.closest_m.q05),
                format!("{:.0} m", row.closest_m.q50),
                share(row.unseen_vessels.as_ref()),
                share(row.training_tracks.as_ref()),
            ]);
        }
    }
    Ok(writeln!(out, "{lines}")?)
}

/// A rate and its interval in per cent.
fn interval(rate: f64, [low, high]: [f64; 2]) -> String {
    format!("{:.0} ({:.0}\u{2013}{:.0})", 100.0 * rate, 100.0 * low, 100.0 * high)
}

/// A share with the number of its episodes.
fn share(share: Option<&Share>) -> String {
    share.map_or_else(
        || "\u{2013}".to_owned(),
        |share| format!("{} of {}", interval(share.rate, share.ci95), share.episodes),
    )
}
