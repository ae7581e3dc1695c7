//! Reads the arrays of recordings: NumPy's file format, version 1, without records, and archives of such
//! files. The crates that read all of it bring a parser generator, which takes as long to compile as
//! everything else of the tests.

use std::collections::HashMap;
use std::error::Error;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use zip::ZipArchive;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// The arrays of an archive (`.npz`) by name.
#[derive(Debug)]
pub struct Npz(HashMap<String, Vec<u8>>);

impl Npz {
    /// Reads an archive.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn read(path: &Path) -> Result<Npz> {
        let mut archive = ZipArchive::new(BufReader::new(File::open(path)?))?;
        let mut files = HashMap::new();
        for i in 0..archive.len() {
            let (mut member, mut bytes) = (archive.by_index(i)?, Vec::new());
            member.read_to_end(&mut bytes)?;
            files.insert(member.name()?.trim_end_matches(".npy").to_owned(), bytes);
        }
        Ok(Npz(files))
    }

    /// Whether there is an array of a name.
    pub fn has(&self, name: &str) -> bool {
        self.0.contains_key(name)
    }

    /// The items of an array of f32.
    ///
    /// # Errors
    /// It is missing, or of another type.
    pub fn singles(&self, name: &str) -> Result<Vec<f32>> {
        self.items(name, |array| array.singles())
    }

    /// The items of an array of f64.
    ///
    /// # Errors
    /// It is missing, or of another type.
    pub fn floats(&self, name: &str) -> Result<Vec<f64>> {
        self.items(name, |array| array.floats())
    }

    /// The items of an array of integers of any width, and flags as 0 and 1.
    ///
    /// # Errors
    /// It is missing, or of another type.
    pub fn integers(&self, name: &str) -> Result<Vec<i64>> {
        self.items(name, |array| array.integers())
    }

    /// The items of an array of flags, 0 or 1.
    ///
    /// # Errors
    /// It is missing, or of another type.
    pub fn flags(&self, name: &str) -> Result<Vec<bool>> {
        Ok(self.integers(name)?.into_iter().map(|flag| flag != 0).collect())
    }

    /// A JSON document that is stored as bytes.
    ///
    /// # Errors
    /// It is missing, or no JSON.
    pub fn json(&self, name: &str) -> Result<serde_json::Value> {
        let bytes: Vec<u8> = self.integers(name)?.into_iter().map(|x| x as u8).collect();
        Ok(serde_json::from_slice(&bytes)?)
    }

    /// Whether a matrix has its columns one after the other.
    ///
    /// # Errors
    /// It is missing, or of an unknown type.
    pub fn is_by_column(&self, name: &str) -> Result<bool> {
        let bytes = self.0.get(name).ok_or_else(|| format!("{name}: missing"))?;
        Ok(Array::new(bytes)?.is_by_column)
    }

    fn items<T>(&self, name: &str, read: impl Fn(&Array<'_>) -> Result<Vec<T>>) -> Result<Vec<T>> {
        let bytes = self.0.get(name).ok_or_else(|| format!("{name}: missing"))?;
        Array::new(bytes).and_then(|array| read(&array)).map_err(|e| format!("{name}: {e}").into())
    }
}

/// An array: the bytes of its items, and their type as NumPy writes it (`<f4`).
pub(crate) struct Array<'a> {
    dtype: &'a str,
    /// In Fortran's order.
    is_by_column: bool,
    items: &'a [u8],
}

impl<'a> Array<'a> {
    /// Finds header and items in the bytes of a file.
    pub(crate) fn new(file: &'a [u8]) -> Result<Array<'a>> {
        let rest = file.strip_prefix(b"\x93NUMPY\x01\x00").ok_or("expected a .npy file of version 1.0")?;
        let (length, rest) = rest.split_first_chunk().ok_or("the header is cut off")?;
        let (header, items) =
            rest.split_at_checked(u16::from_le_bytes(*length).into()).ok_or("the header is cut off")?;
        let header = std::str::from_utf8(header)?;
        let is_by_column = header.contains("'fortran_order': True");
        let dtype = header.split_once("'descr': '").and_then(|(_, rest)| rest.split_once('\''));
        let (dtype, _) = dtype.ok_or(format!("expected items of one type, got {header}"))?;
        Ok(Array { dtype, is_by_column, items })
    }

    pub(crate) fn singles(&self) -> Result<Vec<f32>> {
        match self.dtype {
            "<f4" => self.convert(f32::from_le_bytes),
            other => Err(format!("expected <f4, got {other}").into()),
        }
    }

    pub(crate) fn floats(&self) -> Result<Vec<f64>> {
        match self.dtype {
            "<f8" => self.convert(f64::from_le_bytes),
            other => Err(format!("expected <f8, got {other}").into()),
        }
    }

    /// Integers of any width, and flags as 0 and 1.
    pub(crate) fn integers(&self) -> Result<Vec<i64>> {
        match self.dtype {
            "|b1" | "|u1" => self.convert(|[byte]| i64::from(byte)),
            "|i1" => self.convert(|byte| i64::from(i8::from_le_bytes(byte))),
            "<u2" => self.convert(|bytes| i64::from(u16::from_le_bytes(bytes))),
            "<i2" => self.convert(|bytes| i64::from(i16::from_le_bytes(bytes))),
            "<i4" => self.convert(|bytes| i64::from(i32::from_le_bytes(bytes))),
            "<i8" => self.convert(i64::from_le_bytes),
            other => Err(format!("expected integers of at most 8 bytes, got {other}").into()),
        }
    }

    fn convert<T, const SIZE: usize>(&self, value: impl Fn([u8; SIZE]) -> T) -> Result<Vec<T>> {
        let (items, rest) = self.items.as_chunks();
        if !rest.is_empty() {
            return Err(format!("the last item of type {} is cut off", self.dtype).into());
        }
        Ok(items.iter().map(|&bytes| value(bytes)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::Array;

    fn file(header: &str, items: &[u8]) -> Vec<u8> {
        let length = u16::try_from(header.len()).expect("a short header").to_le_bytes();
        [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), items].concat()
    }

    #[test]
    fn reads_items_and_refuses_what_it_does_not_know() {
        let header = "{'descr': '<i2', 'fortran_order': False, 'shape': (2,), }\n";
        let bytes = file(header, &[1, 0, 254, 255]);
        let array = Array::new(&bytes).expect("an array");
        assert_eq!(array.integers().expect("integers"), [1, -2]);
        assert_eq!(array.floats().expect_err("not floats").to_string(), "expected <f8, got <i2");

        for (bytes, expected) in [
            (file(header, &[1]), "cut off"),
            (file(&header.replace("'<i2'", "[('x', '<i2')]"), &[]), "one type"),
            (file(header, &[])[..20].to_vec(), "cut off"),
            (b"PK".to_vec(), "version 1.0"),
        ] {
            let error = Array::new(&bytes).and_then(|array| array.integers()).expect_err(expected);
            assert!(error.to_string().contains(expected), "{error}");
        }
    }
}
