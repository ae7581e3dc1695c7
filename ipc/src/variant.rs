//! The variant of iceoryx2's services that pools use: the thread-safe one, with ids made of random numbers.
//!
//! iceoryx2 0.10 draws the id of a node from a counter in `/dev/shm` (`unique_id_generator/unique_system_id.rs`,
//! `node/global_management_segment.rs`). That counter is the only file of iceoryx2 that is made for all users
//! (`enable_global_access(true)`; the mode becomes 0666 in `dynamic_storage/posix_shared_memory.rs`, `init_impl`), it
//! has a fixed name, it is opened if it is there, whoever made it, and one of size 0 is waited for without a limit
//! (`open_impl`, `MappingSizeIsZero`). With an id generator of our own it is never opened or made. Every other
//! segment is made with `O_EXCL` and mode 0200 and becomes 0600, so no other user can ever open it.
//!
//! The names of the other segments hold the ids of the ports they belong to. iceoryx2 makes those from the process
//! number, the time and a counter; random ones cannot be predicted, so a name cannot be occupied in advance.

#![allow(unsafe_code)] // iceoryx2 takes an id only on the promise that it is unique

use iceoryx2::config::Config;
use iceoryx2::prelude::{Service, ZeroCopySend, ipc_threadsafe};
use iceoryx2::service::internal::ServiceInternal;
use iceoryx2::unique_id_generator::{Entity, UniqueId, UniqueIdGenerator, UniqueIdGeneratorGenerateError};
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use rustix::rand::{GetRandomFlags, getrandom};
use std::fmt::Debug;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// iceoryx2's service for processes whose threads share ports, with [`RandomIds`].
#[derive(Clone, Debug)]
pub struct PoolService {}

type Base = ipc_threadsafe::Service;

impl Service for PoolService {
    type ServiceNameHasher = <Base as Service>::ServiceNameHasher;
    type StaticStorage = <Base as Service>::StaticStorage;
    type ConfigSerializer = <Base as Service>::ConfigSerializer;
    type PersistentDynamicStorage<T: Debug + Send + Sync + ZeroCopySend + 'static> =
        <Base as Service>::PersistentDynamicStorage<T>;
    type Bag = <Base as Service>::Bag;
    type DynamicStorage<T: Debug + Send + Sync + ZeroCopySend + 'static> =
        <Base as Service>::DynamicStorage<T>;
    type SharedMemory = <Base as Service>::SharedMemory;
    type ResizableSharedMemory = <Base as Service>::ResizableSharedMemory;
    type Connection = <Base as Service>::Connection;
    type Event = <Base as Service>::Event;
    type Monitoring = <Base as Service>::Monitoring;
    type Reactor = <Base as Service>::Reactor;
    type ArcThreadSafetyPolicy<T: Send + Debug + Abandonable> = <Base as Service>::ArcThreadSafetyPolicy<T>;
    type BlackboardMgmt<T: Send + Sync + Debug + ZeroCopySend + 'static> =
        <Base as Service>::BlackboardMgmt<T>;
    type BlackboardPayload = <Base as Service>::BlackboardPayload;
    type UniqueId = RandomIds;
}

impl ServiceInternal<PoolService> for PoolService {}

/// Ids of 104 bits: 64 random ones, and 40 that count up from a random number.
///
/// iceoryx2 calls the upper half of an id its unique value, which must differ within a process; by that of a node's id
/// it also tells the owners of a service's resources apart. It writes ids into names as decimal numbers, and
/// [`MAX_ID_DIGITS`] of them must fit into the path of a socket: hence 40 bits and not 64.
#[derive(Debug)]
pub struct RandomIds;

/// Bits of an id's unique value.
const UNIQUE_BITS: u32 = 40;

/// Digits of 2^104 - 1.
pub(crate) const MAX_ID_DIGITS: usize = 32;

impl UniqueIdGenerator for RandomIds {
    fn generate<S: Service>(_: Entity, _: &Config) -> Result<UniqueId, UniqueIdGeneratorGenerateError> {
        static NEXT: OnceLock<AtomicU64> = OnceLock::new();
        let failed = |_| UniqueIdGeneratorGenerateError::GenerationError;
        let [secret, start] = [random().map_err(failed)?, random().map_err(failed)?];
        // Relaxed: the number is all there is.
        let next = NEXT.get_or_init(|| AtomicU64::new(start)).fetch_add(1, Ordering::Relaxed);
        let unique = next & ((1 << UNIQUE_BITS) - 1);
        let value = u128::from(unique) << 64 | u128::from(secret);
        // SAFETY: the upper half differs for the first 2^40 ids of a process.
        Ok(unsafe { UniqueId::from_raw_id(value) })
    }
}

/// A number from the system's generator.
pub(crate) fn random() -> std::io::Result<u64> {
    let mut bytes = [0; 8];
    // At most 256 bytes come whole (getrandom(2)).
    getrandom(&mut bytes, GetRandomFlags::empty())?;
    Ok(u64::from_ne_bytes(bytes))
}
