//! Batches that Python objects hold. The places that they lie in are used again, so that a step allocates
//! nothing but its Python object.

use smaclite_ipc::Batch;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError, RwLock};

/// One of the holders of a batch, which is given back with the last of them.
pub struct Held(Arc<Place>);

#[derive(Default)]
struct Place {
    /// `None` once there is no holder.
    batch: RwLock<Option<Batch>>,
    holders: AtomicUsize,
}

impl Place {
    /// Adds a holder, if there is one.
    fn join(self: &Arc<Place>) -> Option<Held> {
        let more = |holders| (holders > 0).then_some(holders + 1);
        // The lock of the batch publishes it; the count publishes nothing.
        let joined = self.holders.fetch_update(Ordering::Relaxed, Ordering::Relaxed, more);
        joined.is_ok().then(|| Held(Arc::clone(self)))
    }
}

impl Held {
    /// A batch in a place of its own.
    pub fn alone(batch: Batch) -> Held {
        Places::default().hold(batch)
    }

    /// Calls `read` with the batch.
    pub fn with<R>(&self, read: impl FnOnce(&Batch) -> R) -> R {
        let batch = self.0.batch.read().unwrap_or_else(PoisonError::into_inner);
        read(batch.as_ref().expect("a held place has a batch"))
    }
}

impl Clone for Held {
    fn clone(&self) -> Held {
        self.0.join().expect("this is a holder")
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        if self.0.holders.fetch_sub(1, Ordering::AcqRel) == 1 {
            *self.0.batch.write().unwrap_or_else(PoisonError::into_inner) = None;
        }
    }
}

/// The places of a lane's batches.
#[derive(Default)]
pub struct Places(Mutex<Vec<Arc<Place>>>);

impl Places {
    /// Puts a batch, the newest, into a free place.
    pub fn hold(&self, batch: Batch) -> Held {
        let mut places = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // A place without a holder whose batch is still there is about to be emptied.
        let is_free = |place: &Arc<Place>| {
            place.holders.load(Ordering::Acquire) == 0 && place.batch.try_read().is_ok_and(|b| b.is_none())
        };
        let index = places.iter().position(is_free).unwrap_or_else(|| {
            places.push(Arc::default());
            places.len() - 1
        });
        places.swap(0, index);
        let place = &places[0];
        *place.batch.write().unwrap_or_else(PoisonError::into_inner) = Some(batch);
        place.holders.store(1, Ordering::Release);
        Held(Arc::clone(place))
    }

    /// The newest batch, if it is still held.
    pub fn newest(&self) -> Option<Held> {
        let places = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        places.first().and_then(Place::join)
    }
}
