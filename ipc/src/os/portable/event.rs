//! How a process of a pool wakes another: by a datagram to a port of this machine, whose number is in shared
//! memory with what happened. Others on this machine can send one too, and only wake the process for nothing.

#![allow(unsafe_code)] // implements unsafe functions of iceoryx2's traits

use crate::os::variant::Storage;
use iceoryx2::prelude::{FileName, Path as FolderPath};
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_bb_lock_free::mpmc::counting_bit_set::RelocatableCountingBitSet;
use iceoryx2_cal::event::common::EventImpl;
use iceoryx2_cal::event::trigger::{Configuration, HandlerInterface, State, WaiterInterface};
use iceoryx2_cal::event::{ListenerCreateError, ListenerWaitError, NotifierNotifyError, NotifierOpenError};
use iceoryx2_cal::named_concept::{NamedConceptPathHintRemoveError, NamedConceptRemoveError};
use std::io::{Error, ErrorKind, Result as IoResult};
use std::mem::MaybeUninit;
use std::net::{Ipv4Addr, UdpSocket};
use std::ptr::NonNull;
use std::time::Duration;

type Events = RelocatableCountingBitSet;

/// The port of a listener.
type Port = u16;

/// The events of pools.
pub(crate) type Trigger = EventImpl<Events, Port, Storage<State<Events, Port>>, Notifier, Listener>;

/// Wakes a listener.
#[derive(Debug)]
pub struct Notifier(UdpSocket);

/// Waits for notifiers. Its socket blocks, except while it is emptied.
#[derive(Debug)]
pub struct Listener(UdpSocket);

/// Datagrams that are taken from a socket at once. More are sent by nobody who means well, and wake the
/// process again; taken until there are none, they would keep it for as long as they come.
const MOST_AT_ONCE: usize = 64;

fn socket() -> IoResult<UdpSocket> {
    UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))
}

impl Notifier {
    fn of(port: Port) -> IoResult<Notifier> {
        let socket = socket()?;
        socket.connect((Ipv4Addr::LOCALHOST, port))?;
        socket.set_nonblocking(true)?;
        Ok(Notifier(socket))
    }
}

impl HandlerInterface<Events, Port, Storage<State<Events, Port>>> for Notifier {
    fn open(_: &FileName, _: &Configuration, port: &Port) -> Result<Notifier, NotifierOpenError> {
        Notifier::of(*port).map_err(|_| NotifierOpenError::InternalFailure)
    }

    fn notify(&self) -> Result<(), NotifierNotifyError> {
        match self.0.send(&[0]) {
            Ok(_) => Ok(()),
            Err(error) => Err(match error.kind() {
                ErrorKind::WouldBlock => NotifierNotifyError::BufferIsFull,
                ErrorKind::Interrupted => NotifierNotifyError::Interrupt,
                ErrorKind::ConnectionRefused | ErrorKind::ConnectionReset => {
                    NotifierNotifyError::Disconnected
                }
                _ => NotifierNotifyError::InternalFailure,
            }),
        }
    }
}

impl Listener {
    /// Waits for one datagram; also none is fine.
    fn receive(&self) -> Result<(), ListenerWaitError> {
        match self.0.recv(&mut [0; 8]) {
            Ok(_) => Ok(()),
            Err(error) => match error.kind() {
                ErrorKind::Interrupted => Err(ListenerWaitError::InterruptSignal),
                _ if is_none(&error) => Ok(()),
                _ => Err(ListenerWaitError::InternalFailure),
            },
        }
    }

    fn empty(&self) -> IoResult<()> {
        self.0.set_nonblocking(true)?;
        let error = (0..MOST_AT_ONCE).find_map(|_| self.0.recv(&mut [0; 8]).err());
        self.0.set_nonblocking(false)?;
        error.filter(|error| !is_none(error)).map_or(Ok(()), Err)
    }
}

/// Whether there was no datagram: each system has its own errors for it.
fn is_none(error: &Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::ConnectionReset)
}

fn failed(_: Error) -> ListenerWaitError {
    ListenerWaitError::InternalFailure
}

impl WaiterInterface<Events, Port, Storage<State<Events, Port>>> for Listener {
    const IS_FILE_DESCRIPTOR_BASED: bool = false;

    unsafe fn remove(_: &FileName, _: &Configuration) -> Result<bool, NamedConceptRemoveError> {
        Ok(true) // a socket ends with its process
    }

    fn remove_path_hint(_: &FolderPath) -> Result<(), NamedConceptPathHintRemoveError> {
        Ok(())
    }

    fn create(
        _: &FileName,
        _: &Configuration,
        port: &mut MaybeUninit<Port>,
    ) -> Result<Listener, ListenerCreateError> {
        let socket = socket().map_err(|_| ListenerCreateError::InternalFailure)?;
        port.write(socket.local_addr().map_err(|_| ListenerCreateError::InternalFailure)?.port());
        Ok(Listener(socket))
    }

    fn try_wait(&self) -> Result<(), ListenerWaitError> {
        self.empty().map_err(failed)
    }

    fn timed_wait(&self, timeout: Duration) -> Result<(), ListenerWaitError> {
        if timeout.is_zero() {
            return self.try_wait();
        }
        self.0.set_read_timeout(Some(timeout)).map_err(failed)?;
        self.receive()
    }

    fn blocking_wait(&self) -> Result<(), ListenerWaitError> {
        self.0.set_read_timeout(None).map_err(failed)?;
        self.receive()
    }

    fn empty_buffer(&self) -> Result<(), ListenerWaitError> {
        self.empty().map_err(failed)
    }
}

// Their sockets close, as at the end of their process.

impl Abandonable for Notifier {
    unsafe fn abandon_in_place(mut this: NonNull<Self>) {
        // SAFETY: the caller does not use it again.
        unsafe { std::ptr::drop_in_place(&raw mut this.as_mut().0) }
    }
}

impl Abandonable for Listener {
    unsafe fn abandon_in_place(mut this: NonNull<Self>) {
        // SAFETY: the caller does not use it again.
        unsafe { std::ptr::drop_in_place(&raw mut this.as_mut().0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    #[test]
    fn a_datagram_wakes_a_listener_once() {
        let listener = Listener(socket().expect("a socket"));
        let port = listener.0.local_addr().expect("an address").port();
        let notifier = Notifier::of(port).expect("a socket");
        let waits = |timeout| {
            let begin = Instant::now();
            listener.timed_wait(timeout).expect("a socket");
            begin.elapsed()
        };
        let (long, short) = (Duration::from_secs(20), Duration::from_millis(20));
        notifier.notify().expect("a listener");
        notifier.notify().expect("a listener");
        assert!(waits(long) < long);
        listener.empty_buffer().expect("a socket");
        assert!(waits(short) >= short / 2);
        listener.try_wait().expect("nothing to wait for");
        notifier.notify().expect("a listener");
        listener.blocking_wait().expect("a datagram");
    }

    /// A process of another user that sent one after the other kept a pool from its work.
    #[test]
    fn a_listener_takes_a_limited_number_of_datagrams_at_once() {
        let listener = Listener(socket().expect("a socket"));
        let notifier = Notifier::of(listener.0.local_addr().expect("an address").port()).expect("a socket");
        for _ in 0..MOST_AT_ONCE + 1 {
            notifier.notify().expect("a listener");
        }
        listener.empty_buffer().expect("a socket");
        let begin = Instant::now();
        listener.timed_wait(Duration::from_secs(20)).expect("a socket");
        assert!(begin.elapsed() < Duration::from_secs(20), "the last one was not left");
    }

    #[test]
    fn a_listener_that_is_gone_is_no_failure() {
        let listener = Listener(socket().expect("a socket"));
        let notifier = Notifier::of(listener.0.local_addr().expect("an address").port()).expect("a socket");
        drop(listener);
        for _ in 0..3 {
            let notified = notifier.notify();
            assert!(matches!(notified, Ok(()) | Err(NotifierNotifyError::Disconnected)), "{notified:?}");
        }
    }
}
