//! AIS files of all kinds, good and bad, through the public API and the program.

#![allow(clippy::unwrap_used)]

use std::io::Write;
use std::path::{Path, PathBuf};

use proptest::prelude::*;
use searoom::ais::{self, AisError, Area, GeoBox, Import, ImportConfig, MessageDrop, TrackDrop};
use searoom::config::Source;

use crate::cli::searoom;

const HEADER: &str = "MMSI,BaseDateTime,LAT,LON,SOG,COG,Heading\n";
const FIXES: usize = 120;

/// Rows of a vessel that sails north at 8 m/s from 40.40 N, a fix every ten seconds.
fn voyage(mmsi: u32, longitude_deg: f64) -> Vec<String> {
    (0..FIXES)
        .map(|k| {
            let (second, latitude_deg) = (10 * k, 40.40 + 80.0 * k as f64 / 111_040.0);
            let clock = format!("{:02}:{:02}:{:02}", 6 + second / 3600, second / 60 % 60, second % 60);
            format!("{mmsi},2020-12-01T{clock},{latitude_deg:.6},{longitude_deg:.6},15.6,0.0,0\n")
        })
        .collect()
}

fn text_of(rows: &[String]) -> String {
    format!("{HEADER}{}", rows.concat())
}

fn area() -> Area {
    Area::of_box("bay", GeoBox { south_deg: 40.38, north_deg: 40.65, west_deg: -74.10, east_deg: -73.64 })
}

fn import_files(files: &[PathBuf], config: &ImportConfig) -> Result<Import, AisError> {
    let import = ais::import(files, &area(), config, None, &|_| {})?;
    assert!(import.report.adds_up(), "{:?}", import.report);
    Ok(import)
}

fn import_bytes(name: &str, bytes: &[u8]) -> Result<Import, AisError> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join(name);
    std::fs::write(&file, bytes).unwrap();
    import_files(&[file], &ImportConfig::default())
}

fn import_text(text: &str) -> Import {
    import_bytes("ais.csv", text.as_bytes()).unwrap()
}

#[track_caller]
fn assert_one_bad_row(import: &Import, reason: MessageDrop, line: u64) {
    assert_eq!(import.report.messages.dropped.of(reason), 1, "{:?}", import.report);
    let bad = &import.bad_rows[0];
    assert_eq!((bad.reason, bad.line), (reason, line));
    assert!(bad.to_string().contains(&format!("ais.csv:{line}: {reason}")), "{bad}");
    // The good rows around survive.
    assert_eq!(import.tracks.len(), 1);
    assert_eq!(import.report.messages.kept, import.report.messages.read - 1);
}

#[test]
fn a_voyage_becomes_a_track() {
    let import = import_text(&text_of(&voyage(366_000_001, -74.0)));
    let [track] = import.tracks.as_slice() else { panic!("{:?}", import.report) };
    assert_eq!((track.mmsi, track.dt_s, track.positions.len()), (366_000_001, 5.0, 2 * (FIXES - 1) + 1));
    for index in 0..track.positions.len() {
        assert!((track.velocity(index).speed_mps() - 8.0).abs() < 0.05);
    }
}

#[test]
fn a_truncated_file_loses_its_last_row_only() {
    let text = text_of(&voyage(366_000_001, -74.0));
    let import = import_text(&text[..text.len() - 9]);
    assert_one_bad_row(&import, MessageDrop::WrongColumnCount, FIXES as u64 + 1);
}

#[test]
fn one_bad_row_costs_itself_only() {
    let cases = [
        ("366000001,2020-12-01T06:01:01,NaN,-74.0,,,", MessageDrop::UnreadablePosition),
        ("366000001,2020-12-01T06:01:01,inf,-74.0,,,", MessageDrop::UnreadablePosition),
        ("366000001,2020-12-01T06:01:01,40.5,1e999,,,", MessageDrop::UnreadablePosition),
        ("366000001,2020-12-01T06:01:01,-74.0,40.5,,,", MessageDrop::SwappedPosition),
        ("366000001,2020-12-01T06:01:01,140.5,-74.0,,,", MessageDrop::ImpossiblePosition),
        ("366000001,2020-12-41T06:01:01,40.5,-74.0,,,", MessageDrop::UnreadableTime),
        ("36600000I,2020-12-01T06:01:01,40.5,-74.0,,,", MessageDrop::UnreadableMmsi),
        ("366000001,2020-12-01T06:01:01,40.5,-74.0,,", MessageDrop::WrongColumnCount),
        ("366000001;2020-12-01T06:01:01;40.5;-74.0;;;", MessageDrop::WrongColumnCount),
        ("366000001,2020-12-01T06:01:01,40.5,-74.0,,,\"", MessageDrop::UnclosedQuote),
        ("\u{1}\u{0}\u{7f}", MessageDrop::WrongColumnCount),
    ];
    for (row, reason) in cases {
        let mut rows = voyage(366_000_001, -74.0);
        rows.insert(7, format!("{row}\n"));
        assert_one_bad_row(&import_text(&text_of(&rows)), reason, 9);
    }
}

#[test]
fn a_line_of_ten_megabytes_costs_itself_only() {
    let mut rows = voyage(366_000_001, -74.0);
    rows.insert(7, format!("{}\n", "x".repeat(10 << 20)));
    assert_one_bad_row(&import_text(&text_of(&rows)), MessageDrop::LineTooLong, 9);
}

#[test]
fn windows_line_breaks_and_latin_1_names_are_read() {
    let plain = import_text(&text_of(&voyage(366_000_001, -74.0)));
    let windows = import_text(&text_of(&voyage(366_000_001, -74.0)).replace('\n', "\r\n"));
    assert_eq!(windows.tracks, plain.tracks);

    let named = text_of(&voyage(366_000_001, -74.0))
        .replace("Heading\n", "Heading,VesselName\n")
        .replace(",0\n", ",0,SMRREBRD\n");
    let latin_1: Vec<u8> =
        named.into_bytes().into_iter().map(|byte| if byte == b'R' { 0xd8 } else { byte }).collect();
    assert_eq!(import_bytes("ais.csv", &latin_1).unwrap().tracks, plain.tracks);
}

#[test]
fn files_that_are_no_ais_are_refused_with_file_line_and_remedy() {
    let good = text_of(&voyage(366_000_001, -74.0));
    let cases: [(&[u8], &str, &str); 7] = [
        (b"", "ais.csv:1: is empty", "fetch the file again"),
        (b"\x00\x01\x02\x03binary", "ais.csv:1: is not text but binary data", "name a CSV file"),
        (b"\xff\xfeM\x00M\x00S\x00I\x00", "is UTF-16", "save it as UTF-8"),
        (
            &good.replace(',', ";").into_bytes(),
            "ais.csv:1: separates its columns with semicolons",
            "column mapping",
        ),
        (
            &good.replace("LON", "X").into_bytes(),
            "ais.csv:1: looks like MarineCadastre but has no column for the longitude",
            "name the column",
        ),
        (
            good.split_once('\n').unwrap().1.as_bytes(),
            "begins with data instead of a header",
            "add the header line",
        ),
        (&vec![b'x'; 10 << 20], "not the header of a known layout", "column mapping"),
    ];
    for (bytes, problem, remedy) in cases {
        let error = import_bytes("ais.csv", bytes).unwrap_err().to_string();
        assert!(error.contains(problem) && error.contains(remedy), "{error}");
    }
    let missing = import_files(&["no/such.csv".into()], &ImportConfig::default()).unwrap_err().to_string();
    assert!(missing.contains("no/such.csv") && missing.contains("check the path"), "{missing}");
    assert!(
        import_files(&[], &ImportConfig::default()).unwrap_err().to_string().contains("name at least one")
    );
}

#[test]
fn a_header_alone_is_an_empty_recording() {
    for header in [HEADER, HEADER.trim_end()] {
        let import = import_text(header);
        assert_eq!((import.report.messages.read, import.tracks.len()), (0, 0));
    }
}

#[test]
fn a_file_with_swapped_coordinates_says_so() {
    let swapped = text_of(&voyage(366_000_001, -74.0)).replace("LAT,LON", "LON,LAT");
    let import = import_text(&swapped);
    assert_eq!(import.report.messages.dropped.of(MessageDrop::SwappedPosition), FIXES as u64);
    assert!(import.bad_rows[0].to_string().contains("exchange the two columns"));
}

#[test]
fn a_clock_running_backwards_changes_nothing() {
    let rows = voyage(366_000_001, -74.0);
    let forwards = import_text(&text_of(&rows));
    let backwards: Vec<String> = rows.into_iter().rev().collect();
    assert_eq!(import_text(&text_of(&backwards)).tracks, forwards.tracks);
}

#[test]
fn two_vessels_under_one_mmsi_become_two_tracks_and_are_reported() {
    let rows: Vec<String> = voyage(366_000_001, -74.0)
        .into_iter()
        .zip(voyage(366_000_001, -73.8))
        .flat_map(|(a, b)| [a, b])
        .collect();
    let import = import_text(&text_of(&rows));
    assert_eq!(import.tracks.len(), 2);
    assert_eq!(import.report.shared_mmsi, [366_000_001]);
    assert_eq!(import.report.messages.kept, 2 * FIXES as u64);
    for track in &import.tracks {
        assert!(track.positions.windows(2).all(|pair| pair[0].distance_m(pair[1]) < 50.0));
    }
}

#[test]
fn what_is_dropped_is_counted_under_its_reason() {
    let mut rows = voyage(366_000_001, -74.0);
    rows.push(rows[5].clone());
    rows.push(rows[6].replace("-74.000000", "-74.000100"));
    rows.push("366000001,2020-12-01T06:00:55,40.410000,-73.90,,,\n".to_owned());
    rows.push("366000001,2020-12-01T06:00:56,91,181,,,\n".to_owned());
    rows.push("111111111,2020-12-01T06:00:56,40.5,-74.0,,,\n".to_owned());
    rows.push("993660001,2020-12-01T06:00:56,40.5,-74.0,,,\n".to_owned());
    rows.push("366000001,2020-12-01T06:00:57,50.5,-74.0,,,\n".to_owned());
    let dropped = import_text(&text_of(&rows)).report.messages.dropped;
    for reason in [
        MessageDrop::Duplicate,
        MessageDrop::RepeatedTime,
        MessageDrop::PositionSpike,
        MessageDrop::NoPosition,
        MessageDrop::ImpossibleMmsi,
        MessageDrop::NotAVessel,
        MessageDrop::OutsideArea,
    ] {
        assert_eq!(dropped.of(reason), 1, "{reason}");
    }
    assert_eq!(dropped.total(), 7);
}

#[test]
fn short_and_moored_trajectories_are_left_out_by_reason() {
    let moored: Vec<String> = voyage(366_000_002, -74.0)
        .iter()
        .map(|row| {
            let mut columns: Vec<&str> = row.split(',').collect();
            (columns[2], columns[4]) = ("40.500000", "0.0");
            columns.join(",")
        })
        .collect();
    let rows = [&voyage(366_000_001, -74.0)[..30], &voyage(366_000_003, -74.0)[..3], &moored].concat();
    let tracks = import_text(&text_of(&rows)).report.tracks;
    assert_eq!((tracks.found, tracks.kept), (3, 0));
    for reason in [TrackDrop::TooShort, TrackDrop::TooFewFixes, TrackDrop::Moored] {
        assert_eq!(tracks.dropped.of(reason), 1, "{reason}");
    }
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    packed.write_all(bytes).unwrap();
    packed.finish().unwrap()
}

fn zip_of(entries: &[(&str, &[u8])]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, bytes) in entries {
        archive.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

#[test]
fn packed_files_are_read_like_plain_ones_whatever_their_name() {
    let text = text_of(&voyage(366_000_001, -74.0));
    let plain = import_text(&text);
    let half = text.len() / 2;
    let two_members = [gzip(&text.as_bytes()[..half]), gzip(&text.as_bytes()[half..])].concat();
    for packed in [
        gzip(text.as_bytes()),
        two_members,
        zstd::encode_all(text.as_bytes(), 3).unwrap(),
        zip_of(&[("day/aisdk.csv", text.as_bytes()), ("readme.md", b"about")]),
    ] {
        assert_eq!(import_bytes("ais.bin", &packed).unwrap().tracks, plain.tracks);
    }
}

#[test]
fn a_corrupt_archive_gives_what_was_good_and_names_the_line() {
    // Long enough that the damage comes after many good rows.
    let rows: Vec<String> =
        (0..200).flat_map(|n| voyage(366_000_001 + n, -74.0 + 1e-3 * f64::from(n))).collect();
    let text = text_of(&rows);
    let gz = gzip(text.as_bytes());
    let zst = zstd::encode_all(text.as_bytes(), 3).unwrap();
    let zip = zip_of(&[("a.csv", text.as_bytes())]);
    let cut = |packed: &[u8]| packed[..packed.len() / 2].to_vec();
    let mut flipped_zip = zip.clone();
    let middle = zip.len() / 2;
    flipped_zip[middle..middle + 64].fill(0xff);
    for (name, packed) in [("a.gz", cut(&gz)), ("a.zst", cut(&zst)), ("a.zip", flipped_zip)] {
        let import = import_bytes(name, &packed).unwrap();
        let damaged: Vec<(&str, &str)> = import.report.damaged_files().collect();
        assert_eq!(damaged.len(), 1, "{name}");
        assert!(
            damaged[0].1.contains("breaks off after line") && damaged[0].1.contains("fetch"),
            "{damaged:?}"
        );
        assert!(!import.tracks.is_empty(), "{name}");
    }
    // Without its directory, at the end, an archive cannot be opened at all.
    let error = import_bytes("a.zip", &cut(&zip)).unwrap_err().to_string();
    assert!(error.contains("a.zip:1: cannot be read") && error.contains("fetch the file again"), "{error}");
}

#[test]
fn a_decompression_bomb_is_stopped_early() {
    let mut text = text_of(&voyage(366_000_001, -74.0)).into_bytes();
    text.extend(vec![b'\n'; 64 << 20]);
    let config =
        ImportConfig { expansion_checked_from_bytes: 1 << 20, max_expansion: 50, ..ImportConfig::default() };
    for packed in [gzip(&text), zstd::encode_all(text.as_slice(), 1).unwrap(), zip_of(&[("a.csv", &text)])] {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("bomb");
        std::fs::write(&file, packed).unwrap();
        let import = import_files(&[file], &config).unwrap();
        let (_, damage) = import.report.damaged_files().next().unwrap();
        assert!(damage.contains("decompression bomb") && damage.contains("raise max_expansion"), "{damage}");
        assert_eq!(import.tracks.len(), 1);
    }
}

#[test]
fn an_archive_entry_that_climbs_out_is_left_alone() {
    let text = text_of(&voyage(366_000_001, -74.0));
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    let file = inner.join("a.zip");
    std::fs::write(&file, zip_of(&[("../escaped.csv", text.as_bytes()), ("good.csv", text.as_bytes())]))
        .unwrap();
    let import = import_files(&[file], &ImportConfig::default()).unwrap();
    let (name, damage) = import.report.damaged_files().next().unwrap();
    assert!(
        name.ends_with("a.zip!../escaped.csv") && damage.contains("leads out of the archive"),
        "{name} {damage}"
    );
    assert_eq!(import.tracks.len(), 1);
    assert!(!folder.path().join("escaped.csv").exists());
    assert_eq!(std::fs::read_dir(&inner).unwrap().count(), 1);
}

#[test]
fn several_files_are_one_recording() {
    let rows = voyage(366_000_001, -74.0);
    let whole = import_text(&text_of(&rows));
    let folder = tempfile::tempdir().unwrap();
    let files: Vec<PathBuf> = rows
        .chunks(50)
        .enumerate()
        .map(|(index, rows)| {
            let file = folder.path().join(format!("{index}.csv.gz"));
            std::fs::write(&file, gzip(text_of(rows).as_bytes())).unwrap();
            file
        })
        .collect();
    let import = import_files(&files, &ImportConfig::default()).unwrap();
    assert_eq!(import.tracks, whole.tracks);
    assert_eq!(import.report.files.iter().map(|file| file.read).collect::<Vec<_>>(), [50, 50, 20]);
}

#[test]
fn a_big_file_read_in_parts_gives_what_one_reader_gives() {
    // More than one part of 16 MiB, with bad rows throughout.
    let rows: Vec<String> = (0..2500)
        .flat_map(|n| {
            let mut rows = voyage(366_000_001 + n, -74.0 + 1e-4 * f64::from(n));
            rows.push(format!("bad row {n}\n"));
            rows
        })
        .collect();
    let text = text_of(&rows);
    assert!(text.len() > 17 << 20);
    let (parts, one) = (import_text(&text), import_bytes("ais.csv", &gzip(text.as_bytes())).unwrap());
    assert_eq!(parts.tracks, one.tracks);
    assert_eq!(parts.report.messages, one.report.messages);
    assert_eq!(
        parts.bad_rows.iter().map(|row| row.line).collect::<Vec<_>>(),
        (1..=2500).map(|n| 1 + n * (FIXES as u64 + 1)).collect::<Vec<_>>()
    );
}

#[test]
fn other_layouts_are_read_through_a_column_mapping() {
    let mapping = ais::ColumnMapping::parse(&Source::new(
        "mapping.toml",
        "delimiter = ';'\ntime = 'when'\nmmsi = 'ship'\nlatitude_deg = 'y'\nlongitude_deg = 'x'\nsog_kn = 'v'\n",
    ))
    .unwrap();
    let rows = voyage(366_000_001, -74.0);
    let text = format!("ship;when;y;x;v;c;h\n{}", rows.concat().replace(',', ";"));
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("other.csv");
    std::fs::write(&file, text).unwrap();
    let import = ais::import(&[file], &area(), &ImportConfig::default(), Some(&mapping), &|_| {}).unwrap();
    assert_eq!(import.tracks, import_text(&text_of(&rows)).tracks);
}

/// The shipped recordings with their areas, and how many tracks they give.
const SAMPLES: [(&str, &str, u64); 5] = [
    ("ny-harbor-2020-12.csv.gz", "ny-lower-bay.toml", 317),
    ("ny-harbor-2020-06-30-hour.csv.gz", "ny-lower-bay.toml", 20),
    ("hampton-roads-2020-06.csv.gz", "hampton-roads.toml", 222),
    ("dma-north-sea-2022-11-01.csv.gz", "danish-north-sea.toml", 29),
    ("dma-laesoe-ferry-2022-10-15.csv", "laesoe.toml", 1),
];

#[test]
fn shipped_samples_add_up_and_come_out_the_same_twice() {
    let folder = tempfile::tempdir().unwrap();
    for (file, area, tracks) in SAMPLES {
        let mut written = Vec::new();
        for run in ["first", "second"] {
            let out = folder.path().join(run);
            let out_name = out.to_str().unwrap();
            let (file, area) = (format!("ais/{file}"), format!("ais/{area}"));
            let output = searoom(&["ais", "import", &file, "--area", &area, "--out", out_name, "--json"]);
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
            check_sums(&report);
            assert_eq!(report["tracks"]["kept"].as_u64(), Some(tracks), "{file}");
            written.push(
                ["tracks.csv", "tracks.json", "bad_rows.csv"]
                    .map(|name| std::fs::read(out.join(name)).unwrap()),
            );
        }
        assert!(written[0] == written[1], "{file} differs between two runs");
        let set = ais::load_tracks(&folder.path().join("first")).unwrap();
        assert_eq!(set.tracks.len() as u64, tracks);
        assert_smooth(&set);
    }
}

fn check_sums(report: &serde_json::Value) {
    for (what, all) in [("messages", "read"), ("tracks", "found")] {
        let part = &report[what];
        let dropped: u64 =
            part["dropped"].as_object().unwrap().values().map(|many| many.as_u64().unwrap()).sum();
        assert_eq!(part[all].as_u64().unwrap(), part["kept"].as_u64().unwrap() + dropped, "{what}");
    }
}

fn assert_smooth(set: &ais::TrackSet) {
    let cap_m = set.provenance.thresholds.max_speed_mps * 5.0 + 0.001;
    for track in &set.tracks {
        assert!(
            track.positions.windows(2).all(|pair| pair[0].distance_m(pair[1]) <= cap_m),
            "{}",
            track.mmsi
        );
    }
}

/// Of the vessels that pass the Narrows, some go south-east to the open sea and some east along the shore.
#[test]
fn the_default_area_holds_the_passages_through_the_narrows() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let area = Area::load(&root.join("ais/ny-lower-bay.toml")).unwrap();
    let file = root.join("ais/ny-harbor-2020-12.csv.gz");
    let import = ais::import(&[file], &area, &ImportConfig::default(), None, &|_| {}).unwrap();
    let at = |latitude_deg, longitude_deg| {
        import.plane.project(searoom::geo::Geodetic { latitude_deg, longitude_deg })
    };
    let (low, high) = (at(40.59, -74.07), at(40.63, -74.02));
    let (sea, shore) = (at(40.53, -73.96), at(40.555, -73.95));
    let passages: Vec<_> = import
        .tracks
        .iter()
        .filter(|track| {
            track.positions.iter().any(|p| {
                (low.north_m..high.north_m).contains(&p.north_m)
                    && (low.east_m..high.east_m).contains(&p.east_m)
            })
        })
        .collect();
    let reaching = |there: &dyn Fn(&searoom::geo::Position) -> bool| {
        passages.iter().filter(|track| track.positions.iter().any(there)).count()
    };
    let to_sea = reaching(&|p| p.north_m < sea.north_m && p.east_m > sea.east_m);
    let along_shore = reaching(&|p| p.north_m > shore.north_m && p.east_m > shore.east_m);
    assert_eq!(to_sea, 24);
    assert!(along_shore >= 47, "{along_shore}");
}

#[test]
fn the_program_tells_what_is_wrong_and_fails() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let out_name = out.to_str().unwrap();
    let text = text_of(&voyage(366_000_001, -74.0));
    let broken = folder.path().join("broken.csv.gz");
    let packed = gzip(text.as_bytes());
    std::fs::write(&broken, &packed[..packed.len() - 8]).unwrap();
    let output = searoom(&["ais", "import", broken.to_str().unwrap(), "--out", out_name]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("breaks off after line"));
    // What could be read was written all the same.
    assert_eq!(ais::load_tracks(&out).unwrap().tracks.len(), 1);

    let output = searoom(&["ais", "import", "Cargo.toml", "--out", out_name]);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1));
    assert!(message.starts_with("error: Cargo.toml:1: `[package]` is not the header"), "{message}");
    assert_eq!(searoom(&["ais", "import", "--out", out_name]).status.code(), Some(2));
}

#[test]
fn summary_and_plot_show_the_tracks() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let (out_name, map) = (out.to_str().unwrap(), folder.path().join("map.svg"));
    let sample = "ais/dma-laesoe-ferry-2022-10-15.csv";
    assert!(
        searoom(&["ais", "import", sample, "--area", "ais/laesoe.toml", "--out", out_name]).status.success()
    );
    let summary = searoom(&["ais", "summary", out_name]);
    let text = String::from_utf8_lossy(&summary.stdout).into_owned();
    assert!(
        summary.status.success() && text.contains("Laesoe ferry: 1 track") && text.contains("1 vessel"),
        "{text}"
    );
    assert!(searoom(&["ais", "plot", out_name, "--out", map.to_str().unwrap()]).status.success());
    let svg = std::fs::read_to_string(map).unwrap();
    assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever follows a header: no panic, every message once, and the good rows survive.
    #[test]
    fn any_bytes_after_a_header_are_accounted_for(
        bytes in proptest::collection::vec(any::<u8>(), 0..400),
        at in 0..FIXES,
        crlf in any::<bool>(),
    ) {
        let mut rows: Vec<Vec<u8>> = voyage(366_000_001, -74.0).into_iter().map(String::into_bytes).collect();
        rows.insert(at, [&bytes[..], b"\n"].concat());
        let mut text = [HEADER.as_bytes(), &rows.concat()].concat();
        if crlf {
            text = String::from_utf8_lossy(&text).replace('\n', "\r\n").into_bytes();
        }
        let import = import_bytes("ais.csv", &text).unwrap();
        prop_assert!(import.report.messages.kept >= FIXES as u64);
        prop_assert_eq!(import.tracks.len(), 1);
    }
}
