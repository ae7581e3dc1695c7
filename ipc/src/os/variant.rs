//! The variant of iceoryx2's services that pools use: the thread-safe one, with every file in one folder.
//!
//! iceoryx2's own variants put segments directly into `/dev/shm`, where all users see their names and can put
//! files beside them. A program cannot defend itself against that (iceoryx2 0.10.0 and iceoryx2-cal 0.10.0):
//!
//! - The counter of nodes (`node/global_management_segment.rs`) has a fixed name, is created with access
//!   for all users (`dynamic_storage/posix_shared_memory.rs`, `init_impl`), and is used also if another
//!   user created it.
//! - Names of connections consist of the ids of two ports, which other names show already. After the death of
//!   a process its connections are searched in all of `/dev/shm` and opened, also those that another user
//!   created (`service/stale_resource_cleanup.rs`).
//! - An empty segment is waited for without a limit (`posix_shared_memory.rs`, `open_impl`,
//!   `MappingSizeIsZero`).
//!
//! The storages used here map files below the root path of iceoryx2's configuration. On Linux that is a
//! folder of mode 0700 in `/dev/shm` (see `shm_dir`), so it is the same memory, and no other user can list,
//! open or make anything in it. They close these files as soon as they are mapped or read.
//!
//! On Windows, iceoryx2 writes a line to the terminal for most of its calls of the system, also for those
//! that succeed (iceoryx2-pal-posix 0.10.0, `windows/win32_call.rs`), and nothing silences it. So there the
//! locks of nodes and the wakes of events are others too.

mod mapped_file;
mod small_file;

use crate::os::{Event, Monitoring};
use iceoryx2::prelude::{Service, ZeroCopySend, ipc_threadsafe};
use iceoryx2::service::internal::ServiceInternal;
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_cal::resizable_shared_memory::dynamic::DynamicMemory;
use iceoryx2_cal::serialize::postcard::Postcard;
use iceoryx2_cal::shared_memory::common::details::{AllocatorDetails, Memory};
use iceoryx2_cal::shm_allocator::bump_allocator::BumpAllocator;
use iceoryx2_cal::shm_allocator::pool_allocator::PoolAllocator;
use iceoryx2_cal::zero_copy_connection::common::details::{Connection, SharedManagementData};
pub(crate) use mapped_file::Storage;
use std::fmt::Debug;

/// iceoryx2's service for processes whose threads share ports, with all files below the root path.
#[derive(Clone, Debug)]
pub struct PoolService {}

type Base = ipc_threadsafe::Service;

impl Service for PoolService {
    type ServiceNameHasher = <Base as Service>::ServiceNameHasher;
    type StaticStorage = small_file::Storage;
    type ConfigSerializer = Postcard;
    type PersistentDynamicStorage<T: Debug + Send + Sync + ZeroCopySend + 'static> = Storage<T>;
    type Bag = <Base as Service>::Bag;
    type DynamicStorage<T: Debug + Send + Sync + ZeroCopySend + 'static> = Storage<T>;
    type SharedMemory = Memory<PoolAllocator, Storage<AllocatorDetails<PoolAllocator>>>;
    type ResizableSharedMemory = DynamicMemory<PoolAllocator, Self::SharedMemory>;
    type Connection = Connection<Storage<SharedManagementData>>;
    type Event = Event;
    type Monitoring = Monitoring;
    type Reactor = <Base as Service>::Reactor;
    type ArcThreadSafetyPolicy<T: Send + Debug + Abandonable> = <Base as Service>::ArcThreadSafetyPolicy<T>;
    type BlackboardMgmt<T: Send + Sync + Debug + ZeroCopySend + 'static> = Storage<T>;
    type BlackboardPayload = Memory<BumpAllocator, Storage<AllocatorDetails<BumpAllocator>>>;
    type UniqueId = <Base as Service>::UniqueId;
}

impl ServiceInternal<PoolService> for PoolService {}
