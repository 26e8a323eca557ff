//! Who may do what: a page of this server may watch, and control with the token that was printed at the start.

use std::net::IpAddr;

/// The token of a monitor that was started for control: 128 random bits as hexadecimal digits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Token(String);

impl Token {
    /// A new token.
    ///
    /// # Errors
    /// When the system gives no random numbers.
    pub fn new() -> Result<Self, String> {
        let mut bytes = [0; 16];
        getrandom::fill(&mut bytes).map_err(|e| format!("the system gives no random numbers for the token: {e}"))?;
        Ok(Self(crate::client::session::hex(&bytes)))
    }

    /// The token as text.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.0
    }

    /// Whether `given` is the token. The time taken does not tell how much of it is right.
    #[must_use]
    pub fn is(&self, given: &str) -> bool {
        let difference = self.0.bytes().zip(given.bytes()).fold(0, |sum, (own, other)| sum | (own ^ other));
        given.len() == self.0.len() && difference == 0
    }
}

/// Whether a request with these headers comes from a page of this server. A browser sends the page's origin with a WebSocket;
/// a page from elsewhere, or one behind a name that was pointed at this address, is refused. `bound` is the server's address.
///
/// # Errors
/// Why not, in words.
pub fn check_origin(origin: Option<&str>, host: Option<&str>, bound: IpAddr) -> Result<(), String> {
    let host = host.ok_or("the request names no host")?;
    let name = host.rsplit_once(':').map_or(host, |(name, port)| if port.contains(']') { host } else { name });
    let address: Option<IpAddr> = name.trim_matches(['[', ']']).parse().ok();
    let is_loopback = name.eq_ignore_ascii_case("localhost") || address.is_some_and(|address| address.is_loopback());
    if bound.is_loopback() && !is_loopback {
        return Err(format!("the monitor is served on this machine only, not as {host:?}"));
    }
    match origin {
        // No browser: browsers always send it with a WebSocket.
        None => Ok(()),
        Some(origin) if origin.strip_prefix("http://") == Some(host) => Ok(()),
        Some(origin) => Err(format!("the page is from another origin: {origin:?}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOOPBACK: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);
    const ANY: IpAddr = IpAddr::V4(std::net::Ipv4Addr::UNSPECIFIED);

    #[test]
    fn tokens_differ_and_only_the_whole_one_counts() {
        let (one, other) = (Token::new().unwrap(), Token::new().unwrap());
        assert_ne!(one, other);
        assert_eq!(one.text().len(), 32);
        assert!(one.is(one.text()));
        for wrong in ["", &one.text()[..31], &format!("{}0", one.text()), other.text()] {
            assert!(!one.is(wrong), "{wrong}");
        }
    }

    #[test]
    fn a_page_of_this_server_may_connect() {
        for host in ["127.0.0.1:8421", "localhost:8421", "[::1]:8421", "127.0.0.1"] {
            assert_eq!(check_origin(Some(&format!("http://{host}")), Some(host), LOOPBACK), Ok(()));
            assert_eq!(check_origin(None, Some(host), LOOPBACK), Ok(()));
        }
        assert_eq!(check_origin(Some("http://lab-pc:8421"), Some("lab-pc:8421"), ANY), Ok(()));
    }

    #[test]
    fn a_page_of_another_origin_is_refused() {
        let own = Some("127.0.0.1:8421");
        for origin in ["http://evil.example", "null", "https://127.0.0.1:8421", "http://127.0.0.1:8422", "file://"] {
            assert!(check_origin(Some(origin), own, LOOPBACK).unwrap_err().contains("another origin"), "{origin}");
        }
        // A name that was pointed at the loopback address.
        let rebound = check_origin(Some("http://evil.example:8421"), Some("evil.example:8421"), LOOPBACK);
        assert!(rebound.unwrap_err().contains("on this machine only"));
        assert!(check_origin(None, None, LOOPBACK).is_err());
    }
}
