//! A received frame, read in place. The memory stays valid and unchanged for as long as the batch exists,
//! also after its client and its supervisor are gone.

#![allow(unsafe_code)] // reads the sample at an address taken once

use crate::process_owned::ProcessOwned;
use crate::services::{FramePort, FrameSample};
use crate::wire::FrameHeader;
use smaclite_pool::fields::Field;
use smaclite_pool::layout::{Element, Layout};
use std::fmt;
use std::ptr::NonNull;
use std::sync::Arc;

/// One batch: M slots of every field of the lane, read in place.
///
/// Row `i` of each field belongs to the environment `env_id()[i]`; in a synchronous lane, that is `i`. A
/// batch keeps its memory: as long as it exists, nothing writes there, also if its client and the pool are
/// gone. A lane has memory for few batches, so copy what is kept for long (a rollout) and drop the batch.
///
/// # Example
///
/// ```
/// use smaclite_ipc::{Client, WaitOptions};
/// use smaclite_pool::fields::Field;
/// # use smaclite_ipc::{LaneConfig, RuntimeDir, Supervisor, SupervisorConfig};
/// # use smaclite_engine::BattleSetup;
/// # use smaclite_scenarios::ScenarioFiles;
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let folder = tempfile::tempdir()?;
/// # let runtime_dir = RuntimeDir::at(folder.path().to_owned())?;
/// # let (_, files) = ScenarioFiles::resolve("3m")?;
/// # let lanes = vec![LaneConfig::new("3m", BattleSetup::new(files), 2)];
/// # let (name, options) = ("train".to_owned(), Default::default());
/// # let config = SupervisorConfig { name, lanes, options, runtime_dir: runtime_dir.clone() };
/// # let supervisor = Supervisor::start(config)?;
///
/// let wait = WaitOptions::forever();
/// let mut client = Client::connect(&runtime_dir, "train", None, Default::default(), wait)?;
/// let sizes = client.description().sizes;
/// let batch = client.reset(Some(1), None, WaitOptions::forever())?;
/// assert_eq!(batch.env_id(), [0, 1]);
/// for obs in batch.obs().chunks_exact(sizes.n_agents * sizes.obs_size) {
///     assert!(obs.iter().all(|x| (-1.0..=1.0).contains(x)));
/// }
/// let available = batch.field::<u8>(Field::AvailActions).ok_or("the lane leaves it out")?;
/// assert_eq!(available.len(), 2 * sizes.n_agents * sizes.n_actions);
/// drop((client, supervisor));
/// assert_eq!(batch.sequence(), 1); // it is still there
/// # Ok(())
/// # }
/// ```
///
/// # At the edges
///
/// [`field`](Batch::field) is `None` for a field that the lane leaves out, and panics if the type is not the
/// field's.
/// In a forked child it is readable, but unchanged only while the parent holds it: the child's copy holds
/// nothing, so after the parent drops it a later frame may be written there.
pub struct Batch {
    _held: ProcessOwned<Held>,
    /// The sample's payload.
    bytes: NonNull<[u8]>,
    header: FrameHeader,
    layout: Arc<Layout>,
}

impl fmt::Debug for Batch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Batch").field("header", &self.header).finish_non_exhaustive()
    }
}

/// What keeps the memory mapped and unchanged; dropped in this order. Nothing but the drop uses it: to ask a
/// sample for its payload locks a mutex of its port, which a thread of the parent may have locked at the
/// moment of a fork.
struct Held {
    _sample: FrameSample,
    _port: Arc<FramePort>,
}

// SAFETY: everything but `bytes` is `Send` by itself; the sample is, because iceoryx2 declares it. `bytes` is
// the address of memory that any thread may read.
unsafe impl Send for Batch {}

// SAFETY: a shared batch reads `bytes`, `header` and `layout`, which nothing changes, and does not use
// `_held` before it is dropped, which takes the batch by value.
unsafe impl Sync for Batch {}

impl Batch {
    pub(crate) fn new(sample: FrameSample, layout: Arc<Layout>, port: Arc<FramePort>) -> Batch {
        let (bytes, header) = (NonNull::from(sample.payload()), *sample.user_header());
        let _held = ProcessOwned::new(Held { _sample: sample, _port: port });
        Batch { _held, bytes, header, layout }
    }

    /// Where each field lies.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The frame's bytes in shared memory.
    pub fn bytes(&self) -> &[u8] {
        // SAFETY: `new` took the address from the sample, whose memory is mapped, initialised, and written by
        // no process until the sample is given back. Only the drop of `_held` does that, and the borrow is
        // that of the batch. A forked child never gives it back, so there it stays mapped; what the parent
        // may do there is in the type's documentation.
        unsafe { self.bytes.as_ref() }
    }

    /// The frame's header.
    pub fn header(&self) -> &FrameHeader {
        &self.header
    }

    /// Counts the frames of the lane, from 1.
    pub fn sequence(&self) -> u64 {
        self.header().sequence
    }

    /// All elements of a field, slot after slot, or `None` if the lane leaves it out.
    ///
    /// # Panics
    /// If `T` is not the field's type ([`Field::spec`]).
    pub fn field<T: Element>(&self, field: Field) -> Option<&[T]> {
        self.layout.view(self.bytes(), field)
    }

    fn always<T: Element>(&self, field: Field) -> &[T] {
        self.field(field).expect("no lane leaves this field out")
    }

    /// `[M]`: which environment each slot is.
    pub fn env_id(&self) -> &[i32] {
        self.always(Field::EnvId)
    }

    /// `[M]`: team reward of the step just made.
    pub fn reward(&self) -> &[f32] {
        self.always(Field::Reward)
    }

    /// `[M]`, 0 or 1: the battle ended.
    pub fn terminated(&self) -> &[u8] {
        self.always(Field::Terminated)
    }

    /// `[M]`, 0 or 1: the episode limit was reached.
    pub fn truncated(&self) -> &[u8] {
        self.always(Field::Truncated)
    }

    /// `[M]`, 0 or 1: no step was made, so actions were ignored and there is nothing to learn from. So it is
    /// with next-step autoreset after the end of an episode, and after a reset, a restore or a fork, also in
    /// the environments that they only observed again.
    pub fn was_reset(&self) -> &[u8] {
        self.always(Field::WasReset)
    }

    /// `[M, n_agents, obs_size]`, row-major; empty if the lane leaves it out.
    pub fn obs(&self) -> &[f32] {
        self.field(Field::Obs).unwrap_or(&[])
    }
}
