//! The account of an import: every message and every trajectory once, kept or dropped for one
//! reason.

use std::fmt;

use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Declares a fieldless enum of reasons whose names in files are the given words.
macro_rules! reasons {
    ($(#[$doc:meta])* $name:ident { $($(#[$variant_doc:meta])* $variant:ident = $word:literal,)* }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum $name { $($(#[$variant_doc])* $variant,)* }

        impl Reason for $name {
            const ALL: &'static [Self] = &[$(Self::$variant),*];

            fn word(self) -> &'static str {
                match self { $(Self::$variant => $word),* }
            }

            fn index(self) -> usize {
                self as usize
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.pad(self.word())
            }
        }
    };
}

/// A closed list of reasons.
pub trait Reason: Copy + 'static {
    /// All reasons, in the order in which they are tested and listed.
    const ALL: &'static [Self];

    /// The reason's name in files.
    fn word(self) -> &'static str;

    /// Its place in [`Self::ALL`].
    fn index(self) -> usize;
}

reasons! {
    /// Why a message is not part of any kept track, in the order in which the reasons are tested.
    MessageDrop {
        /// The line is longer than the configured limit.
        LineTooLong = "line_too_long",
        /// A quote is opened and not closed on the same line.
        UnclosedQuote = "unclosed_quote",
        /// The row has more or fewer columns than the header, as a truncated one does.
        WrongColumnCount = "wrong_column_count",
        /// Latitude or longitude is missing or not a finite number.
        UnreadablePosition = "unreadable_position",
        /// The sentinel for an unknown position: latitude 91 or longitude 181.
        NoPosition = "no_position",
        /// Outside the area, but inside it with latitude and longitude exchanged.
        SwappedPosition = "swapped_position",
        /// A latitude beyond 90 or a longitude beyond 180 degrees.
        ImpossiblePosition = "impossible_position",
        /// Outside the area's box or polygon.
        OutsideArea = "outside_area",
        /// The time cannot be read or is no date of the calendar.
        UnreadableTime = "unreadable_time",
        /// Outside the area's time window.
        OutsideTime = "outside_time",
        /// The MMSI is missing or not a whole number.
        UnreadableMmsi = "unreadable_mmsi",
        /// A number that is no vessel's MMSI, such as 111111111.
        ImpossibleMmsi = "impossible_mmsi",
        /// A base station, aid to navigation, aircraft, handheld or distress beacon.
        NotAVessel = "not_a_vessel",
        /// Left out by the area's list of MMSI.
        FilteredMmsi = "filtered_mmsi",
        /// Left out by the area's ship types.
        FilteredShipType = "filtered_ship_type",
        /// Left out by the area's range of lengths.
        FilteredLength = "filtered_length",
        /// The same vessel, time and position as another message.
        Duplicate = "duplicate",
        /// A position told before, with a later time at which the reported speed has carried the
        /// vessel on; archives repeat positions where a vessel sent other news.
        StalePosition = "stale_position",
        /// The same vessel and time as another message, with another position.
        RepeatedTime = "repeated_time",
        /// A position out of proportion to the vessel's fixes around it.
        PositionSpike = "position_spike",
        /// In a trajectory with too few fixes.
        InTooFewFixes = "in_track_with_too_few_fixes",
        /// In a trajectory that is too short in time.
        InTooShort = "in_track_too_short",
        /// In a trajectory of a moored or anchored vessel.
        InMoored = "in_moored_track",
        /// In a trajectory outside the area's range of speeds.
        InFilteredSpeed = "in_track_with_filtered_speed",
    }
}

reasons! {
    /// Why a trajectory is left out.
    TrackDrop {
        /// Fewer fixes than configured.
        TooFewFixes = "too_few_fixes",
        /// Shorter in time than configured.
        TooShort = "too_short",
        /// Moored or anchored all along.
        Moored = "moored",
        /// Mean speed outside the area's range.
        FilteredSpeed = "filtered_speed",
    }
}

impl MessageDrop {
    /// Whether the row itself is at fault: these are listed with their line.
    pub fn is_bad_row(self) -> bool {
        matches!(
            self,
            Self::LineTooLong
                | Self::UnclosedQuote
                | Self::WrongColumnCount
                | Self::UnreadablePosition
                | Self::SwappedPosition
                | Self::ImpossiblePosition
                | Self::UnreadableTime
                | Self::UnreadableMmsi
        )
    }

    /// What to do about such rows, where there is something.
    pub fn remedy(self) -> &'static str {
        match self {
            Self::LineTooLong => "raise max_line_bytes if such a line is meant",
            Self::UnclosedQuote => "close the quote or double a quote that is meant",
            Self::WrongColumnCount => {
                "the row is truncated or has a stray delimiter: correct it or fetch the file again"
            }
            Self::UnreadablePosition => "give decimal degrees with a point",
            Self::SwappedPosition => "exchange the two columns with a column mapping",
            Self::ImpossiblePosition => "give degrees, latitude within 90 and longitude within 180",
            Self::UnreadableTime => {
                "give the time in the layout's form, or name its form in a column mapping"
            }
            Self::UnreadableMmsi => "give the nine digits of the MMSI",
            _ => "none needed",
        }
    }
}

impl From<TrackDrop> for MessageDrop {
    fn from(reason: TrackDrop) -> Self {
        match reason {
            TrackDrop::TooFewFixes => Self::InTooFewFixes,
            TrackDrop::TooShort => Self::InTooShort,
            TrackDrop::Moored => Self::InMoored,
            TrackDrop::FilteredSpeed => Self::InFilteredSpeed,
        }
    }
}

/// How many of something, by reason. In files a map of the reasons that occurred.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Counts<R: Reason> {
    counts: Vec<u64>,
    reasons: std::marker::PhantomData<R>,
}

impl<R: Reason> Default for Counts<R> {
    fn default() -> Self {
        Self { counts: vec![0; R::ALL.len()], reasons: std::marker::PhantomData }
    }
}

impl<R: Reason> Counts<R> {
    /// Adds `many` under a reason.
    pub fn add(&mut self, reason: R, many: u64) {
        self.counts[reason.index()] += many;
    }

    /// How many under a reason.
    pub fn of(&self, reason: R) -> u64 {
        self.counts[reason.index()]
    }

    /// How many under all reasons together.
    pub fn total(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// The reasons that occurred, in their order, with their counts.
    pub fn iter(&self) -> impl Iterator<Item = (R, u64)> + '_ {
        R::ALL.iter().map(|&reason| (reason, self.of(reason))).filter(|&(_, many)| many > 0)
    }

    /// Adds another account to this one.
    pub fn merge(&mut self, other: &Self) {
        for (own, more) in self.counts.iter_mut().zip(&other.counts) {
            *own += more;
        }
    }
}

impl<R: Reason> Serialize for Counts<R> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (reason, many) in self.iter() {
            map.serialize_entry(reason.word(), &many)?;
        }
        map.end()
    }
}

impl<'de, R: Reason> Deserialize<'de> for Counts<R> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let map = std::collections::BTreeMap::<String, u64>::deserialize(deserializer)?;
        let mut counts = Self::default();
        for (word, many) in map {
            let reason = R::ALL.iter().find(|reason| reason.word() == word);
            let reason =
                reason.ok_or_else(|| serde::de::Error::custom(format!("unknown reason `{word}`")))?;
            counts.add(*reason, many);
        }
        Ok(counts)
    }
}

/// Of the messages or trajectories found: how many were kept, and why the others were not.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Messages {
    /// Rows read that hold anything at all.
    pub read: u64,
    /// Those that are fixes of a kept track.
    pub kept: u64,
    /// The others, by reason.
    pub dropped: Counts<MessageDrop>,
}

/// The account of the trajectories.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tracks {
    /// Trajectories after splitting.
    pub found: u64,
    /// Those that were resampled and kept.
    pub kept: u64,
    /// The others, by reason.
    pub dropped: Counts<TrackDrop>,
}

/// Optional fields that were cleared because they held a sentinel or could not be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ClearedFields {
    /// Speeds over ground (sentinel 102.3 knots).
    pub sog: u64,
    /// Courses over ground (sentinel 360 degrees).
    pub cog: u64,
    /// Headings (sentinel 511 degrees).
    pub heading: u64,
}

/// Where a vessel's messages were cut into trajectories.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Splits {
    /// At a gap in time.
    pub gap: u64,
    /// At a jump no vessel makes.
    pub jump: u64,
    /// Where the vessel stopped for long, or set off again.
    pub stop: u64,
}

/// How the intervals between fixes were bridged on resampling.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Intervals {
    /// By the cubic spline.
    pub spline: u64,
    /// By the shape-preserving cubic, where the spline swings out.
    pub shape_preserving: u64,
    /// By a straight line, where that is too fast as well.
    pub straight: u64,
}

/// What was read of one file or archive entry.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileReport {
    /// The file as named by the caller; an archive entry follows after `!`.
    pub file: String,
    /// The layout it was read as.
    pub layout: String,
    /// Messages read from it.
    pub read: u64,
    /// Why reading ended before the end of the file, and what to do; nothing where it did not.
    pub damage: Option<String>,
}

/// A row that could not be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BadRow {
    /// The file, as in [`FileReport::file`].
    pub file: String,
    /// Its line, counted from 1.
    pub line: u64,
    /// What is wrong with it.
    pub reason: MessageDrop,
    /// The beginning of the row.
    pub excerpt: String,
}

impl fmt::Display for BadRow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { file, line, reason, excerpt } = self;
        write!(f, "{file}:{line}: {reason} ({excerpt}): {}", reason.remedy())
    }
}

/// The account of an import.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Report {
    /// Every message read, once.
    pub messages: Messages,
    /// Every trajectory found, once.
    pub tracks: Tracks,
    /// Optional fields cleared; their messages live on.
    pub cleared_fields: ClearedFields,
    /// Cuts between trajectories, by cause.
    pub splits: Splits,
    /// How the kept tracks bridge the intervals between their fixes.
    pub intervals: Intervals,
    /// MMSI under which two vessels were under way at one time; both have their tracks.
    pub shared_mmsi: Vec<u32>,
    /// The files read, in the order given.
    pub files: Vec<FileReport>,
}

impl Report {
    /// Whether every message and every trajectory is accounted for exactly once.
    pub fn adds_up(&self) -> bool {
        let in_files: u64 = self.files.iter().map(|file| file.read).sum();
        self.messages.read == in_files
            && self.messages.read == self.messages.kept + self.messages.dropped.total()
            && self.tracks.found == self.tracks.kept + self.tracks.dropped.total()
    }

    /// Files whose end could not be reached.
    pub fn damaged_files(&self) -> impl Iterator<Item = (&str, &str)> {
        self.files.iter().filter_map(|file| Some((file.file.as_str(), file.damage.as_deref()?)))
    }
}
