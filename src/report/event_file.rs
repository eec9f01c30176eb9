//! Scalars over steps in the event files that TensorBoard reads.
//!
//! A file is a sequence of TFRecords: length (8 bytes, little endian), masked CRC-32C of the length, data,
//! masked CRC-32C of the data (TensorFlow's `core/lib/io/record_writer.h`). The data is an `Event` message of
//! `core/util/event.proto` in Protocol Buffers' wire format.

use std::io::{self, Write};

/// Writes the records of one event file.
pub struct EventWriter<W> {
    out: W,
}

impl<W: Write> EventWriter<W> {
    /// Starts a file; `unix_s` is the time now, in seconds since 1970.
    ///
    /// # Errors
    ///
    /// When the file cannot be written.
    pub fn new(mut out: W, unix_s: f64) -> io::Result<Self> {
        let mut event = Vec::new();
        double_field(&mut event, 1, unix_s);
        bytes_field(&mut event, 3, b"brain.Event:2");
        write_record(&mut out, &event)?;
        Ok(Self { out })
    }

    /// Appends values of one step, each with its tag.
    ///
    /// # Errors
    ///
    /// When the file cannot be written.
    pub fn scalars(&mut self, unix_s: f64, step: u64, values: &[(&str, f64)]) -> io::Result<()> {
        let mut summary = Vec::new();
        for (tag, value) in values {
            let mut entry = Vec::new();
            bytes_field(&mut entry, 1, tag.as_bytes());
            key(&mut entry, 2, FIXED_32);
            entry.extend_from_slice(&(*value as f32).to_le_bytes());
            bytes_field(&mut summary, 1, &entry);
        }
        let mut event = Vec::new();
        double_field(&mut event, 1, unix_s);
        key(&mut event, 2, VARINT);
        varint(&mut event, step);
        bytes_field(&mut event, 5, &summary);
        write_record(&mut self.out, &event)
    }

    /// Makes what was written visible to readers.
    ///
    /// # Errors
    ///
    /// When the file cannot be written.
    pub fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

const VARINT: u64 = 0;
const FIXED_64: u64 = 1;
const LENGTH_DELIMITED: u64 = 2;
const FIXED_32: u64 = 5;

fn key(message: &mut Vec<u8>, field: u64, wire_type: u64) {
    varint(message, field << 3 | wire_type);
}

fn varint(message: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        message.push(value as u8 | 0x80);
        value >>= 7;
    }
    message.push(value as u8);
}

fn double_field(message: &mut Vec<u8>, field: u64, value: f64) {
    key(message, field, FIXED_64);
    message.extend_from_slice(&value.to_le_bytes());
}

fn bytes_field(message: &mut Vec<u8>, field: u64, value: &[u8]) {
    key(message, field, LENGTH_DELIMITED);
    varint(message, value.len() as u64);
    message.extend_from_slice(value);
}

fn write_record(out: &mut impl Write, data: &[u8]) -> io::Result<()> {
    let length = (data.len() as u64).to_le_bytes();
    out.write_all(&length)?;
    out.write_all(&masked_crc(&length).to_le_bytes())?;
    out.write_all(data)?;
    out.write_all(&masked_crc(data).to_le_bytes())
}

fn masked_crc(bytes: &[u8]) -> u32 {
    crc_32c(bytes).rotate_right(15).wrapping_add(0xa282_ead8)
}

/// CRC-32C (Castagnoli), bit by bit: records are short and few.
fn crc_32c(bytes: &[u8]) -> u32 {
    const REVERSED_POLYNOMIAL: u32 = 0x82f6_3b78;
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (REVERSED_POLYNOMIAL * (crc & 1)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RFC 3720, appendix B.4.
    #[test]
    fn checksums_are_those_of_the_standard() {
        assert_eq!(crc_32c(&[0; 32]), 0x8a91_36aa);
        assert_eq!(crc_32c(&[0xff; 32]), 0x62a8_ab43);
        assert_eq!(crc_32c(b"123456789"), 0xe306_9283);
    }

    #[test]
    fn records_hold_their_lengths_and_messages() {
        let mut file = Vec::new();
        let mut writer = EventWriter::new(&mut file, 1.5).unwrap();
        writer.scalars(2.0, 300, &[("loss", 0.25)]).unwrap();
        writer.flush().unwrap();

        let first_length = u64::from_le_bytes(file[..8].try_into().unwrap()) as usize;
        assert_eq!(&file[12..12 + 9], [&[0x09][..], &1.5_f64.to_le_bytes()].concat());
        assert!(file[12..12 + first_length].ends_with(b"brain.Event:2"));

        let second = &file[12 + first_length + 4..];
        let length = u64::from_le_bytes(second[..8].try_into().unwrap()) as usize;
        assert_eq!(second.len(), 8 + 4 + length + 4);
        let mut expected = [&[0x09][..], &2_f64.to_le_bytes()].concat();
        // Step 300 is the varint ac 02; the summary holds one value of a tag and a 32-bit float.
        expected.extend([0x10, 0xac, 0x02, 0x2a, 13, 0x0a, 11, 0x0a, 4]);
        expected.extend(b"loss");
        expected.push(0x15);
        expected.extend(0.25_f32.to_le_bytes());
        assert_eq!(&second[12..12 + length], expected);
        assert_eq!(second[12 + length..], masked_crc(&expected).to_le_bytes());
    }
}
