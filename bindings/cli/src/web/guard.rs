//! What every request must pass, and the headers of every response.

use super::connections::Visitor;
use super::pages;
use axum::extract::{ConnectInfo, Request};
use axum::http::header::{self, HeaderName, HeaderValue};
use axum::http::{HeaderMap, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::net::IpAddr;
use std::sync::Arc;
use subtle::ConstantTimeEq;

pub(super) struct Guard {
    token: String,
}

impl Guard {
    pub(super) fn new(token: String) -> Guard {
        Guard { token }
    }

    fn refusal(&self, request: &Request) -> Option<&'static str> {
        let Some(host) = text(request.headers(), &header::HOST).filter(|host| is_trusted(host)) else {
            return Some("open the page by an IP address or as localhost");
        };
        // A page of another site may open a WebSocket to this one; browsers always say which page asks.
        let origin = text(request.headers(), &header::ORIGIN);
        if request.uri().path().ends_with("/ws")
            && origin.and_then(|origin| origin.strip_prefix("http://")) != Some(host)
        {
            return Some("the WebSocket is for this server's own page");
        }
        let given =
            request.uri().query().unwrap_or("").split('&').find_map(|pair| pair.strip_prefix("token="));
        if !bool::from(given.unwrap_or("").as_bytes().ct_eq(self.token.as_bytes())) {
            return Some("the token in the URL is missing or wrong; use the URL that smaclite-pool printed");
        }
        None
    }
}

/// A name may lead here although its owner is another site (DNS rebinding); an address and `localhost`
/// cannot. The port is not compared: it may be forwarded from another one.
fn is_trusted(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    };
    let address = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
    name == "localhost" || address.parse::<IpAddr>().is_ok()
}

fn text<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    headers.get(name).and_then(|value| value.to_str().ok())
}

/// Answers a request if it passes, and sets the headers.
pub(super) async fn check(guard: Arc<Guard>, request: Request, next: Next) -> Response {
    let mut response = match guard.refusal(&request) {
        Some(refusal) => (StatusCode::FORBIDDEN, format!("{refusal}\n")).into_response(),
        None => {
            if let Some(ConnectInfo(visitor)) = request.extensions().get::<ConnectInfo<Visitor>>() {
                visitor.shows_token();
            }
            next.run(request).await
        }
    };
    let headers = [
        (header::CONTENT_SECURITY_POLICY, pages::POLICY),
        (header::CACHE_CONTROL, "no-store"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        // A notebook on this machine may show the page in a cell; the address needs the token all the same.
        (header::CONTENT_SECURITY_POLICY, "frame-ancestors 'self' http://localhost:* http://127.0.0.1:*"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
        (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    ];
    for (name, value) in headers {
        response.headers_mut().append(name, HeaderValue::from_static(value));
    }
    response
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_and_localhost_are_trusted() {
        for host in
            ["127.0.0.1", "127.0.0.1:80", "localhost:8000", "localhost", "[::1]:80", "[::1]", "10.0.0.7:1"]
        {
            assert!(is_trusted(host), "{host}");
        }
        for host in
            ["", ":80", "evil.example", "evil.example:80", "127.0.0.1.evil.example", "localhost.evil:1"]
        {
            assert!(!is_trusted(host), "{host}");
        }
    }
}
