//! Memory of this process. The transport panics where it gets none, so it is asked for before.

use crate::error::IpcError;

/// Too little memory.
#[derive(Debug, thiserror::Error)]
#[error(
    "this system does not give a process {needed} bytes of memory ({for_what}); use fewer environments, or \
     leave fields out"
)]
pub struct TooLittleMemory {
    needed: usize,
    for_what: String,
}

/// Bytes that iceoryx2 needs beside frames and requests for the ports of one process at one lane.
pub(crate) const PORTS: usize = 128 << 10;

/// Checks that `needed` bytes can be had, in one piece: where the system keeps what it promises, as Windows
/// does. macOS promises more memory than it has.
pub(crate) fn check_room(needed: usize, for_what: &str) -> Result<(), TooLittleMemory> {
    let mut memory = Vec::<u8>::new();
    let taken = memory.try_reserve_exact(needed);
    std::hint::black_box(&memory); // nothing uses it, so the compiler might not ask for it
    taken.map_err(|_| TooLittleMemory { needed, for_what: for_what.to_owned() })
}

/// Has every page of the data segments set aside; `false` if `interrupted` returned `true` meanwhile.
pub(crate) fn reserve_segments<E: From<TooLittleMemory> + From<IpcError>>(
    _for_what: &str,
    _interrupted: &mut dyn FnMut() -> bool,
) -> Result<bool, E> {
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::check_room;

    /// A pool of a million environments was a panic of the transport.
    #[test]
    fn memory_that_nobody_has_is_an_error() {
        check_room(1 << 20, "test").expect("a megabyte");
        let error = check_room(usize::MAX / 4, "frames").expect_err("more than there is");
        assert!(error.to_string().contains("(frames)"), "{error}");
    }
}
