//! TensorBoard's event files. A file is a sequence of records; a record is its length (u64), the checksum of
//! those 8 bytes, the data, and the checksum of the data, all little-endian. A checksum is the CRC-32C,
//! rotated right by 15 bits, plus 0xa282ead8 (the format of TFRecord). The data of a record is an `Event` in
//! the wire format of protocol buffers. It needs four messages, which are written here field by field:
//!
//! - `Event`: wall_time = 1 (double), step = 2 (int64), file_version = 3 (string), summary = 5 (`Summary`),
//!   session_log = 7 (`SessionLog`)
//! - `Summary`: value = 1 (repeated `Value`)
//! - `Value`: tag = 1 (string), simple_value = 2 (float)
//! - `SessionLog`: status = 1 (enum; 1 is START: what older files have from its step on is void)

use crate::evaluations::EvaluationRow;
use crate::tensors::FileError;
use crate::training::Record;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// An event file of this process. It begins with the first event: a process that makes none leaves none.
pub(crate) struct TensorBoardLog {
    folder: PathBuf,
    /// Where the run continues.
    steps: u64,
    file: Option<(PathBuf, File)>,
}

impl TensorBoardLog {
    /// A file in the folder. `steps` is where the run continues.
    pub fn new(folder: &Path, steps: u64) -> TensorBoardLog {
        TensorBoardLog { folder: folder.to_owned(), steps, file: None }
    }

    /// Adds the values of an update, except those that do not exist yet.
    pub fn append(&mut self, record: &Record) -> Result<(), FileError> {
        let columns = record.columns().into_iter().filter(|(_, value)| !value.is_nan());
        self.append_values(record.steps, columns)
    }

    /// Adds the results of an evaluation.
    pub fn append_evaluation(&mut self, row: &EvaluationRow) -> Result<(), FileError> {
        let means = row.values().into_iter().filter(|(name, _)| !name.ends_with("seconds"));
        self.append_values(row.trained_steps, means)
    }

    fn append_values(
        &mut self,
        steps: u64,
        values: impl Iterator<Item = (impl AsRef<str>, f64)>,
    ) -> Result<(), FileError> {
        let mut summary = Vec::new();
        for (name, value) in values {
            let mut message = Vec::new();
            bytes_field(&mut message, 1, name.as_ref().as_bytes());
            message.push(2 << 3 | 5); // 32 bits
            message.extend((value as f32).to_le_bytes());
            bytes_field(&mut summary, 1, &message);
        }
        let values = framed(&event(steps, |event| bytes_field(event, 5, &summary)));
        let (path, mut file, bytes) = match self.file.take() {
            Some((path, file)) => (path, file, values),
            None => {
                let name = format!("events.out.tfevents.{:.6}.{}", now(), std::process::id());
                let path = self.folder.join(name);
                let created = File::create(&path);
                let file = created.map_err(|source| FileError::Write { path: path.clone(), source })?;
                (path, file, [self.beginning(), values].concat())
            }
        };
        let written = file.write_all(&bytes);
        let (path, _) = self.file.insert((path, file));
        written.map_err(|source| FileError::Write { path: path.clone(), source })
    }

    /// The first records of a file.
    fn beginning(&self) -> Vec<u8> {
        let mut records = framed(&event(0, |event| bytes_field(event, 3, b"brain.Event:2")));
        if self.steps > 0 {
            let session_start = [1 << 3, 1];
            records.extend(framed(&event(self.steps + 1, |event| bytes_field(event, 7, &session_start))));
        }
        records
    }
}

fn now() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |time| time.as_secs_f64())
}

fn event(step: u64, add: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut event = vec![1 << 3 | 1]; // 64 bits
    event.extend(now().to_le_bytes());
    event.push(2 << 3);
    varint(&mut event, step);
    add(&mut event);
    event
}

fn bytes_field(message: &mut Vec<u8>, field: u8, bytes: &[u8]) {
    message.push(field << 3 | 2); // length and bytes
    varint(message, bytes.len() as u64);
    message.extend(bytes);
}

/// Seven bits per byte, the lowest first; the high bit marks that more follow.
fn varint(message: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        message.push(value as u8 | 0x80);
        value >>= 7;
    }
    message.push(value as u8);
}

fn framed(data: &[u8]) -> Vec<u8> {
    let length = (data.len() as u64).to_le_bytes();
    let checksum =
        |bytes: &[u8]| crc32c::crc32c(bytes).rotate_right(15).wrapping_add(0xa282_ead8).to_le_bytes();
    [&length[..], &checksum(&length), data, &checksum(data)].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_has_length_and_checksums() {
        let record = framed(b"abc");
        assert_eq!(record[..8], [3, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(record[12..15], *b"abc");
        // CRC-32C of "123456789" is 0xe3069283, the check value of its definition.
        let checked = framed(b"123456789");
        let masked = 0xe306_9283u32.rotate_right(15).wrapping_add(0xa282_ead8);
        assert_eq!(checked[21..], masked.to_le_bytes());
    }

    #[test]
    fn an_event_has_the_wire_format_of_protocol_buffers() {
        let event = event(300, |event| bytes_field(event, 3, b"x"));
        assert_eq!(event[0], 0x09);
        assert_eq!(event[9..], [0x10, 0xac, 0x02, 0x1a, 0x01, b'x']);
    }
}
