//! Files of named arrays in the safetensors format: written whole or not at all, and read with checks.

use crate::zoo::{zoo_file, zoo_hint, zoo_teams};
use bytemuck::Pod;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensorError, SafeTensors};
use smaclite_units::file::{shown_reason, write_whole};
use std::collections::HashMap;
use std::fs::{self, DirEntry};
use std::io;
use std::path::{Path, PathBuf};

/// More than any file of a run has; a larger one is not read.
const MAX_BYTES: u64 = 1 << 32;

/// Why a file of a run could not be read or written.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum FileError {
    #[error("cannot write `{}`: {source}", path.display())]
    Write { path: PathBuf, source: io::Error },
    #[error("cannot read `{}`: {source}", path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("`{}` is not a regular file of at most {MAX_BYTES} bytes", path.display())]
    NotRegular { path: PathBuf },
    #[error(
        "`{}` is not the folder of a run of `smaclite-pool train`: it has no run.json{}{}",
        folder.display(),
        inner_hint(folder),
        zoo_hint(folder)
    )]
    NoRun { folder: PathBuf },
    #[error(
        "`{}` has {found}, a file of a run, but no run.json, which says what the run is: put that file back, \
         or move the folder elsewhere", folder.display()
    )]
    Undescribed { folder: PathBuf, found: &'static str },
    #[error(
        "`{}` holds a run, and `{}` in it another one, as `train --seeds` calls it, which would be \
         overlooked: move one of them elsewhere", folder.display(), inner.display()
    )]
    Both { folder: PathBuf, inner: PathBuf },
    #[error(
        "`{}` is a team of the zoo, which has no {missing}: only the files that let it play were kept",
        folder.display()
    )]
    OfZoo { folder: PathBuf, missing: &'static str },
    #[error("`{}` has no {missing}: {why}", folder.display())]
    NoWeights { folder: PathBuf, missing: &'static str, why: &'static str },
    #[error("the zoo has no team `{name}`; it has {}", zoo_teams().collect::<Vec<_>>().join(", "))]
    NotInZoo { name: String },
    #[error("`{}` is damaged or not a file of a run: {}", path.display(), shown_reason(why))]
    Damaged { path: PathBuf, why: String },
    #[error("`{}` does not fit the run: {}", path.display(), shown_reason(why))]
    OtherRun { path: PathBuf, why: String },
}

/// Names a run in the folder, as `train --seeds` makes some, as part of an error.
fn inner_hint(folder: &Path) -> String {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let runs = entries.map(|entry| entry.path()).filter(|path| path.join("run.json").is_file());
    runs.min()
        .map_or_else(String::new, |run| format!(", but runs in it; name one, such as `{}`", run.display()))
}

/// A named array.
pub(crate) struct Array {
    name: String,
    dtype: Dtype,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

/// Types that an array can have.
pub(crate) trait Number: Pod {
    const DTYPE: Dtype;
}

impl Number for f32 {
    const DTYPE: Dtype = Dtype::F32;
}
impl Number for f64 {
    const DTYPE: Dtype = Dtype::F64;
}
impl Number for u8 {
    const DTYPE: Dtype = Dtype::U8;
}
impl Number for u64 {
    const DTYPE: Dtype = Dtype::U64;
}

impl Array {
    pub fn new<T: Number>(name: impl Into<String>, shape: &[usize], values: &[T]) -> Array {
        let bytes = bytemuck::cast_slice(values).to_vec();
        Array { name: name.into(), dtype: T::DTYPE, shape: shape.to_vec(), bytes }
    }

    /// One dimension.
    pub fn flat<T: Number>(name: impl Into<String>, values: &[T]) -> Array {
        Array::new(name, &[values.len()], values)
    }
}

/// The key in a file's metadata of the CRC-32C of names and elements. Files that learners in Python write do
/// not have it.
const CHECKSUM: &str = "crc32c";

fn checksum<'a>(arrays: impl Iterator<Item = (&'a str, &'a [u8])>) -> String {
    let mut arrays: Vec<_> = arrays.collect();
    arrays.sort_unstable_by_key(|(name, _)| *name); // a file has them in another order
    let parts = arrays.into_iter().flat_map(|(name, bytes)| [name.as_bytes(), bytes]);
    format!("{:08x}", parts.fold(0, crc32c::crc32c_append))
}

/// The file's bytes.
pub(crate) fn encode(arrays: &[Array]) -> Result<Vec<u8>, SafeTensorError> {
    let views = arrays.iter().map(|array| {
        Ok((array.name.as_str(), TensorView::new(array.dtype, array.shape.clone(), &array.bytes)?))
    });
    let views = views.collect::<Result<Vec<_>, SafeTensorError>>()?;
    let checksum = checksum(arrays.iter().map(|array| (array.name.as_str(), &array.bytes[..])));
    safetensors::serialize(views, Some(HashMap::from([(CHECKSUM.to_owned(), checksum)])))
}

/// Writes a file whole or not at all. What a run writes is a regular file: to open a pipe would be to wait
/// for its reader.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    if fs::metadata(path).is_ok_and(|metadata| !metadata.is_file()) {
        return Err(FileError::NotRegular { path: path.to_owned() });
    }
    write_whole(path, |output| output.write_all(bytes))
        .map_err(|source| FileError::Write { path: path.to_owned(), source })
}

/// Writes a file of arrays whole, or not at all.
pub(crate) fn write_arrays(path: &Path, arrays: &[Array]) -> Result<(), FileError> {
    let bytes = encode(arrays)
        .map_err(|error| FileError::Write { path: path.to_owned(), source: std::io::Error::other(error) })?;
    write(path, &bytes)
}

/// Removes a file, if it exists.
pub(crate) fn remove(path: &Path) -> Result<(), FileError> {
    match fs::remove_file(path) {
        Err(source) if source.kind() != io::ErrorKind::NotFound => {
            Err(FileError::Write { path: path.to_owned(), source })
        }
        _ => Ok(()),
    }
}

/// Makes a folder, and those that it is in.
pub(crate) fn create_folder(path: &Path) -> Result<(), FileError> {
    fs::create_dir_all(path).map_err(|source| FileError::Write { path: path.to_owned(), source })
}

/// What is in a folder; nothing if it does not exist.
pub(crate) fn entries(folder: &Path) -> Result<Vec<DirEntry>, FileError> {
    let error = |source| FileError::Read { path: folder.to_owned(), source };
    match fs::read_dir(folder) {
        Err(source) if source.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
        entries => entries.map_err(error)?.collect::<Result<_, _>>().map_err(error),
    }
}

/// Whether there is such a file, in a folder or in the zoo.
pub(crate) fn exists(path: &Path) -> bool {
    zoo_file(path).is_some() || path.exists()
}

/// Reads a file, if it is a regular one of a plausible size, or one of the zoo.
///
/// # Errors
/// If it is none, or cannot be read.
pub fn read(path: &Path) -> Result<Vec<u8>, FileError> {
    if let Some(bytes) = zoo_file(path) {
        return Ok(bytes.to_vec());
    }
    let error = |source| FileError::Read { path: path.to_owned(), source };
    let metadata = fs::metadata(path).map_err(error)?;
    if !metadata.is_file() || metadata.len() > MAX_BYTES {
        return Err(FileError::NotRegular { path: path.to_owned() });
    }
    fs::read(path).map_err(error)
}

/// The text of a file; empty if it does not exist.
pub(crate) fn read_text(path: &Path) -> Result<String, FileError> {
    match read(path) {
        Err(FileError::Read { source, .. }) if source.kind() == io::ErrorKind::NotFound => Ok(String::new()),
        bytes => String::from_utf8(bytes?)
            .map_err(|error| FileError::Damaged { path: path.to_owned(), why: error.to_string() }),
    }
}

/// Removes the files that a killed process did not complete; [`write`] gives them such names.
pub(crate) fn remove_incomplete(folder: &Path) -> Result<(), FileError> {
    for entry in entries(folder)? {
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        if is_file && entry.file_name().as_encoded_bytes().starts_with(b".tmp") {
            remove(&entry.path())?;
        }
    }
    Ok(())
}

/// Arrays that were read.
pub(crate) struct Arrays<'a> {
    path: &'a Path,
    tensors: SafeTensors<'a>,
}

impl<'a> Arrays<'a> {
    pub fn decode(path: &'a Path, bytes: &'a [u8]) -> Result<Arrays<'a>, FileError> {
        let damaged =
            |error: SafeTensorError| FileError::Damaged { path: path.to_owned(), why: error.to_string() };
        let tensors = SafeTensors::deserialize(bytes).map_err(damaged)?;
        let arrays = Arrays { path, tensors };
        let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(damaged)?;
        let stored = metadata.metadata().as_ref().and_then(|metadata| metadata.get(CHECKSUM));
        if stored.is_some_and(|stored| *stored != arrays.checksum()) {
            return Err(arrays.damaged("its checksum differs"));
        }
        Ok(arrays)
    }

    fn checksum(&self) -> String {
        let names = self.tensors.names().into_iter();
        checksum(names.filter_map(|name| Some((name, self.tensors.tensor(name).ok()?.data()))))
    }

    /// Whether there is an array of that name.
    pub fn has(&self, name: &str) -> bool {
        self.tensors.tensor(name).is_ok()
    }

    /// The elements of an array of any length.
    pub fn values<T: Number>(&self, name: &str) -> Result<Vec<T>, FileError> {
        let tensor = self.tensors.tensor(name).map_err(|_| self.damaged(format!("it has no `{name}`")))?;
        if tensor.dtype() != T::DTYPE {
            return Err(self.damaged(format!("`{name}` is {:?}, not {:?}", tensor.dtype(), T::DTYPE)));
        }
        Ok(tensor.data().chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect())
    }

    /// The elements of an array of this shape.
    pub fn shaped<T: Number>(&self, name: &str, shape: &[usize]) -> Result<Vec<T>, FileError> {
        let values = self.values(name)?;
        match self.tensors.tensor(name) {
            Ok(tensor) if tensor.shape() == shape => Ok(values),
            Ok(tensor) => {
                Err(self.other_run(format!("`{name}` has the shape {:?}, not {shape:?}", tensor.shape())))
            }
            Err(error) => Err(self.damaged(error.to_string())),
        }
    }

    pub fn damaged(&self, why: impl Into<String>) -> FileError {
        FileError::Damaged { path: self.path.to_owned(), why: why.into() }
    }

    pub fn other_run(&self, why: String) -> FileError {
        FileError::OtherRun { path: self.path.to_owned(), why }
    }
}
