//! The variant of iceoryx2's services that pools use: the thread-safe one of one process, in its own memory.
//!
//! It differs from iceoryx2's own in its events, which wait by semaphores: those of iceoryx2 0.10 need a pair
//! of Unix sockets, which Wine does not have.

use iceoryx2::prelude::{Service, ZeroCopySend, local_threadsafe};
use iceoryx2::service::internal::ServiceInternal;
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_bb_lock_free::mpmc::counting_bit_set::RelocatableCountingBitSet;
use iceoryx2_cal::dynamic_storage::recommended::Local;
use iceoryx2_cal::event::trigger::State;
use iceoryx2_cal::event::trigger::semaphore::{GenericSemaphoreTrigger, SemaphoreMgmt};
use iceoryx2_cal::serialize::postcard::Postcard;
use std::fmt::Debug;

/// iceoryx2's service for threads that share ports.
#[derive(Clone, Debug)]
pub struct PoolService {}

type Base = local_threadsafe::Service;

impl Service for PoolService {
    type ServiceNameHasher = <Base as Service>::ServiceNameHasher;
    type StaticStorage = <Base as Service>::StaticStorage;
    type ConfigSerializer = Postcard;
    type PersistentDynamicStorage<T: Debug + Send + Sync + ZeroCopySend + 'static> =
        <Base as Service>::PersistentDynamicStorage<T>;
    type Bag = <Base as Service>::Bag;
    type DynamicStorage<T: Debug + Send + Sync + ZeroCopySend + 'static> =
        <Base as Service>::DynamicStorage<T>;
    type SharedMemory = <Base as Service>::SharedMemory;
    type ResizableSharedMemory = <Base as Service>::ResizableSharedMemory;
    type Connection = <Base as Service>::Connection;
    type Event = GenericSemaphoreTrigger<
        RelocatableCountingBitSet,
        Local<State<RelocatableCountingBitSet, SemaphoreMgmt>>,
    >;
    type Monitoring = <Base as Service>::Monitoring;
    type Reactor = <Base as Service>::Reactor;
    type ArcThreadSafetyPolicy<T: Send + Debug + Abandonable> = <Base as Service>::ArcThreadSafetyPolicy<T>;
    type BlackboardMgmt<T: Send + Sync + Debug + ZeroCopySend + 'static> =
        <Base as Service>::BlackboardMgmt<T>;
    type BlackboardPayload = <Base as Service>::BlackboardPayload;
    type UniqueId = <Base as Service>::UniqueId;
}

impl ServiceInternal<PoolService> for PoolService {}
