//! A bare iceoryx2 ping-pong between two processes: the lower bound of a round trip through it.

use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::*;
use smaclite_ipc::WaitStrategy;
use smaclite_pool::Polling;
use std::error::Error;
use std::time::{Duration, Instant};

type Ipc = ipc_threadsafe::Service;

/// One of the two processes: what it sends with and what it receives with.
pub(crate) struct Endpoint {
    publisher: Publisher<Ipc, [u8], ()>,
    subscriber: Subscriber<Ipc, [u8], ()>,
    notifier: Notifier<Ipc>,
    listener: Listener<Ipc>,
    polling: Polling,
    _node: Node<Ipc>,
}

impl Endpoint {
    pub(crate) fn open(
        name: &str,
        wait: WaitStrategy,
        out: &str,
        back: &str,
    ) -> Result<Endpoint, Box<dyn Error>> {
        set_log_level(LogLevel::Fatal);
        // iceoryx2 never removes some of its files. Other programs must not find them under the default
        // prefix.
        let mut config = Config::default();
        config.global.prefix = FileName::new(b"smaclite_ping_")?;
        let node = NodeBuilder::new().config(&config);
        let node = node.signal_handling_mode(SignalHandlingMode::Disabled).create::<Ipc>()?;
        let data = |what: &str| -> Result<_, Box<dyn Error>> {
            let service = node.service_builder(&format!("{name}/{what}").as_str().try_into()?);
            Ok(service.publish_subscribe::<[u8]>().enable_safe_overflow(true).open_or_create()?)
        };
        let event = |what: &str| -> Result<_, Box<dyn Error>> {
            Ok(node
                .service_builder(&format!("{name}/{what}").as_str().try_into()?)
                .event()
                .open_or_create()?)
        };
        Ok(Endpoint {
            publisher: data(out)?.publisher_builder().initial_max_slice_len(64).create()?,
            subscriber: data(back)?.subscriber_builder().create()?,
            notifier: event(out)?.notifier_builder().create()?,
            listener: event(back)?.listener_builder().create()?,
            polling: wait.polling(1),
            _node: node,
        })
    }

    pub(crate) fn send(&self) -> Result<(), Box<dyn Error>> {
        self.publisher.loan_slice(64)?.send()?;
        self.notifier.notify()?;
        Ok(())
    }

    /// Waits for a message; `false` if none arrives within a second.
    pub(crate) fn receive(&self) -> Result<bool, Box<dyn Error>> {
        let begin = Instant::now();
        let mut polls = self.polling.begin_at(begin);
        while self.subscriber.receive()?.is_none() {
            if !polls.pause() {
                self.listener.timed_wait(|_| {}, Duration::from_millis(100))?;
            }
            if begin.elapsed() > Duration::from_secs(1) {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// Answers until the process is terminated.
pub(crate) fn serve(name: &str, wait: WaitStrategy) -> Result<(), Box<dyn Error>> {
    let endpoint = Endpoint::open(name, wait, "pong", "ping")?;
    loop {
        if endpoint.receive()? {
            endpoint.send()?;
        }
    }
}
