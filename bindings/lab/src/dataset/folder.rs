//! A folder of arrays as files of NumPy (`.npy`, format 1.0): a header of a multiple of 64 bytes, and the
//! elements. Threads write their rows to their places.

use super::arrays::{ArrayName, PerRow};
use super::chunk::{Chunk, Wanted};
use super::{Dataset, DatasetError};
use smaclite_pool::fields::Dtype;
use smaclite_units::file::os::{partial_folder, write_all_at};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The files of a folder, under another name until they are complete.
pub(super) struct Files {
    /// The name that the folder gets.
    folder: PathBuf,
    partial: TempDir,
    arrays: Vec<(ArrayName, File)>,
}

impl Files {
    pub fn create(dataset: &Dataset, folder: &Path, wanted: Wanted) -> Result<Files, DatasetError> {
        if folder.exists() {
            return Err(DatasetError::FolderExists { folder: folder.display().to_string() });
        }
        let failed = |error| DatasetError::Io { file: folder.display().to_string(), error };
        let parent = folder.parent().filter(|parent| !parent.as_os_str().is_empty());
        let partial = partial_folder().tempdir_in(parent.unwrap_or(Path::new(".")));
        let partial = partial.map_err(failed)?;
        let names = ArrayName::ALL.into_iter().filter(|array| wanted[*array as usize]);
        let create = |array: ArrayName| {
            let file = File::create(partial.path().join(file_name(array)))?;
            write_all_at(&file, &header(array, dataset), 0)?;
            // Its size from the beginning, so that a file without steps is one, too.
            file.set_len((HEADER + n_rows(array, dataset) * row_bytes(array, dataset)) as u64)?;
            Ok(file)
        };
        let create = |array| Ok((array, create(array).map_err(|error| failed_array(folder, array, error))?));
        let arrays = names.map(create).collect::<Result<Vec<_>, DatasetError>>()?;
        let card = dataset.card_json().and_then(|card| serde_json::to_vec_pretty(&card));
        let card = card.map_err(|error| failed(error.into()))?;
        std::fs::write(partial.path().join("card.json"), card).map_err(failed)?;
        Ok(Files { folder: folder.to_owned(), partial, arrays })
    }

    /// Writes the rows of some episodes.
    pub fn write(&self, dataset: &Dataset, chunk: &Chunk<'_>) -> Result<(), DatasetError> {
        for (array, file) in &self.arrays {
            let rows = match array.spec().per {
                PerRow::Step => dataset.steps_of_all(&chunk.episodes),
                PerRow::Episode => chunk.episodes.clone(),
            };
            let offset = HEADER + rows.start * row_bytes(*array, dataset);
            write_all_at(file, chunk.bytes(dataset, *array), offset as u64)
                .map_err(|error| failed_array(&self.folder, *array, error))?;
        }
        Ok(())
    }

    /// Gives the folder its name.
    pub fn finish(self) -> Result<(), DatasetError> {
        let folder = || self.folder.display().to_string();
        std::fs::rename(self.partial.path(), &self.folder).map_err(|error| match self.folder.exists() {
            true => DatasetError::FolderExists { folder: folder() }, // another process was faster
            false => DatasetError::Io { file: folder(), error },
        })?;
        let _ = self.partial.keep(); // it has another name now
        Ok(())
    }
}

fn file_name(array: ArrayName) -> String {
    format!("{}.npy", array.spec().name)
}

/// By the name that the file was to have: the one that it has until then is gone when this is read.
fn failed_array(folder: &Path, array: ArrayName, error: io::Error) -> DatasetError {
    DatasetError::Io { file: folder.join(file_name(array)).display().to_string(), error }
}

/// Bytes of a header: enough for four axes.
const HEADER: usize = 128;

fn header(array: ArrayName, dataset: &Dataset) -> Vec<u8> {
    let descr = match array.spec().dtype {
        Dtype::F32 => "<f4",
        Dtype::I32 => "<i4",
        Dtype::Bool => "|b1",
        other => unreachable!("no array of a dataset has elements of {}", other.name()),
    };
    let axes = std::iter::once(n_rows(array, dataset)).chain(array.row_shape(&dataset.sizes()));
    let shape: String = axes.map(|length| format!("{length}, ")).collect();
    let dict = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({}), }}", shape.trim_end());
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(((HEADER - bytes.len() - 2) as u16).to_le_bytes());
    bytes.extend(dict.as_bytes());
    bytes.resize(HEADER - 1, b' ');
    bytes.push(b'\n');
    bytes
}

fn n_rows(array: ArrayName, dataset: &Dataset) -> usize {
    array.n_rows(dataset.n_steps(), dataset.episodes().len())
}

fn row_bytes(array: ArrayName, dataset: &Dataset) -> usize {
    array.row_bytes(&dataset.sizes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::tests::recorded;

    /// The message of the second was "Directory not empty".
    #[test]
    fn two_expansions_at_once_write_one_folder() {
        let dataset = recorded(1);
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("arrays");
        let [first, second] = [(); 2].map(|()| Files::create(&dataset, &folder, [true; 12]).unwrap());
        first.finish().unwrap();
        let error = second.finish().unwrap_err().to_string();
        assert!(error.ends_with("arrays: exists; the arrays must be written to a new folder"), "{error}");
        assert_eq!(std::fs::read_dir(parent.path()).unwrap().count(), 1, "nothing is left beside it");
    }

    /// On a full disk, the message was "obs.npy: No space left", of whatever folder.
    #[test]
    fn a_file_that_cannot_be_written_is_named_with_its_folder() {
        let dataset = recorded(1);
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("arrays");
        let wanted = ArrayName::ALL.map(|array| array == ArrayName::Obs);
        let mut files = Files::create(&dataset, &folder, wanted).unwrap();
        let path = files.partial.path().join("obs.npy");
        files.arrays[0].1 = File::open(path).unwrap(); // to be read, so that writing fails
        let written = dataset.play(wanted, None, 1, &mut || false, |chunk| files.write(&dataset, &chunk));
        let error = written.map(|_| ()).unwrap_err().to_string();
        assert!(error.starts_with(&format!("{}: ", folder.join("obs.npy").display())), "{error}");
    }
}
