//! Reads the arrays of recorded battles: NumPy's file format, version 1, without records and in C order. The
//! crates that read all of it bring a parser generator, which takes as long to compile as everything else of
//! the tests.

use std::error::Error;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// An array: the bytes of its items, and their type as NumPy writes it (`<f4`).
pub(crate) struct Array<'a> {
    dtype: &'a str,
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
        if !header.contains("'fortran_order': False") {
            return Err(format!("expected an array in C order, got {header}").into());
        }
        let dtype = header.split_once("'descr': '").and_then(|(_, rest)| rest.split_once('\''));
        let (dtype, _) = dtype.ok_or(format!("expected items of one type, got {header}"))?;
        Ok(Array { dtype, items })
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
            (file(&header.replace("False", "True"), &[]), "C order"),
            (file(&header.replace("'<i2'", "[('x', '<i2')]"), &[]), "one type"),
            (file(header, &[])[..20].to_vec(), "cut off"),
            (b"PK".to_vec(), "version 1.0"),
        ] {
            let error = Array::new(&bytes).and_then(|array| array.integers()).expect_err(expected);
            assert!(error.to_string().contains(expected), "{error}");
        }
    }
}
