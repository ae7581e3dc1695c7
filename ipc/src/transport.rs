//! The pool's transport over iceoryx2: frames are loaned, filled in shared memory and sent; requests are read
//! there.

// A loaned sample is shared memory that the operating system zeroed, not uninitialised Rust memory.
#![allow(unsafe_code)]

use crate::os::variant::PoolService;
use crate::refusals::Refusals;
use crate::services::{
    FrameLoan, FramePublisher, IpcError, IpcListener, IpcNotifier, RequestSubscriber, doing,
};
use crate::wire::{FrameHeader, MAGIC, ReadRequest, RequestHeader, read_once, read_request};
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::sample::Sample;
use smaclite_pool::Rejection;
use smaclite_pool::layout::{FORMAT_VERSION, Layout};
use smaclite_pool::transport::{
    Doorbell, Epoch, FrameContent, Inlet, Message, Outlet, Received, Request, Transport, TransportError,
};
use std::sync::Arc;
use std::time::Duration;

/// Lanes over iceoryx2.
pub(crate) struct Iceoryx;

impl Transport for Iceoryx {
    type Inlet = RequestInlet;
    type Outlet = FrameOutlet;
    type Doorbell = WorkBell;
}

/// A received request in shared memory.
pub(crate) struct RequestMessage {
    sample: Sample<PoolService, [u8], RequestHeader>,
    /// What its header said when it was received.
    read: ReadRequest,
}

impl RequestMessage {
    pub(crate) fn read(
        sample: Sample<PoolService, [u8], RequestHeader>,
        layout: &Layout,
    ) -> Result<RequestMessage, Rejection> {
        let read = read_request(read_once(sample.user_header()), sample.payload(), layout)?;
        Ok(RequestMessage { sample, read })
    }
}

impl Message for RequestMessage {
    fn request(&self) -> Request<'_> {
        self.read.request(self.sample.payload())
    }

    fn waited(&self) -> Duration {
        self.read.waited()
    }
}

/// A lane's requests.
pub(crate) struct RequestInlet {
    pub(crate) subscriber: Arc<RequestSubscriber>,
    pub(crate) layout: Arc<Layout>,
}

impl Inlet for RequestInlet {
    type Message = RequestMessage;

    fn receive(&mut self) -> Result<Received<RequestMessage>, TransportError> {
        let sample = self.subscriber.receive().map_err(doing("receiving a request")).map_err(boxed)?;
        let message = sample.map(|sample| RequestMessage::read(sample, &self.layout));
        Ok(match message {
            None => Received::Nothing,
            Some(Ok(message)) => Received::Request(message),
            Some(Err(rejection)) => Received::Malformed(rejection),
        })
    }
}

/// A lane's frames.
pub(crate) struct FrameOutlet {
    pub(crate) publisher: Arc<FramePublisher>,
    pub(crate) notifier: Arc<IpcNotifier>,
    pub(crate) layout: Arc<Layout>,
    pub(crate) refusals: Refusals,
    pub(crate) sequence: u64,
}

// SAFETY: a loan is a chunk of the publisher's data segment, which stays mapped for as long as the loan
// lives; nothing else has its address before it is sent.
unsafe impl Outlet for FrameOutlet {
    type Loan = FrameLoan;

    fn loan(&mut self) -> Result<FrameLoan, TransportError> {
        let loan = self.publisher.loan_slice_uninit(self.layout.bytes());
        loan.map_err(|error| {
            let _ = self.publisher.update_connections(); // recovers the frames of readers that are gone
            boxed(doing("loaning memory for a frame")(error))
        })
    }

    fn payload(loan: &mut FrameLoan) -> &mut [u8] {
        let payload = loan.payload_mut();
        // SAFETY: the bytes lie in a shared-memory mapping, which the kernel zeroes, so they are initialised,
        // by the kernel or by earlier frames; `u8` has no invalid values; the borrow is that of the loan.
        unsafe { std::slice::from_raw_parts_mut(payload.as_mut_ptr().cast::<u8>(), payload.len()) }
    }

    fn publish(&mut self, mut loan: FrameLoan, epoch: Option<Epoch>, content: FrameContent) {
        if let FrameContent::Rejection { request: Some(request), len } = content
            && self.refusals.keep_unless_first(epoch, request, &Self::payload(&mut loan)[..len])
        {
            return;
        }
        self.sequence += 1;
        let (rejection_len, request) = match content {
            FrameContent::Batch => (0, 0),
            FrameContent::Rejection { request, len } => (len as u32, request.map_or(0, |number| number.0)),
        };
        *loan.user_header_mut() = FrameHeader {
            magic: MAGIC,
            version: FORMAT_VERSION,
            layout_hash: self.layout.hash(),
            session: epoch.map_or(0, |epoch| epoch.session.0),
            epoch: epoch.and_then(|epoch| epoch.reset).map_or(0, |number| number.0),
            sequence: self.sequence,
            slots: self.layout.slots() as u32,
            rejection_len,
            request,
        };
        // SAFETY: as in `payload`: every byte is initialised.
        let sent = unsafe { loan.assume_init() }.send();
        // An error means that the connection of a reader broke. The others got the frame, and the session
        // of a dead reader ends.
        if let Err(error) = sent {
            tracing::debug!(?error, "a frame did not reach every reader");
        }
        if let Err(error) = self.notifier.notify() {
            tracing::debug!(?error, "a reader could not be woken");
        }
    }
}

fn boxed(error: IpcError) -> TransportError {
    TransportError(Box::new(error))
}

/// Wakes the server, which receives the requests of all lanes.
pub(crate) struct WorkBell {
    pub(crate) listener: IpcListener,
    pub(crate) notifier: IpcNotifier,
}

impl Doorbell for WorkBell {
    fn wait(&self, timeout: Duration) {
        // An interrupted wait is a short wait: the caller checks for work and waits again.
        let _ = self.listener.timed_wait(|_| {}, timeout);
    }

    fn ring(&self) {
        let _ = self.notifier.notify();
    }
}
