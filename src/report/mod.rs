//! Results for people to read: figures, tables, curves.

pub mod event_file;
